"""How soon does Ctrl-C end a run, whatever it is doing, and does nothing get lost?

Situations: endless runs in all precisions, dense and sparse, with events, many samples in a step, and every
phase and command that takes its time, interrupted on purpose. Scenes: those of the coverage campaign, each
interrupted at a random moment of its work (imports and compiling included; every other one is prolonged, so
that it is integrating by then), then resumed: to the end where it has one, else for as long again and
interrupted once more.

What counts is CPU time from the signal to the end of the process, of all its threads: other work on the
machine doesn't change it. Every scene's code is compiled anew. Linux only (/proc).

Run: python -m experiments.interruptions [--what situations|scenes] [--count N] [--seed S] [--only WORD]
Exit code 1 if anything took more than half a second, or a folder didn't resume.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from experiments.coverage.families import coverage_scene

PROMISED = 0.5  # seconds from the signal to the end
_LONGER = 1e5  # times a prolonged scene's time
_MOMENTS = (0.3, 6.0)  # CPU seconds after the start, imports among them
_PATIENCE = 120.0  # CPU seconds for the next sign of life
_PATIENCE_WITH_NOTHING = 1800.0  # wall seconds, for what uses no CPU time
_INTERRUPTED = 130

_BODY = "[body]\nprincipal_moments = [1, 2, 2.5]\nmass = 1\n[initial]\nangular_velocity = [0.5, 0.25, 1]\n"
_DRIVEN = '[[loads]]\nkind = "torque"\ncomponents = ["0.01*sin(0.3*t)", "0.02*cos(0.5*t)", "0"]\n'
_FLIGHT = (
    "position = [10, 0, 0]\nvelocity = [0, 0.3, 0.1]\n"
    '[[loads]]\nkind = "central_gravity"\ngravitational_parameter = 1\n'
)
_EVENT = '[[events]]\nname = "crossing"\nexpression = "wy"\n'
_DRY = '[[loads]]\nkind = "torque"\ncomponents = ["-1e-9*sign(wx)", "0", "0"]\n'
_DENSE, _SPARSE = "end = 1e9\nevery = 0.125", "end = 1e9\nevery = 1024"
_CROWDED = "end = 10\nsamples = 10000000001"
_INTEGRATING = "integrating into"


@dataclass(frozen=True)
class Situation:
    """What is interrupted.

    Attributes:
        text: a config without its name; None for a command on the run of another.
        line: of stderr to wait for, and then so many CPU ``seconds``.
        before: commands that run to their end first.
        command: where ``{}`` is the config, or the run's folder.
    """

    text: str
    line: str = _INTEGRATING
    seconds: float = 0.7
    before: tuple[str, ...] = ()
    command: str = "run {}"


def _endless(load: str = "", integrator: str = "", every: str = _DENSE, more: str = "") -> str:
    return (
        f"{_BODY}{load}[time]\n{every}\n[integrator]\n{integrator}\n{more}"
        "[limits]\nwall_time = 3600\n[output]\ntimeline = false\n"
    )


def _finite(samples: int, *, end: float = 1000.0, more: str = "") -> str:
    return f"{_BODY}{_DRIVEN}[time]\nend = {end}\nsamples = {samples}\n{more}"


SITUATIONS = {
    **{
        f"{digits}, {how}": Situation(_endless(integrator=f"precision = {digits}", every=every))
        for digits in ('"single"', '"double"', '"extended"', '"quadruple"', "50", "250")
        for how, every in (("dense", _DENSE), ("sparse", _SPARSE))
        if (digits, how) != ('"single"', "dense")  # whose samples it can't tell apart
    },
    "samples in a step": Situation(_endless(every=_CROWDED)),
    "samples in a step, 50 digits": Situation(_endless(integrator="precision = 50", every=_CROWDED)),
    "closed form": Situation(_endless(integrator='method = "closed_form"')),
    "six degrees of freedom": Situation(_endless(_FLIGHT)),
    "torque in time": Situation(_endless(_DRIVEN)),
    "events": Situation(_endless(more=_EVENT)),
    "switching": Situation(_endless(_DRY)),
    "Euler angles": Situation(_endless(integrator='formulation = "euler_angles"')),
    "projected invariants": Situation(_endless(integrator="hold_invariants = true")),
    "imports": Situation(_finite(100), "", 0.3),
    "compiling": Situation(_endless(_FLIGHT), "", 1.8),
    "compiling, quadruple": Situation(_endless(_FLIGHT, 'precision = "quadruple"'), "", 1.8),
    "choosing": Situation(_finite(100, more="[integrator]\naccuracy = 1e-12\n"), "choosing", 0.3),
    "certifying": Situation(_finite(100, end=1e5, more="[integrator]\naccuracy = 1e-8\n"), "certifying", 0.1),
    "Lyapunov": Situation(_finite(100, end=1e6, more="[output]\nlyapunov = true\n"), "Lyapunov", 0.3),
    "dataset": Situation(_finite(1_000_001), "writing dataset", 0.1),
    "timeline": Situation(_finite(200_001), "drawing", 0.2),
    "timeline, later": Situation(_finite(200_001), "drawing", 0.6),
    "verify": Situation(_finite(400_001), "", 2.0, ("run {}",), "verify {}"),
    "plan": Situation(_finite(101), "", 1.0, (), "plan {}"),
    **{
        f"{command} after {moment} s": Situation(_finite(100_001), "", moment, ("run {}",), f"{command} {{}}")
        for command in ("analyse", "plot", "export --format csv")
        for moment in (0.8, 1.3, 1.8)
    },
    **{
        f"tradeoff after {moment} s": Situation(_finite(101, end=1e4), "", moment, (), "tradeoff {}")
        for moment in (1.0, 2.5, 4.0)
    },
}
"""By the name that the table shows."""


@dataclass(frozen=True)
class Ending:
    """How a process ended; None of ``cpu`` where it came to its end before the signal.

    Attributes:
        cpu, wall: seconds from the signal to the end.
    """

    code: int
    cpu: float | None
    wall: float
    said: str

    @property
    def prompt(self) -> bool:
        """Whether it kept the promise."""
        return self.within(PROMISED)

    def within(self, seconds: float) -> bool:
        """Whether it was interrupted and ended within so many seconds of CPU time, if it hadn't before."""
        return self.cpu is None or (self.cpu <= seconds and self.code == _INTERRUPTED)

    @property
    def words(self) -> str:
        """For the table."""
        if self.cpu is None:
            return f"had ended before (exit {self.code})"
        why = "" if self.code == _INTERRUPTED else f": {self.said.strip()[-200:]}"
        return f"{self.cpu:.2f} s CPU, {self.wall:.2f} s wall, exit {self.code}{why}"


def interrupted(command: Sequence[str], folder: Path, line: str = "", seconds: float = 0.0) -> Ending:
    """Start a command in a folder, interrupt it, and wait for its end.

    Args:
        line: part of one on stderr that is waited for, if any; then so many CPU ``seconds``.
    """
    environment = {**os.environ, "HEYOKA_CACHE_DIR": str(folder / "code"), "PYTHONUNBUFFERED": "1"}
    root = str(Path(__file__).parents[1])
    environment["PYTHONPATH"] = os.pathsep.join([root, environment.get("PYTHONPATH", "")])
    with (folder / "stderr").open("w+b") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "rigidsim", *command],
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        ended = threading.Event()
        result: list[tuple[int, float]] = []

        def wait() -> None:
            _, status, used = os.wait4(process.pid, 0)
            result.append((os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime))
            ended.set()

        threading.Thread(target=wait, daemon=True).start()

        def said() -> str:
            return (folder / "stderr").read_text(errors="replace")

        patience = _Patience(process.pid)
        while line not in said() and not ended.wait(0.01) and patience:
            pass
        begin = 0.0 if ended.is_set() or not line else _cpu(process.pid)
        while not ended.wait(0.005) and _cpu(process.pid) < begin + seconds and patience:
            pass
        before = 0.0 if ended.is_set() else _cpu(process.pid)
        alive = not ended.is_set()
        sent = time.monotonic()
        if alive:
            os.kill(process.pid, signal.SIGINT)
        patience = _Patience(process.pid)
        while not ended.wait(0.1) and patience:
            pass
        hangs = not ended.is_set()
        if hangs:
            os.kill(process.pid, signal.SIGKILL)
            ended.wait()
        process.returncode, total = result[0]
        if process.returncode == -signal.SIGINT:  # a shell tells the same of a process that died of Ctrl-C
            process.returncode = _INTERRUPTED
        finished = process.returncode == 0 or not alive
        spent = None if finished and not hangs else total - before
        return Ending(process.returncode, spent, time.monotonic() - sent, said())


class _Patience:
    """True as long as a process may still be waited for, whatever else the machine does meanwhile."""

    def __init__(self, pid: int) -> None:
        self._pid, self._cpu, self._wall = pid, _cpu(pid), time.monotonic()

    def __bool__(self) -> bool:
        spent, waited = _cpu(self._pid) - self._cpu, time.monotonic() - self._wall
        return spent < _PATIENCE and waited < _PATIENCE_WITH_NOTHING


def _cpu(pid: int) -> float:
    """User and system time of a process so far, seconds."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def situations(only: str = "") -> list[str]:
    """Interrupt each situation; names of those that took too long."""
    late = []
    print("| situation | from the signal to the end |\n| --- | --- |")
    for name, situation in SITUATIONS.items():
        if only not in name:
            continue
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            (folder / "scene.toml").write_text(f'name = "scene"\n{situation.text}')
            for before in situation.before:
                interrupted(before.format("scene.toml").split(), folder, "nothing says this", 1e9)
            given = "runs/scene" if situation.before else "scene.toml"
            command = situation.command.format(given).split()
            found = interrupted(command, folder, situation.line, situation.seconds)
        print(f"| {name} | {found.words} |", flush=True)
        if not found.prompt:
            late.append(f"{name}: {found.words}")
    return late


def scenes(numbers: Sequence[int], seed: int) -> list[str]:
    """Interrupt scenes of the coverage campaign at random moments, and resume them; what went wrong."""
    wrong: list[str] = []
    spent: list[float] = []
    resumed = 0
    for number in numbers:
        with tempfile.TemporaryDirectory() as temporary:
            found, problem = _scene(number, seed, Path(temporary))
        spent += [one.cpu for one in found if one.cpu is not None]
        resumed += len(found) > 1
        words = "; resumed: ".join(one.words for one in found)
        print(f"{number:5d} {coverage_scene(number, seed).family:24s} {words}{problem}", flush=True)
        late = [one.words for one in found if not one.prompt]
        if late or problem:
            wrong.append(f"scene {number} of seed {seed}: {'; '.join(late)}{problem}")
    if spent:
        middle, high = np.quantile(spent, [0.5, 0.9])
        print(
            f"\n{len(numbers)} scenes, {len(spent)} interruptions: CPU to the end median {middle:.2f} s, "
            f"90 % {high:.2f}, largest {max(spent):.2f}; {resumed} folders resumed"
        )
    return wrong


def _scene(number: int, seed: int, folder: Path) -> tuple[list[Ending], str]:
    """One of them: its interruptions, and what went wrong when it was resumed."""
    random = np.random.default_rng([11, seed, number])
    text = coverage_scene(number, seed).text.replace("timeline = false", "timeline = true")
    moments = random.uniform(*_MOMENTS, 2)
    endless = number % 2 == 1
    if endless:
        head, _, rest = text.partition("[time]\nend = ")
        end, _, rest = rest.partition("\n")
        samples = f"every = {float(end) / 8!r}\n" + rest.partition("\n")[2]
        text = f"{head}[time]\nend = {float(end) * _LONGER!r}\n{samples}"
        text += "[limits]\nwall_time = 3600\n"
    (folder / "scene.toml").write_text(text)
    found = [interrupted(["run", "scene.toml"], folder, seconds=moments[0])]
    run = f"runs/coverage{number}"
    if found[0].cpu is None or not (folder / run).exists():
        return found, ""
    before = _samples(folder / run)
    found.append(interrupted(["resume", run], folder, seconds=moments[1] if endless else 1e9))
    summary = folder / run / "summary.json"
    if found[1].code not in (0, 3, _INTERRUPTED):
        return found, f"; not resumed: {found[1].said.strip()[-200:]}"
    if not endless and found[1].code == _INTERRUPTED:
        return found, "; the resumed run didn't come to its end"
    if summary.exists() and _samples(folder / run) < before:
        return found, "; samples were lost"
    return found, ""


def _samples(run: Path) -> int:
    """That the summary tells of; 0 without one."""
    summary = run / "summary.json"
    return int(json.loads(summary.read_text()).get("samples") or 0) if summary.exists() else 0


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m experiments.interruptions")
    parser.add_argument("--what", choices=["situations", "scenes"])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="situations with this word in their name")
    arguments = parser.parse_args(argv)
    wrong = []
    if arguments.what != "scenes":
        wrong += situations(arguments.only)
    if arguments.what != "situations":
        wrong += scenes(range(arguments.first, arguments.first + arguments.count), arguments.seed)
    print("\n".join(["", *wrong]) if wrong else f"\neach ended within {PROMISED} s, and every folder resumed")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
