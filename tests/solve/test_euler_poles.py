"""Recorded Euler angles mean the recorded quaternion at and near the poles of their sequence, too.

There only the sum or the difference of the outer angles is defined, and the truth is the attitude itself:
rotations are rebuilt from the recorded numbers with all their digits, in mpmath.
"""

import random
from itertools import product

import mpmath
import numpy as np
import pytest
import xarray
from support import cases, config, run_text

from rigidsim.scene import attitude
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.parts_of_values import parts_in

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


def middle_at(sequence: str, end: int, away: str) -> str:
    """A middle angle next to a pole, with many digits."""
    off = CONTEXT.mpf(away)
    pole = CONTEXT.pi * end if sequence[0] == sequence[2] else CONTEXT.pi * (2 * end - 1) / 2
    return str(CONTEXT.nstr(pole + off if end == 0 else pole - off, 55))


@pytest.mark.parametrize(
    "case",
    cases(
        product(["quaternion", "euler_angles"], ["zxz", "zyx"]),
        [("quaternion", "zxz"), ("euler_angles", "zyx")],
    ),
    ids="-".join,
)
def test_a_start_in_a_pole_keeps_the_angles_given(case: tuple[str, str]) -> None:
    """And the difference of the outer angles goes on from there, as the body leaves the pole."""
    formulation, sequence = case
    middle = middle_at(sequence, 1, "0")
    text = config(
        initial=f'euler_angles = [0.3, "{middle}", 0.4]\nangular_velocity = [0.2, 0.1, 0.3]',
        time="end = 3\nsamples = 31",
        integrator=f'formulation = "{formulation}"\neuler_sequence = "{sequence}"',
        output=RECORD,
    )
    run = run_text(text)
    assert run.summary["warnings"] == []
    found = run.dataset
    np.testing.assert_allclose(found["euler_angles"].values[0], [0.3, float(middle), 0.4], atol=1e-15)
    assert worst_error(found, sequence, 53) <= 1
    first, _, last = found["euler_angles"].values.T
    assert np.abs(np.diff(first - last)).max() < 0.1  # of at most 0.04 rad that the body turns


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


@pytest.mark.parametrize("seed", cases(range(78), [], daily=6))
def test_angles_mean_the_quaternion_in_every_sequence_formulation_and_precision(seed: int) -> None:
    text, sequence, precision = relative(seed, random.Random(seed))
    assert worst_error(run_text(text).dataset, sequence, BITS[precision]) <= 1, text
