"""Settings measured in processes of their own, to which speed, crashes and endless compilations are confined.

Two integrators that are built alike can differ in speed for their whole life, by a factor of up to 2.6, so
that speeds have to be compared over fresh processes. A process gets its tasks as JSON on stdin and answers
with one line of JSON for each as it goes along; whoever started it stops it when time is up.

Speed is measured per natural step (of a closed form: per sample), in passes over the motion's beginning that
are repeated until they can be told from noise. Recording costs the same in every setting and isn't counted.
"""

from __future__ import annotations

import json
import queue
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TextIO

import mpmath
import numpy as np

from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import trial_scene, try_setting
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.config import Experiment, parse
from rigidsim.solve.assembly import assemble
from rigidsim.solve.closed_form import closed_form_of
from rigidsim.solve.problem import prepare_scene
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status

_SHORTEST_PASS = 4e-3  # CPU seconds: the clock's own resolution is a microsecond, a call's cost ten
_LONGEST_WARMING = 2000  # steps
_CLOSED_ROWS = {True: 2000, False: 4}  # of a pass in double, and in mpmath


@dataclass(frozen=True)
class Task:
    """What to do with one setting.

    Attributes:
        kind: "attitudes" (integrate and answer with attitudes and drifts) or "speed".
        times: sample times, s.
        patience: CPU seconds that an integration may take, or that repeated passes should take.
        steps: steps of the whole motion, if known, since passes don't go past its end.
    """

    setting: Setting
    kind: str
    times: tuple[float, ...]
    patience: float
    steps: int = 1_000_000

    def as_json(self) -> dict[str, Any]:
        """JSON values for ``task_of``."""
        return asdict(self)


def task_of(given: dict[str, Any]) -> Task:
    """A task from its JSON values."""
    return Task(**{**given, "setting": Setting(**given["setting"]), "times": tuple(given["times"])})


@dataclass(frozen=True)
class Answer:
    """Result of one task.

    Attributes:
        index: index of the task.
        values: what was measured; empty if nothing was.
        problem: why not, or not to the end, in words; None if all went well.
    """

    index: int
    values: dict[str, Any]
    problem: str | None = None


# --- in the process that measures ------------------------------------------------------------------------


def attitudes(experiment: Experiment, task: Task) -> dict[str, Any]:
    """Integrate over the task's times.

    Returns:
        ``attitudes`` (parts, samples, 4), drifts, steps, order, work and CPU seconds; ``problem`` where the
        motion ended before the last time.
    """
    started = time.process_time()

    def go_on(_: Progress) -> Status | None:
        return Status.WALL_TIME if time.process_time() - started > task.patience else None

    trial = try_setting(experiment, task.setting, [mpmath.mpf(t) for t in task.times], go_on=go_on)
    found: dict[str, Any] = {
        "attitudes": [part.tolist() for part in trial.attitudes],
        "drifts": trial.drifts,
        "steps": trial.steps,
        "order": trial.order,
        "work": trial.work,
        "rows": trial.rows,
        "cpu_seconds": trial.cpu_seconds,
    }
    if trial.status is Status.WALL_TIME:
        found["problem"] = f"took longer than {task.patience:.3g} s, its part of the budget"
    elif trial.status is not Status.FINISHED:
        found["problem"] = trial.status.message
    return found


def speed(experiment: Experiment, task: Task) -> dict[str, Any]:
    """CPU seconds per natural step, or per sample of a closed form: the median of several passes."""
    times = [mpmath.mpf(t) for t in task.times]
    scene = trial_scene(experiment, task.setting, times)
    prepared = prepare_scene(experiment, scene, tolerance=task.setting.tolerance)
    if not prepared.has_steps:
        closed, system, precision = closed_form_of(scene), prepared.system, prepared.precision
        rows = np.resize(prepared.clock.internal(0, prepared.clock.count), _CLOSED_ROWS[precision.narrow])
        begin = prepared.clock.start

        def one_pass(_: int) -> bool:
            closed.states(system, precision, rows, begin)
            return True

        return {"seconds": _per_unit(one_pass, len(rows), len(rows), task.patience)}
    corrected = assemble(prepared).steps()
    start = corrected.boundary()

    def steps(count: int) -> bool:
        corrected.back_to(start)
        return corrected.skip(count)

    steps(min(task.steps, _LONGEST_WARMING))  # charts are compiled when first needed
    return {"seconds": _per_unit(steps, min(32, task.steps), task.steps, task.patience)}


def _per_unit(one_pass: Callable[[int], bool], count: int, most: int, patience: float) -> float:
    """Median over passes of the seconds per unit; passes are lengthened until they can be measured."""
    begun, passes = time.process_time(), []
    while True:
        started = time.process_time()
        one_pass(count)
        ended = time.process_time()
        spent = ended - started
        if spent < _SHORTEST_PASS and count < most and ended - begun < patience:
            count = min(2 * count, most)
            continue
        passes.append(spent / count)
        if ended - begun > patience:
            return statistics.median(passes)


def work(stdin: TextIO, stdout: TextIO) -> None:
    """Do the tasks given on stdin, answering on stdout."""
    given = json.load(stdin)
    experiment = parse(given["text"], source=given["source"])
    for index, table in enumerate(given["tasks"]):
        task = task_of(table)
        answer: dict[str, Any] = {"index": index}
        try:
            answer |= attitudes(experiment, task) if task.kind == "attitudes" else speed(experiment, task)
        except RigidsimError as error:
            answer["problem"] = refusal(error)
        except (OverflowError, ZeroDivisionError, ValueError) as error:
            answer["problem"] = f"{type(error).__name__}: {error}"
        print(json.dumps(answer), file=stdout, flush=True)


def refusal(error: RigidsimError) -> str:
    """An error's problems on one line."""
    return "; ".join(map(str, error.problems)) if isinstance(error, ConfigError) else str(error)


# --- in the process that asks ----------------------------------------------------------------------------


def ask(
    experiment: Experiment,
    tasks: Sequence[Task],
    *,
    deadline: float,
    first_by: float = 0.0,
    python: str = sys.executable,
) -> Iterator[Answer]:
    """Answers to tasks as they come, in order, from a fresh process.

    A task on which the process dies is answered with that, and a new process goes on with the rest. When time
    is up the process is stopped, and the tasks that are left have no answer.

    Args:
        deadline: deadline on ``time.monotonic``'s clock.
        first_by: deadline of the first answer, which may be later.
        python: interpreter of the process.
    """
    first = 0
    while first < len(tasks):
        child = _Child(experiment, tasks[first:], python)
        try:
            following = yield from _answers(child, first, deadline, first_by)
        finally:
            child.end()
        if following is None:
            return
        if following < len(tasks):
            words = f"the process that measured it ended with code {child.code}{child.last_words()}"
            yield Answer(following, {}, words)
            following += 1
        first = following


def _answers(
    child: _Child, first: int, deadline: float, first_by: float
) -> Generator[Answer, None, int | None]:
    """Yield answers; returns the first task without an answer, or None when time is up."""
    following = first
    while True:
        try:
            until = deadline if following else max(deadline, first_by)
            line = child.lines.get(timeout=max(0.0, until - time.monotonic()))
        except queue.Empty:
            return None
        if line is None:
            return following
        values = json.loads(line)
        values.pop("index")
        problem = values.pop("problem", None)
        yield Answer(following, values, problem)
        following += 1


class _Child:
    """A process with its tasks, and the lines that it writes."""

    def __init__(self, experiment: Experiment, tasks: Sequence[Task], python: str) -> None:
        self._process = subprocess.Popen(
            [python, "-m", "rigidsim.accuracy.bench.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self._process.stdin is not None
        self.lines: queue.Queue[str | None] = queue.Queue()
        self._errors: list[str] = []
        self._closed = False
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._read, self._listen)]
        for reader in self._readers:
            reader.start()
        given = {
            "text": experiment.text,
            "source": experiment.source,
            "tasks": [task.as_json() for task in tasks],
        }
        try:
            with self._process.stdin as pipe:
                json.dump(given, pipe)
        except BrokenPipeError:  # it is gone already: the end of its lines tells
            pass

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.put(line)
        self._closed = True
        self.lines.put(None)

    def _listen(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._errors = [*self._errors[-4:], line.strip()]

    @property
    def code(self) -> int | None:
        """Exit code; None while it runs."""
        return self._process.returncode

    def last_words(self) -> str:
        """The last line that it wrote on stderr."""
        return f" ({self._errors[-1]})" if self._errors else ""

    def end(self) -> None:
        """Stop the process if it still runs."""
        try:
            self._process.wait(timeout=5.0 if self._closed else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join(timeout=5)


if __name__ == "__main__":
    work(sys.stdin, sys.stdout)
