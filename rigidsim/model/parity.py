"""Loads must be functions of the attitude: the same for a quaternion q and for -q, which are one attitude.

A load that is odd in the quaternion would depend on the formulation: on whether its attitude has a sign at
all, and on how that was continued.
"""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.model.load_estimate import probe, start_of
from rigidsim.model.state_selection import Requirements
from rigidsim.scene.scene import Scene

_STATES = 16
_NOISE = 1e-9  # of the largest component: far above rounding, far below any load that means its sign
_QUATERNION = ("qw", "qx", "qy", "qz")


def refuse_odd_loads(scene: Scene, requirements: Requirements, loads: Sequence[Load]) -> None:
    """Evaluate torques and forces at random states and at the same attitudes' other quaternions.

    Args:
        loads: those given by expressions or from Python.

    Raises:
        ConfigError: names the load, what was found, and what to write instead.
    """
    for load in loads:
        if "attitude" not in load.reads or requirements.formulation == "rates":
            continue
        m = probe(scene, requirements, [load])
        terms = [*load.torque(m), *(load.force(m) if m.velocity is not None else [])]
        if not terms:
            continue
        names, start = start_of(m, [load])
        generator = np.random.default_rng(0)  # the same each time
        states = start[:, None] + generator.uniform(-1, 1, (len(names), _STATES))
        rows = [names.index(name) for name in _QUATERNION]
        states[rows] /= np.linalg.norm(states[rows], axis=0)
        other = states.copy()
        other[rows] *= -1
        unit = float(scene.context.ldexp(scene.context.one, m.scaling.time))
        times = generator.uniform(float(scene.start) / unit, float(scene.end) / unit, _STATES)
        function = hy.cfunc([x for _, x in terms], list(hy.make_vars(*names)), compact_mode=True)
        with np.errstate(all="ignore"):
            here, there = (np.asarray(function(np.ascontiguousarray(s), time=times)) for s in (states, other))
            different = np.abs(here - there) > _NOISE * np.maximum(np.abs(here), np.abs(there)).max(axis=0)
        different &= np.isfinite(here) & np.isfinite(there)
        if different.any():
            term, place = np.argwhere(different)[0]
            raise ConfigError(_problem(load, states[rows, place], here[term, place], there[term, place]))


def _problem(load: Load, quaternion: np.ndarray, here: float, there: float) -> Problem:
    number = getattr(load, "number", None)
    where = "loads" if number is None else f"[[loads]] number {number + 1}"
    shown = ", ".join(f"{x:.3g}" for x in quaternion)
    return Problem(
        where,
        f"{load.effect} depends on the sign of the quaternion: at q = [{shown}] a part of it is {here:.3g} "
        f"(in internal units), at -q, which is the same attitude, {there:.3g}; use products such as qw*qx, "
        "or say where it jumps: sign(qw)*qx",
    )
