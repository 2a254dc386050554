"""What a solution is held against is as wrong as it says, or less."""

from __future__ import annotations

import mpmath
import numpy as np
from support import config

import rigidsim
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.reference import best_and_second, equals_of, errors_of_best
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import try_setting

GRADIENT = """kind = "gravity_gradient"
gravitational_parameter = 1.0
orbit = { semi_major_axis = 1.0, eccentricity = 0.3, inclination = 0.5 }"""
EQUAL = Setting("double", formulation="rotation_matrix")
CLOSE = 3.0
"""Times what it says: two random walks apart, of which one may have gone the other's way by chance."""


def test_the_best_of_double_precision_knows_its_error() -> None:
    """Held and plain runs in quaternions begin alike and share their rounded values: their distance alone
    was less than a fifth of the error.
    """
    experiment = rigidsim.parse(
        config(
            body="principal_moments = [1.0, 1.1, 1.3]",
            initial="angular_velocity = [0.5, 0.5, 1.5]",
            loads=GRADIENT,
        )
    )
    times = [mpmath.mpf(n) for n in range(0, 20)]

    def attitudes(setting: Setting) -> list[np.ndarray]:
        return try_setting(experiment, setting, times, compact=True).attitudes

    best, plain = best_and_second("double")
    found = {setting: attitudes(setting) for setting in (best, plain, EQUAL)}
    assert equals_of(best, [*found, Setting("double", 1e-9), Setting("extended")]) == [plain, EQUAL]
    true = np.maximum.accumulate(angles_between(found[best], attitudes(Setting("extended"))))
    distances = {s: angles_between(found[best], found[s]) for s in (plain, EQUAL)}
    assert (true <= CLOSE * errors_of_best(best, distances)).all()
    assert (true <= CLOSE * errors_of_best(best, {plain: distances[plain]})).all()
    assert true.max() > 1e-16
