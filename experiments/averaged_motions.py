"""How far are averaged motions from the full one, and do they say so?

Method: forty seeded random bodies (``experiments.averaging.campaign``) are run averaged, with their modelling
error measured in windows, and with every rotation resolved to the end; the largest distance between both
directions of the momentum is held against the error announced.

Held against:
- the announced error covers the true one in every run;
- it is at most ten times the true one in half of them.

The windows were chosen on seed 15; another seed, of which nothing was seen before, is the proof.

Run: python -m experiments.averaged_motions [--full] [--seed 16] [--out DIR]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

from experiments.averaging.campaign import Member, member
from experiments.common import BLUE, GREY, ORANGE, Check, add_arguments, new_figure, save, table, tidy

NAME = "averaged_motions"
MEMBERS = 40
FEW = 12
SEED = 16


def study(full: bool, out: Path, seed: int = SEED) -> list[Check]:
    """All members, or a few; see the module's text."""
    members: list[Member] = []
    for number in range(MEMBERS if full else FEW):
        one = member(number, seed)
        members.append(one)
        print(
            f"{one.number:3d} {one.level:14s} {'tumbling' if one.tumbles else 'principal':9s} "
            + (f"refused: {one.refused}" if one.refused else f"{one.announced:.2e} {one.true:.2e}")
            + (" whole" if one.whole else ""),
            file=sys.stderr,
            flush=True,
        )
    ran = [one for one in members if not one.refused]
    # both integrations round as well, by no more than 1e-9 rad here
    ratios = np.array([one.announced / max(one.true - 1e-9, 1e-12) for one in ran])
    draw(ran, len(members), out)
    return [
        Check("true error over the announced one, largest", float((1 / ratios).max()), 0.0, 1.0, "1",
              "the summary's own bound", "absolute"),
        Check("announced error over the true one, median", float(np.median(ratios)), 0.0, 10.0, "1",
              "ten times in half of the runs", "absolute"),
    ]  # fmt: skip


def draw(ran: list[Member], count: int, out: Path) -> None:
    """Announced errors against true ones."""
    title = (
        f"{len(ran)} of {count} random bodies have an average, and its announced error covers the true one"
    )
    figure = new_figure(8.4, 6.2, title)
    axes = figure.subplots()
    for tumbles, color, label in ((False, BLUE, "principal rotation"), (True, ORANGE, "tumbling")):
        points = [(one.true, one.announced) for one in ran if one.tumbles == tumbles]
        if points:
            axes.loglog(*np.array(points).T, "o", color=color, label=label, markersize=6)
    ends = np.array([min(one.true for one in ran) / 3, max(one.announced for one in ran) * 3])
    axes.loglog(ends, ends, color=GREY, linewidth=1, label="announced = true")
    axes.loglog(ends, 10 * ends, "--", color=GREY, linewidth=1, label="ten times the true one")
    tidy(axes, "true distance from the full motion (rad)", "announced (rad)", "Direction of the momentum")
    axes.legend(loc="lower right", fontsize=9)
    save(figure, out, NAME)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}")
    add_arguments(parser)
    parser.add_argument("--seed", type=int, default=SEED, help="of the bodies (default: %(default)s)")
    asked = parser.parse_args()
    checks = study(asked.full, asked.out, asked.seed)
    print(table(checks, NAME))
    sys.exit(int(not all(check.passed for check in checks)))
