"""Spin and angular momentum relative to the figure axis, seen from the body.

Polar motion: m1 = w1 / w3, m2 = w2 / w3 along the figure's equator (Munk & MacDonald 1960, The Rotation of
the Earth, eq. 6.1.1; IERS: x_p = m1, y_p = -m2).
"""

from __future__ import annotations

from collections.abc import Mapping

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import NO_UNIT, Observable, register_all, same_unit
from rigidsim.model.observables.steadiness import is_nearly_axial
from rigidsim.model.observables.vectors import angle_between, figure_told, in_body
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import dot, norm
from rigidsim.scene.frame import unique_axis


def _polar_motion(m: Mechanics) -> list[Symbolic]:
    figure = m.scene.figure
    w1, w2, w3 = (
        hy.sum([a * w for a, w in zip(in_body(m, axis), m.rates, strict=True)])
        for axis in (figure.first, figure.second, figure.pole)
    )
    off = hy.gt(w1 * w1 + w2 * w2, w3 * w3)
    kept = hy.select(off, 0.0, 1.0)
    kept = kept / kept  # NaN where it is off, and 1 elsewhere
    return [kept * (w1 / w3), kept * (w2 / w3)]


def _no_polar_motion(m: Mechanics) -> str | None:
    """Why there is no polar motion: the spin starts outside the cone about the figure axis where it is
    recorded.
    """
    context, figure = m.scene.context, m.scene.figure
    along = abs(dot(m.scene.angular_velocity, figure.pole))
    across = norm(context, [dot(m.scene.angular_velocity, e) for e in (figure.first, figure.second)])
    if along == 0 and across == 0:
        return "the body starts at rest, without a spin that could have a pole"
    if across > along:
        degrees = context.nstr(context.degrees(context.atan2(across, along)), 4)
        return (
            f"the spin starts {degrees} deg from the figure axis ({figure.described}), and polar motion is "
            "recorded up to 45 deg; choose another [frame] figure_axis, or record wobble_angle"
        )
    return None


def _wobble_angle(m: Mechanics) -> list[Symbolic]:
    largest = unique_axis(m.scene.body, m.scene.context, largest=True)
    assert largest is not None
    return [angle_between(in_body(m, largest), m.momentum_body)]


def _no_largest(m: Mechanics) -> str | None:
    if unique_axis(m.scene.body, m.scene.context, largest=True) is not None:
        return None
    return (
        "the two largest principal moments are equal, so that no axis is that of the largest; record "
        "nutation_angle"
    )


def _nutation_angle(m: Mechanics) -> list[Symbolic]:
    return [angle_between(in_body(m, m.scene.figure.pole), m.momentum_body)]


def _polar_told(m: Mechanics) -> Mapping[str, str]:
    first = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.first)
    return {
        "convention": "m1 = w1/w3, m2 = w2/w3 (IERS: x_p = m1, y_p = -m2); NaN where the spin is more than "
        "45 degrees from the figure axis",
        "first_axis": f"[{first}] in body axes",
    } | figure_told(m)


register_all(
    Observable(
        "polar_motion", ("polar_motion_component",), "rad", "polar motion", _polar_motion,
        same_unit(NO_UNIT, 2), "body axes", by_default=is_nearly_axial, attributes=_polar_told,
        absent=_no_polar_motion,
    ),
    Observable(
        "wobble_angle", (), "rad", "angle of the angular momentum from the axis of largest moment",
        _wobble_angle, same_unit(NO_UNIT, 1), "body axes", by_default=is_nearly_axial,
        attributes=lambda m: {"convention": "0 to pi; NaN where the body is at rest"}, absent=_no_largest,
    ),
    Observable(
        "nutation_angle", (), "rad", "angle of the figure axis from the angular momentum",
        _nutation_angle, same_unit(NO_UNIT, 1), "body axes", by_default=is_nearly_axial,
        attributes=lambda m: {"convention": "0 to pi; NaN where the body is at rest"} | figure_told(m),
    ),
)  # fmt: skip
