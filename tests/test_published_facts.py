"""What this field knows in closed form or in print, recovered from datasets."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from support import EPSILON, run_text

import rigidsim

Ready = Callable[..., rigidsim.Run]


def tilt(run: rigidsim.Run) -> np.ndarray:
    q = run.dataset["quaternion"].values
    return np.arccos(np.clip(1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2), -1, 1))


@pytest.mark.slow
def test_sleeping_top_stays_up_above_the_threshold_and_falls_below(ready: Ready) -> None:
    # w3^2 = 4 A M g l / C^2: Landau & Lifshitz, section 35, problem 1
    threshold = math.sqrt(4 * 2e-4 * 0.1 * 9.80665 * 0.04) / 1e-4
    assert threshold == pytest.approx(56.02, abs=0.005)
    stable = ready("heavy_top_sleeping_stable")
    unstable = ready("heavy_top_sleeping_unstable")
    # linear theory: the push e over half the difference of the two nutation frequencies
    spread = math.sqrt((1e-4 * 57 / 2e-4) ** 2 - 4 * 0.1 * 9.80665 * 0.04 / 2e-4)
    assert tilt(stable).max() <= 1.01 * 2 * 1e-3 / spread
    assert tilt(unstable).max() > 0.3
    for name, side in (("heavy_top_sleeping_stable", 1.001), ("heavy_top_sleeping_unstable", 0.999)):
        close = ready(name, f"initial.angular_velocity=[1e-6, 0, {side * threshold!r}]", "time.end=30")
        assert (tilt(close).max() > 1e-3) == (side < 1)


@pytest.mark.slow
def test_unstable_sleeping_top_grows_at_its_linear_rate(ready: Ready) -> None:
    run = ready("heavy_top_sleeping_unstable", "initial.angular_velocity=[1e-8, 0, 55]")
    # (A theta'' has the complex exponent i C w3 / 2A +- rate)
    rate = math.sqrt(0.1 * 9.80665 * 0.04 / 2e-4 - (1e-4 * 55 / (2 * 2e-4)) ** 2)
    time, angle = run.dataset["time"].values, tilt(run)
    early = (time > 1.5) & (angle < 1e-4)
    fitted = np.polyfit(time[early], np.log(angle[early]), 1)[0]
    # what is left of the decaying solution at 1.5 s, and the chord of arccos near zero
    assert fitted == pytest.approx(rate, rel=0.01)


def test_wobble_of_a_tossed_plate_is_twice_its_spin(ready: Ready) -> None:
    run = ready("tossed_plate")
    momentum = run.dataset["angular_momentum"].values[0]
    precession = np.linalg.norm(momentum) / (0.3 * 0.25**2 / 12)
    assert precession / 25.0 == pytest.approx(2.0, abs=1e-3)  # small angle: w1/w3 = 1/25
    position = run.dataset["position"].values
    time = run.dataset["time"].values
    parabola = 1.5 + 6 * time - 9.80665 / 2 * time**2
    assert np.abs(position[:, 2] - parabola).max() < 20 * EPSILON["double"]


@pytest.mark.parametrize(("inertia", "rate"), [(600, 0), (-600, 27)])
def test_scaling_a_scene_by_powers_of_two_changes_no_bit(inertia: int, rate: int) -> None:
    def scene(name: str, i: int, w: int) -> rigidsim.Run:
        text = f"""
        name = "{name}"
        [body]
        principal_moments = ["{_scaled(1, 1, i)}", "{_scaled(2, 1, i)}", "{_scaled(5, 2, i)}"]
        [initial]
        angular_velocity = ["{_scaled(1, 10, w)}", "{_scaled(1, 1, w)}", "{_scaled(1, 20, w)}"]
        [time]
        end = "{_scaled(1000, 1, -w)}"
        samples = 101
        """
        return run_text(text)

    plain, scaled = scene("plain", 0, 0).dataset, scene("scaled", inertia, rate).dataset
    assert np.array_equal(scaled["quaternion"], plain["quaternion"])
    assert np.array_equal(np.ldexp(scaled["angular_velocity"], -rate), plain["angular_velocity"])
    assert np.array_equal(np.ldexp(scaled["energy"], -inertia - 2 * rate), plain["energy"])
    assert np.array_equal(scaled["energy_drift"], plain["energy_drift"])


def _scaled(numerator: int, denominator: int, exponent: int) -> str:
    if exponent >= 0:
        return f"{numerator * 2**exponent}/{denominator}"
    return f"{numerator}/{denominator * 2**-exponent}"


def test_mars_precesses_under_the_sun_as_measured(ready: Ready) -> None:
    """7.6083(21) arcsec a year (Konopliv et al. 2016), and 0.0067 of geodetic precession back. The mean is
    (3/2) (n^2/w) H cos(eps) (1 - e^2)^(-3/2). Two Martian years leave 1e-3 of it open.
    """
    run = ready("mars_precession")
    time, year = run.dataset["time"].values, 365.25 * 86400
    orbit = math.sqrt(1.32712440018e20 / (1.52371 * 149597870700) ** 3)
    lines = [wave(k * orbit * time) for k in (1, 2, 3) for wave in (np.cos, np.sin)]
    model = np.stack([np.ones_like(time), time / year, *lines], axis=1)
    found = {}
    for name in ("obliquity", "node_longitude"):
        values = run.dataset[name].sel(axis="figure").values * 648000 / math.pi
        found[name] = np.linalg.lstsq(model, values, rcond=None)[0]
    precession = -found["node_longitude"][1]
    assert precession == pytest.approx(7.6083 + 0.0067, rel=1e-3)
    averaged = 1.5 * orbit**2 / (math.radians(350.891982) / 86400) * 0.00538017
    averaged *= math.cos(math.radians(25.1893)) * (1 - 0.0934**2) ** -1.5 * year * 648000 / math.pi
    assert precession == pytest.approx(averaged, rel=1e-3)
    assert abs(found["obliquity"][1]) < 2e-3 * averaged  # no secular change: it is all in the longitude
