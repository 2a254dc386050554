"""What 4096 free bodies cost side by side, beside one compiled integrator that takes them one by one.

    python -m experiments.sweep_cost

Final state and drifts of T = 1000 s each, CPU time of one core, medians over runs in turn: batches with all
that comes before (families, their numbers, samples, drifts), against bare heyoka with ``par[]`` and nothing
recorded.
"""

from __future__ import annotations

import statistics
import sys
import time

import heyoka as hy

from rigidsim.scene.config import parse
from rigidsim.scene.sweep import Sweep
from rigidsim.solve.batch.family import Families, Family, Numbers
from rigidsim.solve.batch.members import Members
from rigidsim.solve.batch.run import BatchRun

MEMBERS, ROUNDS = 4096, 3
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
[sweep]
mode = "zip"
seed = 1
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


def main(count: int = MEMBERS) -> None:
    """Measure and print."""
    sweep = Sweep.of(parse(TEXT.replace("COUNT", str(count))))
    ratios = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        groups = Families(Members.of(sweep)).sort().groups
        before = time.process_time() - begin
        runs = [BatchRun(family) for family, _ in groups]
        for run, (_, numbers) in zip(runs, groups, strict=True):
            for _block in run.blocks(numbers):
                pass
        batch = time.process_time() - begin
        begin = time.process_time()
        for family, numbers in groups:
            one_by_one(family, numbers)
        alone = time.process_time() - begin
        ratios.append(batch / alone)
        found = f"{len(groups)} families, width {runs[0].width}: {batch:.2f} s against {alone:.2f} s"
        each = f"families and numbers {1e6 * before / count:.0f} us a member"
        print(f"{found}: {batch / alone:.3f}; {each}", flush=True)
    print(f"median {statistics.median(ratios):.3f}")


if __name__ == "__main__":
    main(*(int(x) for x in sys.argv[1:]))
