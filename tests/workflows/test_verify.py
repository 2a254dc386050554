"""``verify``: identical, or what differs first; flipped bits and changed digits are found, sealed or not."""

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rigidsim
from rigidsim import RunFolderError
from rigidsim.store import seal
from rigidsim.workflows.read import embedded

pytestmark = pytest.mark.optimised  # what is edited mustn't be zero

TEXT = (
    'name = "v"\n[body]\nprincipal_moments = [1, 2, 2.5]\n'
    "[initial]\nangular_velocity = [0.3, 1.0, 0.5]\n"
    "[time]\nend = 10\nsamples = 41\n[output]\ntimeline = false\n"
    '[[events]]\nname = "flip"\nexpression = "wz"\n'
)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of a finished run; tests work on copies."""
    return rigidsim.run(rigidsim.parse(TEXT), out=tmp_path_factory.mktemp("runs")).folder.dataset


def forged(original: Path, target: Path, edit: Callable[[h5py.File], Any]) -> Path:
    """A copy, edited by someone who knows how to seal it again."""
    content = original.read_bytes()
    target.write_bytes(content[: -len(seal.sealed(io.BytesIO()))])
    with h5py.File(target, "r+") as file:
        edit(file)
    seal.seal(target)
    return target


@pytest.mark.slow
def test_identical_from_the_dataset_alone(original: Path, tmp_path: Path) -> None:
    alone = tmp_path / "mine.h5"
    alone.write_bytes(original.read_bytes())
    verdict = rigidsim.verify(alone)
    assert verdict.identical
    assert (verdict.problems, verdict.differing, verdict.environment) == ([], [], [])
    assert verdict.samples == 41
    assert embedded(alone).text == TEXT


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_any_flipped_bit_is_known_before_anything_is_read(
    where: float, bit: int, original: Path, tmp_path: Path
) -> None:
    content = bytearray(original.read_bytes())
    content[int(where * len(content))] ^= 1 << bit
    damaged = tmp_path / "dataset.h5"
    damaged.write_bytes(content)
    with pytest.raises(RunFolderError, match=r"dataset\.h5: is (torn|damaged)"):
        seal.check_seal(damaged)


@settings(max_examples=2, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_bit_flipped_under_a_good_seal_is_found_by_integrating(
    data: st.DataObject, original: Path, tmp_path: Path
) -> None:
    with h5py.File(original) as file:
        names = [n for n in file if file[n].dtype == "<f8" and file[n].size and n != "flip_index"]
        names = [n for n in names if b"not a netCDF variable" not in bytes(file[n].attrs.get("NAME", b""))]
        name = data.draw(st.sampled_from(names))
        index = data.draw(st.integers(0, file[name].size - 1))
    bit = data.draw(st.integers(0, 63))

    def flip(file: h5py.File) -> None:
        values = file[name][()]
        values.reshape(-1).view(np.uint64)[index] ^= np.uint64(1 << bit)
        file[name][...] = values

    path = forged(original, tmp_path / "forged.h5", flip)
    verdict = rigidsim.verify(path)
    assert not verdict.identical
    assert verdict.problems == []
    assert verdict.differing == [name]
    assert verdict.difference is not None
    assert verdict.difference.variable == name
    with h5py.File(path) as file:
        assert verdict.difference.sample == index // int(np.prod(file[name].shape[1:]))


def edited(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    change(summary)
    path.write_text(json.dumps(summary))


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a held run with a timeline, long enough for corrections."""
    text = TEXT.replace("end = 10", "end = 400").replace("timeline = false", "timeline = true")
    text += "[integrator]\nhold_invariants = true\n"
    return rigidsim.run(rigidsim.parse(text), out=tmp_path_factory.mktemp("runs")).folder.path


def test_a_summary_that_was_edited_by_hand(complete: Path, tmp_path: Path) -> None:
    """The first claim that doesn't hold is named, and how many others there are."""
    folder = shutil.copytree(complete, tmp_path / "run")
    edited(folder, lambda s: s["invariants"]["energy"].update(largest_drift=1e-17, put_back=0.0))
    edited(folder, lambda s: s["invariants"].pop("angular_momentum"))
    edited(folder, lambda s: s["cost"].update(steps=s["cost"]["steps"] + 1))
    verdict = rigidsim.verify(folder)
    assert not verdict.identical
    assert verdict.differing == []
    (problem,) = verdict.problems
    assert problem.startswith(str(folder / "summary.json"))
    assert "(and 3 more of its claims don't hold)" in problem


def test_a_summary_is_true_but_for_times_and_machines(complete: Path, tmp_path: Path) -> None:
    """And the timeline is the one that the summary names."""
    folder = shutil.copytree(complete, tmp_path / "run")

    def elsewhere(summary: dict[str, Any]) -> None:
        summary["cost"]["seconds"] = {"engine": 1.0}
        summary["cost"] |= {"cpu_seconds": 7.0, "wall_seconds": 9.0, "sessions": 3, "steps_redone": 12}
        summary["provenance"]["cpu_model"] = "another"

    edited(folder, elsewhere)
    path = folder / "timeline.rrd"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)
    verdict = rigidsim.verify(folder)
    (problem,) = verdict.problems
    assert problem.startswith(f"{path}: was damaged")
