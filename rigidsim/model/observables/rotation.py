"""Rotation about the momentum, and Andoyer's variables.

With the reference plane (X', Y', n), the unit vector k of the angular momentum G k, and the figure's axes
(e1, e2, e3), the attitude is R3(h) R1(I) R3(g) R1(J) R3(l) with cos I = k . n = H / G, cos J = k . e3 = L / G
(Andoyer 1923; Deprit 1967, Am. J. Phys. 35, 424). Each angle is the arc tangent of two products that vanish
only where it is undefined: h with sin I, l with sin J, g with sin I sin J.

The rotation angle is their sum h + g + l, which is defined where they aren't (with -h if the momentum starts
opposite to n, with -l if it starts opposite to e3, each axis then reversed below): the turn about k from X',
carried there by the smallest rotation that takes n to k, to e1, carried there by the smallest that takes e3
to k. For a free body that turns nearly about its figure axis it grows uniformly.

Polar motion is the spin relative to the figure axis, seen from the body: m1 = w1 / w3, m2 = w2 / w3 along the
figure's equator (Munk & MacDonald 1960, The Rotation of the Earth, eq. 6.1.1; IERS: x_p = m1, y_p = -m2).
"""

from __future__ import annotations

from collections.abc import Mapping

import heyoka as hy

from rigidsim.model.frames import initial_normal, reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.axes import is_nearly_axial
from rigidsim.model.observables.observable import (
    MOMENTUM,
    Angle,
    Observable,
    continuous_angles,
    described_by,
    only_when_named,
    register_all,
    same_unit,
)
from rigidsim.model.rotations import Symbolic, along, apply, length, unit
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply as apply_numbers
from rigidsim.scene.arithmetic import cross, dot, norm
from rigidsim.scene.frame import unique_axis


def _andoyer_momenta(m: Mechanics) -> list[Symbolic]:
    momentum, plane = m.momentum_body, reference_plane(m)
    figure = along(m.fixed(m.scene.figure.pole), momentum)
    return [figure, length(momentum), along(plane.normal, m.momentum_space)]


def _andoyer_angles(m: Mechanics) -> list[Angle]:
    figure, plane = m.scene.figure, reference_plane(m)
    k = unit(m.momentum_body)
    u, v, s = plane.components(apply(m.matrix, k))
    # k x e3 from body components: they are small there, so it keeps its digits
    q0, q1, q2 = plane.components(apply(m.matrix, cross(k, m.fixed(figure.pole))))
    across = (u * u + v * v) * q2 - s * (u * q0 + v * q1)
    return [
        Angle(along(m.fixed(figure.first), k), along(m.fixed(figure.second), k)),
        Angle(across, u * q1 - v * q0),
        Angle(u, -v),
    ]


def _senses(m: Mechanics) -> tuple[int, int]:
    """Side of the reference plane, and of the figure's equator, on which the momentum starts: +1 or -1."""
    scene = m.scene
    momentum = m.starting_momentum
    in_space = apply_numbers(attitude.rotation_matrix(scene.quaternion), momentum)
    above = dot(in_space, initial_normal(scene, m.loads))
    return (-1 if above < 0 else 1), (-1 if dot(momentum, scene.figure.pole) < 0 else 1)


def _rotation_angle(m: Mechanics) -> list[Angle]:
    figure, plane = m.scene.figure, reference_plane(m)
    north, upright = _senses(m)

    def seen(vector: list[Symbolic], sign: int = 1) -> list[Symbolic]:
        """Components along X', Y', n, or X', -Y', -n for sign -1, so that the momentum's last is positive."""
        x, y, z = plane.components(vector)
        signs = (sign, sign * north, sign * north)
        return [a if s > 0 else -a for a, s in zip((x, y, z), signs, strict=True)]

    u, v, s = seen(unit(m.momentum_space))
    first = seen(apply(m.matrix, m.fixed(figure.first)))
    second = seen(apply(m.matrix, m.fixed(figure.second)), upright)
    inverse = 1.0 / (1.0 + s)
    x = [1.0 - u * u * inverse, -(u * v * inverse), -u]
    y = [-(u * v * inverse), 1.0 - v * v * inverse, -v]
    return [Angle(along(y, first) - along(x, second), along(x, first) + along(y, second))]


def _rotation_sum(m: Mechanics) -> str:
    """The rotation angle as a sum of Andoyer's: h and l count backwards on the momentum's other side."""
    north, upright = _senses(m)
    if north > 0 and upright > 0:
        return "h + g + l"
    return f"g {'+' if north > 0 else '-'} h {'+' if upright > 0 else '-'} l"


register_all(
    continuous_angles(
        "rotation_angle", (), "angle of rotation about the angular momentum", _rotation_angle,
        frame="space axes", needs=("attitude", "plane"), by_default=is_nearly_axial,
        attributes=described_by(
            lambda m: f"{_rotation_sum(m)} of andoyer_angles: from X, carried to the momentum's equator by "
            "the smallest rotations, to the figure's first axis; in the direct sense about the momentum; "
            "turns counted",
            figure=True, plane=True,
        ),
    ),
    Observable(
        "rotation_rate", (), "rad s-1", "instantaneous rate of rotation", lambda m: [length(m.rates)],
        same_unit(lambda m: -m.scaling.time, 1), by_default=only_when_named,
        attributes=described_by("norm of the angular velocity"),
    ),
    Observable(
        "rotation_period", (), "s", "instantaneous period of rotation (sidereal length of day)",
        lambda m: [m.number(2 * m.scene.context.pi) / length(m.rates)],
        same_unit(lambda m: m.scaling.time, 1), by_default=only_when_named,
        attributes=described_by("2 pi / rotation_rate, against the stars; infinite at rest"),
    ),
    Observable(
        "andoyer_momenta", ("andoyer_momentum",), "kg m2 s-1", "Andoyer momenta", _andoyer_momenta,
        same_unit(MOMENTUM, 3), needs=("attitude", "plane"), by_default=only_when_named,
        attributes=described_by(
            "L along the figure axis, G the norm, H along the reference plane's normal",
            figure=True, plane=True,
        ),
    ),
    continuous_angles(
        "andoyer_angles", ("andoyer_angle",), "Andoyer angles", _andoyer_angles,
        needs=("attitude", "plane"),
        attributes=described_by(
            "l about the figure axis, g about the momentum, h about the reference plane's normal: attitude = "
            "R3(h) R1(I) R3(g) R1(J) R3(l), cos I = H/G, cos J = L/G; turns counted; NaN where undefined",
            figure=True, plane=True,
        ),
    ),
)  # fmt: skip


# --- relative to the figure axis, seen from the body --------------------------------------------------------


def _polar_motion(m: Mechanics) -> list[Symbolic]:
    figure = m.scene.figure
    w1, w2, w3 = (along(m.fixed(axis), m.rates) for axis in (figure.first, figure.second, figure.pole))
    off = hy.gt(w1 * w1 + w2 * w2, w3 * w3)
    kept = hy.select(off, 0.0, 1.0)
    kept = kept / kept  # NaN where it is off, and 1 elsewhere
    return [kept * (w1 / w3), kept * (w2 / w3)]


def _no_polar_motion(m: Mechanics) -> str | None:
    """Why there is no polar motion: the spin starts outside the cone where it is recorded."""
    context, figure = m.scene.context, m.scene.figure
    aligned = abs(dot(m.scene.angular_velocity, figure.pole))
    across = norm(context, [dot(m.scene.angular_velocity, e) for e in (figure.first, figure.second)])
    if aligned == 0 and across == 0:
        return "the body starts at rest, without a spin that could have a pole"
    if across > aligned:
        degrees = context.nstr(context.degrees(context.atan2(across, aligned)), 4)
        return (
            f"the spin starts {degrees} deg from the figure axis ({figure.described}), and polar motion is "
            "recorded up to 45 deg; choose another [frame] figure_axis, or record wobble_angle"
        )
    return None


def _angle_between(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    """Angle atan2(|a x b|, a . b), 0 to pi, which loses no digits anywhere; NaN if either vector is zero."""
    aligned = along(a, b)
    across = length(cross(a, b))
    size = hy.sqrt(aligned * aligned + across * across)
    return hy.atan2(across / size, aligned / size)


def _wobble_angle(m: Mechanics) -> list[Symbolic]:
    largest = unique_axis(m.scene.body, m.scene.context, largest=True)
    assert largest is not None
    return [_angle_between(m.fixed(largest), m.momentum_body)]


def _no_largest(m: Mechanics) -> str | None:
    if unique_axis(m.scene.body, m.scene.context, largest=True) is not None:
        return None
    return (
        "the two largest principal moments are equal, so that no single axis has the largest; record "
        "nutation_angle"
    )


def _polar_attributes(m: Mechanics) -> Mapping[str, str]:
    first = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.first)
    convention = "m1 = w1/w3, m2 = w2/w3 (IERS: x_p = m1, y_p = -m2); NaN where the spin is more than 45 "
    shown = dict(described_by(convention + "degrees from the figure axis", figure=True)(m))
    return {"convention": shown["convention"], "first_axis": f"[{first}] in body axes"} | shown


_NO_SPIN = "0 to pi; NaN where the body is at rest"

register_all(
    Observable(
        "polar_motion", ("polar_motion_component",), "rad", "polar motion", _polar_motion,
        frame="body axes", by_default=is_nearly_axial, attributes=_polar_attributes,
        absent=_no_polar_motion,
    ),
    Observable(
        "wobble_angle", (), "rad", "angle of the angular momentum from the axis of largest moment",
        _wobble_angle, frame="body axes", by_default=is_nearly_axial,
        attributes=described_by(_NO_SPIN), absent=_no_largest,
    ),
    Observable(
        "nutation_angle", (), "rad", "angle of the figure axis from the angular momentum",
        lambda m: [_angle_between(m.fixed(m.scene.figure.pole), m.momentum_body)],
        frame="body axes", by_default=is_nearly_axial,
        attributes=described_by(_NO_SPIN, figure=True),
    ),
)  # fmt: skip
