"""Runs with kernels: SPK files, resuming at block edges, and kernels that are missing, swapped or moved."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from kernel_scenes import HEAVY, LANDING, STRENGTHS, TURNED, moon
from kernels import write_spk
from support import IMPATIENT

import rigidsim
from rigidsim.scene.kernels.reading import FOLDERS
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing

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


def test_samples_have_the_same_bits_however_many_steps_are_taken_at_once(scene: Path) -> None:
    """Those of several steps together, through edges, or step by step; and one alone as among many."""
    samples = 121
    changes = {"time.samples": samples, "output.estimate": False}
    at_once = rigidsim.run(scene, out=None, changes=changes, tuning=Tuning(Pacing(chunk_seconds=1.0)))
    one_by_one = rigidsim.run(scene, out=None, changes=changes, tuning=IMPATIENT)
    same(at_once, one_by_one)
    every = (samples - 1) // 12
    fewer = rigidsim.run(scene, out=None, changes=changes | {"time.samples": 13})
    np.testing.assert_array_equal(at_once.dataset["quaternion"][::every], fewer.dataset["quaternion"])


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


BAD = {
    "truncated": (lambda x: x[: len(x) // 2], "which is truncated"),
    "no kernel": (lambda x: b"hello" * 1000, "which is no SPK file"),
    "empty": (lambda x: b"", "which is no SPK file"),
}


MISTAKES: list[tuple[dict[str, object], str]] = [
    ({"loads[0].gravitational_parameter": None}, "small.bsp has none of .*give it, in m.3/s.2"),
    ({"time.end": "200 day"}, "from 1969-07-.* to 1969-.*but the run goes from 1969-07-20T12:00:00 to"),
    ({"ephemeris.kernel": "small"}, 'the file beside the config is "./small.bsp"'),
    ({"ephemeris.kernel": "de421.bsp"}, 'the package is named without a suffix: "de421"'),
    ({"ephemeris.kernel": "../configs"}, "is no installed package|which is a folder"),
    ({"loads[0].source": "mars"}, 'given "mars"; .*small.bsp has .*earth'),
]


def test_damaged_files_and_mistakes_with_them_are_refused(scene: Path) -> None:
    for changes, words in MISTAKES:
        with pytest.raises(rigidsim.ConfigError, match=words):
            rigidsim.run(rigidsim.load(scene).replace(changes), out=None)
    kernel = scene.parent / "small.bsp"
    whole = kernel.read_bytes()
    for damage, words in BAD.values():
        kernel.write_bytes(damage(whole))
        with pytest.raises(rigidsim.ConfigError, match=words):
            rigidsim.run(scene, out=None)


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


def test_a_swept_source_has_an_axis_of_another_name_than_the_sources(tmp_path: Path) -> None:
    """Whose places every member records along a dimension of that name."""
    text = moon(body=HEAVY, start=TURNED, epoch=LANDING, time=TIME.replace('"60 day"', '"2 day"'))
    axis = '[sweep.axes]\n"loads[1].source" = {values = ["sun", "venus"]%s}\n'
    path = tmp_path / "moon.toml"
    path.write_text(text + axis % "")
    with pytest.raises(rigidsim.ConfigError, match="a name that the dataset needs itself"):
        rigidsim.sweep(path, out=tmp_path)
    path.write_text(text + axis % ', name = "other"')
    done = rigidsim.sweep(path, out=tmp_path)
    assert done.dataset["source_position_final"].dims == ("other", "source", "space_axis")


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
