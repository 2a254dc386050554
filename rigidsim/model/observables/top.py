"""Tops: tilt, precession and spin of the figure axis against the vertical, and the path of a tip point.

With p the figure axis and v the upward vertical (against gravity) in body axes, e and f the axes of the
figure's equator, and p_X, p_Y the figure axis along the horizontal axes,

    tilt = atan2(hypot(v.e, v.f), v.p),   spin = atan2(v.e, v.f),   precession = atan2(p_X, -p_Y):

the z-x-z Euler angles theta, psi and phi where gravity points down along Z and the figure axis is z (Landau
& Lifshitz, Mechanics, section 35). The horizontal X is the space axis turned by the smallest rotation that
takes Z to the vertical.
"""

from __future__ import annotations

import heyoka as hy

from rigidsim.model.frames import fixed_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    SPACE,
    Angle,
    Observable,
    continuous_angles,
    described_by,
    register_all,
    same_unit,
)
from rigidsim.model.rotations import Symbolic, along, apply, unit
from rigidsim.scene.arithmetic import Vector


def _vertical(m: Mechanics) -> list[Symbolic]:
    """Components of the upward vertical along the figure's equator (two) and the figure axis."""
    figure = m.scene.figure
    up = m.carried(m.vertical)
    return [along(m.fixed(axis), up) for axis in (figure.first, figure.second, figure.pole)]


def tilt(m: Mechanics) -> list[Symbolic]:
    """Angle of the figure axis from the upward vertical, 0 to pi."""
    e, f, p = _vertical(m)
    return [hy.atan2(hy.sqrt(e * e + f * f), p)]


def precession_angle(m: Mechanics) -> list[Angle]:
    """Precession angle of the figure axis about the vertical: line of nodes from the horizontal X."""
    plane = fixed_plane(m, m.carried(m.numbers.up), "horizontal plane")
    u, v, _ = plane.components(unit(m.figure_space))
    return [Angle(u, -v)]


def tip_point(m: Mechanics) -> Vector | None:
    """Body-fixed point whose path is recorded (mpf, m, from the reference point): ``[output] tip``, or the
    centre of mass of a body that turns about another point; None without either.
    """
    given = m.scene.config.output.tip
    if given is not None:
        return [x.at(m.scene.context) for x in given]
    center = m.scene.body.center_of_mass
    return list(center) if any(x != 0 for x in center) else None


def tip(m: Mechanics) -> list[Symbolic]:
    """Position of the tip point, space axes."""
    context, length = m.scene.context, _tip_exponent(m)
    point = [context.ldexp(x, -length) for x in m.carried(tip_point(m))]
    turned = apply(m.matrix, m.fixed(point))
    if m.position is None:
        return turned
    return [x + a for x, a in zip(m.position, turned, strict=True)]


def _tip_exponent(m: Mechanics) -> int:
    return m.scaling.length if m.position is not None else 0


def _no_tip(m: Mechanics) -> str | None:
    if tip_point(m) is not None:
        return None
    return "nothing says which point; give [output] tip = [x, y, z] in body axes, or"


def _is_top(m: Mechanics) -> bool:
    return m.numbers.arm is not None


def _tip_attributes(m: Mechanics) -> dict[str, str]:
    point = tip_point(m)
    components = "" if point is None else ", ".join(m.scene.context.nstr(x, 17) for x in point)
    return {"point": f"[{components}] m in body axes"}


register_all(
    Observable(
        "tilt", (), "rad", "angle of the figure axis from the upward vertical", tilt,
        needs=("vertical",), by_default=_is_top,
        attributes=described_by("from 0, upright, to pi, hanging", figure=True),
    ),
    continuous_angles(
        "precession_angle", (), "precession of the figure axis about the vertical", precession_angle,
        frame="space axes", needs=("attitude", "vertical"), by_default=_is_top,
        attributes=described_by(
            "of the line of nodes from the horizontal X, about the upward vertical; turns counted; NaN where "
            "the figure axis is vertical",
            figure=True,
        ),
    ),
    continuous_angles(
        "spin_angle", (), "rotation about the figure axis",
        lambda m: [Angle(*_vertical(m)[:2])],
        needs=("attitude", "vertical"), by_default=_is_top,
        attributes=described_by(
            "of the body from the line of nodes; turns counted; NaN where the figure axis is vertical",
            figure=True,
        ),
    ),
    Observable(
        "tip", SPACE, "m", "path of a point of the body", tip, same_unit(_tip_exponent, 3), "space axes",
        ("attitude", "place"), by_default=lambda m: _is_top(m) or m.scene.config.output.tip is not None,
        attributes=_tip_attributes, absent=_no_tip,
    ),
)  # fmt: skip
