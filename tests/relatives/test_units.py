"""Units have one meaning, with scipy's value; other dimensions, and angles for numbers, are refused."""

import math
import random
from typing import Any

import pytest
from scipy import constants as c
from support import seeds

import rigidsim
from rigidsim.errors import ConfigError

# value in SI, exponents of (length, mass, time, current), power of an angle
UNITS = {
    "m": (1.0, (1, 0, 0, 0), 0), "km": (1e3, (1, 0, 0, 0), 0), "mm": (1e-3, (1, 0, 0, 0), 0),
    "au": (c.astronomical_unit, (1, 0, 0, 0), 0), "angstrom": (c.angstrom, (1, 0, 0, 0), 0),
    "in": (c.inch, (1, 0, 0, 0), 0), "ft": (c.foot, (1, 0, 0, 0), 0), "mi": (c.mile, (1, 0, 0, 0), 0),
    "nmi": (c.nautical_mile, (1, 0, 0, 0), 0), "kg": (1.0, (0, 1, 0, 0), 0), "g": (1e-3, (0, 1, 0, 0), 0),
    "mg": (1e-6, (0, 1, 0, 0), 0), "t": (1e3, (0, 1, 0, 0), 0), "lb": (c.pound, (0, 1, 0, 0), 0),
    "slug": (c.slug, (0, 1, 0, 0), 0), "s": (1.0, (0, 0, 1, 0), 0), "ms": (1e-3, (0, 0, 1, 0), 0),
    "min": (c.minute, (0, 0, 1, 0), 0), "hour": (c.hour, (0, 0, 1, 0), 0), "day": (c.day, (0, 0, 1, 0), 0),
    "kyr": (1e3 * c.Julian_year, (0, 0, 1, 0), 0), "Myr": (1e6 * c.Julian_year, (0, 0, 1, 0), 0),
    "A": (1.0, (0, 0, 0, 1), 0), "mA": (1e-3, (0, 0, 0, 1), 0), "N": (1.0, (1, 1, -2, 0), 0),
    "mN": (1e-3, (1, 1, -2, 0), 0), "lbf": (c.pound_force, (1, 1, -2, 0), 0), "J": (1.0, (2, 1, -2, 0), 0),
    "kW": (1e3, (2, 1, -3, 0), 0), "Pa": (1.0, (-1, 1, -2, 0), 0), "hPa": (1e2, (-1, 1, -2, 0), 0),
    "psi": (c.psi, (-1, 1, -2, 0), 0), "atm": (c.atm, (-1, 1, -2, 0), 0), "mbar": (1e2, (-1, 1, -2, 0), 0),
    "nT": (1e-9, (0, 1, -2, -1), 0), "gauss": (1e-4, (0, 1, -2, -1), 0), "V": (1.0, (2, 1, -3, -1), 0),
    "ohm": (1.0, (2, 1, -3, -2), 0), "S": (1.0, (-2, -1, 3, 2), 0), "g0": (c.g, (1, 0, -2, 0), 0),
    "rad": (1.0, (0, 0, 0, 0), 1), "mrad": (1e-3, (0, 0, 0, 0), 1), "deg": (c.degree, (0, 0, 0, 0), 1),
    "arcsec": (c.arcsec, (0, 0, 0, 0), 1), "arcmin": (c.arcmin, (0, 0, 0, 0), 1),
    "mas": (1e-3 * c.arcsec, (0, 0, 0, 0), 1), "turn": (2 * math.pi, (0, 0, 0, 0), 1),
    "rpm": (2 * math.pi / 60, (0, 0, -1, 0), 1),
}  # fmt: skip
LONG = {
    "km": "kilometers",
    "mrad": "milliradians",
    "N": "newton",
    "deg": "degrees",
    "day": "days",
    "nT": "nanotesla",
}
RAISED = {1: "¹", 2: "²", 3: "³", -1: "⁻¹", -2: "⁻²"}
UNKNOWN = (
    "cd",
    "Ma",
    "PT",
    "mday",
    "khour",
    "fft",
    "Mlb",
    "degC",
    "°F",
    "Nm",
    "Nms",
    "kgm",
    "parsec",
    "mu",
    "as",
)
KEYS = {  # SI unit of a key: its exponents, and a config that has the value in its place
    "kg m^2": (
        (2, 1, 0, 0),
        '[body]\npreset = "moon"\n[[rotors]]\nname = "w"\naxis = [0, 0, 1]\nrate = 1\nmoment = "{}"',
    ),
    "kg": ((0, 1, 0, 0), '[body]\nshape = "sphere"\nradius = 1\nmass = "{}"'),
    "m": ((1, 0, 0, 0), '[body]\nshape = "sphere"\nradius = "{}"\nmass = 1'),
}
BODY = "[body]\nprincipal_moments = [1, 2, 2.5]\n"
PRESET = '[body]\npreset = "moon"\n'
ORBIT = f'{BODY}[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = 4e14\n'
NUMBERS = (  # places where a number without unit is asked for, or a rate of decay
    ORBIT + '[loads.orbit]\nsemi_major_axis = 7e6\neccentricity = "{}"',
    ORBIT + 'position = [7e6, 0, 0]\n[loads.figure]\npole = [0, 0, 1]\nJ2 = "{}"\nradius = "6378 km"',
    PRESET + '[body.elasticity]\nradius = "1738 km"\nlove_number = "{}"',
    PRESET + '[body.core]\nmoment = 7e-4\nflattening = "{}"',
    PRESET + '[body.core]\nmoment = "{}"',
    PRESET + '[body.core]\nmoment = 7e-4\nfriction = "{}/day"',
    PRESET + '[body.gravity_field]\nradius = 1e6\nC = {{"3,0" = "{}"}}',
    BODY + '[[rotors]]\nname = "w"\nmoment = 0.1\naxis = [0, 0, "{}"]\nrate = 1',
    BODY + '[limits]\nmax_drift = "{}"',
    BODY + '[integrator]\ntolerance = "{}"',
)
REST = "\n[initial]\nangular_velocity = [0.1, 0.2, 1]\n[time]\nend = 1\n"


def read(text: str) -> Any:
    return rigidsim.parse(f'name = "units"\n{text}')


def compound(rng: random.Random) -> tuple[str, float, tuple[int, ...], int]:
    """A random product of units: its text, value, exponents and power of an angle."""
    text, value, exponents, angle, over = "", 1.0, [0, 0, 0, 0], 0, False
    for place in range(rng.randint(1, 4)):
        join = rng.choice((" ", "*", "·", "/", " / ", " per ")) if place else ""
        name, power = rng.choice([*UNITS]), rng.choice((1, 1, 1, 2, 3, -1, -2))
        size, dimension, angles = UNITS[name]
        over = "/" in join or "per" in join
        raised = rng.choice((f"^{power}", f"**{power}", f"^({power})", RAISED[power]))
        text += join + rng.choice((name, LONG.get(name, name)))
        text += "" if power == 1 else raised
        signed = -power if over else power
        value *= size**signed
        exponents = [e + signed * d for e, d in zip(exponents, dimension, strict=True)]
        angle += signed * angles
    return text, value, tuple(exponents), angle


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_right_units_have_their_value(seed: int) -> None:
    """Thirty random quantities for each seed, as constants of a config."""
    rng = random.Random(seed)
    drawn = [compound(rng) for _ in range(30)]
    numbers = [rng.choice((1, -1)) * 10 ** rng.uniform(-9, 9) for _ in drawn]
    lines = [f'p{i} = "{x!r} {text}"' for i, (x, (text, *_)) in enumerate(zip(numbers, drawn, strict=True))]
    config = read(f"{BODY}{REST}[parameters]\n" + "\n".join(lines)).config
    for i, (number, (text, value, *_)) in enumerate(zip(numbers, drawn, strict=True)):
        # scipy's factors and their powers are rounded: at most 4 factors with powers up to 3
        assert float(config.parameters[f"p{i}"]) == pytest.approx(number * value, rel=1e-14, abs=0), text


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_a_key_takes_its_dimension_only(seed: int) -> None:
    """Ten random units at keys for each seed: right ones are taken, others refused with the remedy."""
    rng = random.Random(seed)
    for _ in range(10):
        wanted, (exponents, table) = rng.choice([*KEYS.items()])
        text, _, found, _ = compound(rng)
        if rng.random() < 0.5:  # one that fits
            text, found = {"kg m^2": "lb in^2", "kg": "slug", "m": "nmi"}[wanted], exponents
        given = f"2.25 {text}"
        if found == exponents:
            read(table.format(given) + REST)
            continue
        with pytest.raises(ConfigError) as refused:
            read(table.format(given) + REST)
        assert f"which is {wanted}; units for" in str(refused.value), given


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_no_angle_is_a_number_and_no_name_means_two_things(seed: int) -> None:
    rng = random.Random(seed)
    angles = [name for name, (_, dimension, angle) in UNITS.items() if angle and dimension == (0, 0, 0, 0)]
    for table in NUMBERS:
        plain = f"{rng.uniform(1e-4, 1e-3):.3g}"
        read(table.format(plain) + REST)
        with pytest.raises(ConfigError) as refused:
            read(table.format(f"{plain} {rng.choice(angles)}") + REST)
        assert any(words in str(refused.value) for words in ("only a number without one", "counts angles")), (
            table
        )
    unknown = rng.choice(UNKNOWN)
    with pytest.raises(ConfigError, match=r"unknown unit|has an offset") as refused:
        read(f'{BODY}{REST}[parameters]\np = "{rng.uniform(1, 9):.3g} {unknown}"')
    assert "known units: m kg s" in str(refused.value)
