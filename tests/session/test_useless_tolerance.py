"""A tolerance that means nothing is refused or warned of, with what would: the smallest that does is an
eighth of the precision's epsilon, below which orders rise and errors don't fall.
"""

import numpy as np
import pytest
from support import EPSILON, angle_between, cases, config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.scene import build_scene
from rigidsim.session.understood import cautions_of
from rigidsim.solve.problem import prepare


def told(integrator: str) -> list[str]:
    """Texts of the cautions of a config with this ``[integrator]``."""
    experiment = rigidsim.parse(config(integrator=integrator))
    prepare(experiment)
    cautions = cautions_of(build_scene(experiment))
    assert {caution.code.value for caution in cautions} <= {"no_effect"}
    return [caution.text for caution in cautions]


@pytest.mark.parametrize("precision", cases(EPSILON, ["double"]))
def test_a_tolerance_below_an_eighth_of_epsilon_is_warned_of(precision: str) -> None:
    name = f'precision = "{precision}"\n'
    for factor in (0.13, 1e3):
        assert not told(f"{name}tolerance = {min(factor * EPSILON[precision], 1)!r}")
    for factor in (0.12, 1e-5):
        (text,) = told(f"{name}tolerance = {factor * EPSILON[precision]!r}")
        assert f"a tolerance below {EPSILON[precision] / 8:.3g} costs more and makes no error smaller" in text
        assert 'choose "auto", or a higher precision' in text
    assert not told(name + 'tolerance = "auto"')


def test_a_smaller_tolerance_gains_nothing() -> None:
    """What the warning claims, against 80 bits: a tolerance of 1e-30 takes more orders, and errs as much,
    within what rounding scatters by.
    """
    time = "end = 20\nsamples = 21"
    exact = run_text(config(time=time, integrator='precision = "extended"')).dataset.quaternion.values
    errors, orders = [], []
    for tolerance in ('"auto"', "1e-30"):
        found = run_text(config(time=time, integrator=f"tolerance = {tolerance}")).dataset
        errors.append(float(np.max(angle_between(found.quaternion.values, exact))))
        orders.append(found.attrs["taylor_order"])
    assert orders == [20, 36]
    assert errors[1] > errors[0] / 10


@pytest.mark.parametrize(("precision", "tolerance"), [("double", '"1e-400"'), ("single", "1e-60")])
def test_one_far_below_is_refused_as_a_tolerance(precision: str, tolerance: str) -> None:
    """Also where the precision can't hold it: the scene's own numbers aren't at fault."""
    with pytest.raises(ConfigError, match=r"\[integrator\] tolerance: given .* gain nothing"):
        prepare(rigidsim.parse(config(integrator=f'precision = "{precision}"\ntolerance = {tolerance}')))
