"""Motions averaged over the body's rotation and over the sources' orbits, under gravity gradients."""
