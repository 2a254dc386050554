"""Pace of a full motion whose rotation torques brake or spin up, along the course of its average.

A pilot sees the beginning. Where torques are functions of the rates, the polhode that the body is on at any
later time is known ahead (``rigidsim.model.averaged.course``): some hundred steps on the polhodes of a few
moments give the mean pace.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rigidsim.accuracy.motion import Pilot
from rigidsim.accuracy.trial import compactly
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.driven import Driven, driven_by
from rigidsim.model.averaged.free_motion import Separatrix
from rigidsim.model.averaged.torques import reads_rates_alone
from rigidsim.model.capabilities import gradient_source_of
from rigidsim.model.load import Load
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

_MOMENTS = 6
"""Of the run, Gauss-Legendre nodes: the pace changes like an exponential function, over some e-foldings."""
_STEPS = 256  # at each, of dozens of rotations
_RATES = ("wx", "wy", "wz")


def forecast_pace(prepared: InitialValueProblem, pilot: Pilot) -> float | None:
    """Mean number of steps per second over the whole run, relative to that over the pilot's part, which
    torques change that are functions of the rates: 1 for motions without any, and where the pilot saw the
    end; None if the course of its average isn't known until the end.
    """
    clock, plan = prepared.clock, prepared.system.plan
    whole = float(clock.at(clock.count - 1)) - float(clock.start)
    alone = [load for load in plan.loads if gradient_source_of(load) is None]
    braked = plan.formulation.resolves_rotation and alone and all(map(reads_rates_alone, alone))
    seen = pilot.taken * pilot.step / whole
    if not prepared.has_steps or seen >= 1 or not braked:
        return 1.0
    moments, system = prepared.scene.body.principal_moments, prepared.system
    stepwise = bool(system.plan.surfaces.found) or system.stepwise
    if stepwise or prepared.scene.free_flight or max(moments) == min(moments):
        return None
    course = _driven(prepared, alone)
    twin = double_twin(compactly(prepared))
    if course is None or not all(name in twin.states for name in _RATES):
        return None
    precision = replace(precision_of("double"), compact=True)
    stepper = stepper_of(twin, precision, None, precision.scalar(prepared.clock.start))
    times = course.course.times
    nodes, weights = np.polynomial.legendre.leggauss(_MOMENTS)
    begun, initial = stepper.mark(), np.array(stepper.state)

    def pace(time: float) -> float:
        amplitudes = [float(np.interp(time, times, column)) for column in course.course.amplitudes.T]
        stepper.back_to(begun)
        stepper.state[:] = initial
        _turn_as(stepper, prepared, course, amplitudes)
        stepper.settle()
        before, steps = float(stepper.time), stepper.steps
        going = stepper.skip(_STEPS)
        passed = float(stepper.time) - before
        return (stepper.steps - steps) / passed if going and passed > 0 else math.nan

    def mean_pace(share: float) -> float:
        places = times[0] + share * (times[-1] - times[0]) * (nodes + 1) / 2
        return float(weights / 2 @ [pace(time) for time in places])

    found = mean_pace(1.0) / mean_pace(seen)
    return found if math.isfinite(found) else None


def _driven(prepared: InitialValueProblem, alone: Sequence[Load]) -> Driven | None:
    scaling = replace(prepared.system.scaling, rates=(0, 0, 0))
    try:
        return driven_by(prepared.scene, scaling, alone, float(precision_of("double").epsilon))
    except (ConfigError, Separatrix):
        return None


def _turn_as(
    stepper: TaylorStepper, prepared: InitialValueProblem, course: Driven, amplitudes: list[float]
) -> None:
    """Give the stepper the rates of a momentum on the polhode of amplitudes P and Q."""
    context, polhodes, system = prepared.scene.context, course.polhodes, stepper.system
    unit = course.torques.scaling.momentum
    momentum = course.momentum(*(context.ldexp(context.mpf(x), unit) for x in amplitudes))
    along = [
        sum((a * x for a, x in zip(axis, momentum, strict=True)), context.zero) / moment
        for axis, moment in zip(polhodes.axes, polhodes.moments, strict=True)
    ]
    for i, name in enumerate(_RATES):
        rate: Any = sum((x * axis[i] for x, axis in zip(along, polhodes.axes, strict=True)), context.zero)
        place = system.states.index(name)
        stepper.state[place] = math.ldexp(float(rate), -system.state_exponents[place])
