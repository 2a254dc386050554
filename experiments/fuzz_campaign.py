"""Can a config or a run folder from a stranger hurt rigidsim? Seeded fuzzing at any size.

    python -m experiments.fuzz_campaign --configs 100000 --files 10000

Every case may end in one of two ways: it is read, or it is refused with one clear message (a RigidsimError).
A traceback, a hang (``--seconds`` per case), a crash of the process or memory beyond ``--megabytes`` is a
defect; its case is kept in ``--keep`` and the exit code is 1. Cases run in a child process, which is renewed
when it dies, one at a time; a case is named by the seed and its number, and ``--configs 1 --files 0
--first N`` repeats one.
"""

import contextlib
import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments import fuzzing
from experiments.common import Command
from rigidsim.errors import ConfigError, RigidsimError

LONGEST_MESSAGE = 20_000
PREPARED_EVERY, PLANNED_EVERY = 20, 1000
RUN = """
name = "base"
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.3, 1.0, 0.5]
[[events]]
name = "flip"
expression = "wy"
[time]
end = 200
samples = 201
[integrator]
precision = {precision}
[output]
timeline = false
[limits]
max_steps = {steps}
"""


class TooSlow(BaseException):
    """A case took longer than it may; no library's ``except Exception`` can swallow it."""


def config_case(number: int, seed: int, folder: Path) -> str:
    """Load one hostile config and build its scene; some are prepared and planned as well."""
    from rigidsim.scene.config import load
    from rigidsim.scene.scene import build_scene
    from rigidsim.solve.problem import prepare
    from rigidsim.workflows.plan import plan

    path = folder / "case.toml"
    path.write_bytes(fuzzing.hostile_config(random.Random(f"{seed} config {number}")))
    try:
        experiment = load(path)
        build_scene(experiment)
        if number % PREPARED_EVERY == 0:
            prepare(experiment)
        if number % PLANNED_EVERY == 0:
            plan(experiment)
    except RigidsimError as error:
        return _judged(error)
    return "accepted"


def _judged(error: RigidsimError) -> str:
    """A refusal must be one message of readable length that names a place."""
    text = str(error)
    if not text.strip() or len(text) > LONGEST_MESSAGE:
        raise AssertionError(f"a message of {len(text)} characters")
    if not all(c.isprintable() or c == "\n" for c in text):
        raise AssertionError(f"a message with control characters: {text[:200]!r}")
    if isinstance(error, ConfigError):
        places = [problem.where for problem in error.problems]
        if not all(places) or not all(problem.what for problem in error.problems):
            raise AssertionError(f"a problem without place or text: {text}")
    return "refused"


def base_runs(folder: Path) -> list[Path]:
    """Run folders to damage: finished and unfinished, in double and beyond."""
    import rigidsim

    made = []
    for precision in ('"double"', '"quadruple"'):
        for steps in (100_000, 20):
            out = folder / f"{len(made)}"
            experiment = rigidsim.parse(RUN.format(precision=precision, steps=steps))
            made.append(rigidsim.run(experiment, out=out).folder.path)
    return made


def file_case(number: int, seed: int, folder: Path, bases: list[Path]) -> str:
    """Damage one file of a copied run folder and read everything in it."""
    from rich.console import Console

    from rigidsim.cli.screens import summary as report
    from rigidsim.scene.config import load
    from rigidsim.store.run import open_run

    rng = random.Random(f"{seed} file {number}")
    target = folder / "run"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(rng.choice(bases), target)
    files = sorted(p for p in target.rglob("*") if p.is_file() and p.suffix in (".h5", ".json", ".toml"))
    path = rng.choice(files)
    path.write_bytes(_spoiled(path, rng, bases))
    if rng.random() < 0.3:  # a stranger's folder whose checksum was made to fit
        _resealed(target)
    try:
        load(target / "config.toml")
    except RigidsimError as error:
        _judged(error)
    try:
        opened = open_run(target)
        report.print_summary(opened.outcome, "run", Console(file=io.StringIO(), width=110))
        json.dumps(opened.summary)
        with opened.dataset as dataset:
            dataset.load()
    except RigidsimError as error:
        return _judged(error)
    return "read"


def _spoiled(path: Path, rng: random.Random, bases: list[Path]) -> bytes:
    others = sorted(p for p in rng.choice(bases).rglob("*") if p.is_file())
    other = rng.choice(others).read_bytes()
    content = path.read_bytes()
    if rng.random() < 0.1:
        foreign = [b"", b"\x89HDF\r\n\x1a\n", b"{}", b"[]", b"null", b"[" * 100_000]
        return rng.choice([*foreign, other, content[:-1]])
    if path.suffix == ".json" and rng.random() < 0.7:
        tree = json.loads(content)
        try:
            for _ in range(rng.choice([1, 1, 2, 5])):
                fuzzing.mutate(tree, tree, rng)
            return json.dumps(tree, default=str).encode("utf-8", "surrogatepass")
        except (ValueError, RecursionError):  # a tree within itself, or a number past what can be written
            return b"[" * 100_000
    return fuzzing.damaged(content, other, rng)


def _resealed(target: Path) -> None:
    from rigidsim.store.provenance import file_sha256

    with contextlib.suppress(OSError, ValueError, TypeError, RecursionError):
        summary = json.loads((target / "summary.json").read_text())
        if "dataset_sha256" in summary:
            summary["dataset_sha256"] = file_sha256(target / "dataset.h5")
            (target / "summary.json").write_text(json.dumps(summary))


def _alarm(*_: Any) -> None:
    raise TooSlow


def _guarded(case: Callable[[int], str], number: int, seconds: float) -> tuple[str, str]:
    """The case's outcome, and what went wrong if it is a defect."""
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        return case(number), ""
    except TooSlow:
        return "HANG", traceback.format_exc()
    except BaseException:
        return "TRACEBACK", traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def campaign(
    case: Callable[[int], str], numbers: range, *, seconds: float, megabytes: int, label: str
) -> tuple[Counter[str], dict[int, str]]:
    """Run the cases in a child process that is renewed when it dies.

    Returns:
        How often each outcome was seen, and the defects by case number.
    """
    counts: Counter[str] = Counter()
    defects: dict[int, str] = {}
    following = numbers.start
    while following < numbers.stop:
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reader)
            _serve(case, range(following, numbers.stop), seconds, megabytes, writer)
        os.close(writer)
        with os.fdopen(reader) as results:
            for line in results:
                number, outcome, text = json.loads(line)
                following = number + 1
                counts[outcome] += 1
                if text:
                    defects[number] = text
                    print(f"{label} {number}: {outcome}: {text.strip().splitlines()[-1][:300]}", flush=True)
                if following % 5000 == 0:
                    print(f"{label} {following}: {dict(counts)}", file=sys.stderr, flush=True)
        _, status = os.waitpid(child, 0)
        if following < numbers.stop and os.waitstatus_to_exitcode(status) != 0:
            counts["CRASH"] += 1
            defects[following] = f"the process ended with {os.waitstatus_to_exitcode(status)}"
            print(f"{label} {following}: CRASH: {defects[following]}", flush=True)
            following += 1
    return counts, defects


def _serve(case: Callable[[int], str], numbers: range, seconds: float, megabytes: int, writer: int) -> None:
    """In the child: cases one after the other, each result on a line; ends the process."""
    limit = megabytes * 1_000_000
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    signal.signal(signal.SIGALRM, _alarm)
    with os.fdopen(writer, "w") as out:
        for number in numbers:
            outcome, text = _guarded(case, number, seconds)
            out.write(json.dumps([number, outcome, text]) + "\n")
            out.flush()
    os._exit(0)


@Command
def both(
    configs: int = 2000,
    files: int = 300,
    seed: int = 1,
    first: int = 0,
    seconds: float = 20.0,
    megabytes: int = 6000,
    keep: str = "",
) -> int:
    """Both kinds of cases; 1 if there is a defect.

    Args:
        seconds: longest time of one case.
        megabytes: address space of the child.
        keep: folder for the defects' tracebacks.
    """
    found = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bases = base_runs(folder / "bases") if files else []
        kinds: list[tuple[str, int, Callable[[int], str]]] = [
            ("config", configs, lambda n: config_case(n, seed, folder)),
            ("file", files, lambda n: file_case(n, seed, folder, bases)),
        ]
        for label, count, case in kinds:
            if not count:
                continue
            numbers = range(first, first + count)
            started = time.monotonic()
            counts, defects = campaign(case, numbers, seconds=seconds, megabytes=megabytes, label=label)
            peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000
            print(
                f"{len(numbers)} {label}s, seed {seed}: {dict(counts)}, {len(defects)} defects, "
                f"{time.monotonic() - started:.0f} s, peak memory {peak:.0f} MB"
            )
            found += len(defects)
            if keep and defects:
                Path(keep).mkdir(parents=True, exist_ok=True)
                for number, text in defects.items():
                    (Path(keep) / f"{label}-{seed}-{number}.txt").write_text(text)
    return int(found > 0)
