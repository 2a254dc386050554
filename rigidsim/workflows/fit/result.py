"""What a fit tells: typed values, which ``as_dict`` makes JSON of, with dataset, figure and fitted config."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import PrivateAttr

from rigidsim.store.summary_parts import SummaryPart

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from rigidsim.scene.config import Experiment

KIND = "fit"


class FittedParameter(SummaryPart):
    """One number that was estimated, SI.

    Attributes:
        sigma: standard deviation by the sigmas of data, priors and considered numbers; None if undetermined.
        scaled_sigma: the same with the data's sigmas multiplied so that the residuals fit them.
        start: the config's value. prior_sigma: of its prior; None for none.
    """

    key: str
    unit: str
    value: float
    sigma: float | None
    scaled_sigma: float | None
    start: float
    prior_sigma: float | None


class Undetermined(SummaryPart):
    """Numbers that the data can't tell from one another, or at all.

    Attributes:
        keys: those that take part. amounts: by how much each changes along the direction, SI: the data
            stay the same to first order. text: the same in words.
    """

    keys: list[str]
    amounts: list[float]
    text: str


class Outlier(SummaryPart):
    """A row that was left out; ``sigmas``: its largest residual."""

    data: int
    observable: str
    row: str
    time: float
    sigmas: float


class FittedData(SummaryPart):
    """One set of observations; ``rms``: of the residuals of used rows, in ``unit``; ``sigmas``: the same over
    their sigmas.
    """

    number: int
    file: str
    sha256: str
    observable: str
    rows: int
    used: int
    rms: float
    unit: str
    sigmas: float


class ConsideredNumber(SummaryPart):
    """A number that wasn't estimated, and by how much each estimated one follows it, SI."""

    key: str
    unit: str
    value: float
    sigma: float
    effect: list[float]


class FitResult(SummaryPart):
    """Parameters of an experiment, estimated from observations.

    Attributes:
        chi_square: sum of squares of used residuals in sigmas, with the priors'. freedom: used numbers less
            determined parameters. scale: root of their ratio, by which scaled sigmas differ; None without.
        correlations: between parameters, in their order; None for undetermined ones.
        evaluations: of the motion in the last round. starts: how many, and the sums of squares where each
            ended. derivatives: where they came from.
        told: what a user should know besides. folder: of its files; empty if nowhere.
    """

    kind: str = KIND
    name: str
    converged: bool
    parameters: list[FittedParameter]
    correlations: list[list[float | None]]
    undetermined: list[Undetermined]
    outliers: list[Outlier]
    considered: list[ConsideredNumber]
    data: list[FittedData]
    chi_square: float
    freedom: int
    scale: float | None
    evaluations: int
    starts: list[float | None]
    derivatives: str
    told: list[str]
    folder: str = ""

    _dataset: Any = PrivateAttr(default=None)
    _experiment: Any = PrivateAttr(default=None)

    @property
    def dataset(self) -> xarray.Dataset:
        """Parameters, covariances, residuals, and predicted uncertainties along time, with their units."""
        found: xarray.Dataset = self._dataset
        return found

    @property
    def experiment(self) -> Experiment:
        """The config with the estimated values, without ``[fit]``."""
        found: Experiment = self._experiment
        return found

    def value(self, key: str) -> float:
        """The estimated value of a parameter, SI; ``KeyError`` for others."""
        return self._parameter(key).value

    def sigma(self, key: str) -> float | None:
        """Its standard deviation, SI; None if undetermined."""
        return self._parameter(key).sigma

    def _parameter(self, key: str) -> FittedParameter:
        for one in self.parameters:
            if one.key == key:
                return one
        raise KeyError(f"{key}; parameters are {', '.join(one.key for one in self.parameters)}")

    def plot(self) -> Figure:
        """Residuals, correlations, predicted uncertainty along time and the ellipse of the pole."""
        from rigidsim.look.figures.fitted import fitted_figure

        return fitted_figure(self.dataset)

    def view(
        self, *, web: bool = False, png: str | Path | None = None, at: float | str | None = None,
        part: str = "page",
    ) -> int:  # fmt: skip
        """The fitted motion in the viewer, with a cone of one standard deviation about the figure axis, or a
        picture of it; arguments, value and errors are those of ``Run.view``.
        """
        from rigidsim.workflows.fit.seen import fitted_run  # which loads what runs are made with

        run = fitted_run(self.experiment, self.dataset, self.folder or "memory")
        return run.view(web=web, png=png, at=at, part=part)

    def __repr__(self) -> str:
        lines = [f"<FitResult {self.name!r}: {self.sentence}"]
        lines += [f"  {one.key} = {value_text(one)}" for one in self.parameters]
        return "\n".join(lines) + ">"

    __str__ = __repr__

    @property
    def sentence(self) -> str:
        """The fit in one line."""
        state = "converged" if self.converged else "NOT converged"
        left = f", {len(self.outliers)} left out" if self.outliers else ""
        rows = sum(one.used for one in self.data)
        size = "" if self.scale is None else f", residuals {self.scale:.3g} sigmas"
        return f"{state}, {rows:,} row{'' if rows == 1 else 's'}{left}{size}"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(one.key)}</th><td>{escape(value_text(one))}</td></tr>"
            for one in self.parameters
        )
        unknown = "".join(f"<p>undetermined: {escape(one.text)}</p>" for one in self.undetermined)
        return f"<b>{escape(self.name)}</b>: {escape(self.sentence)}<table>{rows}</table>{unknown}"


def value_text(one: FittedParameter) -> str:
    """Value and sigma, to two digits of the sigma, with the unit."""
    unit = "" if one.unit == "1" else f" {one.unit}"
    if one.sigma is None:
        return f"{one.value:.6g}{unit} (undetermined)"
    return f"{digits_text(one.value, one.sigma)} +- {one.sigma:.2g}{unit}"


def digits_text(value: float, sigma: float) -> str:
    """A value to the second digit of its sigma."""
    import math

    if not sigma > 0 or not math.isfinite(sigma):
        return f"{value:.12g}"
    size = math.floor(math.log10(max(abs(value), sigma)))
    digits = min(16, max(2, size - math.floor(math.log10(sigma)) + 2))
    return f"{value:.{digits}g}"
