"""The folders of runs, sweeps and fits: what is in them, who works there, and what may be replaced.

Each holds ``config.toml``, ``dataset.h5`` and ``summary.json``; the classes say what else.
"""

import errno
import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, TypeAdapter

from rigidsim.errors import FORCE, OUT, RESUME, RunFolderError, StoppedWritingError, once_mended
from rigidsim.look.figure_names import FIGURES
from rigidsim.scene.kernels.reading import NOTE
from rigidsim.store import atomic, provenance, segments
from rigidsim.store.outputs import ANALYSIS
from rigidsim.store.summary import Brief, SummaryPart, read_summary

_REOPENED = ".segments.reopened"


class FileOf:
    """A file of a folder, by its name there."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, folder: "WorkFolder", owner: "type[WorkFolder]") -> Path:
        return folder.path / self._name


@dataclass(frozen=True)
class WorkFolder:
    """Common base of the folders of runs, sweeps and fits."""

    path: Path
    kind: ClassVar[str]
    holds: ClassVar[tuple[str, ...]]  # what such work writes, in the order in which it is removed
    kept: ClassVar[str]  # what remains when writing stops, for messages
    resumed: ClassVar[str]  # what the command that resumes does with the rest, for messages
    shared: ClassVar[bool] = False  # whether several processes may be at work

    config = FileOf("config.toml")
    """The config that is run, one visible value per key."""
    dataset = FileOf("dataset.h5")
    """The dataset, once the work is finished."""
    summary = FileOf("summary.json")
    """The summary: how the work ended and what it cost."""
    data = FileOf("data")
    """Folder with copies of the data of fits."""

    @property
    def begun_here(self) -> bool:
        """Whether such work was begun in the folder."""
        raise NotImplementedError

    @property
    def finished(self) -> bool:
        """Whether its results are there."""
        return self.dataset.exists()

    @contextmanager
    def locked(self, *, shared: bool = False) -> Iterator[None]:
        """Keep out other processes (but those that share the work) inside the block; the lock disappears with
        the process, however it ends.
        """
        try:
            self._refuse_a_file()
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDONLY)  # the folder itself: no file is left behind
        except OSError as error:
            raise self._unwritable(error) from None
        try:
            try:
                fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
            except OSError:
                raise RunFolderError(
                    f"{self.path}: another process is at work there; wait for it, or choose another {OUT} or "
                    "name"
                ) from None
            try:
                yield
            except OSError as error:
                raise StoppedWritingError(
                    f"{self.path}: can't be read or written: {error.filename or 'a file'}: "
                    f"{error.strerror or error}; {self.kept}, and {once_mended(error)}, {RESUME} "
                    f"{self.resumed}"
                ) from error
        finally:
            os.close(descriptor)

    @property
    def at_work(self) -> bool:
        """Whether a process is at work here, as far as can be seen."""
        try:
            descriptor = os.open(self.path, os.O_RDONLY)
        except OSError:
            return False
        # a shared lock disturbs nobody else who looks, an exclusive one sees those that share the work too
        seen_by = fcntl.LOCK_EX if self.shared else fcntl.LOCK_SH
        try:
            fcntl.flock(descriptor, seen_by | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            os.close(descriptor)
        return False

    def claim(self, *, force: bool, mine: Collection[str] = (), clear: bool = True) -> None:
        """Create the folder, or make it ready for work that begins.

        Args:
            force: whether what such work wrote may be replaced; pictures always may.
            mine: names that need no force. clear: whether what is there is removed.

        Raises:
            RunFolderError: the folder holds something else, or can't be written.
        """
        try:
            there = {name for name in self._content() if name[0] != "." and not name.endswith(".png")}
            if not force and there.difference(mine):
                found = folder_at(self.path) or self
                what = f"{'a finished' if found.finished else 'an unfinished'} {found.kind}"
                raise RunFolderError(
                    f"{self.path}: holds {what}; {FORCE} replaces it, another {OUT} puts this {self.kind} "
                    "elsewhere"
                )
            self.remove_torn()
            for path in (self.path / name for name in self.holds if clear):
                if path.is_dir():
                    segments.remove(path)
                path.unlink(missing_ok=True)
            self.path.mkdir(parents=True, exist_ok=True)
            atomic.sync_folder(self.path.parent)
        except OSError as error:
            raise self._unwritable(error) from None

    def _refuse_a_file(self) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise RunFolderError(f"{self.path}: is no folder; choose another {OUT} or name")

    def _content(self) -> Iterator[str]:
        """Names of what the folder holds; refuses what no such work writes."""
        self._refuse_a_file()
        for path in self.path.iterdir() if self.path.exists() else ():
            if path.name not in self.holds and not path.name.startswith((".", "figure")):
                raise RunFolderError(
                    f"{self.path}: holds {path.name}, which no {self.kind} writes; choose another {OUT} or "
                    "name"
                )
            if path.is_symlink():
                raise RunFolderError(f"{path}: is a symbolic link, which no {self.kind} writes; remove it")
            yield path.name

    def remove_torn(self) -> None:
        """Delete partial files that a killed process was writing or deleting."""
        for folder in (self.path, *(self.path / name for name in self.holds)):
            for path in (*folder.glob(".*.partial"), *folder.glob(".timeline.rrd.*.part")):
                if not (self.shared and Path(f"/proc/{path.name.split('.')[-2]}").exists()):
                    path.unlink(missing_ok=True)
        for name in (segments.REMOVED, _REOPENED):
            if (self.path / name).is_dir() and not (self.path / name).is_symlink():
                shutil.rmtree(self.path / name)

    def write_summary(self, summary: SummaryPart) -> None:
        """Write ``summary.json`` atomically."""
        text = json.dumps(summary.as_dict(), indent=2, allow_nan=False)
        atomic.write_bytes(self.summary, (text + "\n").encode())

    def _unwritable(self, error: OSError) -> RunFolderError:
        return RunFolderError(
            f"{self.path}: can't be written: {error.strerror or error}; choose another {OUT}"
        )


@dataclass(frozen=True)
class RunFolder(WorkFolder):
    """The folder of a run."""

    kind = "run"
    kept = "what was saved stays"
    resumed = "continues from there"
    holds = (
        *("config.toml", "dataset.h5", "timeline.rrd", "summary.json", "checkpoint.h5", NOTE, ANALYSIS),
        *("analysis.png", "figure.png", "figure_slide.png"),
        *(f"figure_{name}{end}.png" for name in FIGURES for end in ("", "_slide")),
        # these go last: as long as there are segments, the run isn't finished
        *("segments", "set_aside"),
    )

    timeline = FileOf("timeline.rrd")
    analysis = FileOf(ANALYSIS)
    checkpoint = FileOf("checkpoint.h5")
    """Checkpoint from which a finished run can be prolonged."""
    segments = FileOf("segments")
    """Folder of the segments that an unfinished run has saved."""
    set_aside = FileOf("set_aside")
    """Folder to which segments that don't belong to the run are moved."""

    @property
    def begun_here(self) -> bool:
        """Whether a run was begun, or is finished."""
        return self.dataset.exists() or self.segments.exists() or self.summary.exists()

    def begin(self, config: str, *, force: bool, kernels: Sequence[Path] = ()) -> None:
        """Make the folder ready for a new run: write its config and its kernels' places; it is under way. A
        run that was begun with this config and saved nothing needs no force.
        """
        try:
            begun = self.config.is_file() and self.config.read_bytes() == config.encode()
            self.claim(force=force, mine=[self.config.name] if begun else ())
            atomic.write_bytes(self.config, config.encode())
            if kernels:
                atomic.write_bytes(self.path / NOTE, "".join(f"{place}\n" for place in kernels).encode())
            self.segments.mkdir()
        except OSError as error:
            raise self._unwritable(error) from None

    @property
    def read_only(self) -> OSError | None:
        """Why the folder can't be written, as far as can be seen without trying; None if it can."""
        for place in (self.path, self.segments):
            if not place.is_dir() or _may_write(place):
                continue
            mounted = os.statvfs(place).f_flag & os.ST_RDONLY
            number = errno.EROFS if mounted else errno.EACCES
            return OSError(number, os.strerror(number), str(place))
        return None

    def refuse_read_only(self) -> None:
        """Refuse a folder that can't be written, before hours of work whose result couldn't be saved."""
        error = self.read_only
        if error is not None:
            raise RunFolderError(
                f"{error.filename}: can't be written: {error.strerror}; {once_mended(error)}, give the "
                "command again (info, verify, plot --out and export --out need no writing here)"
            )

    def reopen(self) -> None:
        """Make a finished run unfinished: its dataset becomes the first segment, its checkpoint the second.

        This is one step for other processes, and in a crash: the run is finished before it and unfinished
        after it.
        """
        prepared = self.path / _REOPENED
        prepared.mkdir()
        try:
            os.link(self.dataset, prepared / "00000000.h5")
        except OSError:  # a file system without hard links
            with atomic.replacing(prepared / "00000000.h5") as temporary:
                shutil.copyfile(self.dataset, temporary)
        atomic.write_bytes(prepared / "00000001.h5", self.checkpoint.read_bytes())
        prepared.replace(self.segments)
        atomic.sync_folder(self.path)
        for path in (self.summary, self.timeline, self.dataset, self.checkpoint):
            path.unlink(missing_ok=True)

    def note_timeline(self, summary: Brief, drawn: Path) -> None:
        """Record in the summary the timeline that was redrawn for a complete run, for ``verify``."""
        if drawn == self.timeline and summary.dataset_digest is not None and not self.segments.exists():
            self.write_summary(summary.having(timeline_sha256=provenance.file_sha256(drawn)))

    def read_summary(self) -> Brief:
        """The summary; a run that was killed has none and reads as "running"."""
        if not self.summary.exists():
            return Brief(status="running", message="the run is under way, or was killed")
        return read_summary(self.summary)


def _may_write(folder: Path) -> bool:
    """Whether this process may write there: root may anywhere except on a file system mounted read-only."""
    return os.access(
        folder, os.R_OK | os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids
    )


@dataclass(frozen=True)
class Begun:
    """What a sweep was begun with.

    Attributes:
        members, tiles: that were to be computed for this config.
        tile: members of a block of the sweep, of which a tile holds those that were missing.
        alone: whether all members run one by one though some might share equations, as was found when the
            first members were run; None if that wasn't asked.
    """

    config: str
    config_sha256: str
    members: int
    tiles: int
    tile: Annotated[int, Field(ge=1)]
    alone: bool | None


@dataclass(frozen=True)
class SweepFolder(WorkFolder):
    """The folder of a sweep, with its tiles."""

    kind = "sweep"
    kept = "the tiles that are complete stay"
    resumed = "computes the others"
    shared = True
    holds = ("summary.json", "dataset.h5", "config.toml", "data", "tiles")

    tiles = FileOf("tiles")
    """Folder of the tiles, and of what they were begun with."""
    note = FileOf("tiles/sweep.json")
    """File of ``begun``."""

    @property
    def begun_here(self) -> bool:
        """Whether a sweep was begun, or is finished."""
        return self.tiles.is_dir() or self.read_summary().get("kind") == self.kind

    def read_summary(self) -> dict[str, Any]:
        """Contents of ``summary.json``; empty if there is none."""
        try:
            content = json.loads(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    @property
    def begun(self) -> Begun | None:
        """What the sweep was begun with; None if it wasn't, or if its tiles were deleted.

        Raises:
            RunFolderError: it is damaged, or of a version whose tiles aren't read; a finished one opens.
        """
        try:
            return TypeAdapter(Begun).validate_json(self.note.read_bytes())
        except FileNotFoundError:
            if not any(self.tiles.glob("g*.json")) or self.dataset.exists():
                return None
            why = "was begun by an incompatible version of rigidsim"
        except (OSError, ValueError) as error:
            why = f"is damaged ({str(error).splitlines()[0]})"
        raise RunFolderError(f"{self.note}: {why}; {FORCE} runs all members again")

    def begin(self, begun: Begun) -> None:
        """Write what is begun with. Several processes that share a sweep write the same."""
        self.tiles.mkdir(parents=True, exist_ok=True)
        atomic.write_bytes(self.note, json.dumps(asdict(begun)).encode())
        atomic.write_bytes(self.config, begun.config.encode())

    def tile_files(self, config_sha256: str = "") -> list[Path]:
        """The tiles there are, or those that were computed for a config."""
        return sorted(self.tiles.glob(f"t{config_sha256[:8]}*.h5"))

    def tile_file(self, config_sha256: str, block: int, keys: np.ndarray, items: Sequence[str]) -> Path:
        """Where the tile with these members of a block is saved."""
        content = hashlib.sha256(keys.tobytes() + " ".join(items).encode()).hexdigest()
        return self.tiles / f"t{config_sha256[:8]}-{block:07d}-{content[:8]}.h5"


@dataclass(frozen=True)
class FitFolder(WorkFolder):
    """The folder of a fit."""

    kind = "fit"
    kept = "its copies of config and data stay"
    resumed = "makes it"
    holds = (
        *("config.toml", "dataset.h5", "summary.json", "fitted.toml", "figure.png", "data", "evaluations"),
        "begun.json",
    )

    fitted = FileOf("fitted.toml")
    """The config with the estimated values."""
    figure = FileOf("figure.png")
    begun = FileOf("begun.json")
    """What it was begun with."""

    @property
    def begun_here(self) -> bool:
        """Whether a fit was begun, or is finished."""
        return self.begun.is_file()

    @property
    def finished(self) -> bool:
        """Whether its results are there."""
        return self.summary.is_file() and self.begun_here


def folder_at(path: str | Path) -> WorkFolder | None:
    """The folder of a run, a sweep or a fit at a path, or which a file is in; None if there is none.

    Raises:
        RunFolderError: it can't be entered.
    """
    place = Path(path)
    try:
        place = place if place.is_dir() else place.parent
        for kind in (FitFolder, SweepFolder, RunFolder):
            if (folder := kind(place)).begun_here:
                return folder
    except OSError as error:
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    return None


def find_run(path: str | Path) -> RunFolder:
    """The run at ``path``: a run folder, or a file in one."""
    found = folder_at(path)
    if isinstance(found, RunFolder) and Path(path).exists():
        return found
    usual = Path("runs") / path
    hint = f"; did you mean {usual}?" if usual.is_dir() and not Path(path).is_absolute() else ""
    raise RunFolderError(f"{path}: no run here; give a run folder (runs/NAME) or its dataset.h5{hint}")
