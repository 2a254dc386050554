"""Can a config or a run folder from a stranger hurt rigidsim? Seeded fuzzing at any size.

    python -m experiments.fuzz_campaign --configs 100000 --files 10000

Every case may end in one of two ways: it is read, or it is refused with one clear message (a RigidsimError).
A traceback, a hang (``--seconds`` per case), a crash of the process or memory beyond ``--megabytes`` is a
defect; its case is kept in ``--keep`` and the exit code is 1. Cases run in a child process, which is renewed
when it dies, one at a time. All that is drawn is a function of a ``random.Random``: the seed and a number
name a case, and ``--configs 1 --files 0 --first N`` repeats one.
"""

import contextlib
import datetime
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
import tomllib
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

import rigidsim
from experiments.common import Command
from rigidsim.cli.screens import summary as report
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.config import load
from rigidsim.scene.scene import build_scene
from rigidsim.solve.problem import prepare
from rigidsim.store.provenance import file_sha256
from rigidsim.store.run import open_run
from rigidsim.workflows.plan import plan

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


_READY = Path(__file__).parents[1] / "configs"
CONFIGS = sorted([*_READY.glob("*.toml"), *(_READY / "bodies").glob("*.toml")])
UNITS = [
    "kg", "m", "s", "rad", "deg", "day", "kg m^2", "km/s", "rpm", "µm", "°", "π", "u", "g0", "Å",
    "arcsec",
]  # fmt: skip
NAMES = ["t", "wx", "qw", "phi", "x", "vz", "pi", "e", "k", "sin", "atan2", "exp", "sqrt", "__import__", "ω"]
KEYS = [
    "name", "body", "initial", "loads", "time", "integrator", "output", "events", "limits",
    "parameters", "sweep", "kind", "mass", "samples", "every", "end", "times", "precision", "tolerance",
    "orbit", "components", "shape", "points", "parts", "preset", "quaternion", "euler_angles", "record",
    "expression", "position", "", "é", "a.b", "\u202e", "__class__", "model_config", "$ref", "0", "nan",
]  # fmt: skip
NUMBERS = [
    "0", "-0", "1", "-1", "0.1", "1e-18", "1e18", "1e400", "-1e-400", "1e4999", "1e5001", "1e999999999",
    "1e-999999999", "1e99999999999999999999", "nan", "inf", "-inf", "1/3", "1/0", "2^-20", "2^99999",
    "9^9^9", "0x10", "1_000", "1__0", "٣", "１", "1e", ".", "+-1", "1e400 kg", "1,5", "0.1.2", "1e308",
    "5e-324", "2.5 %",
]  # fmt: skip
STRINGS = [
    "", " ", "\t", "\n", "\x00", "é", "日本", "🪐", "\u202eabc", "..", "../../etc/passwd", "/etc/passwd",
    "C:\\x", ".", "a/b", "-rf", "~", "${HOME}", "{0}", "%s%n", "[bold]x[/]", "auto", "zxz", "quadruple",
    "as a name", "as a point", "__import__('os').system('true')", "sphere", "earth", "torque", "force",
    "uniform_gravity", "quaternion",
]  # fmt: skip


def expression(rng: random.Random, depth: int = 4) -> str:
    """A formula that may or may not be one."""
    if depth == 0 or rng.random() < 0.25:
        return rng.choice([rng.choice(NAMES), rng.choice(NUMBERS), str(rng.randint(-9, 99))])
    inner = expression(rng, depth - 1)
    shape = rng.randrange(7)
    if shape == 0:
        return f"({inner})"
    if shape == 1:
        return f"{rng.choice(['sin', 'log', 'exp', 'atan2', 'sqrt', 'tan', 'f', 'abs'])}({inner})"
    if shape == 2:
        return f"-{inner}"
    if shape == 3:
        return "(" * rng.randint(1, 90) + inner + ")" * rng.randint(1, 90)
    sign = rng.choice(["+", "-", "*", "/", "^", "**", ",", "==", ";", " "])
    return f"{inner}{sign}{expression(rng, depth - 1)}"


def value(rng: random.Random, depth: int = 3) -> Any:
    """A TOML value of any kind, most of them wrong wherever they are put."""
    letters = [*range(32, 127), 0xE9, 0x3C9, 0x1FA90]

    def nested() -> Any:
        item: Any = value(rng, 0)
        for _ in range(rng.choice([1, 2, 30])):
            item = [item]
        return item

    def array() -> Any:
        return (
            [value(rng, max(depth - 1, 0)) for _ in range(rng.randint(0, 5))] if depth else rng.randint(-5, 5)
        )

    kinds: list[Callable[[], Any]] = [
        lambda: rng.choice([0, 1, -1, 2, 3, 10**12, 10**18, -(10**18), 2**63, 10**400, 2**20_000]),
        lambda: rng.choice([0.0, -0.0, 1.5, 1e-300, 1e300, float("nan"), float("inf"), -float("inf")]),
        lambda: rng.random() < 0.5,
        lambda: rng.choice(STRINGS),
        lambda: rng.choice(NUMBERS),
        lambda: f"{rng.choice(NUMBERS)} {unit(rng)}",
        lambda: expression(rng),
        lambda: "".join(chr(rng.choice(letters)) for _ in range(rng.randint(1, 30))),
        lambda: rng.choice("x1(é ") * rng.choice([10, 100, 3000, 20_000]),
        lambda: datetime.date(1979, 5, 27),
        lambda: round(rng.uniform(-10, 10), 3),
        lambda: (
            {rng.choice(KEYS): value(rng, depth - 1) for _ in range(rng.randint(0, 4))} if depth else array()
        ),
        nested,
        array,
    ]
    return kinds[rng.randrange(14)]()


def unit(rng: random.Random) -> str:
    """A unit, or what looks like one."""
    parts = [rng.choice([*UNITS, "parsec", "x", "1e9", "(", ")", ""]) for _ in range(rng.randint(1, 4))]
    powers = ["", "^2", "**-3", "^99", "^0.5", "^^2", "**1e9", "^-", "²"]
    return rng.choice([" ", "*", "/", "//", "·", "."]).join(part + rng.choice(powers) for part in parts)


def _text(item: Any) -> str:
    """A value as TOML."""
    if isinstance(item, bool):
        return str(item).lower()
    if isinstance(item, str):
        escaped = "".join(c if c >= " " and c not in '"\\\x7f' else f"\\u{ord(c):04X}" for c in item)
        return f'"{escaped}"'
    if isinstance(item, dict):
        return "{" + ", ".join(f"{_text(str(k))} = {_text(v)}" for k, v in item.items()) + "}"
    if isinstance(item, list):
        return "[" + ", ".join(map(_text, item)) + "]"
    if isinstance(item, int) and item.bit_length() > 10_000:
        return hex(item)  # decimal texts of this length are refused by Python itself
    return str(item)


def to_toml(table: dict[str, Any]) -> str:
    """A table as TOML text, inner tables inline."""
    return "".join(f"{_text(key)} = {_text(item)}\n" for key, item in table.items())


def _containers(node: Any) -> list[Any]:
    """All tables and arrays of a tree that can be changed."""
    found = [node] if isinstance(node, dict | list) and node else []
    for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        found += _containers(child)
    return found


def mutate(tree: dict[str, Any], other: dict[str, Any], rng: random.Random) -> None:
    """One change somewhere in the tree."""
    place = rng.choice(_containers(tree) or [tree])
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    if not keys:
        place[rng.choice(KEYS)] = value(rng)
        return
    key = rng.choice(keys)
    act = rng.randrange(8)
    if act == 0:
        del place[key]
    elif act == 1 and isinstance(place, dict):
        place[rng.choice([*KEYS, str(key) + "s", str(key)[:-1]])] = place.pop(key)
    elif act == 2:
        donor = rng.choice(_containers(other))
        place[key] = rng.choice(list(donor.values()) if isinstance(donor, dict) else donor)
    elif act == 3 and isinstance(place, list):
        place.insert(key, value(rng))
    elif act == 4 and isinstance(place, dict):
        place[rng.choice(KEYS)] = value(rng)
    elif act == 5 and type(place[key]) in (int, float) and abs(place[key]) < 1e30:
        old = place[key]
        place[key] = rng.choice([-old, old * 10**30, str(old), f"{old} {unit(rng)}"])
    else:
        place[key] = value(rng)


def hostile_config(rng: random.Random) -> bytes:
    """A config file made from the ready ones: changed as a tree, as text, or as bytes."""
    original, other = (rng.choice(CONFIGS).read_text() for _ in range(2))
    way = rng.random()
    if way < 0.65:
        tree = tomllib.loads(original)
        for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
            mutate(tree, tomllib.loads(other), rng)
        return to_toml(tree).encode("utf-8", "surrogatepass")
    if way < 0.8:
        lines = original.splitlines()
        for _ in range(rng.choice([1, 2, 5])):
            at = rng.randrange(len(lines) + 1)
            act = rng.randrange(4)
            if act == 0:
                del lines[at : at + 1]
            elif act == 1:
                lines.insert(at, rng.choice(lines or [""]))
            elif act == 2:
                lines.insert(at, rng.choice(other.splitlines()))
            else:
                lines.insert(at, f"{rng.choice(KEYS) or 'x'} = {_text(value(rng))}")
        return "\n".join(lines).encode("utf-8", "surrogatepass")
    return damaged(original.encode(), other.encode(), rng)


def damaged(content: bytes, other: bytes, rng: random.Random) -> bytes:
    """Bytes with bits flipped, ranges cut, doubled, zeroed, or spliced in from other bytes."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        if not data:
            break
        at = rng.randrange(len(data))
        size = min(rng.choice([1, 1, 4, 8, 64, 1024]), len(data) - at)
        act = rng.randrange(7)
        if act <= 1:
            data[at] ^= 1 << rng.randrange(8)
        elif act == 2:
            del data[at : at + size]
        elif act == 3:
            data[at:at] = data[at : at + size]
        elif act == 4:
            data[at : at + size] = bytes(size)
        elif act == 5:
            data[at : at + size] = rng.randbytes(size)
        else:
            start = rng.randrange(len(other)) if other else 0
            data[at : at + size] = other[start : start + size]
    return bytes(data[: rng.randrange(len(data) + 1)]) if rng.random() < 0.1 else bytes(data)


class TooSlow(BaseException):
    """A case took longer than it may; no library's ``except Exception`` can swallow it."""


def config_case(number: int, seed: int, folder: Path) -> str:
    """Load one hostile config and build its scene; some are prepared and planned as well."""
    path = folder / "case.toml"
    path.write_bytes(hostile_config(random.Random(f"{seed} config {number}")))
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
    made = []
    for precision in ('"double"', '"quadruple"'):
        for steps in (100_000, 20):
            out = folder / f"{len(made)}"
            experiment = rigidsim.parse(RUN.format(precision=precision, steps=steps))
            made.append(rigidsim.run(experiment, out=out).folder.path)
    return made


def file_case(number: int, seed: int, folder: Path, bases: list[Path]) -> str:
    """Damage one file of a copied run folder and read everything in it."""
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
                mutate(tree, tree, rng)
            return json.dumps(tree, default=str).encode("utf-8", "surrogatepass")
        except (ValueError, RecursionError):  # a tree within itself, or a number past what can be written
            return b"[" * 100_000
    return damaged(content, other, rng)


def _resealed(target: Path) -> None:
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
    """How often each outcome was seen, and defects by number, in a child that is renewed when it dies."""
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
