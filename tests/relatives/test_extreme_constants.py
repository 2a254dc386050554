"""Constants at the ends of the range: their value to the last digit, or a refusal that names the key."""

import random

import mpmath
import pytest
from support import config, parts_in, seeds

import rigidsim
from rigidsim.errors import ConfigError

FORCE = '[[loads]]\nkind = "force"\npoint = [0, 0, 1]\ncomponents = ["{}", 0, 0]'
DIPOLE = '[[loads]]\nkind = "magnetic_dipole"\nfield = [1, 0, 0]\nmoment = ["{}", 1, 0]'
PLACES = {  # an expression's place in the config, and tables with it
    "[[loads]] number 1 components[1]": '[[loads]]\nkind = "torque"\ncomponents = ["0", "{}", "0"]',
    "[[loads]] number 1 components[0]": FORCE,
    "[[loads]] number 1 moment[0]": DIPOLE,
    "[[rotors]] number 1 torque": '[[rotors]]\nname = "w"\naxis = [0, 0, 1]\nmoment = 0.1\ntorque = "{}"',
    "[[states]] number 1 derivative": '[[states]]\nname = "u"\nderivative = "{}"',
    "[[events]] number 1 expression": '[[events]]\nname = "e"\nexpression = "{}"',
    "[body] principal_moments[0]": "",
}
FORMS = (
    "{c}*wx",
    "{c}*sin(t)",
    "wx + {c}*t^2",
    "sin({c})*wz",
    "exp(-{e})*wx",
    "{c}*exp(wz)",
    "sqrt({c})*sqrt({c})*wx",
    "k*wx",
)
# decimal exponents between which all bits of a number are those of some float64 (float32 in single)
RANGE = {
    "single": (-37, 38),
    "double": (-307, 308),
    "extended": (-304, 308),
    "quadruple": (-289, 308),
    50: (-272, 308),
}


def scene(precision: str | int, more: str) -> str:
    word = f'"{precision}"' if isinstance(precision, str) else precision
    integrator, time = f"precision = {word}", "end = 1\nsamples = 2"
    return config(initial="angular_velocity = [0.1, 0.2, 1]", time=time, integrator=integrator, more=more)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_a_constant_out_of_range_is_refused_by_its_key(seed: int) -> None:
    """Three constants for each seed, in all places, forms and precisions."""
    rng = random.Random(seed)
    for _ in range(3):
        precision = rng.choice([*RANGE])
        least, most = RANGE[precision]
        tiny = rng.random() < 0.7
        power = rng.randint(-4000, least - 14) if tiny else rng.randint(most + 2, 4000)
        constant = f"{rng.uniform(1, 9):.12g}e{power}"
        where = rng.choice([*PLACES])
        form = rng.choice(FORMS)
        if (not tiny and ("sin" in form or "exp(-" in form)) or where.startswith("[body]"):
            form = "{c}*wx"
        text = form.format(c="k" if "sqrt" in form else constant, e=int(abs(power) * 2.302585) + 1)
        table = PLACES[where].format(text)
        given = scene(precision, f"{table}\n[parameters]\nk = {constant}\n")
        if where.startswith("[body]"):
            given = given.replace("[1, 2, 2.5]", f'["2 + {constant}*t", 2, 2.5]')
        with pytest.raises(ConfigError) as refused:
            rigidsim.run(rigidsim.parse(given), out=None)
        assert where in [problem.where for problem in refused.value.problems], (given, str(refused.value))
        assert "can't hold" in str(refused.value)


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_a_constant_in_range_has_its_value(seed: int) -> None:
    """A state that grows at a rate near the end of the range: u = c t, to the last digits."""
    rng = random.Random(seed)
    precision = rng.choice(["single", "double", "extended"])
    least, _ = RANGE[precision]
    rate = f"{rng.uniform(1, 9):.15g}e{rng.randint(least + 12, least + 40)}"
    run = rigidsim.run(
        rigidsim.parse(scene(precision, f'[[states]]\nname = "u"\nderivative = "{rate}"')), out=None
    )
    bits = {"single": 24, "double": 53, "extended": 64}[precision]
    with mpmath.workprec(200):
        u = sum(mpmath.mpf(float(run.dataset[part].values[-1])) for part in parts_in(run.dataset, "u"))
        # the constant is rounded once, and each of less than 32 steps once
        assert abs(u / mpmath.mpf(rate) - 1) <= 32 * mpmath.mpf(2) ** -bits
