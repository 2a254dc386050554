"""Error laws: the error that rounding and the motion itself leave to a good integration."""

import math
from dataclasses import replace

from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.error_growth import Growth, measure_growth
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.projection import LATE, steps_between

CLOSED_FORM = 50.0
"""In eps: error of a sample from a closed form, thirty operations and sines right to 4 ulp, at any time."""

_LARGEST_EXPONENT = 600.0  # keeps products within doubles


def round_off_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a good integration: (eps / 2) sqrt(steps) |w| t / sqrt 3.

    Rounding lets the frequencies wander as a random walk, and the phase integrates the walk (Brouwer 1937).
    Motions near an unstable axis amplify errors further: see ``rigidsim.solve.error_growth``.
    """
    return tolerance / 2 * math.sqrt(max(steps, 1)) * rate * duration / math.sqrt(3)


def stable_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a motion that amplifies none: the round-off law and the attitude's own walk.

    The law is one of phases that many radians have gathered. A motion of less than some radians, as a slow
    precession often is, shows what each step does to the attitude itself: four components of a unit
    quaternion, each off by eps / 2 of itself, turn it by eps at most, which add up as a random walk.
    """
    walk = tolerance * math.sqrt(max(steps, 1))
    return math.hypot(walk, round_off_law(tolerance, steps, rate, duration))


def attitude_error(level: float, steps: int, rate: float, seconds: float, growth: Growth) -> float:
    """The law of stable motions times the motion's amplification, rad, for errors of size ``level`` at each
    step.
    """
    return stable_law(level, steps, rate, seconds) * growth.at(seconds)


def held_error(
    prepared: InitialValueProblem, steps: int, rate: float, seconds: float, growth: Growth
) -> float:
    """The same where invariants are projected on the way, of a motion whose frequencies depend on them alone
    (one with a closed form); never above the plain run's.

    Corrections k steps apart leave the frequencies off by the wander in between, eps sqrt(k), whose part over
    the ends is taken back: eps k sqrt(n / 12) after n steps. Where they begin late, what rounding did to the
    phase until then comes on top.
    """
    level = prepared.law_tolerance
    plain = attitude_error(level, steps, rate, seconds, growth)
    late = prepared.holds_late
    if not prepared.holds_invariants or steps <= (LATE if late else 0):
        return plain
    between = steps_between(prepared.precision, late=late)
    begun = round_off_law(level, LATE, rate, seconds * LATE / steps) if late else 0.0
    return min(plain, (begun + level * between * math.sqrt(steps / 12)) * growth.at(seconds))


def closed_form_if_any(scene: Scene, *, driven: bool = False) -> tuple[ClosedForm | None, str]:
    """The closed form of a scene's motion, or None and the reason why there is none."""
    try:
        return closed_form_of(scene, driven=driven), ""
    except NoClosedForm as none:
        return None, str(none)


def exact_method(scene: Scene, *, driven: bool = False) -> tuple[str, str]:
    """The method that gives a scene's motion without steps, or empty and the reason why there is none."""
    form, why_not = closed_form_if_any(scene, driven=driven)
    return (form.method if form else ""), why_not


def motion_growth(prepared: InitialValueProblem) -> Growth:
    """Amplification of errors by the motion itself (takes some 30 ms).

    Measured in quaternions, or in rates if no attitude is carried: a chart's own singularity is another
    matter. A closed form makes no errors on the way that could grow.
    """
    if not prepared.has_steps:
        return Growth(factor=1.0, seconds=0.0, rate=0.0, window=0.0)
    system = double_twin(prepared)
    clock, last = prepared.clock, prepared.clock.count - 1
    precision = replace(precision_of("double"), compact=True)  # compiled in a tenth of the time
    growth = measure_growth(system, precision, float(clock.start), float(clock.at(last)))
    return _beyond_measure(prepared, growth) if growth.saturated else growth


def _beyond_measure(prepared: InitialValueProblem, growth: Growth) -> Growth:
    """Growth for a motion past an unstable axis, where offsets became too large to be measured.

    In elliptic functions of parameter m a change of m moves each passage by 1 / (1 - m) times as much, as far
    as there is time to: errors grow no faster than exp(p t), with p the rate of the functions' argument. The
    motion being integrable, they don't grow exponentially for longer. In the unstable state itself, which
    has no m, they grow as fast as they were seen to.
    """
    scene = prepared.scene
    form, _ = closed_form_if_any(scene, driven=bool(prepared.python_loads))
    if form is None:
        return growth
    seconds = float(scene.samples.last - scene.start)
    argument = getattr(form.motion, "argument", None)
    if argument is None:
        return replace(growth, rate=max(growth.rate, growth.passing_rate), window=0.0)
    passage = min(float(argument.speed) * math.ldexp(seconds, -form.scaling.time), _LARGEST_EXPONENT)
    complement = max(float(argument.lattice.complement), math.exp(-_LARGEST_EXPONENT))
    factor = max(growth.factor, min(1 / complement, math.exp(passage)))
    return replace(growth, factor=factor, rate=0.0)
