"""Which settings are measured, and over how much of the motion, within a time budget."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.error_law import exact_method
from rigidsim.accuracy.motion import run_pilot
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import trial_scene
from rigidsim.scene.config import Experiment
from rigidsim.scene.formulations import FORMULATIONS
from rigidsim.scene.scene import build_scene
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import prepare_scene

DEFAULT = Setting()
"""Setting that every cost is relative to."""
_TOLERANCES: dict[str, tuple[float, ...]] = {
    "double": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14),
    "extended": (1e-12, 1e-16),
    "single": (1e-3, 1e-5),
    "quadruple": (1e-24,),
}
_WARMING = 32  # steps whose cost isn't measured
_FEW_TOLERANCES = (1e-6, 1e-10)  # of the other formulations in double precision


@dataclass(frozen=True)
class Budgeting:
    """How a time budget is divided.

    Costs are in steps of the default setting, measured and rounded up.

    Attributes:
        pilot_steps: steps of the pilot that measures the pace of the default setting.
        all_share, all_cost: share of the budget and cost of all settings together.
        reference_share, reference_cost: the same for the reference in quadruple precision.
        quadruple_share, quadruple_cost: the same for all quadruple settings.
        digits_share, digits_cost: the same for the reference of these.
        samples, short_samples: number of attitudes compared, over the whole part and over the short one.
    """

    pilot_steps: int = 4000
    all_share: float = 0.3
    all_cost: float = 350.0
    reference_share: float = 0.3
    reference_cost: float = 1300.0
    quadruple_share: float = 0.1
    quadruple_cost: float = 2600.0
    digits_share: float = 0.2
    digits_cost: float = 12000.0
    samples: int = 32
    short_samples: int = 6


BUDGETING = Budgeting()


@dataclass(frozen=True)
class Plan:
    """How much of the motion is measured.

    Attributes:
        start, end: start and end of the experiment, s.
        steps: approximate steps of the default setting over all of it.
        part, short: parts measured by most settings and by quadruple precision.
        times: seconds, ascending; the first ``short_count`` reach to the end of ``short``.
        exact, why: method that gives the motion without steps; empty if there is none, and why.
        samples: number of samples that the experiment itself records.
    """

    start: float
    end: float
    steps: float
    part: float
    short: float
    times: tuple[float, ...]
    short_count: int
    exact: str
    why: str
    samples: int


def every_setting(exact: str = "", *, full: bool = False) -> list[Setting]:
    """All settings, the most important first, since a budget cuts at the end.

    Args:
        exact: method that gives the motion without steps, if there is one.
        full: include every tolerance in every formulation and precision.
    """

    def both(settings: list[Setting]) -> list[Setting]:
        return [replace(s, hold_invariants=held) for s in settings for held in (False, True)]

    general = [name for name, variables in FORMULATIONS.items() if variables.general]
    further = [name for name in general if name != DEFAULT.formulation]
    plain = both([Setting(p) for p in ("double", "extended", "single", "quadruple")])
    precise = [Setting(p, method=exact) for p in ("double", "extended", "quadruple")] if exact else []
    loose = both([Setting(p, tolerance) for p, some in _TOLERANCES.items() for tolerance in some])
    tight = [
        replace(s, formulation=f)
        for p in ("double", "single", "extended")
        for s in both([Setting(p)])
        for f in further
    ]
    few = both([Setting("double", t, f) for t in _FEW_TOLERANCES for f in further])
    rest = [replace(s, formulation=f) for s in loose if s.precision != "quadruple" for f in further]
    peer = FORMULATIONS[DEFAULT.formulation].checked_by
    # needed to know the error of a reference, if nothing better is possible
    others = [] if exact else [Setting(p, formulation=peer) for p in ("double", "extended")]
    listed = [
        *plain[:2],
        *precise,
        *plain[2:],
        *others,
        *loose,
        *tight[: 4 * len(further)],
        *few,
        *tight[4 * len(further) :],
        *(rest if full else []),
    ]
    return list(dict.fromkeys(listed))


def make_plan(experiment: Experiment, budget: float, how: Budgeting = BUDGETING) -> Plan:
    """Make a plan from a short pilot of the default setting.

    Args:
        budget: seconds for everything.

    Raises:
        ConfigError: the config can't be run.
    """
    scene = build_scene(experiment)
    start, end = float(scene.start), float(scene.samples.last)
    prepared = prepare_scene(experiment, trial_scene(experiment, DEFAULT))
    corrected = assemble(prepared).steps()
    pilot = run_pilot(
        corrected.stepper, prepared.clock, corrected.skip, steps=how.pilot_steps, warming=_WARMING
    )
    whole = pilot.whole * pilot.seconds_per_step
    exact, why = exact_method(scene)
    part = min(1.0, how.all_share * budget / (whole * how.all_cost))
    short = how.quadruple_share * budget / (whole * how.quadruple_cost)
    if not exact:
        part = min(part, how.reference_share * budget / (whole * how.reference_cost))
        short = min(short, how.digits_share * budget / (whole * how.digits_cost))
    short = min(part, short)
    short_times = grid(start, end, short, how.short_samples) if short < part else ()
    # the start is a sample, so that the motion begins there
    times = tuple(sorted({start, *short_times, *grid(start, end, part, how.samples)}))
    limit = short_times[-1] if short_times else times[-1]
    return Plan(
        start=start,
        end=end,
        steps=pilot.whole,
        part=part,
        short=short,
        times=times,
        short_count=sum(t <= limit for t in times),
        exact=exact,
        why=why,
        samples=scene.samples.count,
    )


def grid(start: float, end: float, part: float, count: int) -> tuple[float, ...]:
    """Times over the first part of a motion that are exact in single precision too."""
    exact = start + (end - start) * part * np.arange(1, count + 1) / count
    rounded = exact.astype(np.float32)
    late = rounded.astype(np.float64) > exact
    rounded[late] = np.nextafter(rounded[late], np.float32(-np.inf))
    return tuple(sorted({float(t) for t in rounded if float(t) > start})) or (float(exact[-1]),)
