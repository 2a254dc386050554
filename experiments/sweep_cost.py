"""What do 4096 free bodies cost side by side, what does a second worker gain, and what is all else a member?

Question: final state and drifts of T = 1000 s each, beside one compiled integrator that takes the members one
by one; the wall time of a sweep of a minute or more with two workers beside that with one; the CPU time of a
member of a planar map besides its steps.

Method: CPU time of one core, medians over runs in turn: batches with all that comes before (families, their
numbers, samples, drifts), against bare heyoka with ``par[]`` and nothing recorded; and once more with
estimates of errors, which aren't part of what is asked. With ``--workers``: whole processes of ``rigidsim
sweep``, one worker and several in turn, wall time by stages, and CPU time; nothing else should run beside
them. With ``--overhead``: CPU time of ``rigidsim sweep`` of Hyperion's map with final states, each member's
as the difference of a large map and a small one, over 10 and 20 orbits; the second ten cost steps alone, so
that the first cost all else besides.

Held against: at most 0.25 of the CPU at width 8, 0.35 at width 4; with two workers at most 0.55 of the wall
time of one; 20 us a member of a planar map.

Run: python -m experiments.sweep_cost [4096]
     python -m experiments.sweep_cost --workers 2 [150000]
     python -m experiments.sweep_cost --overhead
"""

from __future__ import annotations

import argparse
import math
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import heyoka as hy

from experiments.common import Check, table
from rigidsim.accuracy.estimates.members import MemberEstimates
from rigidsim.scene.config import parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.batch.family import Families, Family, Members, Numbers
from rigidsim.solve.batch.run import BatchRun

MEMBERS, MANY, ROUNDS = 4096, 150_000, 3
_MOST = {8: 0.25, 4: 0.35}
_MOST_OF_TWO = 0.55
_ASKED = "asked of this project"
TEXT = """
name = "free_bodies"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 1000
samples = 2
[output]
record = ["angular_velocity", "quaternion"]
estimate = false
timeline = false
[sweep]
mode = "zip"
seed = 1
keep = ["final"]
axes."initial.angular_velocity" = {uniform = [[0.1, 0.1, 0.1], [1, 1, 1]], count = COUNT, name = "rate"}
axes."body.principal_moments[1]" = {uniform = [1.6, 2.4], count = COUNT, name = "moment"}
"""


def one_by_one(family: Family, numbers: Numbers) -> None:
    """The members of a family in one scalar integrator."""
    traced = family.traced
    rights = traced.as_parameters([right for _, right in traced.system.equations])
    equations = list(zip(traced.system.variables, rights, strict=True))
    swept = numbers.parameters[traced.in_equations]
    units = numbers.whole_numbers(traced.system.scaling.time)
    engine = hy.taylor_adaptive(equations, numbers.initial[:, 0].tolist(), pars=swept[:, 0].tolist())
    for k, unit in enumerate(units.tolist()):
        engine.time = 0.0
        engine.state[:], engine.pars[:] = numbers.initial[:, k], swept[:, k]
        engine.propagate_until(1000.0 * 2.0**-unit)


def side_by_side(count: int) -> list[Check]:
    """Members in batches beside one by one, and what their estimates cost."""
    sweep = Sweep.of(parse(TEXT.replace("COUNT", str(count))))
    ratios, width = [], 0
    for _ in range(ROUNDS):
        begin = time.process_time()
        groups = Families(Members(sweep)).sort().groups
        before = time.process_time() - begin
        runs = [BatchRun(family) for family, _ in groups]
        blocks = [list(run.blocks(numbers)) for run, (_, numbers) in zip(runs, groups, strict=True)]
        batch = time.process_time() - begin
        begin = time.process_time()
        for (family, numbers), found in zip(groups, blocks, strict=True):
            estimates = MemberEstimates(family, runs[0].width)
            for block in found:
                estimates.of(numbers, block)
        estimated = time.process_time() - begin
        begin = time.process_time()
        for family, numbers in groups:
            one_by_one(family, numbers)
        alone = time.process_time() - begin
        ratios.append(batch / alone)
        width = runs[0].width
        found = f"{len(groups)} families, width {width}: {batch:.2f} s against {alone:.2f} s"
        each = f"families and numbers {1e6 * before / count:.0f} us a member"
        more = f"estimates {estimated / batch:.2f} of the batches more, {estimated / alone:.2f} of one by one"
        print(f"{found}: {batch / alone:.3f}; {each}; {more}", flush=True)
    most = _MOST.get(width, 1.0)
    return [
        Check(
            f"CPU over one by one, width {width}", statistics.median(ratios), 0, most, "1", _ASKED, "absolute"
        )
    ]


STAGES = {"trying out": "import", "running": "check", "writing": "tiles"}
"""What a line on stderr begins, and what has ended with it."""


def staged(command: Sequence[str]) -> dict[str, float]:
    """Wall seconds of the stages of a sweep, of the whole, and the CPU seconds of all its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = last = time.perf_counter()
    seconds: dict[str, float] = {}
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            now = time.perf_counter()
            for words, stage in STAGES.items():
                if words in line:
                    seconds[stage], last = now - last, now
    ended = time.perf_counter()
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    return {**seconds, "dataset": ended - last, "wall": ended - began, "cpu": cpu}


def shared(count: int, workers: int) -> list[Check]:
    """A sweep by one worker and by several, as whole processes; each is a new sweep, with its check."""
    ratios = []
    with tempfile.TemporaryDirectory(prefix="rigidsim-workers-") as temporary:
        config = Path(temporary) / "free_bodies.toml"
        config.write_text(TEXT.replace("COUNT", str(count)), encoding="utf-8")
        for turn in range(ROUNDS):
            told = {}
            for number in (1, workers):
                out = Path(temporary) / f"{turn}_{number}"
                command = [sys.executable, "-m", "rigidsim", "sweep", str(config), "--out", str(out)]
                told[number] = staged([*command, "--workers", str(number)])
                stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in told[number].items())
                print(f"{number} workers, seconds: {stages}", flush=True)
                shutil.rmtree(out)
            ratios.append(told[workers]["wall"] / told[1]["wall"])
    most = _MOST_OF_TWO if workers == 2 else 1.0
    name = f"wall time with {workers} workers over one"
    return [Check(name, statistics.median(ratios), 0, most, "1", _ASKED, "absolute")]


MAP = Path(__file__).parents[1] / "configs" / "sweeps" / "hyperion_map.toml"
ORBIT, SMALL, LARGE = 2 * math.pi, 100, 400
_MOST_OVERHEAD = 20.0  # us


def overhead() -> list[Check]:
    """CPU time of a member of a planar map besides its steps, files and labels included."""
    with tempfile.TemporaryDirectory(prefix="rigidsim-overhead-") as temporary:
        found = [_overhead(Path(temporary)) for _ in range(ROUNDS)]
    print(f"us a member, in turn: {', '.join(f'{value:.1f}' for value in found)}")
    name = "CPU time of a planar member besides its steps"
    return [Check(name, statistics.median(found), 0, _MOST_OVERHEAD, "us", _ASKED, "absolute")]


def _overhead(place: Path) -> float:
    seconds = {}
    for side in (SMALL, LARGE):
        for orbits in (10, 20):
            axes = 'sweep.axes."initial.{}".linspace=[0, {}, {}]'
            settings = [
                axes.format("euler_angles[2]", "3.141592653589793", side),
                axes.format("angular_velocity[2]", "3", side),
                f"time.end={orbits * ORBIT}", "time.samples=2", 'sweep.keep=["final"]',
            ]  # fmt: skip
            command = [sys.executable, "-m", "rigidsim", "sweep", str(MAP), "--out", str(place), "--force"]
            command += [word for setting in settings for word in ("--set", setting)]
            seconds[side, orbits] = staged(command)["cpu"]
    ten, twenty = (seconds[LARGE, orbits] - seconds[SMALL, orbits] for orbits in (10, 20))
    return 1e6 * (2 * ten - twenty) / (LARGE**2 - SMALL**2)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print; exit code 1 where more was taken than is asked."""
    parser = argparse.ArgumentParser(prog="python -m experiments.sweep_cost")
    parser.add_argument("members", type=int, nargs="?", help=f"{MEMBERS} by default, {MANY} with --workers")
    parser.add_argument("--workers", type=int, help="compare a sweep by so many with one by one worker")
    parser.add_argument("--overhead", action="store_true", help="what a planar member costs besides steps")
    given = parser.parse_args(argv)
    if given.overhead:
        checks = overhead()
    elif given.workers is None:
        checks = side_by_side(given.members or MEMBERS)
    else:
        checks = shared(given.members or MANY, given.workers)
    print(table(checks, "sweep_cost"))
    return int(not all(check.passed for check in checks))


if __name__ == "__main__":
    sys.exit(main())
