"""What a comparison tells: typed values, which ``as_dict`` makes JSON of, with dataset and figure."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import PrivateAttr

from rigidsim.store.outputs import writing
from rigidsim.store.summary_parts import SummaryPart
from rigidsim.workflows.compare.conventions import Convention

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

AGREES, INTEGRATION_ERROR, WRONG_MODEL, UNDECIDED = "agrees", "integration_error", "wrong_model", "undecided"
INCONSISTENT_RATES = "inconsistent_rates"
_MOST_DRAWN = 4000  # points of a figure


class AttitudeError(SummaryPart):
    """Angle between the trajectory's attitudes and the experiment's, rad, over all rows.

    ``time``: of the largest one, s; ``row``: as the file counts it.
    """

    largest: float
    rms: float
    time: float
    row: str


class TrajectoryDrift(SummaryPart):
    """Largest drift of an invariant by the trajectory's own numbers, relative to ``rigidsim``'s scale."""

    name: str
    largest: float
    final: float


class LocalDefects(SummaryPart):
    """What the experiment's equations miss from rows to the next ones.

    Attributes:
        largest: angle, rad; rms: the same in the mean; time: of the largest, s.
        rate_largest: rad/s; None without rates in the trajectory.
        rows: number of rows that were started from.
        window_s: length of the windows that models are told from integrators by.
        unexplained: of the windows' attitude defects, rms of what differences of the rates don't explain
            over rms of what they do; without rates of what no added acceleration explains over all.
        missing_acceleration: rms, rad/s^2, that would explain the rates' defects, or the attitude's where
            the trajectory has no rates.
        order: of the tool's method, and step_tolerance: rad, that errors of its steps are held to, if rows
            are its steps; None where they don't show.
    """

    largest: float
    rms: float
    time: float
    rate_largest: float | None
    rows: int
    window_s: float | None
    unexplained: float | None
    missing_acceleration: float | None
    order: float | None = None
    step_tolerance: float | None = None


class Disagreement(SummaryPart):
    """The first row that is further from the experiment than ``within``."""

    time: float
    row: str


class Comparison(SummaryPart):
    """A trajectory of another tool beside an experiment.

    Attributes:
        verdict: agrees, integration_error, wrong_model, inconsistent_rates or undecided.
        why: the verdict in words, with the numbers that it was given for.
        within: rad, what attitudes may differ by and agree.
        resolution: rad, of the trajectory's attitudes by the digits that they are written in.
        rate_error: largest difference of angular velocities, rad/s; None without rates.
        position_error: the same of positions, m.
        told: what a user should know besides.
        dataset_file, figure_file, timeline_file: where they were written; empty if nowhere.
    """

    name: str
    source: str
    rows: int
    span_s: float
    verdict: str
    why: str
    within: float
    resolution: float
    attitude_error: AttitudeError
    rate_error: float | None
    position_error: float | None
    convention: Convention
    drifts: list[TrajectoryDrift]
    local_defects: LocalDefects | None
    first_disagreement: Disagreement | None
    told: list[str]
    dataset_file: str = ""
    figure_file: str = ""
    timeline_file: str = ""

    _dataset: Any = PrivateAttr(default=None)

    @property
    def dataset(self) -> xarray.Dataset:
        """Attitude error, drifts and defects along time, with their units."""
        found: xarray.Dataset = self._dataset
        return found

    def plot(self) -> Figure:
        """Attitude error, drifts and local defects along time."""
        from rigidsim.look.figures.compared import compared_figure

        return compared_figure(thinned(self.dataset))

    def save(self, path: str | Path) -> Path:
        """Write the dataset (netCDF-4/HDF5)."""
        with writing(Path(path)) as temporary:
            self.dataset.to_netcdf(temporary, engine="h5netcdf")
        return Path(path)

    def __repr__(self) -> str:
        error = self.attitude_error
        return (
            f"<Comparison of {self.source} with {self.name!r}: {self.verdict}, attitude error "
            f"{error.largest:.3g} rad at {error.time:.6g} s ({error.rms:.3g} rms)>"
        )

    __str__ = __repr__

    def _repr_html_(self) -> str:
        rows = [
            ("verdict", self.verdict),
            ("why", self.why),
            ("attitude error", f"{self.attitude_error.largest:.4g} rad"),
        ]
        rows += [(f"drift of {x.name}", f"{x.largest:.3g}") for x in self.drifts]
        cells = "".join(f"<tr><th>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in rows)
        return f"<table>{cells}</table>"


def thinned(dataset: xarray.Dataset) -> xarray.Dataset:
    """A comparison's dataset with, of very many rows, the largest of each stretch, as a figure shows them."""
    stretch = -(-dataset.sizes["time"] // _MOST_DRAWN)
    return (
        dataset if stretch == 1 else abs(dataset).coarsen(time=stretch, boundary="pad").max(keep_attrs=True)
    )
