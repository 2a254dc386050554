"""Neighbours of a motion, carried along to learn how its errors grow."""
