"""Mercury's ready scene beside its planar equation of motion, and the fit of its lines."""

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp


def test_the_ready_scene_turns_as_the_planar_equation_says() -> None:
    """a'' = -(3/2) (B - A)/C_m G M/r^3 sin 2(a - f), f the Sun's longitude in the equator of the start.

    The Sun leaves that plane by 2e-5 rad in a year, whose square is below everything here; 1e-9 rad is what
    DOP853 leaves at its tolerance.
    """
    pytest.importorskip("de421")
    from experiments import mercury_librations as study
    from experiments.bare import blocks
    from experiments.common import simulate

    kernel = blocks.Kernel("de421")
    start = study.START + 2451545.0
    stored = {name: np.load(kernel.folder / f"jpl-{name}.npy") for name in ("mercury", "sun")}

    def sun(day: float) -> np.ndarray:
        places = []
        for name in ("sun", "mercury"):
            parts = (kernel.last - kernel.first) / len(stored[name])
            at = (start + day - kernel.first) / parts
            places.append(chebyshev.chebval(2 * (at % 1) - 1, stored[name][int(at)].T))
        return np.asarray(places[0] - places[1])

    result = simulate(
        study.SCENE,
        "output.record=['quaternion']",
        "output.estimate=false",
        "time.end=352 day",
        "time.every=4 day",
    )
    days, quaternion = result.values("time") / 86400, result.values("quaternion")
    w, x, y, z = quaternion[0]
    first = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    pole = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    second = np.cross(pole, first)
    pull = 1.5 * (4 * 0.8067e-5 / 0.346) / 0.431 * kernel.parameters["sun"]

    def rates(day: float, state: np.ndarray) -> list[float]:
        place = sun(day)
        seen = math.atan2(place @ second, place @ first)
        return [state[1], -pull / np.linalg.norm(place) ** 3 * math.sin(2 * (state[0] - seen))]

    spin = math.radians(6.139061792135)
    truth = solve_ivp(rates, (0, 352), [0, spin], "DOP853", days, rtol=1e-13, atol=1e-14).y[0]
    w, x, y, z = quaternion.T
    now = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    turned = np.unwrap(np.arctan2(now @ second, now @ first))
    assert np.abs(turned - truth).max() < 3e-9
