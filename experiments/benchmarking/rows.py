"""The rows of the benchmark: what is run, what it is held against, and what the ratio may be at most."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.benchmarking.processes import SCRIPT, Figures, told, whole

CONFIG = """name = "benchmark"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1.0, 0.05]
[time]
end = {end}
samples = {samples}
[integrator]
precision = "{precision}"
hold_invariants = false
[output]
timeline = {timeline}
estimate = {estimate}
"""
_TIMES = 50  # in a warm process
_EXTENDED_TOLERANCE = 2.0**-66
"""An eighth of epsilon keeps the truncation of the series below the rounding; a step costs a seventh more."""
_MODULE = ("-m", "experiments.benchmarking.ours")


Job = Callable[[Path, bool], Figures]
"""Something to run in a fresh process: takes a folder, and whether estimates are on."""


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        key: for ``--rows``.
        work, against: in words.
        bound: of the median ratio.
        ours, bare: what is run.
        measure: which of the figures is compared.
        plain: whether the ratio that is judged is without estimates.
        dataset: whether both leave a dataset with the same variables.
    """

    key: str
    work: str
    against: str
    bound: float
    ours: Job
    bare: Job
    measure: str = "cpu"
    plain: bool = True
    dataset: bool = False


@dataclass(frozen=True)
class Scene:
    """The free body of the benchmark."""

    end: float
    samples: int
    precision: str = "double"
    timeline: bool = False

    def config(self, folder: Path, estimate: bool) -> str:
        """The path of its config, written into a folder."""
        path = folder / "benchmark.toml"
        values = {"end": self.end, "samples": self.samples, "precision": self.precision}
        switches = {"timeline": str(self.timeline).lower(), "estimate": str(estimate).lower()}
        path.write_text(CONFIG.format(**values, **switches))
        return str(path)

    @property
    def run(self) -> Job:
        """A run folder, imports apart."""
        return lambda folder, estimate: told([*_MODULE, self.config(folder, estimate), str(folder)])

    @property
    def command(self) -> Job:
        """The command line as a whole."""
        begin = ("-m", "rigidsim", "run")
        return lambda folder, estimate: whole([*begin, self.config(folder, estimate), "--out", str(folder)])

    @property
    def warm(self) -> Job:
        """In memory, again and again."""
        again = ("--again", str(_TIMES))
        return lambda folder, estimate: told([*_MODULE, self.config(folder, estimate), *again])

    def script(self, kind: str, tolerance: float | None = None) -> Job:
        """The script of ``experiments/bare``; at heyoka's own tolerance unless another is given."""
        more = ["extended"] if self.precision == "extended" else []
        more += [] if tolerance is None else [repr(tolerance)]
        given = [str(self.end), str(self.samples), *more]
        return lambda folder, _: told([SCRIPT, kind, str(folder / "bare.h5"), *given])


def imports(*modules: str) -> Job:
    """An interpreter that does nothing but import."""
    return lambda folder, estimate: whole(["-c", f"import {', '.join(modules)}"])


def rows(*, quick: bool) -> list[Row]:
    """All rows but those of the satellite.

    Args:
        quick: a hundredth of the lengths, where ratios tell nothing.
    """
    part = 0.01 if quick else 1.0
    sparse = Scene(1e7 * part, 1001)
    dense = Scene(1e5 * part, round(1e6 * part))
    shown = Scene(1e5 * part, round(1e6 * part), timeline=True)
    extended = Scene(1e5 * part, round(1e5 * part), "extended")
    few, many = Scene(1e5 * part, round(1e6 * part)), Scene(1e5 * part, round(1e8 * part))
    tiny = Scene(1.0, 11)
    return [
        Row(
            "sparse", f"free body, {_span(sparse)}", "`propagate_grid` + h5py", 1.03,
            sparse.run, sparse.script("sparse"),
        ),
        Row(
            "dense", f"free body, {_span(dense)}, default record",
            "script with the same variables, gzip 4 + shuffle", 0.6,
            dense.run, dense.script("dense"), dataset=True,
        ),
        Row(
            "timeline", f"the same with its timeline ({min(shown.samples, 100_000):,} rows)",
            "the same script without one", 0.8,
            shown.run, dense.script("dense"),
        ),
        Row(
            "extended", f"80-bit, {_span(extended)}", "the same script in 80-bit arithmetic", 1.02,
            extended.run, extended.script("dense"), dataset=True,
        ),
        Row(
            "extended_alike", f"80-bit, {_span(extended)}", "that script at the tolerance of rigidsim", 1.02,
            extended.run, extended.script("dense", _EXTENDED_TOLERANCE), dataset=True,
        ),
        Row(
            "memory", f"{many.samples:.0e} samples: peak memory", f"{few.samples:.0e} samples", 1.1,
            many.run, few.run, measure="peak", plain=False,
        ),
        Row(
            "tiny", "tiny scene, whole process, no timeline", '`python -c "import heyoka, h5py"`', 3.0,
            tiny.command, imports("heyoka", "h5py"), plain=False,
        ),
        Row(
            "tiny_timeline", "tiny scene, whole process, with timeline",
            '`python -c "import heyoka, h5py, rerun"`', 2.1,
            Scene(1.0, 11, timeline=True).command, imports("heyoka", "h5py", "rerun"), plain=False,
        ),
        Row(
            "warm", "tiny scene in a warm process, no files", "bare `taylor_adaptive` + run", 2.0,
            tiny.warm, lambda folder, estimate: told([SCRIPT, "warm", str(_TIMES)]),
        ),
    ]  # fmt: skip


def _span(scene: Scene) -> str:
    return f"T = {scene.end:.0e}, {scene.samples:,} samples"
