"""Lines near Nyquist's frequency, where a line meets its mirror image around the circle of frequencies."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from support import cases, run_text

import rigidsim

FAULT = Path(__file__).parents[1] / "data/faults/nyquist_line.toml"
WELL_APART = 1.2  # bins; lines closer than one can't be told apart
HELD = 0.3  # bins from Nyquist's frequency: closer to its mirror image than lines that can be told apart


def analysed(values: np.ndarray, lines: int = 8) -> Any:
    """Real or complex samples, one a second."""
    time = np.arange(float(len(values)))
    if np.iscomplexobj(values):
        columns = np.stack([values.real, values.imag, 0 * time], axis=1)
        data: Any = (("time", "body_axis"), columns, {"units": "1"})
        dataset = xarray.Dataset({"x": data}, coords={"time": time, "body_axis": ["x", "y", "z"]})
        return rigidsim.analyse(dataset, "x.x+iy", lines=lines)["x.x+iy"]
    dataset = xarray.Dataset({"x": ("time", values, {"units": "1"})}, coords={"time": time})
    return rigidsim.analyse(dataset, lines=lines)["x"]


def nearest(signal: Any, turns: float) -> Any:
    """The line nearest to a frequency in turns per sample."""
    return min(signal.lines, key=lambda line: abs(float(line.frequency) / (2 * np.pi) - turns))


def right(line: Any, turns: float, amplitude: float, errors: float = 3) -> bool:
    """Whether frequency and amplitude are right within some of their errors, or rounding."""
    off = abs(float(line.frequency) / (2 * np.pi) - turns)
    return bool(
        off <= errors * line.frequency_error / (2 * np.pi) + 1e-12
        and abs(float(line.amplitude) - amplitude) <= errors * line.amplitude_error + 1e-11
    )


def test_a_line_a_bin_below_nyquist_and_one_far_from_it() -> None:
    signal = rigidsim.analyse(run_text(FAULT.read_text()), "angular_velocity.z")["angular_velocity.z"]
    for turns, amplitude, phase in ((0.2137, 1.0, 0.0), (0.4998, 0.5, 0.7)):
        line = nearest(signal, turns)
        assert right(line, turns, amplitude)
        # the integration's own rounding is a walk of 4000 samples, some 1e-13
        assert abs(float(line.amplitude) - amplitude) < 1e-11
        assert abs(float(line.frequency) / (2 * np.pi) - turns) < 1e-12
        assert abs(float(line.phase) - phase) < 1e-9
    assert max(float(line.amplitude) for line in signal.lines) < 1.001


@pytest.mark.parametrize("count", [200, 201])
def test_at_nyquist_samples_show_amplitude_times_cosine(count: int) -> None:
    time = np.arange(count)
    values = np.cos(2 * np.pi * 0.2137 * time) + 0.5 * np.cos(np.pi * time + 0.7)
    signal = analysed(values)
    assert right(nearest(signal, 0.2137), 0.2137, 1.0)
    line = nearest(signal, 0.5)
    assert float(line.amplitude) == pytest.approx(0.5 * np.cos(0.7), rel=1e-12)
    assert float(line.phase) == pytest.approx(0, abs=1e-12)
    assert line.phase_error == np.inf
    assert line.frequency_error == pytest.approx(2 * np.pi * HELD / count)
    assert any("cosine of its phase" in note for note in signal.notes)


def test_constants_have_no_lines() -> None:
    for value in (0.0, 0.1, -3e7):
        signal = analysed(np.full(64, value))
        assert not signal.lines
        assert float(signal.value.real) == value


def _draw(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """Samples, and frequency and amplitude of the lines in them."""
    count = int(rng.integers(32, 600))
    n = np.arange(count) - (count - 1) / 2
    sign = rng.choice([-1.0, 1.0])
    gap = rng.uniform(0, 1.5) if kind != "exactly" else 0.0
    near = 0.5 - gap / count
    lines = [(rng.uniform(0.15, 0.3), 1.0), (near, 10 ** rng.uniform(-3, 0))]
    if kind == "two":
        lines.append((near - rng.uniform(0.5, 3) / count, 0.3))
    values = np.zeros(count, dtype=complex)
    for turns, amplitude in lines:
        values += amplitude * np.exp(1j * (2 * np.pi * turns * n + rng.uniform(0, 2 * np.pi)))
    if kind == "complex":
        across = -0.5 + rng.uniform(1.5, 3) / count  # on the other side of the circle
        values += 0.2 * np.exp(1j * (2 * np.pi * across * n + 1))
        return (values if sign > 0 else values.conj()), [(sign * f, a) for f, a in [*lines, (across, 0.2)]]
    samples = values.real
    if kind == "noise":
        samples = samples + 1e-3 * rng.standard_normal(count)
    if kind == "growing":  # no line, but what a huge one within a hundredth of a bin would look like
        samples = samples + 0.3 * (-1.0) ** np.arange(count) * n / count
    return samples, lines


def _relative(seed: int, kind: str) -> str:
    """What is wrong in a random relative; empty where nothing is."""
    rng = np.random.default_rng([25, 3, seed])
    values, lines = _draw(rng, kind)
    signal = analysed(values)
    largest = max((float(line.amplitude) for line in signal.lines), default=0.0)
    # lines 0.6 bins apart can cancel each other in part: over the samples by a third at most
    if largest > 1.5 * np.max(np.abs(values)):
        return f"{kind} {seed}: an amplitude of {largest:.3g} in samples of {np.max(np.abs(values)):.3g}"
    count = len(values)
    mirrored = [f for f, _ in lines] + ([-f for f, _ in lines] if np.isrealobj(values) else [])
    gaps = [
        min(abs((turns - f + 0.5) % 1 - 0.5) * count for f in mirrored if f != turns) for turns, _ in lines
    ]
    resolved = min(gaps) >= WELL_APART and kind != "growing"
    for (turns, amplitude), gap in zip(lines, gaps, strict=True):
        line = nearest(signal, turns)
        # of what is left unresolved elsewhere, errors tell the order of magnitude
        if (resolved or gap > 20) and not right(line, turns, amplitude, errors=3 if resolved else 10):
            return f"{kind} {seed}: {turns} {amplitude} found as {line}"
    return ""


KINDS = ("real", "exactly", "two", "complex", "noise", "growing")


@pytest.mark.parametrize("case", cases(product(KINDS, range(15)), [(kind, 1) for kind in KINDS[::2]], 6))
def test_random_relatives(case: tuple[str, int]) -> None:
    kind, seed = case
    assert not _relative(seed, kind)
