"""Runs and sweeps under an SPK file go on with the same bytes wherever these are, and with no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from kernel_scenes import STRENGTHS, moon
from spk_files import write_kernel
from support import EAGER

import rigidsim

EARTH = {"earth": STRENGTHS["earth"]}
SWEPT = '[sweep]\n[sweep.axes]\n"initial.angular_velocity[0]" = {linspace = [0, 1e-8, 3]}\n'


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a config and its kernel; the working folder is another."""
    for name in ("place", "elsewhere", "else"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "else")
    monkeypatch.setenv("RIGIDSIM_KERNELS", "")
    write_kernel(tmp_path / "place" / "moon.bsp")
    text = moon("./moon.bsp", EARTH, time='end = "200 day"\nevery = "1 day"')
    (tmp_path / "place" / "moon.toml").write_text(text)
    (tmp_path / "place" / "sweep.toml").write_text(text.replace('"200 day"', '"8 day"') + SWEPT)
    return tmp_path / "place"


def swap(kernel: Path, found: bytes) -> None:
    """Another kernel of the same name: the last digit of one coefficient."""
    changed = bytearray(found)
    changed[20_000] ^= 1
    kernel.write_bytes(changed)


def test_a_run_goes_on_with_the_same_bytes_elsewhere_and_with_no_others(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = rigidsim.load(place / "moon.toml")
    whole = rigidsim.run(experiment, out=place / "whole")
    cut = rigidsim.run(experiment.replace({"limits.max_steps": 20}), out=place / "cut", tuning=EAGER)
    assert not cut.folder.dataset.exists()
    kernel = place / "moon.bsp"
    given = kernel.read_bytes()

    kernel.unlink()
    for goes_on, folder in ((rigidsim.resume, cut), (rigidsim.verify, whole)):
        with pytest.raises(rigidsim.ConfigError, match="which isn't there: looked for in"):
            goes_on(folder.folder.path)
    swap(kernel, given)
    for goes_on, folder in ((rigidsim.resume, cut), (rigidsim.verify, whole)):
        with pytest.raises(rigidsim.RunFolderError) as caught:
            goes_on(folder.folder.path)
        assert 'begun with a kernel "moon.bsp" of SHA-256' in str(caught.value)
        assert "put the former in its place, or name its folder in" in str(caught.value)

    kernel.unlink()
    elsewhere = place.parent / "elsewhere"
    (elsewhere / "moon.bsp").write_bytes(given)
    monkeypatch.setenv("RIGIDSIM_KERNELS", str(elsewhere))
    assert rigidsim.verify(whole.folder.path).identical


def test_a_sweep_finds_the_kernel_beside_its_config_and_notes_its_hash(place: Path) -> None:
    done = rigidsim.sweep(place / "sweep.toml", out=place / "runs")
    alone = {"time.end": "8 day", "initial.angular_velocity[0]": 5e-9}
    single = rigidsim.run(rigidsim.load(place / "moon.toml").replace(alone), out=None)
    with done.dataset as dataset:
        assert dataset.attrs["ephemeris_kernel"] == "moon.bsp"
        assert dataset.attrs["ephemeris_sha256"] == single.dataset.attrs["ephemeris_sha256"]
        row = dataset["quaternion_final"].values[1]
        assert (row == single.dataset["quaternion"].values[-1]).all()
