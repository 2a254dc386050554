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

import sys

import numpy as np

from experiments.averaging.campaign import Member, member
from experiments.common import BLUE, GREY, ORANGE, Answer, Check, Curve, Panel, Picture, Study

MEMBERS = 40
FEW = 12
SEED = 16


@Study
def study(full: bool, seed: int = SEED) -> Answer:
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
    figure = picture(ran, len(members))
    return [
        Check("true error over the announced one, largest", float((1 / ratios).max()), 0.0, 1.0, "1",
              "the summary's own bound", "absolute"),
        Check("announced error over the true one, median", float(np.median(ratios)), 0.0, 10.0, "1",
              "ten times in half of the runs", "absolute"),
    ], figure  # fmt: skip


def picture(ran: list[Member], count: int) -> Picture:
    """Announced errors against true ones."""
    ends = np.array([min(one.true for one in ran) / 3, max(one.announced for one in ran) * 3])
    curves = [Curve(ends, factor * ends, label, GREY, style, 1) for factor, label, style in (
        (1, "announced = true", "-"), (10, "ten times the true one", "--"))]  # fmt: skip
    for tumbles, color, label in ((False, BLUE, "principal rotation"), (True, ORANGE, "tumbling")):
        points = [(one.true, one.announced) for one in ran if one.tumbles == tumbles]
        if points:
            curves.append(Curve(*np.array(points).T, label, color, "o", 1.5))
    title = (
        f"{len(ran)} of {count} random bodies have an average, and its announced error covers the true one"
    )
    xlabel = "true distance from the full motion (rad)"
    panel = Panel("Direction of the momentum", xlabel, "announced (rad)", curves, log="xy")
    return Picture(title, "a", [panel], (8.4, 6.2))


if __name__ == "__main__":
    raise SystemExit(study.main())
