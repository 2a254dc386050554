"""At equal attitude error, what do rigidsim, bare heyoka and other integrators cost?

A free asymmetric top, a heavy symmetric top and a tumbling satellite under gravity gradient, over about 140
and 9000 rad. Each peer runs in fresh processes, in turn; per setting the fastest of several calls in a
process, the median over processes; imports and compilation apart. The error is the angle between the final
attitude and that of 128-bit arithmetic. The cost at an error is that of the cheapest of a peer's settings,
interpolated in the logarithms, as a ratio to bare heyoka at its best. A peer that isn't installed is left out
with a message.

Run: python -m experiments.peer_comparison [--repeats 3] [--full] [--peers heyoka,rigidsim,...]
"""

import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.common import BLUE, DEFAULT_OUT, GREY, RED, Command, chosen, new_figure, save, tidy
from experiments.peers import ADAPTERS
from experiments.peers.campaign import BARE, OURS, Measured, measure
from experiments.peers.curves import Point, cost_at, frontier
from experiments.peers.scenes import SCENES

NAME = "peer_comparison"
ERRORS = (1e-6, 1e-9, 1e-12)
_COARSEST = 2e-2  # rad, left end of the figure
_LEAST = 1e-16  # rad; a double holds no better attitude, and a logarithmic axis no zero
_STYLES = {
    "bare heyoka": ("black", "-", "o", 4),
    "bare heyoka, attitude in the orbital frame": ("black", "--", "s", 3.5),
    "bare heyoka, cos(n t) explicit": ("black", ":", "^", 3),
    "bare heyoka, 80 bit": ("#888888", "-", "o", 3.5),
    "rigidsim, formulation auto": (BLUE, "-", "s", 4),
    "rigidsim, quaternion": (BLUE, "-", "o", 4),
    "rigidsim, invariants held": ("#4393c3", "--", "D", 4),
    "rigidsim, closed form": (BLUE, "", "*", 13),
    "rigidsim, accuracy": (BLUE, "", "P", 8),
    "rigidsim, 80 bit": ("#92c5de", "-", "o", 3.5),
    "rigidsim, rotation": (BLUE, ":", "v", 3),
    "rigidsim, Euler": (BLUE, ":", "X", 3),
    "numba DOP853": (RED, "-", "o", 3.5),
    "scipy DOP853, numba": (GREY, "-", "s", 3),
    "scipy LSODA": (GREY, "--", "^", 3),
    "MuJoCo RK4": ("#a6761d", "-", "o", 3.5),
    "MuJoCo implicit": ("#a6761d", ":", "s", 3),
}
"""Color, line, marker and its size, by the beginning of a way's title."""


def rows(measured: Measured, cases: Sequence[tuple[str, float]]) -> list[str]:
    """Markdown: ratios to bare heyoka at its best, by scene, horizon and error."""
    peers = [p for p in ADAPTERS if p != BARE and p in measured.imports]
    lines = ["| scene, horizon | error, rad | bare heyoka, CPU ms | " + " | ".join(peers) + " |"]
    lines.append("| --- " * (3 + len(peers)) + "|")
    for scene, end in cases:
        for error in ERRORS:
            bare = cost_at(measured.of(scene, end, BARE), error)
            costs = [cost_at(measured.of(scene, end, peer), error) for peer in peers]
            shown = [_ratio(cost, bare) for cost in costs]
            first = "not reached" if bare is None else f"{1e3 * bare:.3g}"
            rads = SCENES[scene].rate * end
            lines.append(f"| {scene}, {rads:.2g} rad | {error:.0e} | {first} | " + " | ".join(shown) + " |")
    return lines


def _ratio(cost: float | None, bare: float | None) -> str:
    if cost is None:
        return "–"
    return f"({1e3 * cost:.3g} ms)" if bare is None else f"{cost / bare:.3g}"


def draw(measured: Measured, cases: Sequence[tuple[str, float]], out: Path) -> Path:
    """Work against precision, a panel per scene and horizon; lower right is better."""
    scenes = list(dict.fromkeys(scene for scene, _ in cases))
    columns = max(sum(s == scene for s, _ in cases) for scene in scenes)
    title = "What does an attitude cost?"
    figure = new_figure(max(9.0, 6.5 * columns), 2.2 + 3.7 * len(scenes), title)
    grid = figure.subplots(len(scenes), columns, squeeze=False, sharex=True)
    handles: dict[str, Any] = {}
    for row, scene in enumerate(scenes):
        for column, end in enumerate(e for s, e in cases if s == scene):
            panel = grid[row][column]
            for peer in measured.imports:
                _curves(panel, measured.of(scene, end, peer), peer, handles)
            panel.set(xscale="log", yscale="log", xlim=(_COARSEST, _LEAST / 2))
            turned = SCENES[scene].rate * end
            tidy(panel, "", "CPU seconds", f"{SCENES[scene].title}, {turned:,.0f} rad")
    for panel in grid[-1]:
        panel.set_xlabel("attitude error at the end, rad (better to the right)")
    names = sorted(handles, key=lambda name: list(_STYLES).index(_family(name)))
    lines = [handles[name] for name in names]
    figure.legend(lines, names, loc="outside lower center", ncols=2 + columns, frameon=False, fontsize=8.5)
    return save(figure, out, NAME)


def _family(title: str) -> str:
    """The entry of ``_STYLES`` for a way's title."""
    if title in _STYLES:
        return title
    return max((name for name in _STYLES if title.startswith(name)), key=len)


def _curves(panel: Any, points: list[Point], peer: str, handles: dict[str, Any]) -> None:
    for title in dict.fromkeys(p.title for p in points):
        curve = frontier([p for p in points if p.title == title])
        color, line, marker, size = _STYLES[_family(title)]
        (handle,) = panel.plot(
            [max(p.error, _LEAST) for p in curve],
            [p.cost for p in curve],
            color=color,
            linestyle=line,
            marker=marker,
            markersize=size,
            linewidth=2 if peer in (BARE, OURS) and line == "-" else 1.1,
            zorder=3 if peer in (BARE, OURS) else 2,
        )
        if any(p.error < _COARSEST for p in curve):  # else it isn't in the picture
            handles.setdefault(title, handle)


@Command
def campaign(
    out: Path = DEFAULT_OUT,
    repeats: int = 3,
    full: bool = False,
    short: bool = False,
    scenes: str = "",
    peers: str = "",
    cap: float = 10.0,
) -> int:
    """Measure, print the tables, draw the figure; 1 if the bare script itself could not be measured.

    Args:
        repeats: fresh processes per peer.
        full: every setting; else every third.
        short: short horizons alone.
        scenes, peers: names, all by default.
        cap: CPU seconds after which a curve ends.
    """
    asked = chosen(peers, ADAPTERS)
    cases = [(name, end) for name in chosen(scenes, SCENES) for end in SCENES[name].ends[: 1 if short else 2]]
    measured = measure(asked, cases, repeats=repeats, stride=1 if full else 3, fill=0.05, cap=cap)
    print("\n".join([*rows(measured, cases), ""]))
    for peer, seconds in measured.imports.items():
        print(f"import of {peer}: {statistics.median(seconds):.2f} CPU s")
    print("\n".join(measured.notes))
    print(f"figure: {draw(measured, cases, out)}")
    return int(BARE in asked and BARE not in measured.imports)
