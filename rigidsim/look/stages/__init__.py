"""Stages by kind of scene: what stands around a body, chosen from what its dataset says of itself.

| module | holds |
| --- | --- |
| `registry` | all kinds, and the choice among them |
| `parts` | what a stage is made of: arrows, trails, lines, solids, frames, cameras |
| `bodies` | the body, its arrows and trails, where the eye is |
| `top` | a body on a fixed point under gravity |
| `satellite`, `orbit`, `orbits` | bodies on prescribed and on free orbits, and what they share |
| `flight` | a body that flies under gravity |
| `planet` | a globe with its axes, and the paths of its pole |
| `free` | free rotation, with Poinsot's construction |
| `generic` | any other scene |
"""
