"""Rotation about the momentum, and Andoyer's variables.

With the reference plane (X', Y', n), the unit vector k of the angular momentum G k, and the figure's axes
(e1, e2, e3), the attitude is R3(h) R1(I) R3(g) R1(J) R3(l) with cos I = k . n = H / G, cos J = k . e3 = L / G
(Andoyer 1923; Deprit 1967, Am. J. Phys. 35, 424). Each angle is the arc tangent of two products that vanish
only where it is undefined: h with sin I, l with sin J, g with sin I sin J.

The rotation angle is their sum h + g + l, which is defined where they aren't (with -h if the momentum starts
opposite to n, with -l if it starts opposite to e3, each axis then reversed below): the turn about k from X',
carried there by the smallest rotation that takes n to k, to e1, carried there by the smallest that takes e3
to k. For a free body that turns nearly about its figure axis it grows uniformly.
"""

from __future__ import annotations

from rigidsim.model.frames.reference_plane import initial_normal, reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    MOMENTUM,
    Angle,
    Observable,
    continuous_angles,
    only_when_named,
    register_all,
    same_unit,
)
from rigidsim.model.observables.steadiness import is_nearly_axial, steady_rotation
from rigidsim.model.observables.vectors import along, figure_told, in_body, length, plane_told, unit
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply as apply_numbers
from rigidsim.scene.arithmetic import cross, dot


def _andoyer_momenta(m: Mechanics) -> list[Symbolic]:
    momentum, plane = m.momentum_body, reference_plane(m)
    figure = along(in_body(m, m.scene.figure.pole), momentum)
    return [figure, length(momentum), along(plane.normal, m.momentum_space)]


def _andoyer_angles(m: Mechanics) -> list[Angle]:
    figure, plane = m.scene.figure, reference_plane(m)
    k = unit(m.momentum_body)
    u, v, s = plane.components(apply(m.matrix, k))
    # k x e3 from body components: they are small there, so it keeps its digits
    q0, q1, q2 = plane.components(apply(m.matrix, cross(k, in_body(m, figure.pole))))
    across = (u * u + v * v) * q2 - s * (u * q0 + v * q1)
    return [
        Angle(along(in_body(m, figure.first), k), along(in_body(m, figure.second), k)),
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
        """Components along X', Y', n, or along X', -Y', -n for sign -1, so that the momentum's last one is
        positive.
        """
        x, y, z = plane.components(vector)
        signs = (sign, sign * north, sign * north)
        return [a if s > 0 else -a for a, s in zip((x, y, z), signs, strict=True)]

    u, v, s = seen(unit(m.momentum_space))
    first = seen(apply(m.matrix, in_body(m, figure.first)))
    second = seen(apply(m.matrix, in_body(m, figure.second)), upright)
    inverse = 1.0 / (1.0 + s)
    x = [1.0 - u * u * inverse, -(u * v * inverse), -u]
    y = [-(u * v * inverse), 1.0 - v * v * inverse, -v]
    return [Angle(along(y, first) - along(x, second), along(x, first) + along(y, second))]


def _rotation_sum(m: Mechanics) -> str:
    """The rotation angle as a sum of Andoyer's: seen from the side on which the momentum is, h and l count
    backwards if that isn't the normal's, or the figure axis'.
    """
    north, upright = _senses(m)
    if north > 0 and upright > 0:
        return "h + g + l"
    return f"g {'+' if north > 0 else '-'} h {'+' if upright > 0 else '-'} l"


def _rotation_period(m: Mechanics) -> list[Symbolic]:
    return [m.number(2 * m.scene.context.pi) / length(m.rates)]


def _told(convention: str) -> dict[str, str]:
    return {"convention": convention}


register_all(
    continuous_angles(
        "rotation_angle", (), "angle of rotation about the angular momentum", _rotation_angle,
        frame="space axes", needs=("attitude", "plane"), by_default=is_nearly_axial, steady=steady_rotation,
        attributes=lambda m: _told(
            f"{_rotation_sum(m)} of andoyer_angles: from X, carried to the momentum's equator by the "
            "smallest rotations, to the figure's first axis; in the direct sense about the momentum; turns "
            "counted"
        ) | figure_told(m) | plane_told(m),
    ),
    Observable(
        "rotation_rate", (), "rad s-1", "instantaneous rate of rotation", lambda m: [length(m.rates)],
        same_unit(lambda m: -m.scaling.time, 1), by_default=only_when_named,
        attributes=lambda m: _told("norm of the angular velocity"),
    ),
    Observable(
        "rotation_period", (), "s", "instantaneous period of rotation (sidereal length of day)",
        _rotation_period, same_unit(lambda m: m.scaling.time, 1), by_default=only_when_named,
        attributes=lambda m: _told("2 pi / rotation_rate, against the stars; infinite at rest"),
    ),
    Observable(
        "andoyer_momenta", ("andoyer_momentum",), "kg m2 s-1", "Andoyer momenta", _andoyer_momenta,
        same_unit(MOMENTUM, 3), needs=("attitude", "plane"), by_default=only_when_named,
        attributes=lambda m: _told(
            "L along the figure axis, G the norm, H along the reference plane's normal"
        ) | figure_told(m) | plane_told(m),
    ),
    continuous_angles(
        "andoyer_angles", ("andoyer_angle",), "Andoyer angles", _andoyer_angles,
        needs=("attitude", "plane"),
        attributes=lambda m: _told(
            "l about the figure axis, g about the momentum, h about the reference plane's normal: attitude = "
            "R3(h) R1(I) R3(g) R1(J) R3(l), cos I = H/G, cos J = L/G; turns counted; NaN where undefined"
        ) | figure_told(m) | plane_told(m),
    ),
)  # fmt: skip
