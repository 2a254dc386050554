"""Segments torn, missing, foreign, edited or old: named, moved aside, and made again with the same bits."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from support import cases, same_bits

import rigidsim
from rigidsim import RunFolderError
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store import seal
from rigidsim.store.segments import SegmentLimits, read_chain

TEXT = (
    'name = "d"\n[body]\nprincipal_moments = [1, 2, 2.5]\n'
    "[initial]\nangular_velocity = [0.3, 1.0, 0.5]\n"
    "[time]\nend = 30\nsamples = 61\n[output]\ntimeline = false\n"
)
NUMBER = 2  # of the segment that something happens to


def begun(out: Path) -> rigidsim.Run:
    """A run that was stopped, with a segment for every few steps."""
    tuning = Tuning(Pacing(chunk_seconds=0.0, patience=0.0), SegmentLimits(seconds=0.0))
    run = rigidsim.run(rigidsim.parse(TEXT + "[limits]\nmax_steps = 30\n"), out=out, tuning=tuning)
    assert run.status == "stopped: max_steps"
    assert len(list(run.folder.segments.iterdir())) >= 5
    return run


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, rigidsim.Run]:
    """An unfinished run, another of the same config, and one in one go."""
    place = tmp_path_factory.mktemp("runs")
    whole = rigidsim.run(rigidsim.parse(TEXT), out=place / "whole")
    return {"begun": begun(place / "a"), "twin": begun(place / "b"), "whole": whole}


def torn(path: Path, _: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1000])


def flipped(path: Path, _: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    path.write_bytes(content)


def lost(path: Path, _: Path) -> None:
    path.unlink()


def foreign(path: Path, twin: Path) -> None:
    shutil.copy(twin / path.name, path)


def edited(path: Path, _: Path) -> None:
    """By someone who seals it again: the chain of seals tells."""
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(b"\nrigidsim sha256 ")])
    with h5py.File(path, "r+") as file:
        file["energy"][0] = 7.0
    seal.seal(path)


def pipe(path: Path, _: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGES = {f.__name__: f for f in (torn, flipped, lost, foreign, edited, pipe)}
SAYS = {
    "torn": "is torn or foreign",
    "flipped": "is damaged or was edited",
    "lost": "is missing",
    "foreign": "belongs to another run",
    "edited": "doesn't follow the segment before it",
    "pipe": "is no file, but a folder, pipe or device",
}


@pytest.mark.parametrize("kind", cases(DAMAGES, ["torn"]))
def test_a_damaged_segment(kind: str, originals: dict[str, rigidsim.Run], tmp_path: Path) -> None:
    folder = shutil.copytree(originals["begun"].folder.path, tmp_path / "d")
    damage: Callable[[Path, Path], None] = DAMAGES[kind]
    before = sorted((folder / "segments").iterdir())
    damage(before[NUMBER], originals["twin"].folder.segments)

    chain = read_chain(folder / "segments")
    assert chain.damage is not None
    assert SAYS[kind] in chain.damage
    # an edited segment with a good seal is known by the next one, which was sealed with the old one's seal
    good = NUMBER + 1 if kind == "edited" else NUMBER
    assert f"{good:08d}.h5" in chain.damage
    assert chain.paths == before[:good]
    with pytest.raises(RunFolderError, match=r"rigidsim\.resume\(\.\.\.\) sets it aside"):
        _ = rigidsim.open_run(folder).dataset

    if kind == "edited":  # what follows is made again; what was forged well enough only verify finds
        assert not rigidsim.verify(
            rigidsim.resume(folder, overrides=["limits.max_steps=100000"]).folder.path
        ).identical
        return
    done = rigidsim.resume(folder, overrides=["limits.max_steps=100000"])
    assert done.status == "finished"
    (told,) = [w for w in done.summary["warnings"] if "set_aside" in w]
    assert SAYS[kind] in told
    aside = sorted(p.name for p in done.folder.set_aside.iterdir())
    assert aside == [p.name for p in before[good + (kind == "lost") :]]
    same_bits(done, originals["whole"])


def test_a_damaged_file_is_not_prolonged(originals: dict[str, rigidsim.Run], tmp_path: Path) -> None:
    """Nor is a dataset by another file, or by none."""
    folder = shutil.copytree(originals["whole"].folder.path, tmp_path / "d")
    name = "checkpoint.h5"
    flipped(folder / name, folder)
    before = sorted(p.name for p in folder.iterdir())
    with pytest.raises(RunFolderError, match=rf"{name}: is damaged or was edited"):
        rigidsim.resume(folder, until="60")
    assert sorted(p.name for p in folder.iterdir()) == before
    shutil.copy(originals["twin"].folder.segments / "00000001.h5", folder / "dataset.h5")
    with pytest.raises(RunFolderError, match=r"dataset\.h5: is a segment of an unfinished run"):
        _ = rigidsim.open_run(folder).dataset
    (folder / "dataset.h5").unlink()
    with pytest.raises(RunFolderError, match=r"its dataset\.h5 is missing; run it again with force=True"):
        _ = rigidsim.open_run(folder).dataset
    with pytest.raises(RunFolderError, match=r"its dataset\.h5 is missing; run it again with force=True"):
        rigidsim.resume(folder)
