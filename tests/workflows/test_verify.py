"""``verify``: identical, or what differs first; flipped bits and changed digits are found, sealed or not."""

from __future__ import annotations

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
from support import CONFIGS, cases

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


def test_identical_from_the_dataset_alone(original: Path, tmp_path: Path) -> None:
    alone = tmp_path / "mine.h5"
    alone.write_bytes(original.read_bytes())
    verdict = rigidsim.verify(alone)
    assert verdict.identical
    assert (verdict.problems, verdict.differing, verdict.environment) == ([], [], [])
    assert verdict.samples == 41
    assert embedded(alone).text == TEXT


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


@pytest.mark.parametrize("digit", [("0.3, 1.0", "0.3, 1.0000000000000002"), ("2.5]", "2.4]")])
def test_a_changed_digit_in_the_embedded_config(
    digit: tuple[str, str], original: Path, tmp_path: Path
) -> None:
    path = forged(
        original, tmp_path / "forged.h5", lambda file: file.attrs.modify("config", TEXT.replace(*digit))
    )
    verdict = rigidsim.verify(path)
    assert not verdict.identical
    assert "angular_velocity" in verdict.differing or "angular_momentum" in verdict.differing
    assert verdict.difference is not None


def test_a_changed_digit_in_the_config_beside_it(tmp_path: Path) -> None:
    run = rigidsim.run(rigidsim.parse(TEXT), out=tmp_path)
    run.folder.config.write_text(TEXT.replace("1.0, 0.5", "1.0, 0.6"))
    verdict = rigidsim.verify(run.folder.path)
    assert not verdict.identical
    assert verdict.differing == []
    assert 'line 5 is "angular_velocity = [0.3, 1.0, 0.6]"' in verdict.problems[0]


def test_another_machine_or_version_is_named(original: Path, tmp_path: Path) -> None:
    def elsewhere(file: h5py.File) -> None:
        file.attrs["version_heyoka"] = "6.0.0"
        file.attrs["code_target_cpu"] = "z80"
        file["energy"][7] = np.nextafter(file["energy"][7], 9)

    verdict = rigidsim.verify(forged(original, tmp_path / "elsewhere.h5", elsewhere))
    assert verdict.differing == ["energy"]
    assert verdict.difference is not None
    assert verdict.difference.sample == 7
    assert 0 < verdict.difference.size < 1e-14
    assert any(text.startswith("version_heyoka 6.0.0 -> ") for text in verdict.environment)
    assert any(text.startswith("code_target_cpu z80 -> ") for text in verdict.environment)


def test_a_dataset_exchanged_for_a_run_of_the_same_config(tmp_path: Path) -> None:
    one = rigidsim.run(rigidsim.parse(TEXT), out=tmp_path / "a")
    other = rigidsim.run(rigidsim.parse(TEXT), out=tmp_path / "b")
    one.folder.dataset.write_bytes(other.folder.dataset.read_bytes())
    verdict = rigidsim.verify(one.folder.path)
    assert not verdict.identical
    assert verdict.differing == []
    assert "was written for another dataset" in verdict.problems[0]
    with pytest.raises(RunFolderError, match=r"isn't the dataset that summary\.json beside it"):
        _ = one.dataset


@pytest.mark.slow
@pytest.mark.parametrize("path", cases(CONFIGS[::3], []), ids=lambda p: p.stem)
def test_every_ready_scene_is_identical(path: Path, ready: Callable[..., rigidsim.SavedRun]) -> None:
    verdict = rigidsim.verify(ready(path).folder.path)
    assert verdict.identical, verdict.as_dict()


def edited(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    change(summary)
    path.write_text(json.dumps(summary))


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a held run with a timeline, long enough for corrections."""
    text = TEXT.replace("end = 10", "end = 2000").replace("timeline = false", "timeline = true")
    text += "[integrator]\nhold_invariants = true\n"
    return rigidsim.run(rigidsim.parse(text), out=tmp_path_factory.mktemp("runs")).folder.path


# what is edited, and how the problem names it
EDITS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "status": (lambda s: s.update(status="stopped: max_drift"), "status is 'stopped: max_drift', 'finished'"),
    "steps": (lambda s: s["cost"].update(steps=s["cost"]["steps"] + 1), "cost.steps is "),
    "largest drift": (lambda s: s["invariants"]["energy"].update(largest_drift=1e-17),
                      "invariants.energy.largest_drift is 1e-17, "),
    "final drift": (lambda s: s["invariants"]["energy"].update(final_drift=0.0),
                    "invariants.energy.final_drift is 0.0, "),
    "initial value": (lambda s: s["invariants"]["energy"].update(
        initial=np.nextafter(s["invariants"]["energy"]["initial"], 9)), "invariants.energy.initial is "),
    "put back": (lambda s: s["invariants"]["energy"].update(put_back=0.0),
                 "invariants.energy.put_back is 0.0"),
    "no drift": (lambda s: s["invariants"].pop("energy"), "there is no invariants.energy"),
    "an invariant more": (lambda s: s["invariants"].update(helicity=s["invariants"]["energy"]),
                          "invariants.helicity is "),
    "precision": (lambda s: s.update(precision="quadruple"), "precision is 'quadruple', 'double'"),
    "not held": (lambda s: s.update(hold_invariants=False), "hold_invariants is False, True"),
    "events": (lambda s: s["events"].update(flip=3), "events.flip is 3, 0 when run again"),
    "time reached": (lambda s: s.update(time_reached=7.0), "time_reached is 7.0, 2000.0 when run again"),
    "dataset": (lambda s: s.update(dataset_sha256="0" * 64), "was written for another dataset"),
    "timeline": (lambda s: s.update(timeline_sha256="0" * 64), "timeline.rrd: was damaged or changed"),
}  # fmt: skip


@pytest.mark.parametrize("what", cases(EDITS, list(EDITS)[::7]))
def test_a_summary_that_was_edited_by_hand(what: str, complete: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(complete, tmp_path / "run")
    edited(folder, EDITS[what][0])
    verdict = rigidsim.verify(folder)
    assert not verdict.identical
    assert verdict.differing == []
    assert len(verdict.problems) == 1
    assert EDITS[what][1] in verdict.problems[0]
    named = "timeline.rrd" if what == "timeline" else "summary.json"
    assert verdict.problems[0].startswith(str(folder / named))


def test_a_summary_is_true_but_for_times_and_machines(complete: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(complete, tmp_path / "run")

    def elsewhere(summary: dict[str, Any]) -> None:
        summary["cost"]["seconds"] = {"engine": 1.0}
        summary["cost"] |= {"cpu_seconds": 7.0, "wall_seconds": 9.0, "sessions": 3, "steps_redone": 12}
        summary["provenance"]["cpu_model"] = "another"

    edited(folder, elsewhere)
    verdict = rigidsim.verify(folder)
    assert verdict.identical, verdict.problems


@pytest.mark.parametrize("how", cases(["lost", "bit", "link"], ["bit"]))
def test_the_timeline_that_the_summary_names(how: str, complete: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(complete, tmp_path / "run")
    path = folder / "timeline.rrd"
    content = bytearray(path.read_bytes())
    if how == "bit":
        content[len(content) // 2] ^= 4
        path.write_bytes(content)
    else:
        path.unlink()
    if how == "link":
        path.symlink_to(complete / "timeline.rrd")
    (problem,) = rigidsim.verify(folder).problems
    assert problem.startswith(f"{path}: {'was damaged' if how == 'bit' else 'is missing'}")


def test_a_summary_that_is_gone(complete: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(complete, tmp_path / "v")
    (copy / "summary.json").unlink()
    verdict = rigidsim.verify(copy)
    assert not verdict.identical
    assert verdict.differing == []
    assert any("summary.json: is missing" in problem for problem in verdict.problems)
