"""All figures by name: what each needs and consists of, and the page that suits a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import xarray
from matplotlib import rc_context
from matplotlib.figure import Figure

from rigidsim.look import signals
from rigidsim.look.figure_names import FIGURES, OVERVIEW, SPECTRUM
from rigidsim.look.figures import (
    changing,
    gyrostat,
    librations,
    poles,
    polhode,
    published,
    sensitivity,
    timelines,
)
from rigidsim.look.figures.composing import compose, shown_rows
from rigidsim.look.figures.drift import drift
from rigidsim.look.figures.panel import Panel
from rigidsim.look.figures.slides import slide
from rigidsim.look.figures.style import STYLE

SUFFIXES = (".png", ".svg")
_DOTS, _SLIDE_DOTS = 160, 250  # per inch


@dataclass(frozen=True)
class Kind:
    """A figure that can be asked for (``FIGURES`` has in a line what it shows): what a run must have for it,
    in words, its panels over time and its square ones. It can be drawn of a run that has something for one of
    the latter, or without them for one of the former.
    """

    needs: str
    curves: Sequence[Panel] = ()
    planes: Sequence[Panel] = ()

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether it can be drawn of a dataset (in memory)."""
        return any(panel.shows(rows) for panel in self.planes or self.curves)


_TURNS, _ATTITUDE = "angular_velocity recorded", "an attitude recorded"
_AXIS = "an attitude or an axis (figure_axis, momentum_axis, obliquity) recorded"
KINDS: dict[str, Kind] = {
    "polar_motion": Kind("a spin near a principal axis", [timelines.polar_motion], [poles.polar_motion]),
    "pole_path": Kind(_AXIS, (), [poles.pole_path, poles.nutation]),
    "nutation": Kind(
        "a pole that a torque moves, within half a radian of its mean motion", (), [poles.nutation]
    ),
    "obliquity": Kind(_AXIS, [timelines.obliquity, timelines.longitude]),
    "libration": Kind(
        "libration, roll_pitch_yaw, nadir or source_position recorded",
        [
            librations.longitude,
            librations.latitude,
            librations.locking,
            timelines.libration,
            timelines.roll_pitch_yaw,
        ],
        [librations.nadir, librations.phases, librations.locking_phases],
    ),
    "pointing": Kind(
        "air_velocity, or nadir without libration or roll_pitch_yaw, recorded", [librations.pointing]
    ),
    "tip": Kind(
        "a top: a body on a fixed point under uniform gravity",
        [timelines.tilt, timelines.precession],
        [poles.tip],
    ),
    "polhode": Kind(_TURNS, (), [polhode.polhode, polhode.poinsot]),
    "momentum_sphere": Kind(
        "angular_velocity and rates of rotors recorded, and a momentum of constant size",
        (),
        [gyrostat.momentum_sphere, gyrostat.momentum_sphere_at_end],
    ),
    "rotors": Kind("rotors whose rates were recorded", [gyrostat.tilts, gyrostat.rotor_rates]),
    "herpolhode": Kind("an attitude and a constant momentum", (), [polhode.herpolhode]),
    "path": Kind("position recorded", (), [poles.path]),
    "rates": Kind(_TURNS, [timelines.rates, changing.moments]),
    "core": Kind(
        "rates of a fluid core and of the mantle recorded",
        [changing.core_axis, changing.core_slip],
    ),
    "published": Kind(
        "a published orientation ([output] orientation) and the attitude",
        [published.angles, published.rotation],
    ),
    "attitude": Kind(_ATTITUDE, [timelines.attitude, timelines.wobble]),
    "wobble": Kind(
        "a free symmetric body, its attitude, angular_velocity and angular_momentum recorded",
        [poles.wobble_and_spin],
    ),
    "states": Kind("user-defined states ([[states]]) recorded", changing.OWN_STATES),
    "sensitivity": Kind(
        "sensitivities ([output] sensitivity)",
        [sensitivity.attitude, sensitivity.rates, sensitivity.position],
    ),
    "drift": Kind("invariants", [drift]),
}


def available(dataset: xarray.Dataset) -> list[str]:
    """The figures that a dataset has something for."""
    rows = shown_rows(dataset).rows
    return [OVERVIEW, *(name for name, kind in KINDS.items() if kind.shows(rows))]


def figure(dataset: xarray.Dataset, what: str = OVERVIEW) -> Figure:
    """A figure of a run by its name in `FIGURES`; of a run of any length, possibly lazy, at most 20,000 rows.

    Raises:
    ValueError: no such figure, none for this dataset, or a dataset without samples.
    """
    check_name(what)
    shown = shown_rows(dataset)
    if what == OVERVIEW:
        curves, planes = _leading(shown.rows)
        return compose(shown, (*curves, drift), planes, facts=True)
    if what == SPECTRUM:
        raise ValueError("figure 'spectrum': is drawn of an analysis: rigidsim.analyse(run).figure()")
    kind = KINDS[what]
    if not kind.shows(shown.rows):
        raise ValueError(
            f"figure {what!r}: needs {kind.needs}; possible for this run: {', '.join(available(dataset))}"
        )
    return compose(shown, kind.curves, kind.planes)


def for_slides(dataset: xarray.Dataset, what: str = OVERVIEW, ground: str = "light") -> Figure:
    """The leading panel of a figure of a run, alone and in large letters, on a light or a dark ground.

    Raises:
    ValueError: as for ``figure``, or another ground.
    """
    check_name(what)
    shown = shown_rows(dataset)
    curves, planes = _leading(shown.rows) if what == OVERVIEW else ((), ())
    if what in KINDS:
        curves, planes = KINDS[what].curves, KINDS[what].planes
    panels = [*((panel, True) for panel in curves), *((panel, False) for panel in planes)]
    if what != OVERVIEW:  # what it is named for
        panels.sort(key=lambda found: found[1])
    for panel, over_time in panels:
        if panel.shows(shown.rows):
            return slide(shown, panel, ground, over_time=over_time)
    raise ValueError(
        f"figure {what!r}: this run has no panel of it for a slide; it has {', '.join(available(dataset))}"
    )


def check_name(what: str) -> None:
    """Refuse an unknown name by ``ValueError``, with a list of the figures."""
    if what not in FIGURES:
        close = get_close_matches(what, FIGURES, 1)
        hint = f"; did you mean {close[0]!r}?" if close else "."
        raise ValueError(f"figure {what!r}: there is none of that name{hint} Available: {', '.join(FIGURES)}")


def save_figure(
    dataset: xarray.Dataset, path: str | Path, what: str = OVERVIEW, *, file_format: str | None = None,
    slides: str | None = None,
) -> Path:  # fmt: skip
    """Draw a figure of a run to a file (see `figure`), which is whole when this returns its path, in the
    format given or that of its suffix; with ``slides``, a ground, its leading panel alone (see `for_slides`).
    ``ValueError`` for another suffix, too.
    """
    path = Path(path)
    file_format = file_format or figure_format(path)
    if slides is not None:
        page = for_slides(dataset, what, slides)
        page.savefig(path, dpi=_SLIDE_DOTS, format=file_format, facecolor=page.get_facecolor())
        return path
    with rc_context(STYLE):  # type: ignore[arg-type]
        figure(dataset, what).savefig(path, dpi=_DOTS, format=file_format)
    return path


def figure_format(path: Path) -> str:
    """File format for a path's suffix: "png" or "svg"; ``ValueError`` for another."""
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"figure {path.name!r}: the suffix must be one of {', '.join(SUFFIXES)}, given {path.suffix!r}"
        )
    return path.suffix.lower()[1:]


def _leading(rows: xarray.Dataset) -> tuple[Sequence[Panel], Sequence[Panel]]:
    """Curves and planes of the page that suits a scene, with rates of rotors and user-defined states."""
    found = gyrostat.leading(rows, timelines.rates)
    curves, planes = found or _of_body(rows)
    wheels = [] if found else [gyrostat.rotor_rates]
    return [*curves, *wheels, *changing.OWN_STATES], planes


def _of_body(rows: xarray.Dataset) -> tuple[Sequence[Panel], Sequence[Panel]]:
    moving = [poles.path] if poles.path.shows(rows) else []
    attitude = [timelines.rates, timelines.attitude]
    tilting = [timelines.obliquity, timelines.longitude]
    if librates(rows):
        swinging = [timelines.libration, timelines.roll_pitch_yaw, librations.pointing]
        if librations.latitude.shows(rows):  # its figure axis precesses, as the Moon's
            swinging = [librations.longitude, librations.latitude, timelines.libration]
        return swinging, [librations.nadir, *(moving or [librations.phases])]
    if signals.is_top(rows):
        turning = timelines.precession if timelines.precession.shows(rows) else timelines.attitude
        return [timelines.tilt, turning], [poles.tip]
    if librations.locking.shows(rows):
        return [timelines.rates, librations.locking], [*moving, librations.locking_phases]
    if changing.core_axis.shows(rows):
        tilting = [changing.core_axis, changing.core_slip]
        precessing = poles.precesses(rows) or not signals.near_axis(rows)
        return tilting, [*moving, *([poles.polar_motion] if precessing else [poles.pole_path])]
    if signals.near_axis(rows) and changing.moments.shows(rows):
        return [timelines.rates, changing.moments, timelines.wobble], [*moving, poles.polar_motion]
    if signals.near_axis(rows) and changing.OWN_STATES[0].shows(rows):
        return [timelines.wobble, timelines.rates], [*moving, poles.polar_motion]
    if signals.near_axis(rows):
        if poles.precesses(rows) and not moving:
            return [timelines.braking, *tilting], [poles.nutation, poles.pole_path]
        wobbling = [poles.wobble_and_spin] if moving else []
        return [timelines.braking, *wobbling, timelines.polar_motion], [poles.polar_motion, *moving]
    if moving and librations.pointing.shows(rows):
        return [librations.pointing, timelines.rates], [*moving, polhode.polhode]
    if moving:
        return attitude, [*moving, polhode.polhode]
    if not any(panel.shows(rows) for panel in attitude):  # only axes are known, as of an averaged model
        axes = tilting if poles.precesses(rows) else [timelines.wobble]
        return [timelines.braking, *axes], [poles.nutation, poles.pole_path]
    if polhode.surfaces(rows) is not None:
        return attitude, [polhode.polhode, polhode.herpolhode]
    return attitude, [polhode.polhode]


def librates(dataset: xarray.Dataset) -> bool:
    """Whether the body keeps its attitude to its orbit: the source stays near one body direction."""
    nadir = librations.toward(dataset)
    if nadir is None:
        return signals.values(dataset, "libration") is not None
    finite = signals.finite_rows(nadir)
    mean = finite.mean(axis=0) if len(finite) else np.zeros(3)
    size = float(np.linalg.norm(mean))
    return size > 0.5 and bool((finite @ mean).min() > 0.5 * size)
