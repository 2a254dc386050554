"""Sensitivities: identities of mechanics, differences in higher precision, bits of the motion, refusals."""

import numpy as np
import pytest
from support import cases, run_text

from experiments.sensitivity_campaign import BOUND, case, checked
from rigidsim import ConfigError
from rigidsim.scene.rotations import rotation_matrix
from rigidsim.solve.problem import prepare
from rigidsim.workflows.read import parse
from rigidsim.workflows.sensitivity import Tangents

FREE = """
name = "free"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, 0.05]
quaternion = [0.8, 0.1, -0.3, 0.5]
[time]
end = 30
samples = 61
"""
KEYS = '["initial.angular_velocity", "body.principal_moments", "initial.attitude"]'
TORQUE = '[[loads]]\nkind = "torque"\ncomponents = ["{}", "0", "0"]\n'
ROUNDING = 1e-12
"""Relative: some hundred steps of 1e-16, grown as far as a free body's motion grows, like the time."""


def test_a_free_bodys_derivatives_obey_its_scaling_laws() -> None:
    """Faster rates are the same motion run through sooner: w0 . d/dw0 gives t times the motion's own pace.
    Larger moments, all in proportion, change nothing. A turned start turns the whole motion.
    """
    times = np.linspace(0, 30, 13)
    keys = ["initial.angular_velocity", "body.principal_moments", "initial.attitude"]
    found = Tangents(parse(FREE), keys).at({}, times)
    of_attitude, of_rates = found.slopes["quaternion"], found.slopes["angular_velocity"]
    start, moments = np.array([0.3, 1.0, 0.05]), np.array([1, 2, 2.5])
    w = found.values["angular_velocity"]
    matrix = np.moveaxis(np.array(rotation_matrix([*found.values["quaternion"].T])), 2, 0)
    in_space = np.einsum("nij,nj->ni", matrix, w)
    size = np.abs(of_attitude[:, :6]).max()
    by_scale = np.einsum("nki,k->ni", of_attitude[:, :3], start)
    assert np.abs(by_scale - times[:, None] * in_space).max() < ROUNDING * size
    pull = -np.cross(w, w * moments) / moments  # Euler's equations
    by_scale = np.einsum("nki,k->ni", of_rates[:, :3], start)
    assert np.abs(by_scale - w - times[:, None] * pull).max() < ROUNDING * size
    for slopes in (of_attitude, of_rates):
        assert np.abs(np.einsum("nki,k->ni", slopes[:, 3:6], moments)).max() < ROUNDING * size
    assert np.abs(of_rates[:, 6:]).max() == 0
    turned = np.einsum("ij,nkj->nki", matrix[0].T, of_attitude[:, 6:])
    assert np.abs(turned - np.eye(3)).max() < ROUNDING


@pytest.mark.parametrize("number", cases(range(100, 106), []))
def test_random_keys_and_scenes_agree_with_higher_precision(number: int) -> None:
    assert 0 <= max(checked(case(number)).values()) < BOUND


WAYS = ['formulation = "euler_angles"\nhold_invariants = true', 'precision = "extended"']


@pytest.mark.parametrize("integrator", cases(WAYS, WAYS[:1]), ids=["charts and projection", "80 bits"])
def test_the_motions_bits_are_those_of_the_plain_run(integrator: str) -> None:
    """And the derivatives are those without a run, which begins nowhere anew."""
    text = FREE + f"[integrator]\n{integrator}\n"
    plain = run_text(text).dataset
    beside = run_text(text + f"[output]\nsensitivity = {KEYS}\n").dataset
    for name in plain.variables:
        assert plain[name].values.tobytes() == beside[name].values.tobytes(), name
    added = set(beside.variables) - set(plain.variables) - {"parameter", "space_axis"}
    assert {name.removesuffix("_lo") for name in added} == {
        "attitude_sensitivity",
        "angular_velocity_sensitivity",
    }
    assert beside["attitude_sensitivity"].dims == ("time", "parameter", "space_axis")
    assert list(beside["parameter"].values[:4]) == [
        *(f"initial.angular_velocity[{i}]" for i in range(3)), "body.principal_moments[0]",
    ]  # fmt: skip
    keys = [str(key) for key in beside["parameter"].values]
    alone = Tangents(parse(text), keys).at({}, plain["time"].values).slopes["quaternion"]
    apart = np.abs(beside["attitude_sensitivity"].values - alone).max()
    assert apart < 10 * ROUNDING * np.abs(alone).max()


@pytest.mark.parametrize(
    ("keys", "more", "words"),
    [
        ('["initial.angular_velocitty[0]"]', "", 'unknown key "angular_velocitty"'),
        ('["time.end"]', "", "no number of the motion"),
        ('["body.mass"]', "", "isn't given in the config"),
        ('["initial.attitude[3]"]', "", "indices 0, 1 and 2"),
        ('["initial.attitude", "initial.attitude[1]"]', "", "another key stands for"),
        ('["loads[0].components[0]"]', TORQUE.format("0.1"), "has no number there"),
        ('["initial.attitude"]', '[integrator]\nprecision = "single"\n', "single precision"),
        ('["initial.attitude"]', '[integrator]\nmethod = "closed_form"\n', "takes no steps"),
        ('["initial.attitude"]', TORQUE.format("-0.1*sign(wx)"), "make the change smooth"),
    ],
)
def test_what_has_no_derivative_is_refused_in_words(keys: str, more: str, words: str) -> None:
    with pytest.raises(ConfigError, match=r"\[output\] sensitivity") as refused:
        prepare(parse(FREE + more + f"[output]\nsensitivity = {keys}\n"))
    assert words in str(refused.value)
