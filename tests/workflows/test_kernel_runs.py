"""Runs with kernels: SPK files, resuming at block edges, and kernels that are missing, swapped or moved."""

import os
from pathlib import Path

import numpy as np
import pytest
from kernel_scenes import HEAVY, LANDING, STRENGTHS, TURNED, moon
from kernels import write_spk

import rigidsim
from rigidsim.scene.kernels.reading import FOLDERS

TIME = 'end = "60 day"\nsamples = 61'
BEGIN, END = 2440420.0, 2440500.0


def text_of(kernel: str) -> str:
    return moon(kernel, STRENGTHS, body=HEAVY, start=TURNED, epoch=LANDING, time=TIME)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A config with an SPK file beside it."""
    monkeypatch.delenv(FOLDERS, raising=False)
    folder = tmp_path / "configs"
    folder.mkdir()
    write_spk(folder / "small.bsp", BEGIN, END)
    path = folder / "moon.toml"
    path.write_text(text_of("small.bsp"))
    return path


def same(one: rigidsim.Run, other: rigidsim.Run) -> None:
    first, second = one.dataset, other.dataset
    assert set(first) == set(second)
    for name in first:
        np.testing.assert_array_equal(first[name].values, second[name].values, err_msg=str(name))


def test_a_file_says_what_the_package_does(scene: Path) -> None:
    write_spk(scene.parent / "small.bsp", BEGIN, END, kind=3)
    by_file = rigidsim.run(scene, out=None).dataset
    text = text_of("de421")
    by_package = rigidsim.run(rigidsim.parse(text), out=None).dataset
    for source in ("earth", "sun"):
        one, other = (x["source_position"].sel(source=source).values for x in (by_file, by_package))
        error = np.linalg.norm(one - other, axis=1) / np.linalg.norm(other, axis=1)
        assert error.max() < 1e-15
    np.testing.assert_allclose(by_file["quaternion"], by_package["quaternion"], atol=1e-13)
    assert by_file.attrs["ephemeris_kernel"] == "small.bsp"


@pytest.mark.slow
def test_resumed_anywhere_it_has_the_same_bits(scene: Path, tmp_path: Path) -> None:
    """At each of many steps, among them those that end at edges."""
    whole = rigidsim.run(scene, out=tmp_path / "whole")
    steps = whole.summary["cost"]["steps"]
    edges = 0
    for stop in range(1, steps, max(steps // 8, 1)):
        changes = {"limits.max_steps": stop}
        begun = rigidsim.run(scene, out=tmp_path / "begun", changes=changes, force=True)
        assert begun.status == "stopped: max_steps"
        past = (begun.summary["engine_time"] / 86400 - 1.5 + 2) % 4 - 2  # the first block ends after 1.5 days
        edges += abs(past) < 1e-9
        resumed = rigidsim.resume(tmp_path / "begun" / "moon", overrides={"limits.max_steps": 10**6})
        same(whole, resumed)
    assert edges > 0


@pytest.mark.slow
def test_the_same_bytes_go_on_elsewhere_and_others_are_refused(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = rigidsim.run(scene, out=tmp_path / "whole")
    rigidsim.run(scene, out=tmp_path / "begun", changes={"limits.max_steps": 20})
    run, kernel = tmp_path / "begun" / "moon", scene.parent / "small.bsp"
    assert rigidsim.verify(tmp_path / "whole" / "moon").identical
    given = kernel.read_bytes()
    kernel.unlink()
    for repeat in (rigidsim.resume, rigidsim.verify):
        with pytest.raises(rigidsim.RigidsimError, match=r"small.bsp.*isn't there: looked for in"):
            repeat(run if repeat is rigidsim.resume else tmp_path / "whole" / "moon")
    write_spk(kernel, BEGIN, END, shift=1e-3)
    for repeat in (rigidsim.resume, rigidsim.verify):
        with pytest.raises(rigidsim.RigidsimError, match=r"begun with a kernel .* but the one found is of"):
            repeat(run if repeat is rigidsim.resume else tmp_path / "whole" / "moon")
    kernel.unlink()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "small.bsp").write_bytes(given)
    monkeypatch.setenv(FOLDERS, str(elsewhere))
    same(whole, rigidsim.resume(run, overrides={"limits.max_steps": 10**6}))
    assert rigidsim.verify(tmp_path / "whole" / "moon").identical


def test_reading_a_config_changes_nothing_for_the_next(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which isn't beside the first, and so doesn't find its kernel."""
    monkeypatch.chdir(tmp_path)
    before = dict(os.environ)
    rigidsim.run(scene, out=None, changes={"time.end": "1 day"})
    assert dict(os.environ) == before
    with pytest.raises(rigidsim.ConfigError, match="which isn't there: looked for in"):
        rigidsim.run(rigidsim.parse(scene.read_text()), out=None)


@pytest.mark.slow
def test_a_sweep_finds_the_kernel_beside_its_config_and_notes_its_hash(scene: Path) -> None:
    swept = scene.with_name("sweep.toml")
    axes = '"initial.angular_velocity[0]" = {linspace = [0, 1e-8, 3]}'
    swept.write_text(scene.read_text().replace('"60 day"', '"2 day"') + f"[sweep]\n[sweep.axes]\n{axes}\n")
    alone = {"time.end": "2 day", "initial.angular_velocity[0]": 5e-9}
    single = rigidsim.run(rigidsim.load(scene).replace(alone), out=None).dataset
    with rigidsim.sweep(swept, out=scene.parent / "runs").dataset as dataset:
        assert dataset.attrs["ephemeris_kernel"] == "small.bsp"
        assert dataset.attrs["ephemeris_sha256"] == single.attrs["ephemeris_sha256"]
        assert (dataset["quaternion_final"].values[1] == single["quaternion"].values[-1]).all()
