"""Error laws: the error that rounding and the motion itself leave to a good integration."""

import math

from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import LATE, steps_between

CLOSED_FORM = 50.0
"""In eps: error of a sample from a closed form, thirty operations and sines right to 4 ulp, at any time."""


def round_off_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a good integration: (eps / 2) sqrt(steps) |w| t / sqrt 3.

    Rounding lets the frequencies wander as a random walk, and the phase integrates the walk (Brouwer 1937).
    Motions near an unstable axis amplify errors further: see ``rigidsim.accuracy.choice``.
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


def held_error(
    prepared: InitialValueProblem, steps: int, rate: float, seconds: float, amplification: float
) -> float:
    """The law of stable motions times the motion's amplification, rad, where invariants are projected on the
    way, of a motion whose frequencies depend on them alone (one with a closed form); never above the plain
    run's.

    Corrections k steps apart leave the frequencies off by the wander in between, eps sqrt(k), whose part over
    the ends is taken back: eps k sqrt(n / 12) after n steps. Where they begin late, what rounding did to the
    phase until then comes on top.
    """
    level = prepared.law_tolerance
    plain = stable_law(level, steps, rate, seconds) * amplification
    late = prepared.holds_late
    if not prepared.holds_invariants or steps <= (LATE if late else 0):
        return plain
    between = steps_between(prepared.precision, late=late)
    begun = round_off_law(level, LATE, rate, seconds * LATE / steps) if late else 0.0
    return min(plain, (begun + level * between * math.sqrt(steps / 12)) * amplification)


def closed_form_if_any(scene: Scene, *, driven: bool = False) -> tuple[ClosedForm | None, str]:
    """The closed form of a scene's motion, or None and the reason why there is none."""
    try:
        return closed_form_of(scene, driven=driven), ""
    except NoClosedForm as none:
        return None, str(none)
