"""Published bodies, held against published facts that they were not made from, where there are any."""

import math
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from support import config

from experiments.bare import blocks
from experiments.closed_forms import free_top
from experiments.spectral_lines import MOMENTS, PUBLISHED, RATES
from rigidsim import parse
from rigidsim.errors import ConfigError
from rigidsim.scene.bodies.presets import FOLDER, PRESETS
from rigidsim.scene.exact import parse_number
from rigidsim.scene.scene import build_scene

CONTEXT = mpmath.MPContext()
CONTEXT.prec = 200
LAST = CONTEXT.mpf(2) ** -180  # of 200 bits; differences of moments lose up to 14
SUN = 1.32712440018e20  # G M, m^3/s^2
DAY, YEAR, ARCSEC = 86400, 365.25 * 86400, math.pi / 648000


def body_of(table: str) -> Any:
    text = f'name = "b"\n[body]\n{table}\n[initial]\nangular_velocity = [0, 0, 0]\n[time]\nend = 1\n'
    return build_scene(parse(f"{text}[integrator]\nprecision = 50\n")).body


def body(name: str) -> Any:
    return body_of(f'preset = "{name}"')


def exact(text: str) -> Any:
    value = Fraction(text)
    return CONTEXT.mpf(value.numerator) / value.denominator


def close(value: Any, text: str) -> bool:
    """Equal to the published decimals, to the last bits of the context."""
    return bool(abs(value / exact(text) - 1) <= LAST)


def spin(name: str) -> float:
    return float(parse_number(PRESETS[name].rotation[2], "rad/s"))  # type: ignore[misc]


@pytest.mark.parametrize("name", PRESETS)
def test_each_preset_has_remarks_and_a_source(name: str) -> None:
    remarks = FOLDER.joinpath(f"{name}.toml").read_text().partition("\n\n")[0]
    assert all(line.startswith("# ") for line in remarks.splitlines())
    resolved = body(name)
    if not PRESETS[name].tensor:
        assert max(resolved.principal_moments) == max(resolved.inertia[i][i] for i in range(3))
    assert resolved.source.startswith(f"preset {name} (")


def test_the_moon_librates_as_published() -> None:
    """beta, gamma (DE430); J2, C22 of the gravity field (Konopliv et al. 2013) but for the permanent tide."""
    moon = body("moon")
    a, b, c = moon.principal_moments
    assert close((c - a) / b, "0.0006310213")
    assert close((b - a) / c, "0.0002277317")
    scale = moon.mass * 1738000**2
    assert abs((a + b + c) / 3 / scale - exact("0.392728")) < 5e-7  # Williams et al. 2014
    assert float((c - (a + b) / 2) / scale) == pytest.approx(203.3e-6, rel=4e-3)
    assert float((b - a) / (4 * scale)) == pytest.approx(22.43e-6, rel=4e-3)
    assert float(moon.mass) * 6.67430e-11 == pytest.approx(4902.80007e9, rel=1e-6)
    assert 2 * math.pi / spin("moon") / DAY == pytest.approx(27.3216616, abs=5e-7)  # sidereal month


def test_mars_precesses_under_the_sun_as_published() -> None:
    """7608.3 mas/yr measured (Konopliv et al. 2016), and 6.7 of geodetic precession the other way."""
    mars = body("mars")
    a, b, c = mars.principal_moments
    flattening = (c - (a + b) / 2) / c
    assert close(flattening, "0.00538017")  # Baland et al. 2020
    assert close(c / (mars.mass * 3396000**2), "0.36367")
    eccentricity, axis = 0.0934, 1.52371 * 149597870700
    rate = 1.5 * SUN / axis**3 / spin("mars") * float(flattening) * math.cos(math.radians(25.1893))
    rate *= (1 - eccentricity**2) ** -1.5
    assert rate * YEAR / ARCSEC == pytest.approx(7.6083 + 0.0067, rel=1e-3)  # other torques, a year's digits
    j2 = float((c - (a + b) / 2) / (mars.mass * 3396000**2))
    assert j2 == pytest.approx(1.9566e-3, rel=1e-3)  # of the gravity field, normalised 8.7502e-4
    assert float((b - a) / c) == pytest.approx(6.94e-4, rel=1e-3)
    assert float(mars.mass) * 6.67430e-11 == pytest.approx(42828.3758e9, rel=2e-6)
    assert 2 * math.pi / spin("mars") / 3600 == pytest.approx(24.6229, abs=1e-4)  # sidereal day


def test_mercury_turns_three_times_in_two_years_and_librates_as_its_shell_says() -> None:
    mercury = body("mercury")
    a, b, c = mercury.principal_moments
    assert close(c / (mercury.mass * 2440000**2), "0.346")  # Margot et al. 2012
    assert close((c - (a + b) / 2) / (mercury.mass * 2440000**2), "5.0334e-5")
    assert close((b - a) / (4 * mercury.mass * 2440000**2), "0.8067e-5")
    # of the shell: (B - A)/C_m = 2.18e-4 (4 %) from its libration, C_m = 0.431 C (6 %): Margot et al. 2012
    assert float((b - a) / c) == pytest.approx(2.18e-4 * 0.431, rel=0.07)
    assert spin("mercury") * 87.969 * DAY / (2 * math.pi) == pytest.approx(1.5, rel=1e-5)
    assert float(mercury.mass) * 6.67430e-11 == pytest.approx(22031.874e9, rel=5e-6)


def test_hyperion_is_the_ellipsoid_of_wisdom_peale_and_mignard() -> None:
    hyperion = body("hyperion")
    a, b, c = hyperion.principal_moments
    assert float(a / c) == pytest.approx(0.59555, abs=5e-6)
    assert float(b / c) == pytest.approx(0.85945, abs=7e-6)
    assert (b - a) / c == pytest.approx(0.264, abs=5e-4)  # as the paper gives it
    ellipsoid = body_of('shape = "ellipsoid"\nmass = 5.551e18\nsemi_axes = [190e3, 145e3, 114e3]')
    for ours, theirs in zip(hyperion.principal_moments, ellipsoid.principal_moments, strict=True):
        assert float(ours / theirs) == pytest.approx(1, abs=1e-5)  # five digits are given
    assert PRESETS["hyperion"].rotation == ()


def test_phobos_is_as_flat_as_a_homogeneous_body_of_its_shape() -> None:
    """J2 = 0.105 of an older model of the shape (Chao & Rubincam 1989), R = 11 km; an orbit in 7.65 h."""
    phobos = body("phobos")
    a, b, c = phobos.principal_moments
    assert float((b - a) / c) == pytest.approx(0.1294, abs=1e-4)
    assert float((c - (a + b) / 2) / (phobos.mass * 11000**2)) == pytest.approx(0.105, rel=0.1)
    assert 2 * math.pi / spin("phobos") / 3600 == pytest.approx(7.6538, abs=1e-4)


def test_vesta_has_its_j2_and_turns_in_five_hours() -> None:
    vesta = body("vesta")
    a, b, c = vesta.principal_moments
    assert a == b
    assert float((c - a) / (vesta.mass * 265000**2)) == pytest.approx(0.0317799 * math.sqrt(5), rel=1e-6)
    assert float(vesta.mass) * 6.67430e-11 == pytest.approx(17.28824e9, rel=2e-6)
    assert 2 * math.pi / spin("vesta") / 3600 == pytest.approx(5.342, abs=1e-3)


def test_toutatis_has_both_periods() -> None:
    toutatis = body("toutatis")
    x, y, z = toutatis.principal_moments
    assert close(x / z, "3.09")
    assert close(y / z, "3.22")
    assert [exact(m) for m in MOMENTS] == [exact("3.09"), exact("3.22"), 1]
    assert [rate.split()[0] for rate in PRESETS["toutatis"].rotation] == RATES
    rates = [float(parse_number(rate, "rad/s")) for rate in PRESETS["toutatis"].rotation]
    top = free_top([float(m) for m in toutatis.principal_moments], rates)
    assert float(top.period) / DAY == pytest.approx(PUBLISHED["wobble"], rel=0.01)
    assert float(2 * mpmath.pi / top.precession) / DAY == pytest.approx(PUBLISHED["precession"], rel=0.01)


def test_apophis_has_both_periods_and_the_published_energy() -> None:
    """Pravec et al. 2014: 27.38 h, 263 h, energy 1.024(13) of the least that its momentum allows."""
    apophis = body("apophis")
    i1, i2, i3 = (float(m) for m in apophis.principal_moments)
    assert i1 / i3 == pytest.approx(0.61)
    assert i2 / i3 == pytest.approx(0.965)
    w1, w3 = 0.0639465 / 3600, 0.1990845 / 3600
    top = free_top([i1, i2, i3], [w1, 0.0, w3])
    assert float(2 * mpmath.pi / abs(top.precession)) / 3600 == pytest.approx(27.38, abs=1e-3)
    assert float(top.period) / 3600 == pytest.approx(263, abs=0.01)
    momentum, energy = math.hypot(i1 * w1, i3 * w3), (i1 * w1**2 + i3 * w3**2) / 2
    assert energy / (momentum**2 / (2 * i3)) == pytest.approx(1.024, abs=0.001)


def test_venus_moves_its_pole_in_525_centuries_and_precesses_as_published() -> None:
    """Cottereau, Souchay & Aljbaae 2010: 525 cy, and 28965.10 years of precession with C/(M R^2) = 0.336."""
    a, b, c = (float(m) for m in body("venus").principal_moments)
    wobble = math.sqrt((c - a) * (c - b) / (a * b)) * abs(spin("venus"))
    assert 2 * math.pi / wobble / YEAR / 100 == pytest.approx(525, rel=5e-3)
    assert 2 * math.pi / abs(spin("venus")) / DAY == pytest.approx(243.0226, rel=3e-6)
    flattening, axis = (c - (a + b) / 2) / c, 0.72333 * 149597870700
    tilt = math.cos(math.radians(2.6392))
    rate = 1.5 * SUN / axis**3 / abs(spin("venus")) * flattening * tilt * YEAR / ARCSEC
    assert rate == pytest.approx(1296000 / 28965.10 * 0.336 / 0.337, rel=3e-3)
    assert rate == pytest.approx(44.58, abs=3.3)  # Margot et al. 2021


def test_titan_is_nearly_in_hydrostatic_equilibrium_and_turns_once_in_an_orbit() -> None:
    titan = body("titan")
    a, b, c = titan.principal_moments
    scale = titan.mass * 2575000**2
    j2, c22 = float((c - (a + b) / 2) / scale), float((b - a) / (4 * scale))
    assert j2 / c22 == pytest.approx(3.186, abs=1e-3)  # 10/3 in equilibrium
    assert float(c / scale) == pytest.approx(0.341, rel=1e-12)
    # an orbit takes 15.945421 days in the planetary fact sheet; IAU's rate of rotation gives 15.945448
    assert 2 * math.pi / spin("titan") / DAY == pytest.approx(15.945421, abs=3e-5)


def test_ceres_and_small_bodies_turn_in_their_published_hours() -> None:
    ceres = body("ceres")
    a, _, c = ceres.principal_moments
    assert float((c - a) / (ceres.mass * 470000**2)) == pytest.approx(0.026499, rel=1e-12)
    hours = {
        "ceres": (9.074170, 1e-6),
        "eros": (5.27025547, 3e-6),
        "bennu": (4.296057, 2e-6),
        "didymos": (2.26, 1e-4),
    }
    for name, (period, uncertain) in hours.items():
        assert 2 * math.pi / spin(name) / 3600 == pytest.approx(period, abs=uncertain)


def test_eros_has_its_gravity_field() -> None:
    eros = body("eros")
    a, b, c = eros.principal_moments
    scale = eros.mass * 16000**2
    assert float((c - (a + b) / 2) / scale) == pytest.approx(0.052478 * math.sqrt(5), rel=1e-3)
    half = math.sqrt(5 / 12) * math.hypot(0.082538, 0.027745)
    assert float((b - a) / (4 * scale)) == pytest.approx(half, rel=1e-3)
    volume = 2503e9  # m^3, of the shape in the same publication
    assert float(eros.mass) / volume == pytest.approx(2670, rel=0.01)  # kg/m^3, Yeomans et al. 2000


def test_didymos_weighs_what_its_moonlet_orbits() -> None:
    mass = 4 * math.pi**2 * 1206**3 / (6.67430e-11 * (11.921473 * 3600) ** 2)
    assert float(body("didymos").mass) == pytest.approx(mass, rel=0.01)


def test_the_space_station_is_the_published_tensor() -> None:
    slug_foot_squared = exact("0.45359237") * exact("9.80665") * exact("0.3048")  # kg m^2
    published = (
        ("2.80701911616e7", "4.822509936e5", "-1.71675094448e7"),
        ("4.822509936e5", "9.5144639344e7", "6.02604448e4"),
        ("-1.71675094448e7", "6.02604448e4", "7.6594401336e7"),
    )
    station = body("space_station")
    for row, expected in zip(station.inertia, published, strict=True):
        for x, text in zip(row, expected, strict=True):
            assert float(x / (slug_foot_squared * exact(text))) == pytest.approx(1, abs=1e-11)
    assert station.mass is None
    assert float(body_of('preset = "space_station"\nmass = 4e5').principal_moments[0]) == float(
        station.principal_moments[0]
    )


def test_a_cubesat_is_the_sum_of_its_parts() -> None:
    """Point masses on a fine grid in each of five boxes."""
    boxes = [(3.6, (0.1, 0.1, 0.3405), (0.0, 0.0, 0.0))]
    for x, y in ((0.2, 0), (-0.2, 0), (0, 0.2), (0, -0.2)):
        boxes.append((0.1, (0.3, 0.1, 0.002) if x else (0.1, 0.3, 0.002), (x, y, -0.17025)))
    nodes, weights = np.polynomial.legendre.leggauss(2)  # exact for squares
    points = []
    for mass, size, centre in boxes:
        for i, j, k in np.ndindex(2, 2, 2):
            place = [c + s / 2 * nodes[n] for c, s, n in zip(centre, size, (i, j, k), strict=True)]
            points.append((mass * weights[i] * weights[j] * weights[k] / 8, np.array(place)))
    total = sum(m for m, _ in points)
    centre = sum(m * r for m, r in points) / total
    tensor = sum(
        m * ((r - centre) @ (r - centre) * np.eye(3) - np.outer(r - centre, r - centre)) for m, r in points
    )
    found = body("cubesat_3u")
    assert float(found.mass) == pytest.approx(total, rel=1e-15)
    assert np.diag(tensor) == pytest.approx([float(m) for m in found.principal_moments], rel=1e-13)
    assert len(found.drawing) == 5


def test_a_whole_presets_keys_are_overridden_one_by_one() -> None:
    def field(more: str = "") -> Any:
        return body_of(f'preset = "earth_rigid"\n{more}').gravity

    whole = field()
    assert float(whole.coefficients[3, 0, False]) == 2.532474e-6
    one = field('gravity_field = {C = {"3,0" = 1e-6}}')
    assert float(one.coefficients[3, 0, False]) == 1e-6
    assert one.coefficients[3, 1, False] == whole.coefficients[3, 1, False]
    other = field('gravity_field = {radius = "6000 km", C = {"4,0" = 1e-6}}')
    assert set(other.coefficients) == {(4, 0, False)}
    with pytest.raises(ConfigError, match="gravity_field"):
        field("gravity_field = 3")


def test_the_rigid_earth_is_flattened_and_triaxial_as_published() -> None:
    earth = body("earth_rigid")
    a, b, c = earth.principal_moments
    assert close((c - (a + b) / 2) / c, "0.0032737548")
    scale = earth.mass * exact("6378136.6") ** 2
    assert float((c - (a + b) / 2) / scale) == pytest.approx(0.001082625305, rel=1e-15)
    half = math.hypot(1.5745e-6, 9.0387e-7)
    assert float((b - a) / (4 * scale)) == pytest.approx(half, rel=1e-12)
    greenwich = {1: (2.1931e-6, 2.681e-7), 2: (3.0905e-7, -2.1143e-7), 3: (1.0058e-7, 1.9722e-7)}
    for m, (cosine, sine) in greenwich.items():
        turned = complex(cosine, -sine) * np.exp(1j * m * math.radians(-14.929376301576161))
        assert float(earth.gravity.coefficients[3, m, False]) == pytest.approx(turned.real, rel=1e-12)
        assert float(earth.gravity.coefficients[3, m, True]) == pytest.approx(-turned.imag, rel=1e-12)


def test_mars_of_konopliv_has_the_gravity_field_of_its_source_and_the_published_precession() -> None:
    mars = body("mars_konopliv")
    a, b, c = mars.principal_moments
    scale = mars.mass * 3396000**2
    assert float((c - (a + b) / 2) / scale) == pytest.approx(8.750220924537e-4 * math.sqrt(5), rel=1e-15)
    half = math.sqrt(5 / 12) * math.hypot(8.463302655983e-5, 4.893941832167e-5)
    assert float((b - a) / (4 * scale)) == pytest.approx(half, rel=1e-12)
    assert float(mars.mass) * 6.67430e-11 == pytest.approx(42828.3758157561e9, rel=1e-14)
    flattening = float((c - (a + b) / 2) / c)
    assert flattening == pytest.approx(0.00537997, rel=1e-15)
    assert abs(flattening - 0.00538017) < 148e-8  # Baland et al. 2020
    normalised = {
        0: (-1.18970150373e-05, 0.0),
        1: (3.804998199101e-06, 2.517711770763e-05),
        2: (-1.594743192372e-05, 8.362393978467e-06),
        3: (3.505629836033e-05, 2.557132545737e-05),
    }
    east = math.atan2(4.893941832167e-5, -8.463302655983e-5) / 2
    for m, (cosine, sine) in normalised.items():
        norm = math.sqrt((2 - (m == 0)) * 7 * math.factorial(3 - m) / math.factorial(3 + m))
        turned = norm * complex(cosine, -sine) * np.exp(1j * m * east)
        assert float(mars.gravity.coefficients[3, m, False]) == pytest.approx(turned.real, rel=1e-12)
        if m:
            assert float(mars.gravity.coefficients[3, m, True]) == pytest.approx(-turned.imag, rel=1e-11)


def test_the_moon_of_de421_has_the_packages_constants() -> None:
    constants = blocks.Kernel(pytest.importorskip("de421").__name__).constants
    moon = body("moon_de421")
    a, b, c = moon.principal_moments
    scale = moon.mass * 1738000**2
    assert float((c - a) / b) == pytest.approx(constants["LBET"], rel=1e-15)
    assert float((b - a) / c) == pytest.approx(constants["LGAM"], rel=1e-15)
    assert float((c - (a + b) / 2) / scale) == pytest.approx(constants["J2M"], rel=1e-14)
    cube = constants["AU"] ** 3 * 1e9 / 86400**2
    strength = constants["GMB"] * cube / (1 + constants["EMRAT"])
    assert float(moon.mass) * 6.67430e-11 == pytest.approx(strength, rel=1e-14)
    for (n, m, sine), value in moon.gravity.coefficients.items():
        name = f"{'S' if sine else 'C'}{n}{m}M" if m else f"J{n}M"
        assert float(value) == (constants[name] if m else -constants[name])
    assert len(moon.gravity.coefficients) == 16
    tables = PRESETS["moon_de421"].tables
    assert float(tables["elasticity"]["love_number"]) == constants["K2M"]
    assert float(tables["elasticity"]["delay"].split()[0]) == constants["TAUM"]
    named = {"moment": "IFAC", "flattening": "COBLAT", "friction": "KVC"}
    assert {key: float(tables["core"][key].split()[0]) for key in named} == {
        key: constants[name] for key, name in named.items()
    }


def test_a_preset_takes_another_dynamical_ellipticity() -> None:
    scene = build_scene(parse(config('preset = "earth"\ndynamical_ellipticity = "0.0032672658"')))
    a, b, c = scene.body.principal_moments
    assert a == b
    assert abs((c - a) / c - scene.context.mpf("0.0032672658")) < 1e-40
    with pytest.raises(ConfigError, match="it replaces smaller moments of a preset"):
        build_scene(parse(config("principal_moments = [1, 2, 2.5]\ndynamical_ellipticity = 0.1")))
