"""The run folder: ``config.toml``, ``dataset.h5``, ``timeline.rrd``, ``summary.json``, ``segments/``."""

import errno
import fcntl
import json
import os
import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

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
    """Common base of the folders of runs and sweeps."""

    path: Path
    kind: ClassVar[str]
    kept: ClassVar[str]  # what remains when writing stops, for messages
    resumed: ClassVar[str]  # what the command that resumes does with the rest, for messages
    # the lock by which it is seen whether a process is at work: a shared one disturbs nobody else who looks,
    # an exclusive one sees those that share the work too
    seen_by: ClassVar[int]

    config = FileOf("config.toml")
    """The config that is run, one visible value per key."""
    dataset = FileOf("dataset.h5")
    """The dataset, once the work is finished."""
    summary = FileOf("summary.json")
    """The summary: how the work ended and what it cost."""

    @contextmanager
    def locked(self, *, shared: bool = False) -> Iterator[None]:
        """Keep out other processes (but those that share the work) inside the block; the lock disappears with
        the process, however it ends.
        """
        try:
            self.refuse_a_file()
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDONLY)  # the folder itself: no file is left behind
        except OSError as error:
            raise self.unwritable(error) from None
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
        try:
            fcntl.flock(descriptor, self.seen_by | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            os.close(descriptor)
        return False

    def refuse_a_file(self) -> None:
        """Refuse a plain file in the folder's place."""
        if self.path.exists() and not self.path.is_dir():
            raise RunFolderError(f"{self.path}: is no folder; choose another {OUT} or name")

    def content(self, ours: Collection[str]) -> set[str]:
        """Names of what the folder holds; refuses what no such work writes."""
        self.refuse_a_file()
        names = set()
        for path in self.path.iterdir() if self.path.exists() else ():
            if path.name not in ours and not path.name.startswith("."):
                raise RunFolderError(
                    f"{self.path}: holds {path.name}, which no {self.kind} writes; choose another {OUT} or "
                    "name"
                )
            if path.is_symlink():
                raise RunFolderError(f"{path}: is a symbolic link, which no {self.kind} writes; remove it")
            names.add(path.name)
        return names

    def write_summary(self, summary: SummaryPart) -> None:
        """Write ``summary.json`` atomically."""
        text = json.dumps(summary.as_dict(), indent=2, allow_nan=False)
        atomic.write_bytes(self.summary, (text + "\n").encode())

    def unwritable(self, error: OSError) -> RunFolderError:
        """The error to raise if nothing can be written."""
        return RunFolderError(
            f"{self.path}: can't be written: {error.strerror or error}; choose another {OUT}"
        )


@dataclass(frozen=True)
class RunFolder(WorkFolder):
    """Paths of one run."""

    kind = "run"
    kept = "what was saved stays"
    resumed = "continues from there"
    seen_by = fcntl.LOCK_SH

    timeline = FileOf("timeline.rrd")
    figure = FileOf("figure.png")
    """Default file of ``rigidsim plot``."""
    analysis = FileOf(ANALYSIS)
    spectrum = FileOf("analysis.png")
    """Figure of the analysis."""
    checkpoint = FileOf("checkpoint.h5")
    """Checkpoint from which a finished run can be prolonged."""
    segments = FileOf("segments")
    """Folder of the segments that an unfinished run has saved."""
    set_aside = FileOf("set_aside")
    """Folder to which segments that don't belong to the run are moved."""

    def figure_of(self, what: str) -> Path:
        """Default file of ``rigidsim plot --what`` for a figure of that name."""
        return self.path / f"figure_{what}.png"

    def begin(self, config: str, *, force: bool, kernels: Sequence[Path] = ()) -> None:
        """Make the folder ready for a new run: write its config and its kernels' places; it is under way."""
        self.create(config, force=force)
        try:
            atomic.write_bytes(self.config, config.encode())
            if kernels:
                atomic.write_bytes(self.path / NOTE, "".join(f"{place}\n" for place in kernels).encode())
            self.segments.mkdir()
        except OSError as error:
            raise self.unwritable(error) from None

    def create(self, config: str, *, force: bool) -> None:
        """Create the folder, or clear it of an earlier run; one that was begun with this config and saved
        nothing needs no force.
        """
        files = [self.config, self.dataset, self.timeline, self.summary, self.checkpoint, self.figure]
        files += [self.figure_of(name + end) for name in FIGURES for end in ("", "_slide")]
        files.append(self.figure_of("slide"))
        files += [self.analysis, self.spectrum, self.path / NOTE]
        folders = [self.segments, self.set_aside]
        try:
            present = self.content([path.name for path in files + folders])
            begun = self.config.name in present and self.config.read_bytes() == config.encode()
            drawn = {path.name for path in files if path.suffix == ".png"}
            mine = drawn | ({self.config.name} if begun else set())
            if not force and any(not name.startswith(".") for name in present - mine):
                what = "a finished run" if self.dataset.exists() else "an unfinished run"
                raise RunFolderError(
                    f"{self.path}: holds {what}; {FORCE} replaces it, another {OUT} puts this one elsewhere"
                )
            self.remove_torn()
            for path in files:  # segments go last: as long as they are there, the run isn't finished
                path.unlink(missing_ok=True)
            for path in folders:
                segments.remove(path)
            self.path.mkdir(parents=True, exist_ok=True)
            atomic.sync_folder(self.path.parent)
        except OSError as error:
            raise self.unwritable(error) from None

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

    def remove_torn(self) -> None:
        """Delete partial files that a killed process was writing or deleting."""
        for folder in (self.path, self.segments):
            for pattern in (".*.partial", ".timeline.rrd.*.part"):
                for path in folder.glob(pattern):
                    path.unlink(missing_ok=True)
        for name in (segments.REMOVED, _REOPENED):
            if (self.path / name).is_dir() and not (self.path / name).is_symlink():
                shutil.rmtree(self.path / name)

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


def find_run(path: str | Path) -> RunFolder:
    """The run at ``path``: a run folder, or a file in one."""
    given = Path(path)
    try:
        run = RunFolder(given if given.is_dir() else given.parent)
        found = run.dataset.exists() or run.segments.exists() or run.summary.exists()
        there = given.exists() and found
    except OSError as error:  # a folder that can't be entered
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    if not there:
        usual = Path("runs") / given
        hint = f"; did you mean {usual}?" if usual.is_dir() and not given.is_absolute() else ""
        raise RunFolderError(f"{path}: no run here; give a run folder (runs/NAME) or its dataset.h5{hint}")
    return run
