"""Other ways to integrate a rotating body: one adapter per peer, the same scenes and equations for all.

An adapter is a module with

- ``TITLES``: {variant: title}, what to call its ways;
- ``knobs(variant, scene)``: tolerances or step sizes from loose to tight, none where a scene is beyond it;
- ``prepare(scene, end, variant, knob)``: compiles, warms up and returns a function of no arguments that
  integrates from 0 to ``end`` and returns the final quaternion (4,), or an ``Answer`` with CPU seconds of its
  own. Importing the module imports the peer, and fails with ``ImportError`` where that is absent.

``experiments.peers.child`` runs one adapter in a process of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

ADAPTERS = {
    "heyoka": "bare_heyoka",
    "rigidsim": "own_runs",
    "numba": "numba_dop853",
    "scipy": "scipy_ivp",
    "mujoco": "mujoco_steps",
}
"""Package that must be there: module of its adapter."""


@dataclass(frozen=True)
class Answer:
    """What an adapter returns that times itself.

    Attributes:
        quaternion: final, w x y z.
        seconds: CPU seconds of the integration alone.
    """

    quaternion: Sequence[float]
    seconds: float
