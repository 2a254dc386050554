"""analyse: frequencies of closed forms against elliptic functions, datasets from anywhere, refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from support import config, run_text

import rigidsim
from rigidsim import RigidsimError
from rigidsim.scene.scene import build_scene

MOMENTS, RATES = ["3", "2", "1"], ["0.3", "0.2", "1"]


def test_the_free_nutation_of_the_earth() -> None:
    text = (Path(__file__).parents[2] / "configs/earth_free_nutation.toml").read_text()
    run = run_text(text, 'output.record=["polar_motion"]', "time.end=365 day")
    signal = rigidsim.analyse(run)["polar_motion"]
    assert [line.label.text for line in signal.lines] == ["wobble"]
    # 304.456 sidereal days, prograde, from little more than one turn
    sidereal = 2 * np.pi / 7.292115e-5
    assert signal.lines[0].period == pytest.approx(sidereal * (1 - 0.00327379492) / 0.00327379492, rel=1e-9)
    assert signal.lines[0].period / 86400 == pytest.approx(303.62, abs=0.01)
    assert signal.lines[0].frequency > 0
    assert float(signal.lines[0].amplitude) == pytest.approx(1e-6, rel=1e-9)


def labels(analysis: Any, signal: str, count: int) -> dict[str, float]:
    """The strongest lines by label, and their frequencies."""
    return {line.label.text: float(line.frequency) for line in analysis[signal].lines[:count]}


@pytest.mark.slow
def test_the_free_core_nutation() -> None:
    """Of a core that begins aside: both modes of the linearised equations, in body axes and in space."""
    a, moment, f = 0.94, 0.11, 0.05
    text = config(
        f"principal_moments = [{a}, {a}, 1]\n"
        f"core = {{moment = {moment}, flattening = {f}, angular_velocity = [1e-6, 0, 1]}}",
        "angular_velocity = [0, 0, 1]",
        time="end = 1000\nsamples = 2001",
        output='record = ["angular_velocity", "core_angular_velocity", "figure_axis"]\nestimate = false',
    )
    analysis = rigidsim.analyse(run_text(text), ["core_angular_velocity", "figure_axis"], lines=4)
    mantle = a - moment * (1 - f)
    modes = np.linalg.eigvals(
        [[(1 - moment - mantle) / mantle, moment * f / mantle], [1 / (1 - f), -1 / (1 - f)]]
    )
    retrograde, prograde = sorted(modes)
    body = labels(analysis, "core_angular_velocity.x+iy", 2)
    assert body == pytest.approx(
        {"free_core_nutation - spin": retrograde, "wobble": prograde}, rel=1e-11
    )  # amplitudes squared
    space = labels(analysis, "figure_axis.X+iY", 3)
    assert space["free_core_nutation"] == pytest.approx(1 + retrograde, rel=1e-10)
    assert space["free_nutation"] == pytest.approx(1 + prograde, rel=1e-11)


@pytest.mark.slow
def test_free_librations_of_the_moon() -> None:
    """Those that the map of the Cassini state has as eigenvalues: about 75.6 and 2.9 years, and 24.1 years in
    the frame of the node.
    """
    ready = rigidsim.load(Path(__file__).parents[2] / "configs" / "moon_cassini_state.toml")
    found = build_scene(ready).found_start
    wobble, in_frame, longitude = sorted(x for _, x in found.exponents if x > 0)
    quick = {"time.end": "1 day", "time.samples": 2, "output.estimate": False}
    start = rigidsim.run(ready.replace(quick), out=None).dataset.isel(time=0)
    pushed = start["angular_velocity"].values + np.array([1e-9, 0, 1e-10])
    moved = ready.replace(
        {
            "initial": {
                "equilibrium": None,
                "quaternion": start["quaternion"].values.tolist(),
                "angular_velocity": pushed.tolist(),
            },
            "time": {"end": "300 yr", "every": "10 day", "samples": None},
            "output": {"record": ["angular_velocity", "figure_axis", "obliquity"], "estimate": False},
        }
    )
    names = ["angular_velocity", "figure_axis.X+iY", "obliquity.spin"]
    analysis = rigidsim.analyse(rigidsim.run(moved, out=None), names, lines=12)
    known = {k.name: float(k.value) for k in analysis.known}
    # amplitudes of 4e-4 rad, squared, and other lines within the span's resolution
    assert known["longitude"] == pytest.approx(longitude, rel=1e-5)
    assert known["wobble"] == pytest.approx(wobble, rel=1e-5)
    assert known["latitude"] - known["node"] == pytest.approx(in_frame, rel=1e-5)
    assert "wobble" in labels(analysis, "angular_velocity.x+iy", 4)
    assert "longitude" in labels(analysis, "angular_velocity.z", 3)
    assert {"node", "latitude"} <= set(labels(analysis, "figure_axis.X+iY", 6))
    assert "latitude - node" in labels(analysis, "obliquity.spin", 4)


def made_up(**attributes: Any) -> xarray.Dataset:
    time = np.arange(400) * 0.5
    values = 0.2 + 1e-3 * time + 0.1 * np.cos(0.7 * time + 0.3) + 0.01 * np.cos(1.4 * time)
    return xarray.Dataset(
        {"obliquity": ("time", values, {"units": "rad"}), "spin_rate": ("time", values)},
        coords={"time": ("time", time)},
        attrs=attributes,
    )


REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (made_up().isel(time=slice(0, 10)), {}, "has 10 samples; analyse needs at least 32"),
    (made_up().isel(time=[*range(100), *range(102, 200)]), {}, "samples aren't equidistant: 0.5 to 1.5 s"),
    (made_up().rename(time="t"), {}, "no coordinate time"),
    (made_up(), {"variables": "tilt"}, "no signal 'tilt'; there are obliquity, spin_rate"),
    (made_up(), {"lines": 0}, "given lines = 0; 1 to 500 are allowed"),
    (made_up(), {"floor": 2.0}, "given floor = 2"),
    (made_up(), {"window": 99}, "window of order 99; 1 to 20"),
    (made_up().where(lambda d: d.time != 3), {}, "not all samples are finite"),
]


def test_what_cannot_be_analysed_is_refused() -> None:
    for dataset, options, message in REFUSED:
        with pytest.raises(RigidsimError, match=message):
            rigidsim.analyse(dataset, **options)
