"""Directions of the figure, spin and momentum axes in space, and their angles against the reference plane.

With a unit axis a = (u, v, s) along the plane's X', Y' and normal n
(``rigidsim.model.frames``):

    obliquity = atan2(|n x a|, n . a),    node longitude = atan2(u, -v),

the latter of n x a, where the equator whose pole is a rises through the plane: luni-solar precession makes it
decrease. Neither loses digits at any angle.

The kind decides what is recorded by default: a planet that precesses has directions and their angles; a body
that turns nearly about its figure axis has polar motion, wobble and a rotation angle; other bodies have
neither.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import heyoka as hy

from rigidsim.model.frames import reference_plane
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    SPACE,
    Angle,
    Observable,
    continuous_angles,
    described_by,
    only_when_named,
    register_all,
)
from rigidsim.model.rotations import Symbolic, apply, unit
from rigidsim.model.scaling import source_rate
from rigidsim.scene.arithmetic import apply as multiply
from rigidsim.scene.arithmetic import cross, dot, norm
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_equator

AXIS = ("axis",)


def three_axes(m: Mechanics) -> list[list[Symbolic]]:
    """Unit vectors in the order of the labels of the dimension ``axis``, space axes."""
    return [unit(m.figure_space), unit(m.spin_space), unit(m.momentum_space)]


def _on_plane(m: Mechanics) -> list[list[Symbolic]]:
    """Components of each axis along the reference plane's X', Y' and normal."""
    plane = reference_plane(m)
    return [plane.components(axis) for axis in three_axes(m)]


def _on_sky(m: Mechanics, axes: list[list[Symbolic]]) -> list[list[Symbolic]]:
    """Components of axes along equatorial axes: the space axes, unless these are the ecliptic's."""
    if m.scene.axes != ECLIPTIC:
        return axes
    c, s = m.fixed(list(obliquity(m.scene.context)))
    return [to_equator(axis, (c, s)) for axis in axes]


def _meridian(m: Mechanics) -> list[Angle]:
    """W: with the pole (x, y, z) and the prime meridian f, the node is along (-y, x, 0), and W is
    atan2(f_z, x f_y - y f_x), times the cosine of the declination.
    """
    figure = m.scene.figure
    (x, y, _), (fx, fy, fz) = _on_sky(m, [m.figure_space, apply(m.matrix, m.fixed(figure.first))])
    return [Angle(fz, x * fy - y * fx)]


def _no_meridian(m: Mechanics) -> str | None:
    if m.scene.axes is not None:
        return None
    return "it counts from the equator of J2000, but what the space axes are isn't known; set [frame] axes"


def _sky(convention: str) -> Callable[[Mechanics], Mapping[str, str]]:
    def against(m: Mechanics) -> str:
        turned = m.scene.axes == ECLIPTIC
        where = "mean equator and equinox of J2000" if turned else "the space axes' XY plane and X"
        return f"{convention}, against {where}"

    return described_by(against, figure=True)


# --- the kind of rotation, by which some variables are recorded by default ----------------------------------

_AXIAL = 0.1
"""Angle (rad) between spin and figure axis up to which a body turns nearly about it."""
_FAST = 10
"""Ratio of a planet's spin to its sources' rates; a slower body librates or tumbles with its source."""


def _turns_about_its_figure(m: Mechanics) -> bool:
    """Whether the body starts turning nearly about its figure axis, a principal one."""
    scene, context = m.scene, m.scene.context
    spin, pole = scene.angular_velocity, scene.figure.pole
    if all(w == 0 for w in spin):
        return False
    aligned, across = abs(dot(spin, pole)), norm(context, cross(pole, spin))
    turned = multiply(scene.body.inertia, pole)
    principal = norm(context, cross(turned, pole)) <= norm(context, turned) * 1e-12
    return bool(across <= _AXIAL * aligned) and principal


def _moves(load: Load) -> bool:
    return bool(load.orbit or load.table or load.placement.moves or load.reacts)


def is_planet(m: Mechanics) -> bool:
    """Whether a fast spin precesses under gravity gradients of orbiting or ephemeris bodies."""
    if m.attitude is None or not m.turning:
        return False
    distant = [x for x in m.turning if _moves(x)]
    fast = norm(m.scene.context, m.scene.angular_velocity) >= _FAST * source_rate(m.scene)
    return len(distant) == len(m.turning) and bool(fast) and _turns_about_its_figure(m)


def is_nearly_axial(m: Mechanics) -> bool:
    """Whether a torque-free body or a planet turns nearly, but not exactly, about its figure axis."""
    if m.carriers or (m.torque and not is_planet(m)):
        return False
    scene, pole = m.scene, m.scene.figure.pole
    wobbles = norm(scene.context, cross(pole, scene.angular_velocity)) != 0
    return _turns_about_its_figure(m) and (bool(wobbles) or bool(m.torque))


# --- the observables ----------------------------------------------------------------------------------------

_AT_REST = "unit vector; NaN where the body is at rest"

register_all(
    Observable(
        "figure_axis", SPACE, "1", "direction of the figure axis", lambda m: unit(m.figure_space),
        frame="space axes", needs=("attitude",), by_default=is_planet,
        attributes=described_by("unit vector", figure=True),
    ),
    Observable(
        "spin_axis", SPACE, "1", "direction of the angular velocity", lambda m: unit(m.spin_space),
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=described_by(_AT_REST),
    ),
    Observable(
        "momentum_axis", SPACE, "1", "direction of the angular momentum",
        lambda m: unit(m.momentum_space),
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=described_by(_AT_REST),
    ),
    continuous_angles(
        "right_ascension", AXIS, "right ascension of the figure, spin and momentum axes",
        lambda m: [Angle(y, x) for x, y, _ in _on_sky(m, three_axes(m))],
        frame="space axes", needs=("attitude",),
        attributes=_sky("longitude from X towards Y, turns counted; NaN at the poles"),
    ),
    Observable(
        "declination", AXIS, "rad", "declination of the figure, spin and momentum axes",
        lambda m: [hy.atan2(z, hy.sqrt(x * x + y * y)) for x, y, z in _on_sky(m, three_axes(m))],
        frame="space axes", needs=("attitude",), by_default=only_when_named,
        attributes=_sky("positive north of the equator"),
    ),
    continuous_angles(
        "prime_meridian", (), "angle of the prime meridian, the IAU's W", _meridian,
        frame="space axes", needs=("attitude",), absent=_no_meridian,
        attributes=described_by(
            "from where the equator of the figure axis rises through the mean equator of J2000, along it in "
            "the direct sense to the figure's first axis; turns counted; NaN at the poles",
            figure=True,
        ),
    ),
    Observable(
        "obliquity", AXIS, "rad", "obliquity of the figure, spin and momentum axes",
        lambda m: [hy.atan2(hy.sqrt(u * u + v * v), s) for u, v, s in _on_plane(m)],
        frame="space axes", needs=("attitude", "plane"), by_default=is_planet,
        attributes=described_by("angle from the reference plane's normal, 0 to pi", figure=True, plane=True),
    ),
    continuous_angles(
        "node_longitude", AXIS,
        "longitude of the node of the equator of the figure, spin and momentum axes",
        lambda m: [Angle(u, -v) for u, v, _ in _on_plane(m)],
        frame="space axes", needs=("attitude", "plane"), by_default=is_planet,
        attributes=described_by(
            "where the equator whose pole is the axis rises through the reference plane, from X turned by "
            "the smallest rotation that takes Z to the normal, in the direct sense; turns counted; NaN where "
            "the obliquity is 0 or pi",
            figure=True, plane=True,
        ),
    ),
)  # fmt: skip
