"""Settings measured in processes of their own, to which speed, crashes and endless compilations are confined.

Two integrators that are built alike can differ in speed for their whole life, by a factor of up to 2.6, so
that speeds have to be compared over fresh processes.

Speed is measured per natural step (of a closed form: per sample), in passes over the motion's beginning that
are repeated until they can be told from noise. Recording costs the same in every setting and isn't counted.
"""

import math
import pickle
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from io import BufferedReader
from select import select
from typing import IO, Self, cast

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
from rigidsim.solve.sampler import Progress
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
    patience: float = field(compare=False)
    speed_steps: int | None = None


@dataclass(frozen=True)
class Answer:
    """Result of one task: its trial or seconds per unit, and why not, or not to the end, if so."""

    trial: Trial | None = None
    seconds: float = math.nan
    problem: str = ""


def _attitudes(experiment: Experiment, task: Task) -> Answer:
    started = time.process_time()

    def go_on(_: Progress) -> Status | None:
        return Status.WALL_TIME if time.process_time() - started > task.patience else None

    trial = try_setting(experiment, task.setting, [mpmath.mpf(t) for t in task.times], go_on=go_on)
    if trial.status is Status.WALL_TIME:
        return Answer(trial, problem=f"took longer than {task.patience:.3g} s, its part of the budget")
    return Answer(trial, problem="" if trial.status is Status.FINISHED else trial.status.message)


def _speed(experiment: Experiment, task: Task) -> Answer:
    """CPU seconds per natural step, or per sample of a closed form: the median of several passes."""
    most = task.speed_steps or 1
    scene = trial_scene(experiment, task.setting, [mpmath.mpf(t) for t in task.times])
    prepared = prepare_scene(experiment, scene, tolerance=task.setting.tolerance)
    if not prepared.has_steps:
        closed, system, precision = closed_form_of(scene), prepared.system, prepared.precision
        rows = np.resize(prepared.clock.internal(0, prepared.clock.count), _CLOSED_ROWS[precision.narrow])
        begin = prepared.clock.start

        def one_pass(_: int) -> None:
            closed.states(system, precision, rows, begin)

        return Answer(seconds=_per_unit(one_pass, len(rows), len(rows), task.patience))
    corrected = assemble(prepared).steps()
    start = corrected.boundary()

    def steps(count: int) -> None:
        corrected.back_to(start)
        corrected.skip(count)

    steps(min(most, _LONGEST_WARMING))  # charts are compiled when first needed
    return Answer(seconds=_per_unit(steps, min(32, most), most, task.patience))


def _per_unit(one_pass: Callable[[int], None], count: int, most: int, patience: float) -> float:
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


def work() -> None:
    """Do the tasks that come on stdin, answering each on stdout."""
    quieten_engine()
    given, answers = cast(BufferedReader, sys.stdin.buffer), sys.stdout.buffer
    text, source = pickle.load(given)
    experiment = parse(text, source=source)
    while given.peek(1):
        task: Task = pickle.load(given)
        try:
            found = (_attitudes if task.speed_steps is None else _speed)(experiment, task)
        except ConfigError as error:
            found = Answer(problem="; ".join(map(str, error.problems)))
        except (RigidsimError, OverflowError, ZeroDivisionError, ValueError) as error:
            name = "" if isinstance(error, RigidsimError) else f"{type(error).__name__}: "
            found = Answer(problem=f"{name}{error}")
        _send(answers, found)


def _send(to: IO[bytes], what: object) -> None:
    pickle.dump(what, to)
    to.flush()


class Worker:
    """A fresh process that does one task after the other; a new one follows where it dies."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self._stopped = experiment, False
        self._child: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop; what another thread waits for then has no answer."""
        self._stopped = True
        if self._child is not None:
            self._child.kill()

    def answer(self, task: Task, until: float) -> Answer | None:
        """Its answer; None if that isn't there by a time (of ``time.monotonic``), or the worker was stopped.
        A task on which the process dies is answered with that.
        """
        command = [sys.executable, "-c", "from rigidsim.accuracy.bench import worker; worker.work()"]
        pipe, begun = subprocess.PIPE, self._child
        child = self._child = begun or subprocess.Popen(command, stdin=pipe, stdout=pipe)
        assert child.stdin is not None
        assert child.stdout is not None
        late = False
        with suppress(EOFError, OSError, pickle.UnpicklingError):  # it ended, perhaps within an answer
            if begun is None:
                _send(child.stdin, (self._experiment.text, self._experiment.source))
            _send(child.stdin, task)
            late = not select([child.stdout], [], [], max(0.0, until - time.monotonic()))[0]
            if not late:
                found: Answer = pickle.load(child.stdout)
                return found
        self._child = None
        if late:
            child.kill()
        with suppress(BrokenPipeError), child:  # closes its pipes, and waits
            pass
        if late or self._stopped:
            return None
        return Answer(problem=f"the process that measured it ended with code {child.returncode}")
