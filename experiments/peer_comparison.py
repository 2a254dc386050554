"""At equal attitude error, what do rigidsim, bare heyoka and other integrators cost?

Question: a free asymmetric top, a heavy symmetric top and a tumbling satellite under gravity gradient, over
about 140 and 9000 rad: how many CPU seconds of integration for an attitude error of 1e-6, 1e-9, 1e-12 rad at
the end, as a ratio to bare heyoka at its best setting?

Method: each peer in fresh processes, in turn, ``--repeats`` times; per setting the fastest of several calls in
a process, the median over processes; imports and compilation apart. The error is the angle between the final
attitude and that of 128-bit arithmetic (checked against the closed form where there is one). The cost at an
error is read off a peer's points, of all its settings the cheapest, interpolated in the logarithms. A peer
that isn't installed is left out with a message.

Run: python -m experiments.peer_comparison [--repeats 3] [--full] [--peers heyoka,rigidsim,...]
     [--python numbalsoda=/other/bin/python]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mpmath

import rigidsim
from experiments.common import BLUE, DEFAULT_OUT, GREEN, GREY, ORANGE, RED, new_figure, save, tidy
from experiments.peers import ADAPTERS
from experiments.peers.scenes import SCENES, Scene

NAME = "peer_comparison"
ERRORS = (1e-6, 1e-9, 1e-12)
EXTRA = 'pip install "rigidsim[peers]"'
BARE, OURS = "heyoka", "rigidsim"
_STYLES = {
    "heyoka": ("black", "-"), "rigidsim": (BLUE, "-"), "numbalsoda": (ORANGE, "-"), "numba": (RED, "-"),
    "rebound": (GREEN, "-"), "scipy": (GREY, "--"), "diffrax": ("#7570b3", "--"), "mujoco": ("#a6761d", "--"),
}  # fmt: skip
_SLOW = 1.0  # CPU seconds; measured in the first repeat alone


@dataclass
class Point:
    """One setting of one peer on one scene.

    Attributes:
        seconds: CPU of the integration, one per process; ``whole`` of the whole call.
        error: angle to the reference at the end, rad.
    """

    peer: str
    title: str
    scene: str
    end: float
    knob: float
    error: float
    seconds: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    prepare: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Median CPU seconds of the integration."""
        return statistics.median(self.seconds)


@dataclass
class Measured:
    """All points, and what there is to say about peers.

    Attributes:
        imports: CPU seconds, by peer.
        notes: why peers and settings are missing.
    """

    points: dict[tuple[Any, ...], Point] = field(default_factory=dict)
    imports: dict[str, list[float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def of(self, scene: str, end: float, peer: str) -> list[Point]:
        """The points of a peer on one horizon of a scene."""
        return [p for p in self.points.values() if (p.scene, p.end, p.peer) == (scene, end, peer)]


def angle(quaternion: Sequence[float], reference: Sequence[Any]) -> float:
    """Rotation between two attitudes, rad; neither need be normalised."""
    with mpmath.workdps(50):
        a = [mpmath.mpf(q) for q in quaternion]
        b = [mpmath.mpf(q) for q in reference]
        scalar = mpmath.fsum(x * y for x, y in zip(a, b, strict=True))
        products = [a[i] * b[j] - a[j] * b[i] for i in range(4) for j in range(i)]
        return float(2 * mpmath.atan2(mpmath.sqrt(mpmath.fsum(p * p for p in products)), abs(scalar)))


def cost_at(points: Sequence[Point], error: float) -> float | None:
    """CPU seconds for an error, by the cheapest of the settings that reach it.

    On each curve (points of one title, by error) the logarithm of the cost is interpolated between the two
    settings around the error; past its end no curve is extended, neither to fewer digits nor to more.

    Returns:
        None if no setting reaches the error.
    """
    found = []
    for title in {p.title for p in points}:
        curve = frontier([p for p in points if p.title == title])
        if not curve or curve[-1].error > error:
            continue
        after = next(n for n, p in enumerate(curve) if p.error <= error)
        second = curve[after]
        if after == 0 or second.error == 0:
            found.append(second.cost)
            continue
        first = curve[after - 1]
        part = math.log(error / first.error) / math.log(second.error / first.error)
        found.append(first.cost * (second.cost / first.cost) ** part)
    return min(found, default=None)


def frontier(points: Sequence[Point]) -> list[Point]:
    """Those that none beats in both cost and error, from cheap to accurate."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cost, p.error)):
        if math.isfinite(point.error) and (not kept or point.error < kept[-1].error):
            kept.append(point)
    return kept


def measure(
    peers: Sequence[str],
    cases: Sequence[tuple[str, float]],
    *,
    repeats: int,
    stride: int = 1,
    fill: float = 0.05,
    cap: float = 10.0,
    pythons: dict[str, str] | None = None,
) -> Measured:
    """Run the peers in turn, each in fresh processes.

    Args:
        peers: names from ``ADAPTERS``.
        cases: pairs of scene and end.
        repeats: processes per peer.
        stride: take every n-th knob.
        fill: CPU seconds of calls per setting, the fastest of which counts.
        cap: CPU seconds of one call from which tighter settings of a peer are left out.
        pythons: interpreters of peers that live in another environment.
    """
    truths = {case: reference(*case) for case in cases}
    measured = Measured()
    slow: set[tuple[Any, ...]] = set()
    for number in range(repeats):
        for peer in peers:
            if number and peer not in measured.imports:
                continue
            skip = [key[1:] for key in slow if key[0] == peer]
            request = {"cases": list(cases), "skip": skip, "stride": stride, "fill": fill, "cap": cap}
            print(f"repeat {number + 1} of {repeats}: {peer}", file=sys.stderr, flush=True)
            for record in _child(peer, request, (pythons or {}).get(peer, sys.executable)):
                _note(measured, peer, record, truths, slow)
    return measured


def _child(peer: str, request: dict[str, Any], python: str) -> list[dict[str, Any]]:
    root = Path(__file__).parents[1]
    command = [python, "-m", "experiments.peers.child", peer, json.dumps(request)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=root, env=_environment())
    records = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode:
        reason = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        records.append({"broke": reason[0]})
    return records


def _environment() -> dict[str, str]:
    """One thread each, so that CPU seconds are those of the work."""
    return os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


def _note(
    measured: Measured, peer: str, record: dict[str, Any], truths: dict[Any, Any], slow: set[tuple[Any, ...]]
) -> None:
    note = ""
    if "absent" in record:
        note = f"{peer} left out: {record['absent']}; install it with {EXTRA}"
    elif "broke" in record:
        note = f"{peer} broke down: {record['broke']}"
    elif "import_seconds" in record:
        measured.imports.setdefault(peer, []).append(record["import_seconds"])
    elif "refused" in record:
        what = " ".join(record["refused"].split())
        note = f"{peer}, {record['variant']} on {record['scene']}: {what}"
    else:
        case = record["scene"], record["end"]
        key = (peer, *case, record["variant"], record["knob"])
        if key not in measured.points:
            error = angle(record["quaternion"], truths[case])
            measured.points[key] = Point(peer, record["title"], *case, record["knob"], error)
        point = measured.points[key]
        point.seconds.append(record["seconds"])
        point.whole.append(record["whole"])
        point.prepare.append(record["prepare"])
        if record["whole"] > _SLOW and peer not in (BARE, OURS):
            slow.add(key)
    if note and note not in measured.notes:
        measured.notes.append(note)


def reference(name: str, end: float) -> list[Any]:
    """The final quaternion by heyoka in 128-bit arithmetic, tolerance 1e-32."""
    from experiments.peers.bare_heyoka import reference as integrated

    with mpmath.workdps(50):
        return [mpmath.mpf(text) for text in integrated(SCENES[name], end)]


def closed_form(scene: Scene, end: float) -> list[Any] | None:
    """The final quaternion in closed form to 34 digits; None where there is none."""
    from rigidsim.prepare import prepare
    from rigidsim.solve.closed import ClosedForm, closed_form_of

    prepared = prepare(rigidsim.parse(scene.config(end), overrides=["integrator.precision=40"]))
    form = closed_form_of(prepared.scene)
    if not isinstance(form, ClosedForm):
        return None
    return list(form.exactly(mpmath.mpf(end), 34)[1])


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


def settings(measured: Measured, cases: Sequence[tuple[str, float]]) -> list[str]:
    """Markdown: each setting's most accurate point, what it costs, and what comes before it."""
    lines = ["| scene, end | way | best error, rad | CPU ms | whole call, ms | compile, s |"]
    lines.append("| --- " * 6 + "|")
    for scene, end in cases:
        for peer in ADAPTERS:
            points = measured.of(scene, end, peer)
            for title in dict.fromkeys(p.title for p in points):
                curve = frontier([p for p in points if p.title == title])
                if not curve:
                    continue
                best = curve[-1]
                whole, compiled = statistics.median(best.whole), max(max(p.prepare) for p in curve)
                lines.append(
                    f"| {scene}, {end:g} s | {title} | {best.error:.1e} | {1e3 * best.cost:.3g} "
                    f"| {1e3 * whole:.3g} | {compiled:.2g} |"
                )
    return lines


def draw(measured: Measured, cases: Sequence[tuple[str, float]], out: Path) -> Path:
    """Work against precision, a panel per scene and horizon; lower left is better."""
    scenes, most = list(dict.fromkeys(s for s, _ in cases)), max(1, len(cases))
    columns = max(sum(s == scene for s, _ in cases) for scene in scenes)
    title = "What does an attitude cost? CPU seconds of the integration against its error at the end"
    figure = new_figure(6.2 * columns, 1 + 3.6 * math.ceil(most / columns), title)
    grid = figure.subplots(len(scenes), columns, squeeze=False)
    handles: dict[str, Any] = {}
    for panel in grid.flat:
        panel.set_visible(False)
    for row, scene in enumerate(scenes):
        for column, end in enumerate(e for s, e in cases if s == scene):
            panel = grid[row][column]
            panel.set_visible(True)
            for peer in measured.imports:
                _curves(panel, measured.of(scene, end, peer), peer, handles)
            panel.set(xscale="log", yscale="log")
            panel.set_xlim(1e-2, 1e-16)
            rads = SCENES[scene].rate * end
            tidy(panel, "attitude error, rad", "CPU seconds", f"{SCENES[scene].title}, {rads:,.0f} rad")
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False, fontsize=8
    )
    return save(figure, out, NAME)


_MARKERS = "osD^vPX"


def _curves(panel: Any, points: list[Point], peer: str, handles: dict[str, Any]) -> None:
    color, line = _STYLES[peer]
    for number, title in enumerate(dict.fromkeys(p.title for p in points)):
        # an exact zero and what lies beyond double have no place on the axis
        curve = [p for p in points if p.title == title and math.isfinite(p.error)]
        (handle,) = panel.plot(
            [max(p.error, 1e-16) for p in curve],
            [p.cost for p in curve],
            color=color,
            linestyle=line if number == 0 else ":",
            marker=_MARKERS[number % len(_MARKERS)],
            markersize=3.5,
            linewidth=1.6 if peer in (BARE, OURS) and number == 0 else 1,
            zorder=3 if peer in (BARE, OURS) else 2,
        )
        handles.setdefault(title, handle)


def arguments_of(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog=f"python -m experiments.{NAME}", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT, help="folder of the figure")
    parser.add_argument("--repeats", type=int, default=3, help="fresh processes per peer")
    parser.add_argument("--full", action="store_true", help="every setting; else every third")
    parser.add_argument("--short", action="store_true", help="short horizons alone")
    parser.add_argument("--scenes", default=",".join(SCENES), help="default: %(default)s")
    parser.add_argument("--peers", default=",".join(ADAPTERS), help="default: %(default)s")
    parser.add_argument("--cap", type=float, default=10.0, help="CPU seconds after which a curve ends")
    parser.add_argument(
        "--python", action="append", default=[], metavar="PEER=PYTHON", help="interpreter for a peer"
    )
    arguments = parser.parse_args(argv)
    for option, known in (("peers", ADAPTERS), ("scenes", SCENES)):
        chosen = getattr(arguments, option).split(",")
        wrong = [name for name in chosen if name not in known]
        if wrong:
            parser.error(f"--{option}: given {', '.join(wrong)}; known: {', '.join(known)}")
        setattr(arguments, option, chosen)
    return arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the tables, draw the figure; 1 if the bare script itself could not be measured."""
    arguments = arguments_of(argv)
    ends = 1 if arguments.short else 2
    cases = [(name, end) for name in arguments.scenes for end in SCENES[name].ends[:ends]]
    pythons = dict(text.split("=", 1) for text in arguments.python)
    measured = measure(
        arguments.peers,
        cases,
        repeats=arguments.repeats,
        stride=1 if arguments.full else 3,
        fill=0.05,
        cap=arguments.cap,
        pythons=pythons,
    )
    print("\n".join([*rows(measured, cases), "", *settings(measured, cases), ""]))
    for peer, seconds in measured.imports.items():
        print(f"import of {peer}: {statistics.median(seconds):.2f} CPU s")
    print("\n".join(measured.notes))
    print(f"figure: {draw(measured, cases, arguments.out)}")
    return int(BARE in arguments.peers and BARE not in measured.imports)


if __name__ == "__main__":
    raise SystemExit(main())
