"""All figures by name: what each shows, for which datasets, and the one that suits a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import signals
from rigidsim.look.figure_names import FIGURES, OVERVIEW, SPECTRUM
from rigidsim.look.figures import drift, flight, poles, polhode, timelines
from rigidsim.look.figures.composing import Panel, compose, has, shown_rows
from rigidsim.look.roles import drifts

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_STEEP = 1.5  # rad of pitch, near which roll and yaw are ill-defined
_FAR = 0.5  # rad from its mean motion, up to which a pole's path is as on a plane to a tenth


def _has_rates_on_surfaces(dataset: xarray.Dataset) -> bool:
    return polhode.surfaces(dataset) is not None


def _has_herpolhode(dataset: xarray.Dataset) -> bool:
    return polhode.herpolhode(dataset) is not None


def _rolls(dataset: xarray.Dataset) -> bool:
    return _has_rates_on_surfaces(dataset) and _has_herpolhode(dataset)


def _has_pole(dataset: xarray.Dataset) -> bool:
    return bool(poles.pole_paths(dataset)[0])


def _has_orientation(dataset: xarray.Dataset) -> bool:
    return bool(timelines.orientations(dataset))


def _precesses(dataset: xarray.Dataset) -> bool:
    return _has_orientation(dataset) and signals.steady_momentum(dataset) is None


def _nods(dataset: xarray.Dataset) -> bool:
    """Whether a pole that precesses stays near its mean motion, where a plane can be laid on the sphere."""
    if not _precesses(dataset):
        return False
    path = poles.nutation(dataset)
    return path is not None and bool(np.nanmax(np.hypot(*path.T)) < _FAR)


def is_top(dataset: xarray.Dataset) -> bool:
    """Whether the scene is a body on a fixed point under uniform gravity, or a top's angles are recorded."""
    fixed = "position" not in dataset and "uniform_gravity" in signals.load_kinds(dataset)
    return (has("tip")(dataset) and "position" not in dataset) or (
        fixed and signals.pole(dataset, "figure") is not None
    )


def _has_wobble(dataset: xarray.Dataset) -> bool:
    return has("nutation_angle")(dataset) or (
        signals.pole(dataset, "figure") is not None and signals.pole(dataset, "momentum") is not None
    )


def librates(dataset: xarray.Dataset) -> bool:
    """Whether the body keeps its attitude to its orbit: the source stays near one body direction."""
    nadir = signals.values(dataset, "nadir")
    if nadir is None:
        return has("libration")(dataset)
    finite = nadir[np.isfinite(nadir).all(axis=1)]
    mean = finite.mean(axis=0) if len(finite) else np.zeros(3)
    return bool(np.linalg.norm(mean) > 0.5 and (finite @ mean).min() > 0.5 * np.linalg.norm(mean))


def _regular(dataset: xarray.Dataset) -> bool:
    """Whether roll and yaw are defined: pitch stays away from a right angle."""
    table = signals.values(dataset, "roll_pitch_yaw")
    return table is not None and bool(np.nanmax(np.abs(table[:, 1])) < _STEEP)


def _swings(dataset: xarray.Dataset) -> bool:
    return has("libration")(dataset) or _regular(dataset)


RATES = Panel(has("angular_velocity"), timelines.rates, begins=True)
ATTITUDE = Panel(has("euler_angles", "quaternion"), timelines.attitude, begins=True)
DRIFT = Panel(lambda dataset: bool(drifts(dataset)), drift.drift_panel)
POLAR_MOTION = Panel(
    lambda dataset: signals.polar_motion(dataset) is not None, timelines.polar_motion, begins=True
)
OBLIQUITY = Panel(_has_orientation, timelines.obliquity, begins=True)
LONGITUDE = Panel(_has_orientation, timelines.longitude, begins=True)
BRAKING = Panel(lambda dataset: bool(timelines.braked(dataset)), timelines.braking)
LIBRATION = Panel(has("libration"), timelines.libration)
ROLL_PITCH_YAW = Panel(_regular, timelines.roll_pitch_yaw, begins=True)
TILT = Panel(lambda dataset: has("tilt")(dataset) or is_top(dataset), timelines.tilt, begins=True)
PRECESSION = Panel(has("precession_angle"), timelines.precession, begins=True)
WOBBLE = Panel(_has_wobble, timelines.wobble)

CIRCLE = Panel(signals.near_axis, poles.polar_motion_panel)
PATH = Panel(_has_pole, poles.pole_path_panel)
NUTATION = Panel(_nods, poles.nutation_panel)
TIP = Panel(is_top, poles.tip_panel)
NADIR = Panel(has("nadir"), poles.nadir_panel)
PHASES = Panel(_swings, poles.phase_panel)
POLHODE = Panel(has("angular_velocity"), polhode.polhode_panel)
HERPOLHODE = Panel(_has_herpolhode, polhode.herpolhode_panel)
POINSOT = Panel(_rolls, polhode.poinsot_panel)
FLIGHT = Panel(has("position"), flight.path_panel)


@dataclass(frozen=True)
class Kind:
    """A figure that can be asked for.

    Attributes:
        needs: what a run must have for it, in words.
        curves: panels over time.
        planes: square panels.
    """

    needs: str
    curves: Sequence[Panel] = ()
    planes: Sequence[Panel] = ()

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether a dataset (in memory) has what one of its planes needs, or without planes, what a curve
        needs.
        """
        return any(panel.shows(rows) for panel in self.planes or self.curves)


_TURNS, _ATTITUDE = "angular_velocity recorded", "an attitude recorded"
_AXIS = "an attitude or an axis (figure_axis, momentum_axis, obliquity) recorded"
KINDS: dict[str, Kind] = {
    "polar_motion": Kind("a spin near a principal axis", (POLAR_MOTION,), (CIRCLE,)),
    "pole_path": Kind(_AXIS, (), (PATH, NUTATION)),
    "nutation": Kind("a pole that a torque moves, within half a radian of its mean motion", (), (NUTATION,)),
    "obliquity": Kind(_AXIS, (OBLIQUITY, LONGITUDE)),
    "libration": Kind(
        "libration, roll_pitch_yaw or nadir recorded", (LIBRATION, ROLL_PITCH_YAW), (NADIR, PHASES)
    ),
    "tip": Kind("a top: a body on a fixed point under uniform gravity", (TILT, PRECESSION), (TIP,)),
    "polhode": Kind(_TURNS, (), (POLHODE, POINSOT)),
    "herpolhode": Kind("an attitude and a momentum that stays put", (), (HERPOLHODE,)),
    "path": Kind("position recorded", (), (FLIGHT,)),
    "rates": Kind(_TURNS, (RATES,)),
    "attitude": Kind(_ATTITUDE, (ATTITUDE, WOBBLE)),
    "drift": Kind("invariants", (DRIFT,)),
}


def available(dataset: xarray.Dataset) -> list[str]:
    """The figures that a dataset has something for."""
    rows = shown_rows(dataset).rows
    return [OVERVIEW, *(name for name, kind in KINDS.items() if kind.shows(rows))]


def figure(dataset: xarray.Dataset, what: str = OVERVIEW) -> Figure:
    """A figure of a run.

    Args:
        dataset: dataset of a run, possibly lazy, of any length; at most 20,000 rows are drawn.
        what: a name of `FIGURES`.

    Raises:
        ValueError: no such figure, none for this dataset, or a dataset without samples.
    """
    check_name(what)
    if what == OVERVIEW:
        return overview(dataset)
    if what == SPECTRUM:
        raise ValueError(
            "figure 'spectrum': is drawn of an analysis: rigidsim.look.spectrum.spectrum_figure("
            "rigidsim.analyse(run).dataset)"
        )
    kind = KINDS[what]
    if not kind.shows(shown_rows(dataset).rows):
        raise ValueError(
            f"figure {what!r}: needs {kind.needs}, which this run hasn't; "
            f"it has {', '.join(available(dataset))}"
        )
    return compose(dataset, kind.curves, kind.planes)


def check_name(what: str) -> None:
    """Refuse an unknown name with a list of the figures.

    Raises:
        ValueError: no figure has this name.
    """
    if what not in FIGURES:
        close = get_close_matches(what, FIGURES, 1)
        hint = f"; did you mean {close[0]!r}?" if close else "."
        raise ValueError(f"figure {what!r}: there is none of that name{hint} Available: {', '.join(FIGURES)}")


def overview(dataset: xarray.Dataset) -> Figure:
    """The page that suits the scene: its leading figures, drifts of invariants and a table.

    Raises:
        ValueError: a dataset without samples.
    """
    curves, planes = _leading(shown_rows(dataset).rows)
    return compose(dataset, (*curves, DRIFT), planes, facts=True)


def _leading(rows: xarray.Dataset) -> tuple[Sequence[Panel], Sequence[Panel]]:
    moving = (FLIGHT,) if FLIGHT.shows(rows) else ()
    if librates(rows):
        return (LIBRATION, ROLL_PITCH_YAW), (NADIR, *(moving or (PHASES,)))
    if is_top(rows):
        return (TILT, PRECESSION if PRECESSION.shows(rows) else ATTITUDE), (TIP,)
    if signals.near_axis(rows):
        if _precesses(rows) and not moving:
            return (OBLIQUITY, LONGITUDE), (NUTATION, PATH)
        return (POLAR_MOTION,), (CIRCLE, *moving)
    if moving:
        return (RATES, ATTITUDE), (*moving, POLHODE)
    if not (RATES.shows(rows) or ATTITUDE.shows(rows)):  # only axes are known, as of an averaged model
        axes = (OBLIQUITY, LONGITUDE) if _precesses(rows) else (WOBBLE,)
        return (BRAKING, *axes), (NUTATION, PATH)
    if polhode.surfaces(rows) is not None:
        return (RATES, ATTITUDE), (POLHODE, HERPOLHODE)
    return (RATES, ATTITUDE), (POLHODE,)
