"""Torques on a rotating body in its own axes, written for lists of three: numbers or heyoka's expressions.

Nothing of rigidsim is used, so that its loads can be held against these. Torques and tensors are per M
R^2 of the body (a torque's unit is 1/time^2), places in the units of R, gravitational parameters in those
of R^3/time^2.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

Vector = Sequence[Any]
Matrix = Sequence[Vector]


def cross(a: Vector, b: Vector) -> list:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Vector, b: Vector) -> Any:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def total(*vectors: Vector) -> list:
    """Their sum."""
    found = list(vectors[0])
    for vector in vectors[1:]:
        found = [x + y for x, y in zip(found, vector, strict=True)]
    return found


def scaled(factor: Any, vector: Vector) -> list:
    """factor * vector."""
    return [factor * x for x in vector]


def times(matrix: Matrix, vector: Vector) -> list:
    """matrix . vector."""
    return [dot(row, vector) for row in matrix]


def body_to_space(q: Vector) -> list:
    """The rotation matrix of a quaternion w x y z."""
    w, x, y, z = q
    return [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]


def to_body(q: Vector, place: Vector) -> list:
    """A vector of space axes in body axes."""
    return [dot(column, place) for column in zip(*body_to_space(q), strict=True)]


def quaternion_rate(q: Vector, w: Vector) -> list:
    """q' = q (0, w)/2, w in body axes."""
    a, b, c, d = q
    return [
        0.5 * (-b * w[0] - c * w[1] - d * w[2]),
        0.5 * (a * w[0] + c * w[2] - d * w[1]),
        0.5 * (a * w[1] + d * w[0] - b * w[2]),
        0.5 * (a * w[2] + b * w[1] - c * w[0]),
    ]


def gradient_torque(parameter: float, place: Vector, tensor: Matrix) -> list:
    """MacCullagh's torque of a point source: 3 Gm'/r^5 x x I x."""
    r2 = dot(place, place)
    return scaled(3.0 * parameter * r2**-2.5, cross(place, times(tensor, place)))


def _legendre(n: int, m: int) -> dict[int, float]:
    """The m-th derivative of the Legendre polynomial P_n, by powers."""
    polynomial = {
        n - 2 * k: (-1) ** k * math.comb(n, k) * math.comb(2 * n - 2 * k, n) / 2**n for k in range(n // 2 + 1)
    }
    for _ in range(m):
        polynomial = {power - 1: power * value for power, value in polynomial.items() if power}
    return polynomial


def _value(polynomial: Mapping[int, float], powers: Sequence[Any]) -> Any:
    """A polynomial of z."""
    return sum((value * powers[k] if k else value for k, value in polynomial.items()), 0.0)


Field = Mapping[tuple[int, int], tuple[float, float]]
"""Unnormalised C and S by degree and order; C_n0 = -J_n."""


def field_torque(parameter: float, place: Vector, radius: float, field: Field) -> list:
    """Torque of a point source on the coefficients of degree 3 and more: -Gm' x x grad Phi.

    Only the slope across u = x/r turns the body. On the sphere the harmonic of degree n and order m is the
    m-th derivative of P_n at u_z times C Re(u_x + i u_y)^m + S Im(u_x + i u_y)^m; off it nothing matters.
    """
    inverse = dot(place, place) ** -0.5
    u = scaled(inverse, place)
    highest = max(n for n, _ in field)
    cosines, sines, heights = [1.0, u[0]], [0.0, u[1]], [1.0, u[2]]
    for _ in range(2, highest + 1):
        c, s = cosines[-1], sines[-1]
        cosines.append(u[0] * c - u[1] * s)
        sines.append(u[0] * s + u[1] * c)
        heights.append(heights[-1] * u[2])
    slope: list = [0.0, 0.0, 0.0]
    for n in sorted({n for n, _ in field}):
        found: list = [0.0, 0.0, 0.0]
        for (degree, m), (c, s) in field.items():
            if degree != n:
                continue
            height, rise = _value(_legendre(n, m), heights), _value(_legendre(n, m + 1), heights)
            if m:
                found[0] = found[0] + m * height * (c * cosines[m - 1] + s * sines[m - 1])
                found[1] = found[1] + m * height * (s * cosines[m - 1] - c * sines[m - 1])
            found[2] = found[2] + rise * (c * cosines[m] + s * sines[m])
        slope = total(slope, scaled((radius * inverse) ** (n - 2), found))
    # Phi's factor R^n/r^(n+1), per M R^2: Gm'/R^2 (R/r)^n/r = Gm'/r^3 (R/r)^(n-2).
    return scaled(-parameter * inverse**3, cross(u, slope))


def figure_torque(
    parameter: float, place: Vector, tensor: Matrix, oblateness: float, radius: float, pole: Vector
) -> list:
    """Torque of an oblate source's J2' R'^2 on the body's tensor; its pole in body axes."""
    inverse = dot(place, place) ** -0.5
    u = scaled(inverse, place)
    s = dot(u, pole)
    iu, ip = times(tensor, u), times(tensor, pole)
    both = total(cross(u, ip), cross(pole, iu))
    found = total(
        scaled(1.0 - 7.0 * s * s, cross(u, iu)), scaled(2.0 * s, both), scaled(-0.4, cross(pole, ip))
    )
    return scaled(7.5 * parameter * oblateness * radius**2 * inverse**5, found)


def tide_tensor(love: float, mass_ratio: float, radius: float, place: Vector) -> list:
    """What a source's tide adds to the tensor, per M R^2: -k2 (m'/m) (R/r)^3 (u u - 1/3)."""
    r2 = dot(place, place)
    factor = -love * mass_ratio * radius**3 * r2**-2.5
    return [
        [factor * (place[i] * place[j] - (r2 / 3.0 if i == j else 0.0)) for j in range(3)] for i in range(3)
    ]


def spin_tensor(love: float, parameter: float, radius: float, w: Vector, mean_rate: float) -> list:
    """What the spin adds beyond a mean rate's share (which is in the measured moments).

    k2 R^3/(3 Gm) (w w - diag(w^2 - n^2, w^2 - n^2, w^2 + 2 n^2)/3).
    """
    factor = love * radius**3 / (3.0 * parameter)
    w2, n2 = dot(w, w), mean_rate**2
    less = [(w2 - n2) / 3.0, (w2 - n2) / 3.0, (w2 + 2.0 * n2) / 3.0]
    return [[factor * (w[i] * w[j] - (less[i] if i == j else 0.0)) for j in range(3)] for i in range(3)]


def turned_back(w: Vector, acceleration: Vector, delay: float, vector: Vector) -> list:
    """A space-fixed vector of today's body axes in those of a delay ago (third order in the angle)."""
    angle = [delay * a - 0.5 * delay**2 * b for a, b in zip(w, acceleration, strict=True)]
    first = cross(angle, vector)
    second = cross(angle, first)
    third = cross(angle, second)
    return total(vector, first, scaled(0.5, second), scaled(1.0 / 6.0, third))


def core_torque(friction: float, equatorial: float, polar: float, w: Vector, core: Vector) -> list:
    """On the mantle: friction K (w_c - w), and the core's pressure (C_c - A_c)(z.w_c)(z x w_c)."""
    pressure = (polar - equatorial) * core[2]
    return [
        friction * (core[0] - w[0]) - pressure * core[1],
        friction * (core[1] - w[1]) + pressure * core[0],
        friction * (core[2] - w[2]),
    ]


def core_acceleration(friction: float, equatorial: float, polar: float, w: Vector, core: Vector) -> list:
    """The core's: d(I_c w_c)/dt + w x I_c w_c = -N_c."""
    moments = [equatorial, equatorial, polar]
    momentum = [m * x for m, x in zip(moments, core, strict=True)]
    torque, turning = core_torque(friction, equatorial, polar, w, core), cross(w, momentum)
    return [(-torque[i] - turning[i]) / moments[i] for i in range(3)]


def solved(matrix: Matrix, vector: Vector) -> list:
    """matrix^-1 . vector for a symmetric matrix of three rows."""
    (a, d, e), (_, b, f), (_, _, c) = matrix
    cofactors = [
        [b * c - f * f, e * f - d * c, d * f - e * b],
        [e * f - d * c, a * c - e * e, d * e - a * f],
        [d * f - e * b, d * e - a * f, a * b - d * d],
    ]
    inverse = (a * cofactors[0][0] + d * cofactors[0][1] + e * cofactors[0][2]) ** -1.0
    return scaled(inverse, times(cofactors, vector))
