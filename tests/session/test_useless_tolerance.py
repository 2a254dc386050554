"""A tolerance that means nothing is refused or warned of, with what would: the smallest that does is an
eighth of the precision's epsilon, below which orders rise and errors don't fall.
"""

import pytest
from support import EPSILON, cases, config

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


@pytest.mark.parametrize(("precision", "tolerance"), [("double", '"1e-400"'), ("single", "1e-60")])
def test_one_far_below_is_refused_as_a_tolerance(precision: str, tolerance: str) -> None:
    """Also where the precision can't hold it: the scene's own numbers aren't at fault."""
    with pytest.raises(ConfigError, match=r"\[integrator\] tolerance: given .* gain nothing"):
        prepare(rigidsim.parse(config(integrator=f'precision = "{precision}"\ntolerance = {tolerance}')))
