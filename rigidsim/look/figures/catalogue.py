"""All figures by name: what each needs and consists of, and the page that suits a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import xarray
from matplotlib import rc_context
from matplotlib.figure import Figure

from rigidsim.look.curves import STATES
from rigidsim.look.figure_names import FIGURES, OVERVIEW, SPECTRUM
from rigidsim.look.figures.composing import compose, found_of, shown_rows
from rigidsim.look.figures.panels import OVER_TIME, PLANES
from rigidsim.look.figures.slides import slide
from rigidsim.look.figures.style import STYLE
from rigidsim.look.pages import leading

SUFFIXES = (".png", ".svg")
_DOTS, _SLIDE_DOTS = 160, 250  # per inch


@dataclass(frozen=True)
class Kind:
    """A figure that can be asked for (``FIGURES`` has in a line what it shows): what a run must have for it,
    in words, and the names of its panels over time and of its square ones. It can be drawn of a run that has
    something for one of the latter, or without them for one of the former.
    """

    needs: str
    curves: Sequence[str] = ()
    planes: Sequence[str] = ()

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether it can be drawn of a dataset (in memory)."""
        panels, names = (PLANES, self.planes) if self.planes else (OVER_TIME, self.curves)
        return any(panels[name].find(rows) is not None for name in names)


_TURNS, _ATTITUDE = "angular_velocity recorded", "an attitude recorded"
_AXIS = "an attitude or an axis (figure_axis, momentum_axis, obliquity) recorded"
KINDS: dict[str, Kind] = {
    "polar_motion": Kind("a spin near a principal axis", ["polar_motion"], ["polar_motion"]),
    "pole_path": Kind(_AXIS, (), ["pole_path", "nutation"]),
    "nutation": Kind("a pole that a torque moves, within half a radian of its mean motion", (), ["nutation"]),
    "obliquity": Kind(_AXIS, ["obliquity", "longitude"]),
    "libration": Kind(
        "libration, roll_pitch_yaw, nadir or source_position recorded",
        ["longitude_libration", "latitude_libration", "locking", "libration", "roll_pitch_yaw"],
        ["nadir", "phases", "locking_phases"],
    ),
    "pointing": Kind("air_velocity, or nadir without libration or roll_pitch_yaw, recorded", ["pointing"]),
    "tip": Kind("a top: a body on a fixed point under uniform gravity", ["tilt", "precession"], ["tip"]),
    "polhode": Kind(_TURNS, (), ["polhode", "poinsot"]),
    "momentum_sphere": Kind(
        "angular_velocity and rates of rotors recorded, and a momentum of constant size",
        (),
        ["momentum_sphere", "momentum_sphere_at_end"],
    ),
    "rotors": Kind("rotors whose rates were recorded", ["rotor_tilts", "rotor_rates"]),
    "herpolhode": Kind("an attitude and a constant momentum", (), ["herpolhode"]),
    "path": Kind("position recorded", (), ["path"]),
    "rates": Kind(_TURNS, ["rates", "spin_down", "moments"]),
    "core": Kind("rates of a fluid core and of the mantle recorded", ["core_axis", "core_slip"]),
    "published": Kind(
        "a published orientation ([output] orientation) and the attitude", ["published", "published_rotation"]
    ),
    "attitude": Kind(_ATTITUDE, ["attitude", "wobble"]),
    "wobble": Kind(
        "a free symmetric body, its attitude, angular_velocity and angular_momentum recorded",
        ["wobble_and_spin"],
    ),
    "states": Kind("user-defined states ([[states]]) recorded", STATES),
    "sensitivity": Kind(
        "sensitivities ([output] sensitivity)",
        ["sensitivity_attitude", "sensitivity_rates", "sensitivity_position"],
    ),
    "drift": Kind("invariants", ["drift"]),
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
        curves, planes = leading(shown.rows)
        return compose(shown, (*curves, "drift"), planes, facts=True)
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
    kind = KINDS[what] if what in KINDS else Kind("", *(leading(shown.rows) if what == OVERVIEW else ()))
    groups = [(OVER_TIME, kind.curves), (PLANES, kind.planes)]
    for panels, names in groups if what == OVERVIEW else reversed(groups):  # first what it is named for
        for name, found in found_of(panels, names, shown.rows):
            return slide(shown, panels[name], found, ground)
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
