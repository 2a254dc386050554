"""Which settings are measured, and over how much of the motion: what a budget of time allows."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.scene.reading import Experiment
from rigidsim.scene.scene import build_scene
from rigidsim.solve.closed import closed_form_of
from rigidsim.trial import Setting, trial_scene

DEFAULT = Setting()
"""What every cost is relative to."""
DIGITS = 50
"""Of the reference for quadruple precision, and of closed forms as a reference."""
FORMULATIONS = ("quaternion", "rotation_matrix", "euler_angles", "canonical")
_TOLERANCES: dict[str, tuple[float, ...]] = {
    "double": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14),
    "extended": (1e-12, 1e-16),
    "single": (1e-3, 1e-5),
    "quadruple": (1e-24,),
}
_FEW_TOLERANCES = (1e-6, 1e-10)  # of the other formulations in double precision
_SAMPLES, _SHORT_SAMPLES = 32, 6
_PILOT_STEPS = 4000

# Costs in steps of the default setting: of all settings together, of the reference in quadruple precision, of
# all quadruple settings, and of the reference for these (measured, rounded up); their shares of the budget.
_ALL_COST, _REFERENCE_COST, _QUADRUPLE_COST, _DIGITS_COST = 350.0, 1300.0, 2600.0, 12000.0
_ALL, _REFERENCE, _QUADRUPLE, _DIGITS_SHARE = 0.3, 0.3, 0.1, 0.2


@dataclass(frozen=True)
class Plan:
    """How much of the motion is measured.

    Attributes:
        start, end: of the experiment, seconds.
        steps: of the default setting over all of it, roughly.
        part, short: measured over, by most settings and by quadruple precision.
        times: seconds, ascending; the first ``short_count`` reach to the end of ``short``.
        closed: whether the scene has a closed form; why: else why not.
        samples: that the experiment itself records.
    """

    start: float
    end: float
    steps: float
    part: float
    short: float
    times: tuple[float, ...]
    short_count: int
    closed: bool
    why: str
    samples: int


def every_setting(closed: bool, *, full: bool = False) -> list[Setting]:
    """All settings, those that matter most first: a budget cuts at the end.

    Args:
        closed: whether the scene has a closed form.
        full: every tolerance in every formulation and precision.
    """

    def both(settings: list[Setting]) -> list[Setting]:
        return [replace(s, hold_invariants=held) for s in settings for held in (False, True)]

    plain = both([Setting(p) for p in ("double", "extended", "single", "quadruple")])
    exact = [Setting(p, method="closed_form") for p in ("double", "extended", "quadruple")] if closed else []
    loose = both([Setting(p, tolerance) for p, some in _TOLERANCES.items() for tolerance in some])
    tight = [
        replace(s, formulation=f)
        for p in ("double", "single", "extended")
        for s in both([Setting(p)])
        for f in FORMULATIONS[1:]
    ]
    few = both([Setting("double", t, f) for t in _FEW_TOLERANCES for f in FORMULATIONS[1:]])
    rest = [replace(s, formulation=f) for s in loose if s.precision != "quadruple" for f in FORMULATIONS[1:]]
    listed = [*plain[:2], *exact, *plain[2:], *loose, *tight[:12], *few, *tight[12:], *(rest if full else [])]
    return list(dict.fromkeys(listed))


def make_plan(experiment: Experiment, budget: float) -> Plan:
    """From a short pilot of the default setting.

    Args:
        budget: seconds for everything.

    Raises:
        ConfigError: the config can't be run.
    """
    from rigidsim.assembly import assemble
    from rigidsim.prepare import prepare_scene

    scene = build_scene(experiment)
    start, end = float(scene.start), float(scene.samples.last)
    prepared = prepare_scene(experiment, trial_scene(experiment, DEFAULT))
    rhythm = assemble(prepared).rhythm
    stepper = rhythm.stepper
    begin, last = float(prepared.clock.start), float(prepared.clock.at(prepared.clock.count - 1))
    rhythm.skip(32)
    begun = time.process_time()
    rhythm.skip(64)
    while stepper.steps < _PILOT_STEPS and float(stepper.time) < last and rhythm.skip(64):
        pass
    pace = (time.process_time() - begun) / max(stepper.steps - 32, 1)
    # the grid may begin after the run does
    begin = min(begin, math.ldexp(start, -prepared.system.scaling.time))
    steps = max(1.0, stepper.steps * (last - begin) / max(float(stepper.time) - begin, 1e-300))
    whole = steps * pace
    form = closed_form_of(scene)
    closed = not isinstance(form, str)
    part = min(1.0, _ALL * budget / (whole * _ALL_COST))
    if not closed:
        part = min(part, _REFERENCE * budget / (whole * _REFERENCE_COST))
    short = _QUADRUPLE * budget / (whole * _QUADRUPLE_COST)
    if not closed:
        short = min(short, _DIGITS_SHARE * budget / (whole * _DIGITS_COST))
    short = min(part, short)
    short_times = grid(start, end, short, _SHORT_SAMPLES) if short < part else ()
    # the start is a sample, so that the motion begins there
    times = tuple(sorted({start, *short_times, *grid(start, end, part, _SAMPLES)}))
    limit = short_times[-1] if short_times else times[-1]
    return Plan(
        start, end, steps, part, short, times, sum(t <= limit for t in times), closed,
        form if isinstance(form, str) else "", scene.samples.count,
    )  # fmt: skip


def grid(start: float, end: float, part: float, count: int) -> tuple[float, ...]:
    """Times over the first part of a motion that single precision means exactly too."""
    exact = start + (end - start) * part * np.arange(1, count + 1) / count
    rounded = exact.astype(np.float32)
    late = rounded.astype(np.float64) > exact
    rounded[late] = np.nextafter(rounded[late], np.float32(-np.inf))
    return tuple(sorted({float(t) for t in rounded if float(t) > start})) or (float(exact[-1]),)
