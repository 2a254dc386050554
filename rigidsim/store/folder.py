"""The run folder: ``config.toml``, ``dataset.h5``, ``timeline.rrd``, ``summary.json``, ``segments/``."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
from pathlib import Path

from rigidsim.errors import FORCE, OUT, RunFolderError, once_mended
from rigidsim.look.figure_names import FIGURES
from rigidsim.scene.records import dataclass
from rigidsim.store import atomic, provenance, segments
from rigidsim.store.summary import Brief, read_summary
from rigidsim.store.work_folder import WorkFolder

_REOPENED = ".segments.reopened"


@dataclass(frozen=True)
class RunFolder(WorkFolder):
    """Paths of one run."""

    kept = "what was saved stays"
    resumed = "continues from there"
    seen_by = fcntl.LOCK_SH

    @property
    def timeline(self) -> Path:
        """The rerun recording."""
        return self.path / "timeline.rrd"

    @property
    def figure(self) -> Path:
        """Where ``rigidsim plot`` draws unless told otherwise."""
        return self.path / "figure.png"

    def figure_of(self, what: str) -> Path:
        """Where ``rigidsim plot --what`` draws a figure of that name unless told otherwise."""
        return self.path / f"figure_{what}.png"

    @property
    def analysis(self) -> Path:
        """Where ``rigidsim analyse`` writes unless told otherwise."""
        return self.path / "analysis.h5"

    @property
    def spectrum(self) -> Path:
        """Its figure."""
        return self.path / "analysis.png"

    @property
    def checkpoint(self) -> Path:
        """Where a finished run can be prolonged from."""
        return self.path / "checkpoint.h5"

    @property
    def segments(self) -> Path:
        """What an unfinished run has saved."""
        return self.path / "segments"

    @property
    def set_aside(self) -> Path:
        """Segments that didn't belong, out of the way."""
        return self.path / "set_aside"

    def begin(self, config: str, *, force: bool) -> None:
        """Make the folder ready for a new run, and leave its config and the mark of a run under way there.

        Raises:
            RunFolderError: as ``create``.
        """
        self.create(force=force)
        try:
            atomic.write_bytes(self.config, config.encode())
            self.segments.mkdir()
        except OSError as error:
            raise self.unwritable(error) from None

    def create(self, *, force: bool) -> None:
        """Make the folder empty of any run.

        Raises:
            RunFolderError: it holds a run and ``force`` is false, or something that is no run, or it can't
                be written.
        """
        files = [self.config, self.dataset, self.timeline, self.summary, self.checkpoint, self.figure]
        files += [self.figure_of(name) for name in FIGURES]
        files += [self.analysis, self.spectrum]
        folders = [self.segments, self.set_aside]
        ours = files + folders
        try:
            self.refuse_a_file()
            present = list(self.path.iterdir()) if self.path.exists() else []
            foreign = [p.name for p in present if p not in ours and not p.name.startswith(".")]
            if foreign:
                raise RunFolderError(
                    f"{self.path}: holds {foreign[0]}, which no run writes; choose another {OUT} or name"
                )
            for path in present:
                if path.is_symlink():
                    raise RunFolderError(f"{path}: is a symbolic link, which no run writes; remove it")
            held = [p for p in present if p in (self.dataset, self.summary, self.segments)]
            if held and not force:
                what = "a finished run" if self.dataset.exists() else "an unfinished run"
                raise RunFolderError(
                    f"{self.path}: holds {what}; {FORCE} replaces it, another {OUT} puts this one elsewhere"
                )
            self.remove_torn()
            for path in files:  # the segments last: as long as they are there, the run isn't finished
                path.unlink(missing_ok=True)
            for path in folders:
                segments.remove(path)
            self.path.mkdir(parents=True, exist_ok=True)
            atomic.sync_folder(self.path.parent)
        except OSError as error:
            raise self.unwritable(error) from None

    @property
    def read_only(self) -> OSError | None:
        """Why nothing can be written here, as far as can be told without trying; None where it can."""
        for place in (self.path, self.segments):
            if not place.is_dir() or _may_write(place):
                continue
            mounted = os.statvfs(place).f_flag & os.ST_RDONLY
            number = errno.EROFS if mounted else errno.EACCES
            return OSError(number, os.strerror(number), str(place))
        return None

    def refuse_read_only(self) -> None:
        """Before hours of work whose result could not be saved.

        Raises:
            RunFolderError: the folder can't be written.
        """
        error = self.read_only
        if error is not None:
            raise RunFolderError(
                f"{error.filename}: can't be written: {error.strerror}; {once_mended(error)}, give the "
                "command again (info, verify, plot --out and export --out need no writing here)"
            )

    def remove_torn(self) -> None:
        """Delete what a killed process was writing, or deleting, when it died."""
        for folder in (self.path, self.segments):
            for pattern in (".*.partial", ".timeline.rrd.*.part"):
                for path in folder.glob(pattern):
                    path.unlink(missing_ok=True)
        for name in (segments.REMOVED, _REOPENED):
            if (self.path / name).is_dir() and not (self.path / name).is_symlink():
                shutil.rmtree(self.path / name)

    def reopen(self) -> None:
        """Make a finished run unfinished: its dataset becomes the first segment, its checkpoint the second.

        In one step for whoever looks, and for a crash: before it the run is finished, after it it isn't.
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

    def write_summary(self, summary: Brief) -> None:
        """Write ``summary.json`` atomically."""
        text = json.dumps(summary.as_dict(), indent=2, allow_nan=False)
        atomic.write_bytes(self.summary, (text + "\n").encode())

    def note_timeline(self, summary: Brief, drawn: Path) -> None:
        """Name the timeline that was drawn again for a complete run in its summary, for ``verify``."""
        if drawn == self.timeline and summary.dataset_digest is not None and not self.segments.exists():
            self.write_summary(summary.having(timeline_sha256=provenance.file_sha256(drawn)))

    def read_summary(self) -> Brief:
        """The summary; a run that was killed has none and reads as "running".

        Raises:
            RunFolderError: damaged.
        """
        if not self.summary.exists():
            return Brief(status="running", message="the run is under way, or was killed")
        return read_summary(self.summary)


def _may_write(folder: Path) -> bool:
    """Root may write everywhere, but not to a file system that is mounted read-only."""
    return os.access(
        folder, os.R_OK | os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids
    )


def find_run(path: str | Path) -> RunFolder:
    """The run at ``path``: a run folder, or a file in one.

    Raises:
        RunFolderError: there is none.
    """
    given = Path(path)
    try:
        run = RunFolder(given if given.is_dir() else given.parent)
        found = run.dataset.exists() or run.segments.exists() or run.summary.exists()
        there = given.exists() and found
    except OSError as error:  # a folder that may not be entered
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    if not there:
        usual = Path("runs") / given
        hint = f"; did you mean {usual}?" if usual.is_dir() and not given.is_absolute() else ""
        raise RunFolderError(f"{path}: no run here; give a run folder (runs/NAME) or its dataset.h5{hint}")
    return run
