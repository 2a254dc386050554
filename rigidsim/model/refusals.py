"""Loads that are refused: those that would act twice, and those that are no functions of the attitude.

The latter must be the same for a quaternion q and for -q, which are one attitude. A load that is odd in the
quaternion would depend on the formulation: on whether its attitude has a sign at all, and on how that was
continued.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.capabilities import GradientAlone, Reacting
from rigidsim.model.formulations.formulation import Requirements
from rigidsim.model.load import Load, force_terms, torque_terms
from rigidsim.model.load_estimate import probe, start_of
from rigidsim.model.state_blocks import BODY
from rigidsim.scene.scene import Scene

_SAME_BODY = 1e-3
"""Relative difference of gravitational parameters below which two sources are taken to be one."""
_STATES = 16
_NOISE = 1e-9  # of the largest component: far above rounding, far below any load that means its sign


def refuse_odd_loads(scene: Scene, requirements: Requirements, loads: Sequence[Load]) -> None:
    """Refuse a load, given by expressions or from Python, that differs between q and -q at random states."""
    for load in loads:
        if "attitude" not in load.reads or not requirements.attitude:
            continue
        m = probe(scene, requirements, [load])
        terms = [*torque_terms(load, m), *(force_terms(load, m) if m.velocity is not None else [])]
        if not terms:
            continue
        names, start = start_of(m, [load])
        generator = np.random.default_rng(0)  # the same each time
        states = start[:, None] + generator.uniform(-1, 1, (len(names), _STATES))
        rows = [names.index(name) for name in BODY.quaternion]
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
            raise ConfigError(_oddness(load, states[rows, place], here[term, place], there[term, place]))


def refuse_second_orbits(scene: Scene, loads: Sequence[Load]) -> None:
    """Refuse the gradient of a source whose place is integrated already: it would act twice."""
    where, bodies = "[[loads]] gravity_gradient", scene.bodies
    pulling = [load for load in loads if "flight" in load.reads]
    attractors = [x for load in pulling if (x := getattr(load, "gravitational_parameter", None)) is not None]
    carried = [] if bodies is None else [s for n, s in enumerate(bodies.strengths) if n != bodies.host]

    def known(strength: Any, others: list[Any]) -> bool:
        return any(abs(strength - other) <= _SAME_BODY * other for other in others)

    for load in loads:
        if not isinstance(load, GradientAlone):
            continue
        if isinstance(load, Reacting):
            named = [getattr(x, "number", None) for x in pulling if _flown_about(x)]
            if getattr(load, "number", None) in named:
                what = "given beside central_gravity of the same body, which has its torque; remove it"
                raise ConfigError(Problem(where, what))
        elif load.gradient_source is not None:
            strength = load.gradient_source.gravitational_parameter
            if known(strength, attractors):
                what = "given for the point that attracts the body in flight; central_gravity has its torque "
                what += "where the body is, and this one would follow an orbit of its own: remove it"
                raise ConfigError(Problem(where, what))
            if known(strength, carried):
                what = "given with the gravitational parameter of one of [[bodies]] and an orbit of its own; "
                what += 'give orbit = {body = "..."}, which is where that body is'
                raise ConfigError(Problem(where, what))


def _flown_about(load: Load) -> bool:
    return isinstance(load, Reacting) and not isinstance(load, GradientAlone)


def _oddness(load: Load, quaternion: np.ndarray, here: float, there: float) -> Problem:
    number = getattr(load, "number", None)
    where = "loads" if number is None else f"[[loads]] number {number + 1}"
    shown = ", ".join(f"{x:.3g}" for x in quaternion)
    return Problem(
        where,
        f"{load.described} depends on the sign of the quaternion: at q = [{shown}] a part of it is "
        f"{here:.3g} (in internal units), at -q, which is the same attitude, {there:.3g}; use products such "
        "as qw*qx, or say where it jumps: sign(qw)*qx",
    )
