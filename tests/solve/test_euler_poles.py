"""Recorded Euler angles mean the recorded quaternion at and near the poles of their sequence, too.

There only the sum or the difference of the outer angles is defined, and the truth is the attitude itself:
rotations are rebuilt from the recorded numbers with all their digits, in mpmath.
"""

from __future__ import annotations

import random
from pathlib import Path

import mpmath
import numpy as np
import pytest
import xarray
from support import angle_between, cases, config, law, run_text

from rigidsim.scene import attitude
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.parts_of_values import parts_in

FAULT = Path(__file__).parents[1] / "data" / "faults" / "euler_singular.toml"
RECORD = 'record = ["euler_angles", "quaternion"]'
BITS = {"single": 24, "double": 53, "extended": 64, "quadruple": 113, "40": 135}
CONTEXT = mpmath.MPContext()
CONTEXT.prec = 200


def exact(dataset: xarray.Dataset, name: str) -> list[list[mpmath.mpf]]:
    """Rows of a recorded vector with its residuals."""
    parts = [dataset[part].values for part in parts_in(dataset, name)]
    return [
        [sum((CONTEXT.mpf(float(x)) for x in numbers), CONTEXT.zero) for numbers in zip(*row, strict=True)]
        for row in zip(*parts, strict=True)
    ]


def worst_error(dataset: xarray.Dataset, sequence: str, bits: int) -> float:
    """Largest error of an element of R(euler_angles), over what is allowed: 1e-13 in double precision and as
    many roundings in others, and the rounding of the angles themselves.
    """
    epsilon = 2.0 ** (1 - bits)
    worst = 0.0
    for angles, q in zip(exact(dataset, "euler_angles"), exact(dataset, "quaternion"), strict=True):
        ours = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, angles, sequence))
        truth = attitude.rotation_matrix(attitude.unit_quaternion(CONTEXT, q))
        error = max(abs(a - b) for x, y in zip(ours, truth, strict=True) for a, b in zip(x, y, strict=True))
        largest = float(max(abs(x) for x in angles))
        worst = max(worst, float(error) / (450 * epsilon + 2 * epsilon * largest))
    return worst


def shared(dataset: xarray.Dataset, side: float) -> np.ndarray:
    """What the outer angles share, a + c or a - c."""
    first, _, last = dataset["euler_angles"].values.T
    return np.asarray(first + side * last)


def middle_at(sequence: str, end: int, away: str) -> str:
    """A middle angle next to a pole, with many digits."""
    off = CONTEXT.mpf(away)
    pole = CONTEXT.pi * end if sequence[0] == sequence[2] else CONTEXT.pi * (2 * end - 1) / 2
    return str(CONTEXT.nstr(pole + off if end == 0 else pole - off, 55))


def test_a_body_that_spins_about_z_from_the_default_attitude_has_its_angle_in_psi() -> None:
    found = run_text(FAULT.read_text()).dataset
    np.testing.assert_allclose(
        found["euler_angles"].values, np.outer(found["time"].values, [0, 0, 1]), rtol=0, atol=1e-14
    )
    assert worst_error(found, "zxz", 53) <= 1


@pytest.mark.parametrize("integrator", ['formulation = "quaternion"', 'formulation = "euler_angles"'])
@pytest.mark.parametrize(("sequence", "side"), [("zxz", -1.0), ("zyx", -1.0)])
def test_a_start_in_a_pole_keeps_the_angles_given(integrator: str, sequence: str, side: float) -> None:
    """And the difference of the outer angles goes on from there, as the body leaves the pole."""
    middle = middle_at(sequence, 1, "0")
    text = config(
        initial=f'euler_angles = [0.3, "{middle}", 0.4]\nangular_velocity = [0.2, 0.1, 0.3]',
        time="end = 3\nsamples = 31",
        integrator=f'{integrator}\neuler_sequence = "{sequence}"',
        output=RECORD,
    )
    found = run_text(text).dataset
    np.testing.assert_allclose(found["euler_angles"].values[0], [0.3, float(middle), 0.4], atol=1e-15)
    assert worst_error(found, sequence, 53) <= 1
    assert np.abs(np.diff(shared(found, side))).max() < 0.1  # of at most 0.04 rad that the body turns


def crossings(start: str, expression: str, formulation: str) -> np.ndarray:
    text = config(
        initial=start,
        time="end = 3\nsamples = 3",
        integrator=f'formulation = "{formulation}"',
        output=RECORD,
        more=f'[[events]]\nname = "it"\nexpression = "{expression}"',
    )
    return np.asarray(run_text(text).dataset["it_time"].values)


SPIN, TUMBLE = "angular_velocity = [0, 0, 1]", "angular_velocity = [0.3, 0.2, 1]"


@pytest.mark.parametrize("formulation", ["quaternion", "euler_angles"])
def test_events_see_the_sum_of_the_outer_angles_in_the_pole(formulation: str) -> None:
    assert crossings(SPIN, "phi + psi - 1.25", formulation) == pytest.approx([1.25], abs=1e-14)


@pytest.mark.parametrize("expression", ["theta - 0.1", "phi - 1"])
def test_events_see_a_motion_leave_the_pole(expression: str) -> None:
    """As one that reads the elements of R: cos(theta) = R_zz, and phi is the angle of (R_xz, -R_yz)."""
    same = {
        "theta - 0.1": "cos(0.1) - (qw^2 - qx^2 - qy^2 + qz^2)",
        "phi - 1": "2*(qx*qz + qw*qy)*cos(1) + 2*(qy*qz - qw*qx)*sin(1)",
    }
    # the angle of a vector that vanishes at the start, so that this product does, too
    truth = crossings(TUMBLE, same[expression], "quaternion")
    found = crossings(TUMBLE, expression, "quaternion")
    assert len(found) == 1
    assert np.abs(truth - found[0]).min() < 1e-12


TILTS = ["0", "0", "1e-30", "1e-18", "1e-16", "1e-15", "1e-14", "1e-12", "1e-9", "1e-6", "1e-3", "0.01"]


CHEAP = ["single", "double", "quadruple", "40"]  # to compile


def relative(n: int, chance: random.Random) -> tuple[str, str, str]:
    """A scene that starts at or near a pole: its text, sequence and precision."""
    sequence = EULER_SEQUENCES[n % 12]
    precision = "extended" if n % 13 == 4 else chance.choice(CHEAP)
    carried = ("quaternion", "rotation_matrix", "euler_angles", "planar", "closed_form", "canonical")[
        (n + n // 12) % 6
    ]
    rates = [chance.uniform(-1, 1) for _ in range(3)]
    if carried == "planar" or chance.random() < 0.4:  # about the axis that the outer angles share
        rates = [0.0, 0.0, 0.0]
        rates["xyz".index(sequence[2])] = chance.uniform(0.2, 1)
    away = chance.choice(["1e-5", "1e-3", "0.01"] if carried == "canonical" else TILTS)
    angles = chance.uniform(-3, 3), middle_at(sequence, chance.randrange(2), away), chance.uniform(-3, 3)
    load = ""
    if carried in ("quaternion", "rotation_matrix", "euler_angles") and chance.random() < 0.5:
        load = 'kind = "torque"\ncomponents = ["0.1*sin(t)", 0.05, "-0.1*wz"]'
    way = 'method = "closed_form"' if carried == "closed_form" else f'formulation = "{carried}"'
    digits = precision if precision.isdigit() else f'"{precision}"'
    text = config(
        initial=f'angular_velocity = {rates}\neuler_angles = [{angles[0]}, "{angles[1]}", {angles[2]}]',
        loads=load,
        time=chance.choice(["end = 3\nsamples = 9", "end = 30\nsamples = 4"]),
        integrator=f'{way}\nprecision = {digits}\neuler_sequence = "{sequence}"',
        output=RECORD,
    )
    return text, sequence, precision


@pytest.mark.slow
def test_angles_mean_the_quaternion_in_every_sequence_formulation_and_precision() -> None:
    chance = random.Random(25)
    for n in range(26):
        text, sequence, precision = relative(n, chance)
        found = run_text(text, f'name="p{n}"').dataset
        assert worst_error(found, sequence, BITS[precision]) <= 1, text


# ---- euler angles as states: small inside, continuous outside, the same attitude as the quaternion

FREE = """
name = "free"
[body]
principal_moments = [1, 1, 1.5]
[initial]
angular_velocity = [0.1, 0.15, 2]
quaternion = [0.7, 0.4, 0.5, 0.3]
[time]
end = 60
samples = 1201
"""


@pytest.mark.parametrize("sequence", cases(EULER_SEQUENCES, ("zxz", "zyx")))
def test_each_sequence_gives_the_attitude_of_the_quaternion(sequence: str) -> None:
    record = 'output.record=["angular_velocity", "quaternion", "euler_angles"]'
    common = [record, f'integrator.euler_sequence="{sequence}"']
    plain = run_text(FREE, 'name="q"', *common)
    angles = run_text(FREE, 'name="e"', 'integrator.formulation="euler_angles"', *common)
    error = angle_between(plain.dataset["quaternion"].values, angles.dataset["quaternion"].values)
    # both formulations within three times the law, the angles' own with the amplification of their chart:
    # an error of the outer angles grows like 1/|singular factor|, whose smallest value the sample shows
    middle = angles.dataset["euler_angles"].values[:, 1]
    factor = np.abs(np.sin(middle) if sequence[0] == sequence[2] else np.cos(middle)).min()
    steps = angles.summary["cost"]["steps"]
    assert error.max() <= 3 * law(2.0**-52, steps, 2.01, 60) * (1 + 1 / factor)
    # angles found from the quaternion agree with those integrated, full turns included
    difference = plain.dataset["euler_angles"].values - angles.dataset["euler_angles"].values
    difference -= difference[0]  # the charts may start on different branches
    assert np.abs(difference).max() <= 6 * law(2.0**-52, steps, 2.01, 60) * (1 + 1 / factor**2)
