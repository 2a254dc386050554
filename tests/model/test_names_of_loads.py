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
from support import config, loaded, run_text

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


def cross(a: Any, b: Any) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def true_matrix(end: float, law: Callable[..., Any], more: tuple[Any, ...] = ()) -> tuple[Any, Any]:
    """Rotation matrix and angular velocity at the end, in 80 bits.

    Args:
        law: torque on the body (body axes) for rates, what turns space into body axes, and time; with
            derivatives of further states, if there are ``more``.
        more: their initial values.
    """
    fp = np.longdouble
    moments = [fp(x) for x in ("0.03", "0.034", "0.01")]
    h = hy.make_vars("hx", "hy", "hz")
    r = [hy.make_vars(*(f"r{i}{j}" for j in range(3))) for i in range(3)]
    others = [hy.make_vars(f"s{n}") for n in range(len(more))]

    def seen(vector: Any) -> list[Any]:
        return [dot([r[i][j] for i in range(3)], vector) for j in range(3)]

    w = [x / i for x, i in zip(seen(h), moments, strict=True)]
    own, changes = law(w, seen, hy.time, others)
    own = [own[j] + 3 * MU * g for j, g in enumerate(_gradient(seen, moments))]
    equations = [(h[i], dot(r[i], own)) for i in range(3)]
    for i in range(3):  # R' = R [w]x
        turned = cross(r[i], w)
        equations += [(r[i][j], turned[j]) for j in range(3)]
    equations += zip(others, changes, strict=True)
    q = np.array([fp(x) for x in ("1", "0.2", "0.1", "-0.3")])
    q /= np.sqrt((q * q).sum())
    c, x, y, z = q
    start = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - c * z), 2 * (x * z + c * y)],
        [2 * (x * y + c * z), 1 - 2 * (x * x + z * z), 2 * (y * z - c * x)],
        [2 * (x * z - c * y), 2 * (y * z + c * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    momentum = start @ (np.array(moments) * np.array([fp("0.5"), fp("-0.6"), fp("0.7")]))
    state = [*momentum, *start.ravel(), *map(fp, more)]
    engine = hy.taylor_adaptive(equations, state, fp_type=fp, compact_mode=True)
    engine.propagate_until(fp(end))
    found = engine.state[3:12].reshape(3, 3)
    return found, (found.T @ engine.state[:3]) / np.array(moments)


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
    dataset = run.dataset
    q = dataset["quaternion"].values[-1].astype(np.longdouble)
    if "quaternion_lo" in dataset:
        q = q + dataset["quaternion_lo"].values[-1]
    q /= np.sqrt((q * q).sum())
    c, x, y, z = q
    ours = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - c * z), 2 * (x * z + c * y)],
        [2 * (x * y + c * z), 1 - 2 * (x * x + z * z), 2 * (y * z - c * x)],
        [2 * (x * z - c * y), 2 * (y * z + c * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return float(np.sqrt(((ours - matrix) ** 2).sum() / 2))


# --- directions and distances -------------------------------------------------------------------------------

TOWARDS = torque("-2e-6*uz_earth", "1e-6*ux_earth*(r_earth/(7e6 m))^2", "2e-6*uy_earth")


def towards_earth(w: Any, seen: Any, time: Any, _: Any) -> Any:
    source = place(time)
    far = hy.sqrt(dot(source, source))
    u, fp = seen([x / far for x in source]), np.longdouble
    ratio = far / 7e6
    return [-fp("2e-6") * u[2], fp("1e-6") * u[0] * ratio * ratio, fp("2e-6") * u[1]], []


@pytest.mark.parametrize(
    ("precision", "bound"), [("double", 2e-12), pytest.param("extended", 2e-15, marks=pytest.mark.slow)]
)
def test_directions_and_distances(precision: str, bound: float) -> None:
    """1000 rad of the body, within what rounding makes of it (the truth itself has 80 bits)."""
    given = config(BODY, START, loads(EARTH, TOWARDS), "end = 950\nsamples = 3", f'precision = "{precision}"')
    truth, _ = true_matrix(950, towards_earth)
    assert apart(run_text(given), truth) <= bound


@pytest.mark.parametrize("formulation", ["rotation_matrix", "euler_angles"])
def test_every_formulation_has_them(formulation: str) -> None:
    given = config(
        BODY, START, loads(EARTH, TOWARDS), "end = 60\nsamples = 3", f'formulation = "{formulation}"'
    )
    truth, _ = true_matrix(60, towards_earth)
    assert apart(run_text(given), truth) <= 2e-13


# --- the magnetic field -------------------------------------------------------------------------------------

B_DOT = ", ".join(
    f'"-k*({a} - {b})"' for a, b in (("wz*by", "wy*bz"), ("wx*bz", "wz*bx"), ("wy*bx", "wx*by"))
)
MAGNET = f"""kind = "magnetic_dipole"
moment = MOMENT
source_moment = [1e22, -2e22, -7.7e22]
{ORBIT}"""
K = '[parameters]\nk = "500 A m^2 s/T"'


def b_dot(w: Any, seen: Any, time: Any, _: Any) -> Any:
    """A moment against db/dt = b x w of a field at rest."""
    b = seen(field(time))
    return cross([-np.longdouble(500) * x for x in cross(b, w)], b), []


@pytest.mark.parametrize(
    ("precision", "bound"), [("double", 2e-12), pytest.param("extended", 2e-15, marks=pytest.mark.slow)]
)
def test_a_law_of_magnetorquers(precision: str, bound: float) -> None:
    text = loads(EARTH, MAGNET.replace("MOMENT", f"[{B_DOT}]"))
    given = config(BODY, START, text, "end = 950\nsamples = 3", f'precision = "{precision}"', more=K)
    truth, rates = true_matrix(950, b_dot)
    run = run_text(given)
    assert apart(run, truth) <= bound
    assert np.linalg.norm(rates) < 0.97 * np.linalg.norm([0.5, -0.6, 0.7])  # it brakes


@pytest.mark.slow
def test_a_field_alone_and_a_filter_of_its_measurement() -> None:
    """A moment of zero gives the field; the law takes the change of a filtered measurement."""
    filters = "".join(
        f'[[states]]\nname = "f{i}"\ninitial = 0\nunit = "T"\nderivative = "(b{i} - f{i})/(5 s)"\n'
        for i in "xyz"
    )
    change = [f"(b{i} - f{i})/(5 s)" for i in "xyz"]
    law = torque(
        *(f"-k*({change[j]}*b{'xyz'[n]} - {change[n]}*b{'xyz'[j]})" for j, n in ((1, 2), (2, 0), (0, 1)))
    )
    text = loads(EARTH, MAGNET.replace("MOMENT", "[0, 0, 0]"), law)
    run = run_text(config(BODY, START, text, "end = 300\nsamples = 3", more=K + "\n" + filters))

    def truth(w: Any, seen: Any, time: Any, f: Any) -> Any:
        b = seen(field(time))
        slopes = [(x - y) / 5.0 for x, y in zip(b, f, strict=True)]
        return cross([-np.longdouble(500) * x for x in slopes], b), slopes

    assert apart(run, true_matrix(300, truth, (0, 0, 0))[0]) <= 1e-12
    # its orbit is integrated where something reads the field alone, and only there
    field_alone = MAGNET.replace("MOMENT", "[0, 0, 0]")
    least = rigidsim.plan(rigidsim.parse(config(BODY, START, field_alone))).as_dict()
    assert "cos_anomaly" not in str(least["reasons"])
    reading = rigidsim.plan(
        rigidsim.parse(config(BODY, START, loads(field_alone, torque("1e-3*bx", "0", "0"))))
    )
    assert "cos_anomaly" in str(reading.as_dict()["reasons"])


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


# --- in flight ----------------------------------------------------------------------------------------------

AIR = """kind = "force"
frame = "body"
components = ["-D*vrx", "-D*vry", "-D*vrz"]""".replace("D", "0.004*exp(-altitude/(60 km))")
CENTRE = """kind = "central_gravity"
radius = "6378 km"
gravitational_parameter = 3.986004418e14
atmosphere_rate = [1e-5, 0, "7.3e-5 rad/s"]"""
BALL = "principal_moments = [1, 1, 1]\nmass = 4"
FLIGHT = f"{START}\nposition = [6.9e6, 0, 1e5]\nvelocity = [10, 5000, 5600]"


def test_altitude_and_the_velocity_relative_to_the_air() -> None:
    """A ball in air, whose attitude drops out of its path."""
    fp = np.longdouble
    place, moving = hy.make_vars("x", "y", "z"), hy.make_vars("u", "v", "w")
    far = hy.sqrt(dot(place, place))
    wind = cross([fp("1e-5"), fp(0), fp("7.3e-5")], place)
    density = fp("0.004") * hy.exp(-(far - fp(6378000)) / fp(60000)) / fp(4)
    pull = fp(MU) / far**3.0
    equations = list(zip(place, moving, strict=True)) + [
        (v, -pull * x - density * (v - u)) for x, v, u in zip(place, moving, wind, strict=True)
    ]
    start = np.array([6.9e6, 0, 1e5, 10, 5000, 5600], dtype=fp)
    engine = hy.taylor_adaptive(equations, start, fp_type=fp, compact_mode=True)
    engine.propagate_until(fp(6000))
    text = config(BALL, FLIGHT, loads(CENTRE, AIR), "end = 6000\nsamples = 3", 'precision = "extended"')
    exact = run_text(text).dataset
    found = exact["position"].values[-1].astype(fp) + exact["position_lo"].values[-1]
    still = run_text(text.replace("0.004", "0.000")).dataset["position"].values[-1]
    assert np.linalg.norm(still - found) > 100  # the air matters
    assert (
        np.abs(found - engine.state[:3]).max() <= 2e-8 * 7
    )  # 3e-15 of the path of 45,000 km, seven times over


# --- what every expression has ------------------------------------------------------------------------------


@pytest.mark.slow
def test_members_of_a_batch_are_the_runs_they_stand_for(tmp_path: Any) -> None:
    law = torque("k*ux_earth*shadow_sun", "1e-6*r_earth/(7e6 m)", "0")
    disc = SUN + '\nradius = "695700 km"'
    more = '[parameters]\nk = "1e-6 N m"\n'
    text = config(BODY, START, loads(EARTH, disc, law), "end = 400\nsamples = 5", more=more)
    axis = '[sweep]\naxes."loads[0].orbit.semi_major_axis" = {values = [7e6, 7.1e6, 7.2e6]}\n'
    sweep = rigidsim.sweep(rigidsim.parse(text + axis), out=tmp_path)
    final = sweep.dataset["quaternion_final"].values
    for number, size in enumerate((7e6, 7.1e6, 7.2e6)):
        alone = run_text(text, f"loads[0].orbit.semi_major_axis={size}").dataset["quaternion"].values[-1]
        assert abs(abs(final[number] @ alone) - 1) <= 1e-13


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (loads(EARTH, torque("ux_sun", "0", "0")), "ux_NAME, uy_NAME, uz_NAME, r_NAME with a load"),
        (loads(EARTH, torque("1e-9*bx", "0", "0")), "bx, by, bz with the field of a magnetic_dipole"),
        (loads(EARTH, torque("1e-9*altitude", "0", "0")), "altitude, vrx, vry, vrz in flight"),
        (loads(EARTH, torque("1e-9*shadow_earth", "0", "0")), "another one whose source has a radius"),
        (loads(EARTH, torque("2 N m*r_earth", "0", "0")), "N m"),
        (loads(EARTH, EARTH), 'two loads are named "earth"'),
        (EARTH.replace('"earth"', '"my earth"'), "letters, digits and underscores"),
        (EARTH.replace("6378 km", "-1 km"), "a positive length is allowed"),
        (loads(EARTH, MAGNET.replace("MOMENT", '["2 N m", 0, 0]')), "A m^2"),
        (loads(EARTH, MAGNET.replace("MOMENT", '["bq", 0, 0]')), 'moment[0]: column 1: unknown name "bq"'),
        (loads(EARTH, MAGNET.replace("MOMENT", "[true, 0, 0]")), "moment[0]"),
    ],
)
def test_what_makes_no_sense_is_refused(given: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        run_text(config(BODY, START, given, "end = 1\nsamples = 2"))
    assert message in str(caught.value)


def test_plan_says_which_names_take_which_states() -> None:
    """And where they are read; a direction takes the attitude, a distance doesn't."""
    reading = torque("1e-6*ux_sun", "1e-9*r_sun/(1 m)", "1e-6*uz_sun*wx/(1 s^-1)")
    given = config(
        BODY, START, loads(SUN, reading), output='record = ["angular_velocity"]',
        more='[[events]]\nname = "up"\nexpression = "uy_sun"',
    )  # fmt: skip
    why = {row["states"]: row["why"] for row in rigidsim.plan(rigidsim.parse(given)).as_dict()["reasons"]}
    assert "(ux_sun, uz_sun in [[loads]] number 2; uy_sun in [[events]] number 1)" in why["qw qx qy qz"]
