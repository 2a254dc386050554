"""What do 4096 free bodies cost side by side, and what does a member cost besides its steps?

Default: CPU time of batches with all that comes before, over bare heyoka with ``par[]`` that takes the
members one by one and records nothing; medians over runs in turn (at most 0.25 at width 8, 0.35 at width 4).
``--overhead``: CPU time of a member of Hyperion's map besides its steps (at most 20 us): the difference of a
large map and a small one over 10 and 20 orbits; the second ten cost steps alone.

Run: python -m experiments.sweep_cost [--overhead]
"""

from __future__ import annotations

import argparse
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

import heyoka as hy

from experiments.common import CONFIGS, Check, table
from rigidsim.scene.config import parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.batch.family import Families, Family, Members, Numbers
from rigidsim.solve.batch.run import BatchRun

MEMBERS, ROUNDS = 4096, 3
MAP, SMALL, LARGE = CONFIGS / "sweeps" / "hyperion_map.toml", 100, 400
TEXT = """
name = "free_bodies"
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.1, 1, 0.05]
time = {end = 1000, samples = 2}
output = {record = ["angular_velocity", "quaternion"], estimate = false, timeline = false}
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
    engine = hy.taylor_adaptive(equations, numbers.initial[:, 0].tolist(), pars=swept[:, 0].tolist())
    for k, unit in enumerate(numbers.whole_numbers(traced.system.scaling.time).tolist()):
        engine.time = 0.0
        engine.state[:], engine.pars[:] = numbers.initial[:, k], swept[:, k]
        engine.propagate_until(1000.0 * 2.0**-unit)


def side_by_side() -> Check:
    """Members in batches, over one by one."""
    sweep = Sweep.of(parse(TEXT.replace("COUNT", str(MEMBERS))))
    ratios, width = [], 0
    for _ in range(ROUNDS):
        begin = time.process_time()
        groups = Families(Members(sweep)).sort().groups
        for family, numbers in groups:
            run = BatchRun(family)
            width = run.width
            list(run.blocks(numbers))
        batch, begin = time.process_time() - begin, time.process_time()
        for family, numbers in groups:
            one_by_one(family, numbers)
        ratios.append(batch / (time.process_time() - begin))
    most = {8: 0.25, 4: 0.35}.get(width, 1.0)
    return asked(f"CPU over one by one, width {width}", ratios, most)


def used(command: Sequence[str]) -> float:
    """CPU seconds of a sweep's processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "rigidsim", "sweep", *command], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def overhead(folder: str) -> Check:
    """CPU time of a member of a planar map besides its steps, files and labels included, us."""
    found = []
    for _ in range(ROUNDS):
        seconds = {}
        for side, orbits in ((SMALL, 10), (SMALL, 20), (LARGE, 10), (LARGE, 20)):
            settings = [
                f'sweep.axes."initial.euler_angles[2]".linspace=[0, 3.141592653589793, {side}]',
                f'sweep.axes."initial.angular_velocity[2]".linspace=[0, 3, {side}]',
                f"time.end={orbits * 2 * math.pi}", "time.samples=2", 'sweep.keep=["final"]',
            ]  # fmt: skip
            words = [word for setting in settings for word in ("--set", setting)]
            seconds[side, orbits] = used([str(MAP), "--out", folder, "--force", *words])
        ten, twenty = (seconds[LARGE, orbits] - seconds[SMALL, orbits] for orbits in (10, 20))
        found.append(1e6 * (2 * ten - twenty) / (LARGE**2 - SMALL**2))
    return asked("CPU of a planar member besides its steps, us", found, 20.0)


def asked(name: str, values: Sequence[float], most: float) -> Check:
    """The median against what is asked of the project."""
    print(f"{name}, in turn: {', '.join(f'{value:.3g}' for value in values)}")
    return Check(name, statistics.median(values), 0, most, "1", "asked of this project", "absolute")


def main() -> int:
    """Measure and print; exit code 1 where more was taken than is asked."""
    parser = argparse.ArgumentParser(prog="python -m experiments.sweep_cost")
    parser.add_argument("--overhead", action="store_true", help="what a planar member costs besides steps")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rigidsim-sweep-cost-") as folder:
        check = overhead(folder) if given.overhead else side_by_side()
    print(table([check], "sweep_cost"))
    return int(not check.passed)


if __name__ == "__main__":
    sys.exit(main())
