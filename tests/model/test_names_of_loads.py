"""Names of loads in expressions, against the same motions in another formulation: angular momentum in space
and rotation matrix, Kepler's equation solved by itself, shadows by quadrature of the covered chords.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import heyoka as hy
import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from space_motions import Motion, cross, dot
from support import config, loaded, matrices, run_text, wide

import rigidsim
from rigidsim import ConfigError

BODY = "principal_moments = [0.03, 0.034, 0.01]"
START = "angular_velocity = [0.5, -0.6, 0.7]\nquaternion = [1, 0.2, 0.1, -0.3]"
MU = 3.986004418e14
ELEMENTS = {"a": "7e6", "e": "0.02", "i": "0.9", "node": "0.3", "w": "0.5", "M": "0.7"}
ORBIT = (
    f"gravitational_parameter = {MU:.10g}\norbit = {{semi_major_axis = 7e6, eccentricity = 0.02, "
    "inclination = 0.9, ascending_node = 0.3, periapsis = 0.5, mean_anomaly = 0.7}"
)
DIPOLE = [np.longdouble(x) for x in ("1e22", "-2e22", "-7.7e22")]
EARTH = f'kind = "gravity_gradient"\nname = "earth"\nradius = "6378 km"\n{ORBIT}'
SUN_ORBIT = 'orbit = {semi_major_axis = "149.6e6 km", eccentricity = 0.0167, mean_anomaly = 5}'
SUN = f'kind = "gravity_gradient"\nname = "sun"\ngravitational_parameter = 1.327e20\n{SUN_ORBIT}'


def loads(*tables: str) -> str:
    return "\n[[loads]]\n".join(tables)


def torque(*components: str) -> str:
    return 'kind = "torque"\ncomponents = [' + ", ".join(f'"{x}"' for x in components) + "]"


# --- the truth ----------------------------------------------------------------------------------------------


def place(time: Any, of: dict[str, str] = ELEMENTS, strength: float = MU) -> list[Any]:
    """From the body to the source: Kepler's equation by heyoka's own solver, turned by three angles."""
    fp = np.longdouble
    a, e = fp(of["a"]), fp(of["e"])
    anomaly = hy.kepE(e, fp(of["M"]) + np.sqrt(fp(strength) / a**3) * time)
    x, y = a * (hy.cos(anomaly) - e), a * np.sqrt(1 - e * e) * hy.sin(anomaly)
    c, s = np.cos(fp(of["w"])), np.sin(fp(of["w"]))
    x, y = c * x - s * y, s * x + c * y
    ci, si = np.cos(fp(of["i"])), np.sin(fp(of["i"]))
    cn, sn = np.cos(fp(of["node"])), np.sin(fp(of["node"]))
    return [cn * x - sn * (ci * y), sn * x + cn * (ci * y), si * y]


def truth(end: float, law: Callable[..., Any]) -> tuple[Any, Any]:
    """Rotation matrix and rates at the end, for a law of (rates, what turns space into body axes)."""
    motion = Motion(("0.03", "0.034", "0.01"), ("0.5", "-0.6", "0.7"), ("1", "0.2", "0.1", "-0.3"))
    pull = _gradient(motion.seen, motion.moments)
    torque = [x + 3 * MU * g for x, g in zip(law(motion.rates, motion.seen), pull, strict=True)]
    (row,) = motion.followed(motion.equations(torque), [end])
    return row[3:12].reshape(3, 3), motion.rates_of(row)


def _gradient(seen: Any, moments: Any) -> list[Any]:
    towards = place(hy.time)
    far = hy.sqrt(dot(towards, towards))
    c = seen([x / far for x in towards])
    return [x / far**3.0 for x in cross(c, [i * x for i, x in zip(moments, c, strict=True)])]


def field(time: Any) -> list[Any]:
    """Of the dipole where the body is (Jackson, eq. 5.56), T, space axes."""
    towards = place(time)
    far = hy.sqrt(dot(towards, towards))
    along = dot(towards, DIPOLE) / far
    size = np.longdouble("1e-7") / far**3.0
    return [size * (3.0 * along * x / far - e) for x, e in zip(towards, DIPOLE, strict=True)]


def apart(run: rigidsim.Run, matrix: Any) -> float:
    """Angle between the attitude at the end of a run and a rotation matrix, rad."""
    return float(np.sqrt(((matrices(wide(run.dataset, "quaternion")[-1]) - matrix) ** 2).sum() / 2))


# --- directions and distances -------------------------------------------------------------------------------

TOWARDS = torque("-2e-6*uz_earth", "1e-6*ux_earth*(r_earth/(7e6 m))^2", "2e-6*uy_earth")


def towards_earth(w: Any, seen: Any) -> Any:
    source = place(hy.time)
    far = hy.sqrt(dot(source, source))
    u, fp = seen([x / far for x in source]), np.longdouble
    ratio = far / 7e6
    return [-fp("2e-6") * u[2], fp("1e-6") * u[0] * ratio * ratio, fp("2e-6") * u[1]]


@pytest.mark.parametrize(
    ("precision", "formulation", "end", "bound"),
    [
        ("double", "quaternion", 950, 2e-12),
        ("double", "euler_angles", 60, 2e-13),
        ("extended", "rotation_matrix", 60, 2e-15),
    ],
)
def test_directions_and_distances(precision: str, formulation: str, end: float, bound: float) -> None:
    """Up to 1000 rad of the body, within what rounding makes of it (the truth itself has 80 bits)."""
    how = f'precision = "{precision}"\nformulation = "{formulation}"'
    given = config(BODY, START, loads(EARTH, TOWARDS), f"end = {end}\nsamples = 3", how)
    assert apart(run_text(given), truth(end, towards_earth)[0]) <= bound


# --- the magnetic field -------------------------------------------------------------------------------------

PAIRS = (("wz*by", "wy*bz"), ("wx*bz", "wz*bx"), ("wy*bx", "wx*by"))
B_DOT = [f"-k*({a} - {b})" for a, b in PAIRS]
K = '[parameters]\nk = "500 A m^2 s/T"'


def magnet(*moment: str) -> str:
    row = ", ".join(f'"{x}"' for x in moment)
    return f'kind = "magnetic_dipole"\nmoment = [{row}]\nsource_moment = [1e22, -2e22, -7.7e22]\n{ORBIT}'


def b_dot(w: Any, seen: Any) -> Any:
    """A moment against db/dt = b x w of a field at rest."""
    b = seen(field(hy.time))
    return cross([-np.longdouble(500) * x for x in cross(b, w)], b)


@pytest.mark.parametrize("way", ["a moment", "a torque in the field of none"])
def test_a_law_of_magnetorquers(way: str) -> None:
    text = loads(EARTH, magnet(*B_DOT))
    if way != "a moment":
        turning = (f"({B_DOT[i]})*b{b} - ({B_DOT[j]})*b{a}" for i, j, a, b in
                   ((1, 2, "y", "z"), (2, 0, "z", "x"), (0, 1, "x", "y")))  # fmt: skip
        text = loads(EARTH, magnet("0", "0", "0"), torque(*turning))
    run = run_text(config(BODY, START, text, "end = 950\nsamples = 3", more=K))
    matrix, rates = truth(950, b_dot)
    assert apart(run, matrix) <= 2e-12
    assert np.linalg.norm(rates) < 0.97 * np.linalg.norm([0.5, -0.6, 0.7])  # it brakes


# --- shadows ------------------------------------------------------------------------------------------------


def angles(t: float, radius: float) -> tuple[float, float, float]:
    """Angular radii of the Sun and the Earth, and the angle between them, 40 digits."""
    with mpmath.workdps(40):
        mp = mpmath.mpf
        near, far = _mp_place(t, ELEMENTS, mp("3.986004418e14")), _mp_place(t, SUN_ELEMENTS, mp("1.327e20"))
        sizes = [mpmath.sqrt(sum(x * x for x in v)) for v in (near, far)]
        c = mpmath.acos(sum(x * y for x, y in zip(near, far, strict=True)) / sizes[0] / sizes[1])
        a = mpmath.asin(mp(radius) / sizes[1]) if radius else mp(0)
        return a, mpmath.asin(mp(6378000) / sizes[0]), c


SUN_ELEMENTS = {"a": "149.6e9", "e": "0.0167", "i": "0", "node": "0", "w": "0", "M": "5"}


def _mp_place(t: float, of: dict[str, str], strength: Any) -> list[Any]:
    mp = mpmath.mpf
    a, e, i, node, w, mean = (mp(of[x]) for x in ("a", "e", "i", "node", "w", "M"))
    mean += mpmath.sqrt(strength / a**3) * mp(t)
    anomaly = mean
    for _ in range(8):
        anomaly -= (anomaly - e * mpmath.sin(anomaly) - mean) / (1 - e * mpmath.cos(anomaly))
    v = 2 * mpmath.atan(mpmath.sqrt((1 + e) / (1 - e)) * mpmath.tan(anomaly / 2))
    r, u = a * (1 - e * mpmath.cos(anomaly)), v + w
    return [
        r * (mpmath.cos(node) * mpmath.cos(u) - mpmath.sin(node) * mpmath.sin(u) * mpmath.cos(i)),
        r * (mpmath.sin(node) * mpmath.cos(u) + mpmath.cos(node) * mpmath.sin(u) * mpmath.cos(i)),
        r * mpmath.sin(u) * mpmath.sin(i),
    ]


def seen_share(t: float, radius: float = 695.7e6) -> float:
    """Share of the Sun's disc past the Earth's, by the chords of one within the other."""
    a, b, c = (float(x) for x in angles(t, radius))
    a_b_c = angles(t, radius)
    if a_b_c[2] >= a_b_c[0] + a_b_c[1]:
        return 1.0
    if a_b_c[2] <= a_b_c[1] - a_b_c[0]:
        return 0.0
    # the Earth's limb crosses the Sun's disc; chords perpendicular to the line of centres, x from the Sun's
    depth = float(a_b_c[0] + a_b_c[1] - a_b_c[2])  # of the lens, without cancellation
    cut = (c * c + a * a - b * b) / (2 * c)

    def under(r: float, sagitta: float) -> float:
        """Area of the segment of a disc of radius r of this height."""
        half = np.sqrt(max(sagitta, 0.0))
        return quad(lambda s: 4 * s * s * np.sqrt(2 * r - s * s), 0, half, epsabs=0, epsrel=1e-13)[0]

    mine = a - cut
    return 1 - (under(a, mine) + under(b, depth - mine)) / (np.pi * a * a)


def contacts(radius: float = 695.7e6) -> list[float]:
    """Times of the contacts of an eclipse, from first to fourth."""
    times = np.linspace(0, 5800, 60)

    def to(sign: int) -> Callable[[float], float]:
        def found(t: float) -> float:
            a, b, c = angles(t, radius)
            return float(b + sign * a - c)

        return found

    roots = []
    for sign in (1, -1) if radius else (1,):
        f = to(sign)
        values = [f(t) for t in times]
        roots += [
            brentq(f, s, t, xtol=1e-9, rtol=1e-15)
            for s, t, x, y in zip(times, times[1:], values, values[1:], strict=False)
            if x * y < 0
        ]
    return sorted(roots)


LIT = '[[states]]\nname = "lit"\ninitial = 0\nunit = "s"\nderivative = "shadow_sun"\n'


def shadowed(radius: str, more: str = "", end: float = 5800, samples: int = 30, **tables: str) -> str:
    text = loads(EARTH, SUN + radius)
    return config(BODY, START, text, f"end = {end}\nsamples = {samples}", more=LIT + more, **tables)


@pytest.mark.slow
def test_shadows_against_quadrature_and_root_finding() -> None:
    half = '[[events]]\nname = "half"\nexpression = "shadow_sun - 0.5"\n'
    data = loaded(run_text(shadowed('\nradius = "695700 km"', half)))
    first, second, third, fourth = contacts()
    penumbras = (first, second), (third, fourth)
    assert seen_share(0) == 1
    assert 5 < second - first < 60
    lit = [quad(seen_share, *ends, epsabs=1e-10)[0] for ends in penumbras]
    # on the way from one sample to the next outside of the penumbras, and across both
    true = [min(t, first) + sum(x for x, (_, end) in zip(lit, penumbras, strict=True) if t > end)
            + max(0.0, t - fourth) for t in data["time"].values]  # fmt: skip
    clear = [not any(begin < t < end for begin, end in penumbras) for t in data["time"].values]
    np.testing.assert_allclose(data["lit"].values[clear], np.array(true)[clear], rtol=0, atol=2e-10)
    crossings = [brentq(lambda t: seen_share(t) - 0.5, *ends, xtol=1e-9) for ends in penumbras]
    np.testing.assert_allclose(data["half_time"].values, crossings, rtol=0, atol=1e-9)


def test_the_shadow_on_a_point_jumps() -> None:
    begin, end = contacts(0)
    data = loaded(run_text(shadowed("")))
    times = data["time"].values
    true = np.minimum(times, begin) + np.maximum(times - end, 0)
    np.testing.assert_allclose(data["lit"].values, true, rtol=0, atol=1e-9)
    with pytest.raises(ConfigError, match=r'"shadow_sun" jumps.*give its source a radius'):
        run_text(shadowed("", '[[events]]\nname = "a"\nexpression = "shadow_sun - 0.5"\n'))


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (loads(EARTH, torque("ux_sun", "0", "0")), "ux_NAME, uy_NAME, uz_NAME, r_NAME with a load"),
        (loads(EARTH, torque("1e-9*bx", "0", "0")), "bx, by, bz with the field of a magnetic_dipole"),
        (loads(EARTH, torque("1e-9*altitude", "0", "0")), "altitude, vrx, vry, vrz in flight"),
        (loads(EARTH, torque("1e-9*shadow_earth", "0", "0")), "another one whose source has a radius"),
        (loads(EARTH, EARTH), 'two loads are named "earth"'),
        (EARTH.replace('"earth"', '"my earth"'), "letters, digits and underscores"),
        (loads(EARTH, magnet("2 N m", "0", "0")), "A m^2"),
    ],
)
def test_what_makes_no_sense_is_refused(given: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        run_text(config(BODY, START, given, "end = 1\nsamples = 2"))
    assert message in str(caught.value)
