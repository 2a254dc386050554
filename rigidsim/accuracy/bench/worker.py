"""Settings measured in processes of their own, to which speed, crashes and endless compilations are confined.

Two integrators that are built alike can differ in speed for their whole life, by a factor of up to 2.6, so
that speeds have to be compared over fresh processes. A process gets its tasks on stdin and answers one after
the other on stdout; whoever started it stops it when time is up.

Speed is measured per natural step (of a closed form: per sample), in passes over the motion's beginning that
are repeated until they can be told from noise. Recording costs the same in every setting and isn't counted.
"""

import math
import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Literal

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
    """What to do with one setting: integrate it over some times (s), which may take ``patience`` CPU seconds,
    or measure its speed, for so long and over no more than the whole motion's steps.
    """

    setting: Setting
    kind: Literal["attitudes", "speed"]
    times: tuple[float, ...]
    patience: float
    steps: int = 1_000_000


@dataclass(frozen=True)
class Answer:
    """Result of one task: its trial or seconds per unit, and why not, or not to the end, if so."""

    trial: Trial | None = None
    seconds: float = math.nan
    problem: str | None = None
    index: int = 0


def _attitudes(experiment: Experiment, task: Task) -> Answer:
    """Integrate over the task's times."""
    started = time.process_time()

    def go_on(_: Progress) -> Status | None:
        return Status.WALL_TIME if time.process_time() - started > task.patience else None

    trial = try_setting(experiment, task.setting, [mpmath.mpf(t) for t in task.times], go_on=go_on)
    problem = None if trial.status is Status.FINISHED else trial.status.message
    if trial.status is Status.WALL_TIME:
        problem = f"took longer than {task.patience:.3g} s, its part of the budget"
    return Answer(trial, problem=problem)


def _speed(experiment: Experiment, task: Task) -> Answer:
    """CPU seconds per natural step, or per sample of a closed form: the median of several passes."""
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

    steps(min(task.steps, _LONGEST_WARMING))  # charts are compiled when first needed
    return Answer(seconds=_per_unit(steps, min(32, task.steps), task.steps, task.patience))


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
    """Do the tasks given on stdin, answering on stdout."""
    quieten_engine()
    text, source, tasks = pickle.load(sys.stdin.buffer)
    experiment, answers = parse(text, source=source), Connection(sys.stdout.fileno(), readable=False)
    for task in tasks:
        measure = _attitudes if task.kind == "attitudes" else _speed
        try:
            found = measure(experiment, task)
        except ConfigError as error:
            found = Answer(problem="; ".join(map(str, error.problems)))
        except RigidsimError as error:
            found = Answer(problem=str(error))
        except (OverflowError, ZeroDivisionError, ValueError) as error:
            found = Answer(problem=f"{type(error).__name__}: {error}")
        answers.send(found)


def ask(
    experiment: Experiment, tasks: Sequence[Task], *, deadline: float, first_by: float = 0.0
) -> Iterator[Answer]:
    """Answers to tasks as they come, in order, from a fresh process.

    A task on which the process dies is answered with that, and a new process goes on with the rest. At the
    deadline (``time.monotonic``), that of the first answer at least ``first_by``, the process is stopped, and
    the tasks that are left have no answer.
    """
    command = [sys.executable, "-c", "from rigidsim.accuracy.bench import worker; worker.work()"]
    pipe = subprocess.PIPE
    following = 0
    while following < len(tasks):
        with (
            tempfile.TemporaryFile() as errors,
            subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors) as child,
        ):
            assert child.stdin is not None
            assert child.stdout is not None
            try:
                with suppress(BrokenPipeError), child.stdin:  # if it is gone, the end of its answers tells
                    pickle.dump((experiment.text, experiment.source, tasks[following:]), child.stdin)
                with Connection(os.dup(child.stdout.fileno()), writable=False) as answers:
                    while following < len(tasks):
                        until = deadline if following else max(deadline, first_by)
                        if not answers.poll(max(0.0, until - time.monotonic())):
                            return
                        yield replace(answers.recv(), index=following)
                        following += 1
            except (EOFError, OSError):  # it ended, perhaps within an answer
                code = child.wait()
            finally:
                child.kill()
            if following < len(tasks):
                errors.seek(0)
                last = errors.read().decode(errors="replace").splitlines()[-1:]
                words = "".join(f" ({line.strip()})" for line in last)
                problem = f"the process that measured it ended with code {code}{words}"
                yield Answer(problem=problem, index=following)
                following += 1
