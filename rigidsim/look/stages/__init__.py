"""Stages by kind of scene, as numbers: what stands around a body, as its dataset says of itself.

A kind is a function that makes a ``parts.Picture`` of a dataset and its body, or returns None for scenes of
other kinds; ``registry`` lists them. Stages are made of `parts`: arrows, trails, lines, solids, cameras;
`bodies` draws the body itself, its arrows and trails, and its track.
"""
