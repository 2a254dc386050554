"""A number means what was written, to every digit, until it is rounded once to the working precision."""

from decimal import Decimal
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import config

from rigidsim import parse
from rigidsim.scene.arithmetic import context_for, working_bits
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import prepare

DIGITS = 50
CONTEXT = context_for(DIGITS)
NAMES = ["single", "double", "extended", "quadruple", DIGITS]

decimals = st.decimals(
    min_value=-(10**12), max_value=10**12, allow_nan=False, allow_infinity=False, places=30
)
any_decimals = st.builds(
    lambda sign, digits, exponent: Decimal((sign, tuple(digits), exponent)),
    st.sampled_from([0, 1]),
    st.lists(st.integers(0, 9), min_size=1, max_size=60),
    st.integers(-400, 400),
)


def as_fraction(value: mpmath.mpf) -> Fraction:
    """A finite mpf, exactly."""
    sign, mantissa, exponent, _ = value._mpf_
    return (-1) ** sign * Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def scene_text(end: str = "1", rate: str = "1", moment: str = "2", integrator: str = "") -> str:
    body, initial = f"principal_moments = [2, {moment}, 3]", f"angular_velocity = [{rate}, 0, 1]"
    return config(body, initial, (), f"end = {end}", integrator)


# ---- as written -------------------------------------------------------------------------------------------


@given(any_decimals)
def test_a_decimal_is_the_fraction_that_it_shows(number: Decimal) -> None:
    exact = Fraction(number)
    for written in (number, str(number), f"{number} kg", f"{number}  kg "):
        assert parse_number(written, "kg") == ExactNumber(exact)
    assert parse_number(f"{number} g", "kg") == ExactNumber(exact / 1000)


# ---- units ------------------------------------------------------------------------------------------------

# written, SI unit, value in mpmath by the unit's definition
UNITS = [
    ("23.44 deg", "rad", lambda m: m.mpf(2344) / 100 * m.pi / 180),
    ("84381.406 arcsec", "rad", lambda m: m.mpf(84381406) / 1000 * m.pi / 648000),
    ("50.307 arcsec/yr", "rad/s", lambda m: m.mpf(50307) / 1000 * m.pi / 648000 / 31557600),
    ("1 g cm^2", "kg m^2", lambda m: m.mpf(1) / 10**7),
    (
        "0.6 dalton angstrom^2",
        "kg m^2",
        lambda m: m.mpf(6) / 10 * m.mpf("1.66053906892e-27") / m.mpf(10) ** 20,
    ),
    ("1/3 t", "kg", lambda m: m.mpf(1000) / 3),
    ("π/2", "1", lambda m: m.pi / 2),
    ("2*pi/365.25 rad/day", "rad/s", lambda m: 2 * m.pi / (m.mpf(36525) * 864)),
    ("pi deg", "rad", lambda m: m.pi**2 / 180),
]


@pytest.mark.parametrize(("written", "unit", "value"), UNITS, ids=[u[0] for u in UNITS])
def test_units_to_fifty_digits(written: str, unit: str, value) -> None:
    expected = value(CONTEXT)
    # three operations of CONTEXT (128 bits past fifty digits) on either side
    assert abs(parse_number(written, unit).at(CONTEXT) - expected) <= 8 * CONTEXT.eps * abs(expected)
    assert float(parse_number(written, unit)) == float(expected)


# ---- into the working precision ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
@given(number=decimals)
def test_every_precision_rounds_to_nearest(name: str | int, number: Decimal) -> None:
    precision, bits = precision_of(name), working_bits(name)
    exact = Fraction(number)
    got = as_fraction(precision.exact(precision.number(parse_number(number, "1").at(context_for(name)))))
    # half a unit in the last place of the larger power of two below the value is at most |x| 2^-bits
    assert abs(got - exact) <= abs(exact) * Fraction(2) ** -bits


# ---- all the way through a scene --------------------------------------------------------------------------

FORTY = "1.234567890123456789012345678901234567891"


def test_forty_digits_reach_the_scene_and_the_states() -> None:
    prepared = prepare(
        parse(scene_text(end=FORTY, rate=FORTY, moment=f'"{FORTY} kg m^2"', integrator="precision = 50"))
    )
    exact, scene = Fraction(FORTY), prepared.scene
    half_ulp = Fraction(2) ** -prepared.precision.bits  # of a number between 1 and 2
    for value in (scene.angular_velocity[0], scene.body.principal_moments[1], scene.end):
        # a single division of the scene's arithmetic
        assert abs(as_fraction(value) - exact) <= Fraction(2) ** -scene.context.prec
        scalar = prepared.precision.number(value)
        assert abs(as_fraction(prepared.precision.exact(scalar)) - exact) <= half_ulp
        assert abs(as_fraction(prepared.precision.exact(scalar)) - Fraction(float(FORTY))) > half_ulp
    unit = Fraction(2) ** prepared.system.state_exponents[0]
    assert as_fraction(prepared.system.initial[0]) * unit == as_fraction(scene.angular_velocity[0])
