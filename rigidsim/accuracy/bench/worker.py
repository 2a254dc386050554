"""Settings measured in processes of their own, to which speed, crashes and endless compilations are confined.

Two integrators that are built alike can differ in speed for their whole life, by a factor of up to 2.6, so
that speeds have to be compared over fresh processes.

Speed is measured per natural step (of a closed form: per sample), in passes over the motion's beginning that
are repeated until they can be told from noise. Recording costs the same in every setting and isn't counted.
"""

import math
import statistics
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Self

import mpmath
import numpy as np

from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import Trial, trial_scene, try_setting
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.config import Experiment, parse
from rigidsim.solve.assembly import assemble
from rigidsim.solve.closed_form import closed_form_of
from rigidsim.solve.compiled import quieten_engine
from rigidsim.solve.problem import prepare_scene
from rigidsim.solve.status import Status

_SHORTEST_PASS = 4e-3  # CPU seconds: the clock's own resolution is a microsecond, a call's cost ten
_LONGEST_WARMING = 2000  # steps
_CLOSED_ROWS = {True: 2000, False: 4}  # of a pass in double, and in mpmath


@dataclass(frozen=True)
class Task:
    """A setting to be integrated over some times (s), within ``patience`` CPU seconds; with ``speed_steps``
    its speed to be measured instead, for so long and over no more than so many steps.
    """

    setting: Setting
    times: tuple[float, ...]
    patience: float = field(default=math.inf, compare=False)
    speed_steps: int | None = None


@dataclass(frozen=True)
class Answer:
    """Result of one task: its trial or seconds per unit, and why not, or not to the end, if so."""

    trial: Trial | None = None
    seconds: float = math.nan
    problem: str = ""


def _attitudes(experiment: Experiment, task: Task, times: list[mpmath.mpf]) -> Answer:
    until = time.process_time() + task.patience
    go_on = lambda _: Status.WALL_TIME if time.process_time() > until else None  # noqa: E731
    trial = try_setting(experiment, task.setting, times, go_on=go_on)
    if trial.status is Status.WALL_TIME:
        return Answer(trial, problem=f"took longer than {task.patience:.3g} s, its part of the budget")
    return Answer(trial, problem="" if trial.status is Status.FINISHED else trial.status.message)


def _speed(experiment: Experiment, task: Task, times: list[mpmath.mpf]) -> Answer:
    """CPU seconds per natural step, or per sample of a closed form: the median of several passes, which are
    lengthened until they can be measured.
    """
    most = task.speed_steps or 1
    scene = trial_scene(experiment, task.setting, times)
    prepared = prepare_scene(experiment, scene, tolerance=task.setting.tolerance)
    if prepared.has_steps:
        corrected = assemble(prepared).steps()
        start = corrected.boundary()

        def one_pass(steps: int) -> None:
            corrected.back_to(start)
            corrected.skip(steps)

        one_pass(min(most, _LONGEST_WARMING))  # charts are compiled when first needed
        count = min(32, most)
    else:
        closed, clock, precision = closed_form_of(scene), prepared.clock, prepared.precision
        rows = np.resize(clock.internal(0, clock.count), _CLOSED_ROWS[precision.narrow])

        def one_pass(steps: int) -> None:
            closed.states(prepared.system, precision, rows, clock.start)

        count = most = len(rows)
    begun, passes = time.process_time(), list[float]()
    while not passes or time.process_time() - begun <= task.patience:
        started = time.process_time()
        one_pass(count)
        spent = time.process_time() - started
        if spent < _SHORTEST_PASS and count < most and time.process_time() - begun < task.patience:
            count = min(2 * count, most)
        else:
            passes.append(spent / count)
    return Answer(seconds=statistics.median(passes))


def work(descriptor: int) -> None:
    """Do the tasks that come over a connection, answering each."""
    quieten_engine()
    tasks = Connection(descriptor)
    text, source = tasks.recv()
    experiment = parse(text, source=source)
    while True:
        try:
            task: Task = tasks.recv()
        except EOFError:
            return
        try:
            do = _attitudes if task.speed_steps is None else _speed
            found = do(experiment, task, [mpmath.mpf(t) for t in task.times])
        except ConfigError as error:
            found = Answer(problem="; ".join(map(str, error.problems)))
        except (RigidsimError, OverflowError, ZeroDivisionError, ValueError) as error:
            name = "" if isinstance(error, RigidsimError) else f"{type(error).__name__}: "
            found = Answer(problem=f"{name}{error}")
        tasks.send(found)


class Worker:
    """A fresh process that does one task after the other; a new one follows where it dies."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self._stopped = experiment, False
        self._child: tuple[subprocess.Popen[bytes], Connection] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop; what another thread waits for then has no answer."""
        self._stopped = True
        if self._child is not None:
            self._child[0].kill()

    def answer(self, task: Task, until: float) -> Answer | None:
        """Its answer; None if that isn't there by a time (of ``time.monotonic``), or the worker was stopped.
        A task on which the process dies is answered with that.
        """
        child, tasks = self._child = self._child or self._begun()
        late = False
        with suppress(EOFError, OSError):  # it ended, perhaps within an answer
            tasks.send(task)
            late = not tasks.poll(max(0.0, until - time.monotonic()))
            if not late:
                found: Answer = tasks.recv()
                return found
        self._child = None
        if late:
            child.kill()
        tasks.close()
        code = child.wait()
        if late or self._stopped:
            return None
        return Answer(problem=f"the process that measured it ended with code {code}")

    def _begun(self) -> tuple[subprocess.Popen[bytes], Connection]:
        ours, theirs = Pipe()
        call = f"from rigidsim.accuracy.bench import worker; worker.work({theirs.fileno()})"
        child = subprocess.Popen([sys.executable, "-c", call], pass_fds=[theirs.fileno()])
        theirs.close()
        ours.send((self._experiment.text, self._experiment.source))
        return child, ours
