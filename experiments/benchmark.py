"""As fast as the machine? Runs of rigidsim beside bare scripts of the same work, and what each may cost.

Held against: scripts in ``experiments/bare`` that anybody would write with heyoka and h5py, imports of the
modules that they need, and a compiled DOP853 (extras ``peers``).

Method: pairs of fresh processes, ours first in every other one; the ratio is the median over the pairs. CPU
seconds (user and system, all threads), imports apart but where the whole process counts; heyoka's cache of
compiled code is warm on both sides. Of the first rows and the warm one what is judged is without estimates;
with them it stands beside, over at most three pairs. Absolute times depend on what else the machine does.

Run: python -m experiments.benchmark [--pairs 7] [--rows sparse,dense,...] [--quick] [--out DIR]
     [--scratch DIR] [--into README.md]
With ``--into`` table and notes replace what stands between that file's lines ``<!-- benchmark -->`` and
``<!-- end of benchmark -->``. Exit code 1 if a ratio is above its bound (never with ``--quick``). 1e8 samples
take some 15 GB of disk and several minutes; ``--rows`` leaves them out.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from experiments.benchmarking.processes import Figures
from experiments.benchmarking.readers import farthest, readings
from experiments.benchmarking.rows import Row
from experiments.benchmarking.rows import rows as all_rows
from experiments.common import BLUE, DEFAULT_OUT, GREY, RED, Command, chosen, new_figure, save, tidy
from experiments.peers import campaign
from experiments.peers.curves import cost_at
from experiments.peers.own_runs import PROPAGATED
from experiments.peers.scenes import SCENES

NAME = "benchmark"
SATELLITE = "satellite"
_ESTIMATED = 3  # pairs with estimates at most


@dataclass
class Result:
    """What came out of a row; ``ratios`` and ``estimated`` pair by pair, the latter with estimates on.

    Attributes:
        ours, bare: the figures that are compared, medians.
        wall: likewise wall seconds, ours and bare.
        size: bytes of both datasets.
        readers: what each makes of ours.
        differences: of its numbers from the bare script's, the largest of each variable.
        note: why there is no ratio, and what else is to be said.
        measure: which figure is compared.
    """

    work: str
    against: str
    bound: float
    ratios: list[float] = field(default_factory=list)
    estimated: list[float] = field(default_factory=list)
    judged: bool = True
    ours: float | None = None
    bare: float | None = None
    wall: tuple[float, float] | None = None
    size: tuple[int, int] | None = None
    readers: dict[str, str] = field(default_factory=dict)
    differences: dict[str, float] = field(default_factory=dict)
    note: str = ""
    measure: str = "cpu"

    @property
    def ratio(self) -> float | None:
        """The median."""
        return statistics.median(self.ratios) if self.ratios else None

    @property
    def met(self) -> bool | None:
        """None where nothing was measured, or is too short to tell."""
        return None if self.ratio is None or not self.judged else self.ratio <= self.bound

    @property
    def line(self) -> str:
        """Of the table."""
        ratio, spread, verdict = "–", "–", "–"
        if self.ratio is not None:
            ratio, verdict = f"{self.ratio:.3g}", _VERDICTS[self.met]
            spread = f"{min(self.ratios):.3g} .. {max(self.ratios):.3g}"
        beside = f"{statistics.median(self.estimated):.3g}" if self.estimated else ""
        cpu = wall = ""
        if self.measure == "cpu" and self.ours is not None and self.bare is not None:
            cpu = f"{self.ours:.3g} / {self.bare:.3g}"
        if self.wall is not None:
            wall = f"{self.wall[0]:.3g} / {self.wall[1]:.3g}"
        size = "" if self.size is None else f"{self.size[0] / 1e6:.3g} / {self.size[1] / 1e6:.3g}"
        cells = [self.work, self.against, ratio, f"{self.bound:g}", verdict, str(len(self.ratios)), spread]
        cells += [beside, cpu, wall, size]
        return f"| {' | '.join(cells)} |"


_VERDICTS = {True: "met", False: "NOT MET", None: "not judged"}
BEGIN, END = "<!-- benchmark -->", "<!-- end of benchmark -->"
HEAD = (
    "| work | against | ratio | at most | | pairs | of them | with estimates | CPU s | wall s | MB |",
    "| --- " * 11 + "|",
)


def measure(row: Row, pairs: int, scratch: Path | None, *, judged: bool = True) -> Result:
    """One row, in fresh processes."""
    result = Result(row.work, row.against, row.bound, judged=judged, measure=row.measure)
    ours: list[Figures] = []
    bare: list[Figures] = []
    with tempfile.TemporaryDirectory(dir=scratch) as warming:  # compiled code, caches of files
        row.bare(Path(warming), False)
    for pair in range(1 if row.measure == "peak" else pairs):
        with (
            tempfile.TemporaryDirectory(dir=scratch) as own,
            tempfile.TemporaryDirectory(dir=scratch) as other,
        ):
            both = [(ours, row.ours, Path(own), not row.plain), (bare, row.bare, Path(other), not row.plain)]
            for figures, job, folder, estimate in both[:: -1 if pair % 2 else 1]:
                figures.append(job(folder, estimate))
            result.ratios.append(ours[-1][row.measure] / bare[-1][row.measure])
            if row.dataset and not pair:
                _look_at(result, next(Path(own).glob("*/dataset.h5")), Path(other) / "bare.h5")
        if row.plain and pair < _ESTIMATED:
            with tempfile.TemporaryDirectory(dir=scratch) as own:
                result.estimated.append(row.ours(Path(own), True)["cpu"] / bare[-1]["cpu"])
    result.ours, result.bare = (statistics.median(f[row.measure] for f in fs) for fs in (ours, bare))
    if "wall" in ours[0] and "wall" in bare[0]:
        first, second = (statistics.median(f["wall"] for f in fs) for fs in (ours, bare))
        result.wall = first, second
    return result


def _look_at(result: Result, ours: Path, bare: Path) -> None:
    result.size = ours.stat().st_size, bare.stat().st_size
    result.readers = readings(ours)
    result.differences = farthest(ours, bare)


def measure_satellite(pairs: int, *, quick: bool) -> list[Result]:
    """The rows without closed form: a satellite under gravity gradient at equal error, against DOP853.

    Both sides take CPU seconds from the start to the quaternion at the last sample, on an integrator that was
    compiled before: for DOP853 its one compiled function, for rigidsim the cheaper of its loop alone (with
    the samples at start and end) and of a run until its samples are on their way to the file (with statistics
    and packing, which no peer does); the ratio with the latter is in the note.
    """
    scene = SCENES[SATELLITE]
    end = scene.ends[0 if quick else 1]
    # the fastest of so many seconds of calls counts: on a shared core some moments are much slower
    found = campaign.measure(
        [campaign.OURS, "numba"], [(SATELLITE, end)], repeats=pairs, fill=0.05 if quick else 0.25
    )
    points, others = (found.of(SATELLITE, end, peer) for peer in (campaign.OURS, "numba"))
    whole = [point for point in points if point.title != PROPAGATED]
    missing = [note for note in found.notes if "left out" in note or "broke" in note]
    results = []
    for error in (1e-6, 1e-9):
        ours, best, recorded = (cost_at(some, error) for some in (points, others, whole))
        ratios = [ours / best] if ours and best else []
        notes = [f"with recording the ratio is {recorded / best:.3g}"] if recorded and best else []
        work = f"satellite without closed form at {error:.0e} rad, {scene.rate * end:.2g} rad"
        note, against = "; ".join(notes + missing), "best compiled DOP853"
        results.append(Result(work, against, 1.0, ratios, judged=not quick, ours=ours, bare=best, note=note))
    return results


def draw(results: Sequence[Result], out: Path) -> Path:
    """Ratios with their bounds, a line for each row."""
    shown = [result for result in results if result.ratio is not None][::-1]
    figure = new_figure(
        10, 1.6 + 0.62 * len(shown), "What rigidsim costs, over a bare script of the same work"
    )
    axes = figure.subplots()
    for place, result in enumerate(shown):
        color = RED if result.met is False else BLUE
        axes.plot([min(result.ratios), max(result.ratios)], [place, place], color=color, lw=2, alpha=0.4)
        axes.plot([result.ratio], [place], "o", color=color, ms=8, label="_")
        axes.plot([result.bound] * 2, [place - 0.32, place + 0.32], color="black", lw=2)
        if result.estimated:
            axes.plot([statistics.median(result.estimated)], [place], "d", color=GREY, ms=6, mfc="white")
    axes.set_yticks(
        range(len(shown)), [f"{r.work}\nagainst {r.against}".replace("`", "") for r in shown], fontsize=8.5
    )
    beside = axes.secondary_yaxis("right")
    beside.set_yticks(range(len(shown)), [f"{r.ratio:.3g} (≤ {r.bound:g})" for r in shown], fontsize=8.5)
    axes.axvline(1, color="#999999", lw=1, ls=":")
    axes.set_ylim(-0.7, len(shown) - 0.2)
    axes.set_xlim(left=0)
    tidy(axes, "ratio (median and range over the pairs); black: at most; diamond: with estimates", "")
    return save(figure, out, NAME)


def report(results: Sequence[Result]) -> str:
    """Markdown: the table, readers and notes."""
    lines = [*HEAD, *(result.line for result in results)]
    lines.append("\nSeconds and MB of the dataset: rigidsim's and the other's, medians of the pairs.")
    for result in results:
        if result.readers:
            said = ", ".join(f"{name}: {what}" for name, what in result.readers.items())
            worst = max(result.differences.values())
            lines.append(f"\n{result.work}: read by {said}; at most {worst:.1e} from the script's numbers")
        if result.note:
            lines.append(f"\n{result.work}: {result.note}")
    return "\n".join(lines)


def replaced(text: str, block: str) -> str:
    """A text with another block between its two marks.

    Raises:
        ValueError: it has no such marks.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no lines {BEGIN} and {END}")
    return f"{before}{begin}\n{block.strip()}\n{end}{after}"


@Command
def benchmark(
    pairs: int = 7,
    rows: str = "",
    quick: bool = False,
    out: Path = DEFAULT_OUT,
    scratch: str = "",
    into: str = "",
) -> int:
    """Measure rows, print and keep their table.

    Args:
        pairs: of fresh processes.
        rows: keys of rows; all by default.
        quick: a hundredth of the lengths, judging no ratio.
        out: folder of table and figure.
        scratch: where runs are written.
        into: a page that has a place for the table.
    """
    wanted = chosen(rows, [*(row.key for row in all_rows(quick=quick)), SATELLITE])
    if into:
        replaced(Path(into).read_text(), "")  # before anything is measured
    results: list[Result] = []
    for row in all_rows(quick=quick):
        if row.key in wanted:
            results.append(measure(row, pairs, Path(scratch) if scratch else None, judged=not quick))
            print(results[-1].line, file=sys.stderr, flush=True)
    if SATELLITE in wanted:
        results += measure_satellite(pairs, quick=quick)
    print(report(results))
    if into:
        Path(into).write_text(replaced(Path(into).read_text(), report(results)))
    print(f"\nfigure: {draw(results, out)}")
    return 0 if quick else int(any(result.met is False for result in results))
