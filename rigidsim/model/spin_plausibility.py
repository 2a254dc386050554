"""Spins beside an orbit that are allowed, but implausible: the orbit's rate in deg/s, and those that just
miss a resonance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from rigidsim.model.averaged.hansen import hansen
from rigidsim.model.plausibility import meant_body
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, dot, norm
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.orbits import PACES, KeplerOrbit, Orbit
from rigidsim.scene.readable_time import span_text
from rigidsim.scene.scene import Scene
from rigidsim.store.summary_parts import Caution, WarningCode

_RESONANCES = (Fraction(1), Fraction(3, 2), Fraction(1, 2), Fraction(2))
_MISSED = 0.01  # of the resonant spin; one farther off wasn't meant to be there
_FEEBLE = 1e-6  # of the mean motion: a narrower resonance holds nothing
_UPRIGHT = math.cos(0.5)  # of the angle between the spin and the orbit's normal
_STEADY = math.cos(0.1)  # of the angle between the spin and a principal axis
_NOTICED = 0.1  # of a resonance's width: a start so far off librates by 0.1 rad
_SAME = 0.05  # of the miss, by which the spin and a multiple of the mean motion may differ
_ALIKE = 2e-3  # relative difference of a spin from the orbit's rate, as far as three digits tell


def about_spin(
    table: Orbit, orbit: KeplerOrbit, strength: ExactNumber, where: str, scene: Scene
) -> Iterator[Caution]:
    """A spin about a principal axis along the normal of an orbit.

    Args:
        table: the orbit as given.
        strength: G M of the attracting body as given.
        where: place of the load in the config.
    """
    found = _spin(scene, orbit)
    if found is not None and float(orbit.mean_motion) > 0:
        known = meant_body(strength) is not None
        if known:
            yield from _in_degrees(found[0], float(orbit.mean_motion), where, scene)
        yield from _near_resonance(*found, table, orbit, where, scene, known=known)


def _in_degrees(spin: float, motion: float, where: str, scene: Scene) -> Iterator[Caution]:
    """A spin without a unit that is the orbit's rate in deg/s."""
    given = scene.config.initial.angular_velocity
    if given is None or any(x.sign and not x.assumed for x in given):
        return
    if abs(spin / math.degrees(motion) - 1) < _ALIKE:
        value = f"{spin:.6g}"
        yield Caution(
            WarningCode.ANGLE_WITHOUT_UNIT,
            f"[initial] angular_velocity: given {value} without a unit, which is taken as rad/s, while the "
            f'orbit of {where} has {math.degrees(motion):.6g} deg/s; write "{value} deg/s" if that is meant, '
            f'"{value} rad/s" if not',
        )


def _near_resonance(
    spin: float, asymmetry: float, table: Orbit, orbit: KeplerOrbit, where: str, scene: Scene, *, known: bool
) -> Iterator[Caution]:
    """A spin within a per cent of 1:1, 3:2, 1:2 or 2:1 with the orbit that just misses the resonance.

    It is told if it is outside the libration and the attracting body is a known one, or if the spin is a
    multiple of the mean anomaly's rate while the resonance is with the mean longitude: then a sidereal period
    was given as the anomalistic one (about a known body also within the libration, which it makes large).

    The resonance p of a body that turns about its principal axis C holds rates within
    n sqrt(3 (B - A) |H| / C) of (p - 1) n + d(mean longitude)/dt, with H(p, e) of Goldreich & Peale 1966
    (Astronomical Journal 71, 425).
    """
    motion = float(orbit.mean_motion)
    longitude = motion + float(orbit.periapsis_rate) + float(orbit.node_rate)
    for p in _RESONANCES:
        expected = float(p - 1) * motion + longitude
        miss = spin - expected
        if longitude <= 0 or abs(miss) > _MISSED * abs(expected):
            continue
        size = hansen(scene.context, orbit.eccentricity, int(2 * p), 2)
        width = motion * math.sqrt(3 * asymmetry * abs(float(size)))
        confused = abs(spin - float(p) * motion) < _SAME * abs(miss)
        outside = width < abs(miss) and (known or confused)
        librating = abs(miss) > _NOTICED * width and known and confused
        if width < _FEEBLE * motion or not (outside or librating):
            continue
        text = (
            f"[initial] angular_velocity: a turn takes {_turn(spin)}, {100 * abs(miss) / expected:.2g} % "
            f"{'faster' if miss > 0 else 'slower'} than the {p.numerator}:{p.denominator} resonance with the "
            f"orbit of {where} ({_turn(expected)}), which holds {100 * width / expected:.2g} %; the mean "
            f"anomaly returns after {_turn(motion)}, the mean longitude after {_turn(longitude)}"
        )
        pace = next((key for key in PACES if getattr(table, key) is not None), "")
        if pace in ("", "period"):
            from_where = "period" if pace else "the one of Kepler's third law"
            text += (
                f": {from_where} is anomalistic; give sidereal_period if a sidereal month or year is meant"
            )
        yield Caution(WarningCode.NEAR_RESONANCE, text)


def _turn(rate: float) -> str:
    return span_text(2 * math.pi / rate, 8)


def _spin(scene: Scene, orbit: KeplerOrbit) -> tuple[float, float] | None:
    """Rate (rad/s) of a body that turns forwards about a principal axis C along the orbit's normal, and
    (B - A)/C; None for any other motion.
    """
    context, body = scene.context, scene.body
    rates = scene.angular_velocity
    size = norm(context, rates)
    if size == 0:
        return None
    axis = max(range(3), key=lambda i: abs(dot(body.principal_axes[i], rates)))
    if abs(dot(body.principal_axes[axis], rates)) < _STEADY * size or body.principal_moments[axis] == 0:
        return None
    space = apply(attitude.rotation_matrix(scene.quaternion), rates)
    if dot(space, orbit.normal(context)) < _UPRIGHT * size:
        return None
    a, b = (body.principal_moments[i] for i in range(3) if i != axis)
    return float(size), float(abs(b - a) / body.principal_moments[axis])
