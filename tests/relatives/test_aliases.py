"""Lines of motions faster than the samples: labelled where the motion is known, marked where it can't be.

The truth: a frequency w seen every T seconds appears at |w - 2 pi k / T|, k being the nearest whole number.
"""

import numpy as np
import pytest
import xarray
from support import seeds

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
