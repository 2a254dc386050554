"""Stages by kind of scene: what stands around a body, as its dataset says of itself. They load rerun.

A kind is a function that makes a ``parts.Picture`` of a dataset and its body, or returns None for scenes of
other kinds; ``registry`` lists them. Stages are made of `parts`, which are entities of the viewer: arrows,
trails, lines, solids; `bodies` draws the body itself, its arrows and trails, and its track.
"""
