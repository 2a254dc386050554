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


RADII = {
    "moon": 1738000, "mars": 3396000, "mars_konopliv": 3396000, "mercury": 2440000, "phobos": 11000,
    "vesta": 265000, "titan": 2575000, "ceres": 470000, "eros": 16000, "earth": "6378136.6",
    "earth_rigid": "6378136.6",
}  # fmt: skip
# preset, quantity, published value (text: to the last bit), relative tolerance
FACTS: list[tuple[str, str, Any, float]] = [
    ("moon", "beta", "0.0006310213", 0),  # DE430
    ("moon", "gamma", "0.0002277317", 0),
    ("moon", "mean", 0.392728, 1.3e-6),  # Williams et al. 2014
    ("moon", "J2", 203.3e-6, 4e-3),  # of the gravity field (Konopliv et al. 2013) but for the permanent tide
    ("moon", "C22", 22.43e-6, 4e-3),
    ("moon", "GM", 4902.80007e9, 1e-6),
    ("moon", "days", 27.3216616, 1.9e-8),  # sidereal month
    ("mars", "H", "0.00538017", 0),  # Baland et al. 2020
    ("mars", "C", "0.36367", 0),
    ("mars", "J2", 1.9566e-3, 1e-3),  # of the gravity field, normalised 8.7502e-4
    ("mars", "gamma", 6.94e-4, 1e-3),
    ("mars", "GM", 42828.3758e9, 2e-6),
    ("mars", "days", 24.6229 / 24, 4e-6),
    ("mercury", "C", "0.346", 0),  # Margot et al. 2012
    ("mercury", "J2", "5.0334e-5", 0),
    ("mercury", "C22", "0.8067e-5", 0),
    # of the shell: (B - A)/C_m = 2.18e-4 (4 %) from its libration, C_m = 0.431 C (6 %): Margot et al. 2012
    ("mercury", "gamma", 2.18e-4 * 0.431, 0.07),
    ("mercury", "days", 87.969 / 1.5, 1e-5),  # three turns in two years
    ("mercury", "GM", 22031.874e9, 5e-6),
    ("hyperion", "A/C", 0.59555, 9e-6),  # Wisdom, Peale & Mignard
    ("hyperion", "B/C", 0.85945, 9e-6),
    ("hyperion", "gamma", 0.264, 2e-3),
    ("phobos", "gamma", 0.1294, 8e-4),
    ("phobos", "J2", 0.105, 0.1),  # of an older model of the shape (Chao & Rubincam 1989)
    ("phobos", "days", 7.6538 / 24, 1.3e-5),  # an orbit
    ("vesta", "J2", 0.0317799 * math.sqrt(5), 1e-6),
    ("vesta", "GM", 17.28824e9, 2e-6),
    ("vesta", "days", 5.342 / 24, 2e-4),
    ("titan", "J2/C22", 3.186, 3e-4),  # 10/3 in equilibrium
    ("titan", "C", 0.341, 1e-12),
    ("titan", "days", 15.945421, 2e-6),  # an orbit in the planetary fact sheet
    ("ceres", "J2", 0.026499, 1e-12),
    ("ceres", "days", 9.074170 / 24, 1e-7),
    ("eros", "days", 5.27025547 / 24, 6e-7),
    ("bennu", "days", 4.296057 / 24, 5e-7),
    ("didymos", "days", 2.26 / 24, 5e-5),
    ("cubesat_3u", "GM", 4 * 6.67430e-11, 1e-15),
    ("cubesat_3u", "A/C", 2.28487490131579, 1e-12),  # of five boxes, by Steiner's theorem
    ("eros", "J2", 0.052478 * math.sqrt(5), 1e-3),
    ("eros", "C22", math.sqrt(5 / 12) * math.hypot(0.082538, 0.027745), 1e-3),
    ("eros", "GM", 2670 * 2503e9 * 6.67430e-11, 0.01),  # density and volume of Yeomans et al. 2000
    ("didymos", "GM", 4 * math.pi**2 * 1206**3 / (11.921473 * 3600) ** 2, 0.01),  # its moonlet's orbit
    ("earth", "H", "0.00327379492", 0),  # Mathews, Herring & Buffett 2002
    ("earth", "A/(C - A)", 304.456, 1e-6),
    ("earth", "C", 0.3307, 3e-4),  # Groten 2004
    ("earth_rigid", "H", "0.0032737548", 0),
    ("earth_rigid", "J2", 0.001082625305, 1e-15),
    ("earth_rigid", "C22", math.hypot(1.5745e-6, 9.0387e-7), 1e-12),
    ("mars_konopliv", "H", 0.00537997, 1e-15),
    ("mars_konopliv", "J2", 8.750220924537e-4 * math.sqrt(5), 1e-15),
    ("mars_konopliv", "C22", math.sqrt(5 / 12) * math.hypot(8.463302655983e-5, 4.893941832167e-5), 1e-12),
    ("mars_konopliv", "GM", 42828.3758157561e9, 1e-14),
]


def figure(name: str) -> dict[str, Any]:
    """Ratios of the moments and others that are published."""
    known = body(name)
    a, b, c = known.principal_moments
    mean = (a + b) / 2
    found = {"beta": (c - a) / b, "gamma": (b - a) / c, "H": (c - mean) / c, "A/C": a / c, "B/C": b / c}
    found |= {"A/(C - A)": a / (c - a), "GM": known.mass * exact("6.67430e-11")}
    if name in RADII:
        scale = known.mass * exact(str(RADII[name])) ** 2
        found |= {"C": c / scale, "mean": (a + b + c) / 3 / scale, "J2": (c - mean) / scale}
        found |= {"C22": (b - a) / (4 * scale), "J2/C22": 4 * (c - mean) / (b - a) if a != b else None}
    if len(PRESETS[name].rotation) == 3:
        found["days"] = 2 * math.pi / spin(name) / DAY
    return found


@pytest.mark.parametrize(("name", "what", "published", "near"), FACTS)
def test_a_preset_has_what_is_published(name: str, what: str, published: Any, near: float) -> None:
    value = figure(name)[what]
    assert float(value) == pytest.approx(published, rel=near) if near else close(value, published)


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
    greenwich = {1: (2.1931e-6, 2.681e-7), 2: (3.0905e-7, -2.1143e-7), 3: (1.0058e-7, 1.9722e-7)}
    for m, (cosine, sine) in greenwich.items():
        turned = complex(cosine, -sine) * np.exp(1j * m * math.radians(-14.929376301576161))
        assert float(earth.gravity.coefficients[3, m, False]) == pytest.approx(turned.real, rel=1e-12)
        assert float(earth.gravity.coefficients[3, m, True]) == pytest.approx(-turned.imag, rel=1e-12)


def test_mars_of_konopliv_has_the_gravity_field_of_its_source_and_the_published_precession() -> None:
    mars = body("mars_konopliv")
    assert abs(figure("mars_konopliv")["H"] - 0.00538017) < 148e-8  # Baland et al. 2020
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
