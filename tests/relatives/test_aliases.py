"""Lines of motions faster than the samples: labelled where the motion is known, marked where it can't be.

The truth: a frequency w seen every T seconds appears at |w - 2 pi k / T|, k being the nearest whole number;
and a planet that turns at W about its axis of largest moment C nutates freely at W sqrt((C-A)(C-B)/(A B)) in
the body and, W faster, in space.
"""

import numpy as np
import pytest
import xarray
from support import config, run_text, seeds

import rigidsim


def seen_at(frequency: float, spacing: float) -> float:
    turn = 2 * np.pi / spacing
    return float(abs(frequency - turn * np.round(frequency / turn)))


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_lines_of_random_samplings(seed: int) -> None:
    """A slow and a fast known line, and an unknown one, sampled at random: only the last can be an alias."""
    rng = np.random.default_rng(seed)
    spacing, count = 10 ** rng.uniform(-2, 4), int(rng.integers(400, 900))
    nyquist, step = np.pi / spacing, 2 * np.pi / (spacing * count)
    while True:
        slow, unknown = nyquist * rng.uniform(0.05, 0.9, 2)
        fast = nyquist * rng.uniform(1.1, 30)
        seen = [slow, seen_at(fast, spacing), seen_at(unknown, spacing), 0.0, nyquist]
        sums = [seen_at(m * slow + n * fast, spacing) for m in range(-6, 7) for n in range(-6, 7)]
        if np.diff(np.sort(seen)).min() > 12 * step and np.abs(np.subtract(sums, unknown)).min() > step:
            break  # no line hides another one, and no sum of known frequencies is the unknown one
    time = np.arange(count) * spacing
    sizes, phases = 10 ** rng.uniform(-3, 0, 3), rng.uniform(-3, 3, 3)
    parts = [a * np.cos(w * time + p) for a, w, p in zip(sizes, (slow, fast, unknown), phases, strict=True)]
    dataset = xarray.Dataset({"obliquity": ("time", sum(parts), {"units": "rad"})}, {"time": time})
    lines = rigidsim.analyse(dataset, known={"slow": slow, "fast": fast}, lines=3).signals[0].lines
    found = {line.label.text: line for line in lines}
    assert set(found) == {"slow", "fast", ""}
    assert float(found["fast"].frequency) == pytest.approx(fast, rel=1e-9)
    assert float(found["fast"].observed) == pytest.approx(seen[1], rel=1e-9)
    assert float(found[""].frequency) == pytest.approx(unknown, rel=1e-9)
    assert [found[name].can_be_alias for name in ("slow", "fast", "")] == [False, False, True]
    # of motions that the samples resolve, no line can be one
    resolved = rigidsim.analyse(dataset, known={"slow": slow / 4}, lines=3).signals[0].lines
    assert not any(line.can_be_alias for line in resolved) or slow / 2 > nyquist


PLANET = config(
    "principal_moments = [{a}, {b}, 1]",
    'euler_angles = [0, "{tilt} deg", 0]\nangular_velocity = [0, 0, {spin}]',
    'kind = "gravity_gradient"\ngravitational_parameter = 1.32712440018e20\n'
    'orbit = {{semi_major_axis = "{distance} au", eccentricity = {eccentricity}}}',
    'end = "{end} day"\nevery = "{every} day"',
    output='record = ["obliquity", "node_longitude"]',
)


@pytest.mark.parametrize("seed", seeds(1, 50))
@pytest.mark.slow
@pytest.mark.unoptimised
def test_the_free_nutation_of_random_planets(seed: int) -> None:
    """Sampled every few days, it is labelled and unfolded."""
    rng = np.random.default_rng([1, seed])
    flat, uneven = 10 ** rng.uniform(-2.4, -1.8), 10 ** rng.uniform(-4, -3)
    a, b = 1 - flat - uneven, 1 - flat
    spin = 2 * np.pi / (86400 * rng.uniform(0.5, 1.5))
    wobble = spin * np.sqrt((1 - a) * (1 - b) / (a * b))
    values = {"tilt": rng.uniform(10, 40), "distance": rng.uniform(0.5, 1.0)}
    values["eccentricity"] = rng.uniform(0, 0.1)
    orbit = np.sqrt(1.32712440018e20 / (values["distance"] * 1.495978707e11) ** 3)
    while True:
        every = rng.uniform(3, 9)
        seen, nyquist = seen_at(spin + wobble, 86400 * every), np.pi / (86400 * every)
        forced = [seen_at(j * spin + k * orbit, 86400 * every) for j in (0, 2) for k in range(-6, 12)]
        if 0.1 * nyquist < seen < 0.9 * nyquist and np.abs(np.subtract(forced, seen)).min() > 0.03 * nyquist:
            break  # three bins from the lines that the source forces on an uneven body
    text = PLANET.format(a=a, b=b, spin=spin, every=every, end=every * 200, **values)
    analysis = rigidsim.analyse(run_text(text), "obliquity.figure")
    lines = {line.label.text: line for line in analysis.signals[0].lines}
    nutation = lines["free_nutation"]
    assert nutation.unfolded
    assert not nutation.can_be_alias
    # torques change the wobble a little, and a label may be off by a twentieth of a bin (docs/analysis.md)
    bin_width = 2 * np.pi / (200 * every * 86400)
    assert float(nutation.frequency) - spin == pytest.approx(wobble, abs=bin_width / 20)
    assert all(line.can_be_alias == (not line.label.text) for line in lines.values())
