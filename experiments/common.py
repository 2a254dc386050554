"""What all studies share: checks and their table, the command line, runs in a temporary folder, figures.

A study is a module whose text asks a question and whose ``study(full)``, under ``@Study``, returns checks
and a picture; its command writes ``out/NAME.png`` and ends with exit code 1 if a check fails. Campaigns of
other kinds have a function under ``@Command``.
"""

import argparse
import inspect
import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import mpmath
import numpy as np
import xarray
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import rigidsim
from rigidsim.scene.parts_of_values import parts_in

CONFIGS = Path(__file__).parents[1] / "configs"
DEFAULT_OUT = Path("runs/experiments")
BLUE, ORANGE, GREEN, RED, GREY = "#2166ac", "#e08214", "#1b9e77", "#b2182b", "#636363"
COLORS = {"blue": BLUE, "orange": ORANGE, "green": GREEN, "red": RED, "grey": GREY}
EPSILON = {"single": 2.0**-23, "double": 2.0**-52, "extended": 2.0**-63, "quadruple": 2.0**-112}


@dataclass(frozen=True)
class Check:
    """One number held against another.

    Attributes:
        name: what was measured.
        measured, expected: in ``unit``; floats, or mpf where double would not do.
        tolerance: largest error that passes: over abs(expected) if relative, else in ``unit``.
        unit: of both numbers; "1" for none.
        source: where the expected number is from, and where the tolerance is from.
        kind: "relative", "absolute", or "apart": the numbers must differ by more than the tolerance (in
            ``unit``), for what a model must not reproduce.
    """

    name: str
    measured: Any
    expected: Any
    tolerance: float
    unit: str
    source: str
    kind: Literal["relative", "absolute", "apart"] = "relative"

    @property
    def error(self) -> float:
        """Relative to the expected number, or in ``unit``."""
        difference = abs(self.measured - self.expected)
        return float(difference / abs(self.expected) if self.kind == "relative" else difference)

    @property
    def passed(self) -> bool:
        """False for nan, whatever the kind."""
        return self.error > self.tolerance if self.kind == "apart" else self.error <= self.tolerance

    @property
    def row(self) -> str:
        """A Markdown row."""
        allowed = {"relative": f"{self.tolerance:.1e} rel", "absolute": f"{self.tolerance:.1e}",
                   "apart": f"> {self.tolerance:.1e}"}[self.kind]  # fmt: skip
        unit = "" if self.unit == "1" else f" {self.unit}"
        verdict = "ok" if self.passed else "**FAILED**"
        return (
            f"| {self.name} | {_shown(self.measured, self)} | {_shown(self.expected, self)}{unit} "
            f"| {self.error:.1e} | {allowed} | {verdict} | {self.source} |"
        )


def _shown(value: Any, check: Check) -> str:
    """As many digits as the tolerance resolves, and one more; at least four, at most 34."""
    scale = max(abs(check.expected), abs(value)) or 1
    tolerance = check.tolerance if check.kind == "relative" else check.tolerance / float(scale)
    digits = 1 - math.floor(math.log10(tolerance)) if tolerance > 0 else 34
    with mpmath.workdps(60):
        return str(mpmath.nstr(mpmath.mpf(value), min(max(digits, 4), 34)))


def table(checks: Sequence[Check], title: str = "") -> str:
    """The checks as a Markdown table, with a verdict below."""
    failed = sum(not check.passed for check in checks)
    verdict = f"{len(checks)} checks, all passed" if not failed else f"{len(checks)} checks, {failed} FAILED"
    head = [f"## {title}", ""] if title else []
    return "\n".join(
        [
            *head,
            "| check | measured | expected | error | allowed | | source; origin of the tolerance |",
            "| --- | --- | --- | --- | --- | --- | --- |",
            *(check.row for check in checks),
            "",
            verdict,
        ]
    )


@dataclass(frozen=True)
class Result:
    """A finished run, in memory."""

    dataset: xarray.Dataset
    summary: dict[str, Any]

    @property
    def steps(self) -> int:
        """Taylor steps taken."""
        return int(self.summary["cost"]["steps"])

    @property
    def seconds(self) -> float:
        """CPU of integrating and recording."""
        return float(self.summary["cost"]["cpu_by_phase"]["integrate_and_record"])

    def told(self, name: str) -> "Result":
        """Print steps and CPU on stderr."""
        print(f"{name:40s} {self.steps:12,d} steps, {self.seconds:.3g} s", file=sys.stderr)
        return self

    def apart(self, other: "Result", name: str = "momentum_axis") -> np.ndarray:
        """Distances of a vector from another run's, at the samples."""
        return np.asarray(np.linalg.norm(self.values(name) - other.values(name), axis=1))

    def announced(self, name: str = "momentum_axis") -> float:
        """How far an averaged run says that a variable may be from the full motion's, until the end."""
        return float(self.summary["modelling"][name])

    def values(self, name: str) -> Any:
        """A variable as a float64 array."""
        return self.dataset[name].values

    def exact(self, name: str, component: str = "") -> list[Any]:
        """A scalar variable, the time or a component, as mpf with every digit of the run's precision."""
        chosen = {self.dataset[name].dims[1]: component} if component else {}
        return exact(*(self.dataset[part].sel(chosen).values for part in parts_in(self.dataset, name)))


def exact(*parts: Any) -> list[Any]:
    """The sums of float64 parts, as mpf of the current mpmath precision."""
    return [sum(mpmath.mpf(float(x)) for x in reversed(row)) for row in zip(*parts, strict=True)]


def simulate(config: str | Path, *overrides: str) -> Result:
    """Run a config in a folder of its own that goes away, without a timeline.

    Args:
        config: the path of a config, or a TOML text.
        overrides: ``KEY=VALUE`` texts.

    Raises:
        RuntimeError: the run didn't finish.
    """
    settings = ["output.timeline=false", *overrides]
    read: Callable[..., rigidsim.Experiment] = rigidsim.load if isinstance(config, Path) else rigidsim.parse
    experiment = read(config, overrides=settings)
    with tempfile.TemporaryDirectory() as folder:
        run = rigidsim.run(experiment, out=folder)
        if run.status != "finished":
            raise RuntimeError(f"{experiment.config.name}: {run.status}: {run.summary['message']}")
        with run.dataset as dataset:
            return Result(dataset.load(), run.summary)


def covered(title: str, distance: np.ndarray, announced: float) -> Check:
    """An average's largest distance from the full motion over what it announces."""
    print(f"{title}: {distance.max():.2g} from the full motion, {announced:.2g} announced", file=sys.stderr)
    name = f"{title} from the full motion's, over what is announced"
    source = "summary.json, modelling: at most 1"
    return Check(name, float(distance.max()) / announced, 0.5, 0.5, "1", source, "absolute")


def round_off(result: Result, rate: float, precision: str = "double") -> float:
    """Three times the round-off law of attitudes, (eps/2) sqrt(steps) |w| t / sqrt 3 (Brouwer 1937), rad.

    Args:
        result: for its steps and duration.
        rate: abs(w), rad/s.
        precision: of the run.
    """
    time = result.values("time")
    duration = float(time[-1] - time[0])
    return 3 * EPSILON[precision] / 2 * math.sqrt(result.steps) * rate * duration / math.sqrt(3)


def new_figure(width: float = 10, height: float = 6, title: str = "") -> Figure:
    """A figure on the Agg canvas, with a title that answers the study's question."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(title, fontsize=13, fontweight="bold")
    return figure


def tidy(axes: Any, xlabel: str, ylabel: str, title: str = "") -> None:
    """Labels, a light grid, no box."""
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    if title:
        axes.set_title(title, fontsize=10.5)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in {"top", "right"} & set(axes.spines):  # which maps of a sphere lack
        axes.spines[side].set_visible(False)


def save(figure: Figure, out: Path, name: str) -> Path:
    """Write ``out/name.png``."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{name}.png"
    figure.savefig(path, dpi=130)
    return path


@dataclass(frozen=True)
class Curve:
    """A line, or dots, in matplotlib's style; without x or y a level from side to side.

    Attributes:
        color: a name in ``COLORS``, or of matplotlib.
        width: of lines, and 4 of them the diameter of markers.
        more: further options of ``Axes.plot``.
    """

    x: Any
    y: Any
    label: str = ""
    color: str = "blue"
    style: str = "-"
    width: float = 1.2
    more: Mapping[str, Any] = field(default_factory=dict)

    def draw(self, axes: Any) -> None:
        """Onto axes."""
        options = {"color": COLORS.get(self.color, self.color), "linewidth": self.width, **self.more}
        if self.label:
            options["label"] = self.label
        if self.x is None:
            axes.axhline(self.y, linestyle=self.style, **options)
        elif self.y is None:
            axes.axvline(self.x, linestyle=self.style, **options)
        else:
            axes.plot(self.x, self.y, self.style, **{"markersize": 4 * self.width, **options})


@dataclass(frozen=True)
class Panel:
    """Curves with their labels.

    Attributes:
        log: which axes are logarithmic: "", "x", "y" or "xy".
        equal: whether both axes have one scale.
        legend: where it stands; none without labels.
        limits: ``xlim``, ``ylim`` and what else ``Axes.set`` takes.
        more: what curves can't say, drawn onto the axes.
    """

    title: str
    xlabel: str
    ylabel: str
    curves: Sequence[Curve] = ()
    log: str = ""
    equal: bool = False
    legend: str = "best"
    limits: Mapping[str, Any] = field(default_factory=dict)
    more: Callable[[Any], None] = lambda axes: None

    def draw(self, axes: Any) -> None:
        """Onto axes."""
        for curve in self.curves:
            curve.draw(axes)
        axes.set(**{f"{axis}scale": "log" for axis in self.log})
        if self.equal:
            axes.set_aspect("equal", adjustable="datalim")
        tidy(axes, self.xlabel, self.ylabel, self.title)
        self.more(axes)
        axes.set(**self.limits)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(loc=self.legend, fontsize=9, framealpha=0.8)


@dataclass(frozen=True)
class Picture:
    """Panels under a title that answers the study's question.

    Attributes:
        layout: a mosaic of letters, one for each panel in order ("ab;cc").
        size: inches.
        options: of ``Figure.subplot_mosaic``: ``height_ratios``, ``per_subplot_kw`` ...
    """

    title: str
    layout: str
    panels: Sequence[Panel]
    size: tuple[float, float] = (11.0, 5.5)
    options: Mapping[str, Any] = field(default_factory=dict)

    def figure(self) -> Figure:
        """The figure."""
        figure = new_figure(*self.size, self.title)
        axes = figure.subplot_mosaic(self.layout, **self.options)
        for letter, panel in zip(sorted(axes), self.panels, strict=True):
            panel.draw(axes[letter])
        return figure


Answer = tuple[list[Check], Picture | None]
"""Checks, and the picture if there is one."""


class Command:
    """``@Command`` over the last function of a module makes a command of it, with its arguments as options.

    The function prints what it finds, and returns the exit code: 0 if nothing is wrong. A module that is run
    by ``python -m`` ends here.

    Attributes:
        name: of the module.
        question: the module's text.
    """

    def __init__(self, measure: Callable[..., Any]) -> None:
        self.measure = measure
        self.name = Path(measure.__code__.co_filename).stem
        self.question = str(measure.__globals__["__doc__"])
        if measure.__module__ == "__main__":
            raise SystemExit(self.main())

    @property
    def options(self) -> dict[str, Any]:
        """Names and defaults, whose types the given values get; a switch is False by default."""
        return {name: one.default for name, one in inspect.signature(self.measure).parameters.items()}

    def parsed(self, argv: Sequence[str] | None) -> dict[str, Any]:
        """The function's arguments."""
        parser = argparse.ArgumentParser(
            prog=f"python -m experiments.{self.name}",
            description=self.question,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        for name, default in self.options.items():
            flag = f"--{name.replace('_', '-')}"
            if default is False:
                parser.add_argument(flag, action="store_true")
            else:
                parser.add_argument(flag, type=type(default), default=default, help="default: %(default)s")
        return vars(parser.parse_args(argv))

    def main(self, argv: Sequence[str] | None = None) -> int:
        """The command."""
        return int(self.measure(**self.parsed(argv)))


def chosen(text: str, known: Iterable[str]) -> list[str]:
    """Names in an option's text, separated by commas; all that are known if it is empty.

    Raises:
        SystemExit: one isn't known.
    """
    names = text.split(",") if text else list(known)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise SystemExit(f"given {', '.join(unknown)}; known: {', '.join(known)}")
    return names


class Study(Command):
    """A study of motions, ``study(full) -> Answer``; ``--full`` is for longer runs and more cases."""

    @property
    def options(self) -> dict[str, Any]:
        """Those of the function, and ``--out``, the folder of the figure."""
        return super().options | {"full": False, "out": DEFAULT_OUT}

    def __call__(self, full: bool, out: Path, **more: Any) -> list[Check]:
        """Measure, and save the picture as ``out/NAME.png``."""
        checks, picture = self.measure(full, **more)
        if picture is not None:
            save(picture.figure(), out, self.name)
        return checks

    def main(self, argv: Sequence[str] | None = None) -> int:
        """Print the table; exit code 1 if a check failed."""
        checks = self(**self.parsed(argv))
        print(table(checks, self.name))
        return int(not checks or not all(check.passed for check in checks))
