"""Runs in processes of their own, the moments at which something happens to them, and what must be left."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import rigidsim
from experiments.durability.judging import Tally, ended, names
from experiments.durability.scenes import Undisturbed, same, text_of, tuning_of
from rigidsim.errors import RigidsimError
from rigidsim.session.session import Observer, Tuning


def child(work: Callable[[], object], log: Path) -> int:
    """Do something in a process of its own; returns its id. Its exit code is 0 when nothing was raised, that
    of the command line for what it says to users, and 9 for anything else.
    """
    pid = os.fork()
    if pid:
        return pid
    code = 9
    try:
        os.nice(5)
        with log.open("a") as file:
            os.dup2(file.fileno(), 2)
        sys.stderr = os.fdopen(2, "w", closefd=False)  # a test's capture has put something else there
        work()
        code = 0
    except RigidsimError as error:
        print(error, file=sys.stderr)
        code = error.exit_code
    except BaseException as error:
        print(repr(error), file=sys.stderr)
    finally:
        sys.stderr.flush()
        os._exit(code)


def exit_code(pid: int) -> int:
    """Wait for a child to end."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def work_on(
    folder: Path, text: str, tuning: Tuning | None = None, observer: Observer | None = None
) -> Callable[[], object]:
    """Begin the run of a folder, or go on with it."""
    begun = (folder / "segments").exists() or (folder / "dataset.h5").exists()
    how = {"tuning": tuning or tuning_of(folder.name), "observer": observer}
    if begun:
        return lambda: rigidsim.resume(folder, **how)
    return lambda: rigidsim.run(rigidsim.parse(text), out=folder.parent, force=True, **how)


def in_turn(scenes: Sequence[str], trials: int, deadline: float) -> Iterator[tuple[int, str]]:
    """Numbers, and scenes one after the other, until there are enough or no time is left."""
    for number in range(trials):
        if time.monotonic() > deadline:
            return
        yield number, scenes[number % len(scenes)]


@dataclass(frozen=True)
class Trial:
    """A run that is disturbed again and again, in a folder with the name of its scene.

    Attributes:
        wholes: undisturbed runs.
        title: for messages.
    """

    tally: Tally
    wholes: Undisturbed
    run: Path
    title: str

    def begin(self, tuning: Tuning | None = None, observer: Observer | None = None) -> int:
        """Begin the run or go on with it, in a process; returns its id."""
        log = self.run.parent.with_suffix(".log")
        log.touch()
        return child(work_on(self.run, text_of(self.run.name), tuning, observer), log)

    @property
    def told(self) -> str:
        """What the processes wrote."""
        return self.run.parent.with_suffix(".log").read_text()

    def expect(self, good: bool, what: str) -> bool:
        """Note a failure."""
        return self.tally.expect(good, f"{self.title}: {what}; said {self.told[-300:]}")

    def check(self, acknowledged: int) -> None:
        """The folder is readable, and has all acknowledged rows (-1: all there are) in the right bits."""
        reference = self.wholes[self.run.name]
        acknowledged = reference.sizes["time"] if acknowledged < 0 else acknowledged
        saved = (self.run / "segments").exists() or (self.run / "dataset.h5").exists()
        try:
            opened = rigidsim.open_run(self.run) if saved else None
            if opened is None or not opened.saved:
                self.expect(acknowledged == 0, f"nothing saved, {acknowledged} rows acknowledged")
                return
            with opened.dataset as found:
                rows = found.sizes["time"]
                self.expect(rows >= acknowledged, f"{rows} rows, {acknowledged} acknowledged")
                difference = same(found, reference, rows)
                self.expect(not difference, f"{difference} differs")
        except RigidsimError as error:
            self.expect(False, f"unreadable: {error}")

    def finish(self, tuning: Tuning | None = None, observer: Observer | None = None) -> None:
        """Let the run come to its end, which is the undisturbed one's."""
        if ended(self.run):
            rigidsim.resume(self.run)  # cleans up
        else:
            code = exit_code(self.begin(tuning, observer))
            if not self.expect(code == 0, f"ended with {code}"):
                return
        run, reference = rigidsim.open_run(self.run), self.wholes[self.run.name]
        with run.dataset as found:
            difference = same(found, reference)
            steps = found.attrs["steps"] == reference.attrs["steps"]
        good = run.status == "finished" and not difference and steps
        self.expect(good, f"complete: {difference or run.status}")
        left = {"config.toml", "dataset.h5", "summary.json", "checkpoint.h5"}
        self.expect(names(self.run) == left, f"left behind {names(self.run) ^ left}")
        self.tally.counts["completed runs identical"] += not difference


def await_moment(pid: int, folder: Path, kind: str, delay: float, nth: int) -> bool:
    """Wait for a moment; False when the child ended before.

    Args:
        kind: "any": ``delay`` seconds from now; "writing": while the ``nth`` temporary file from now is
            written; "named": just after the ``nth`` file from now got its name.
    """
    deadline = time.monotonic() + (delay if kind == "any" else 20.0)
    seen, count = names(folder), 0
    while time.monotonic() < deadline:
        if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return False
        if kind == "any":
            time.sleep(0.0005)
            continue
        time.sleep(0.0002)
        now = names(folder)
        new = now - seen
        seen = now
        writing = any(name.endswith(".partial") for name in new)
        named = any(not name.startswith(".") for name in new)
        if (kind == "writing" and writing) or (kind == "named" and named):
            count += 1
            if count >= nth:
                time.sleep(delay % 0.002)
                return True
    return True
