"""What a scene is about: the curves and planes shown first, its numbers in words, and pages of text."""

import re
from collections.abc import Callable, Iterator

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals, sources
from rigidsim.look.curves import CURVES, STATES, Plot, orientations, plotted, precesses
from rigidsim.look.fits import circulation, secular, turn_text
from rigidsim.look.record import scene_of
from rigidsim.look.signals import title_of
from rigidsim.look.solids import Array
from rigidsim.scene.readable import TimeWords, angle_text, period_text, turning_text, typeset

Names = list[str]
_TURN = 2 * np.pi
_STEADY = 0.3  # of the largest rate, above which a body is said to turn at its mean rate
_LEAST = 1e-9  # rad, of a longitude's advance, below which it is rounding
_PARTS, _SLOWER = 10, 1.5  # parts of a run whose mean rates differ so many times: it spins up or down
_AT_REST = 1e-3  # of its largest rate, below which a body doesn't turn
_REGULAR = 0.05  # by which swings may differ that have one period
_FROM_TO = {
    "obliquity_of_date": "obliquity", "climatic": "{}", "insolation": "insolation",
    "tilt": "tilt", "wobble": "nutation angle", "pointing": "pointing error", "roll_pitch_yaw": "{}",
    "libration": "{}", "yaw": "yaw", "separation": "distance",
    "rotor_tilts": "axis of rotor {} off L",
    "rotor_rates": "rate of rotor {}", "braking": "remaining {}", "core_axis": "core axis from the mantle's",
}  # fmt: skip
"""Names of curves, and what their numbers are called."""
_GLYPHS = (
    (0x20, 0x7E), (0xA0, 0x148), (0x14A, 0x1C3), (0x1C5, 0x31E), (0x384, 0x38A), (0x38E, 0x3A1),
    (0x3A3, 0x3E1), (0x3F0, 0x49D), (0x4A0, 0x4FF), (0x1E00, 0x1EFF), (0x2000, 0x200A), (0x2010, 0x2027),
    (0x2030, 0x205E), (0x2074, 0x208E), (0x2090, 0x209C), (0x20A0, 0x20BF), (0x2190, 0x2199),
)  # fmt: skip
_SINGLE = "\n\t²³−√∞≈≠≤≥∂∆∏∑∫■▲▼◆●○◊"
_RANGES = "".join(f"{re.escape(chr(low))}-{re.escape(chr(high))}" for low, high in _GLYPHS)
_WITHOUT_GLYPH = re.compile(f"[^{_SINGLE}{_RANGES}]")


def leading(rows: xarray.Dataset) -> tuple[Names, Names]:
    """Names of curves, and of planes, that suit a dataset in memory, with rates of rotors and user-defined
    states; those that it has nothing for are left out by whoever draws them.
    """
    moving, free = (["path"], []) if "position" in rows else ([], ["herpolhode"])
    near = signals.near_axis(rows)
    core = "core_angular_velocity" in rows and "angular_velocity" in rows
    bare = not {"quaternion", "euler_angles", "angular_velocity"} & set(
        rows
    )  # only axes, of an averaged model

    def shows(name: str) -> bool:
        return CURVES[name](rows) is not None

    kinds: list[tuple[Callable[[], bool], Names, Names]] = [
        (
            lambda: scene_of(rows).has_rotors and gyrostats.Gyrostat.of(rows, 0) is not None,
            ["rotor_tilts", "rotor_rates", "rates"],
            ["momentum_sphere", "momentum_sphere_at_end"],
        ),
        (lambda: shows("separation"), ["yaw", "separation", "mutual_period"], ["path"]),
        (
            lambda: shows("climatic") or shows("insolation"),
            ["obliquity_of_date", "climatic", "insolation"],
            [],
        ),
        (  # its figure axis precesses, as the Moon's
            lambda: sources.librates(rows) and shows("latitude_libration"),
            ["longitude_libration", "latitude_libration", "libration"],
            ["sub_source", "nadir"],
        ),
        (
            lambda: sources.librates(rows),
            ["libration", "roll_pitch_yaw", "pointing"],
            ["nadir", *(moving or ["phases"])],
        ),
        (
            lambda: signals.is_top(rows),
            ["tilt", "precession" if "precession_angle" in rows else "attitude"],
            ["tip"],
        ),
        (lambda: shows("locking"), ["rates", "locking"], [*moving, "locking_phases"]),
        (
            lambda: core and (precesses(rows) or not near),
            ["core_axis", "core_slip"],
            [*moving, "polar_motion"],
        ),
        (lambda: core, ["core_axis", "core_slip"], [*moving, "pole_path"]),
        (
            lambda: near and "principal_moments" in rows,
            ["rates", "moments", "wobble"],
            [*moving, "polar_motion"],
        ),
        (lambda: near and shows(STATES[0]), ["wobble", "rates"], [*moving, "polar_motion"]),
        (
            lambda: near and not moving and precesses(rows),
            ["braking", "obliquity", "longitude"],
            ["nutation", "pole_path"],
        ),
        (
            lambda: near,
            ["braking", *(["wobble_and_spin"] if moving else []), "polar_motion"],
            ["polar_motion", *moving],
        ),
        (
            lambda: bool(moving) and sources.pointing_angle(rows) is not None,
            ["pointing", "rates", "spin_down"],
            [*moving, "polhode"],
        ),
        (
            lambda: bare and precesses(rows),
            ["braking", "obliquity", "longitude"],
            ["nutation", "pole_path"],
        ),
        (lambda: bare, ["braking", "wobble"], ["nutation", "pole_path"]),
        (lambda: True, ["rates", "attitude", "spin_down"], [*moving, "polhode", *free]),
    ]
    curves, planes = next((curves, planes) for holds, curves, planes in kinds if holds())
    return list(dict.fromkeys([*curves, "rotor_rates", *STATES])), planes


def numbers(rows: xarray.Dataset) -> list[tuple[str, str]]:
    """The motion's own numbers: names and texts of periods, rates of precession, ranges of angles."""
    if rows.sizes["time"] < 3:
        return []
    return [*_periods(rows), *_precession(rows), *_ranges(rows)]


def _periods(rows: xarray.Dataset) -> list[tuple[str, str]]:
    """How long the body takes to turn, to flip, and to go round what it goes round."""
    found: list[tuple[str, str]] = []
    seconds, rates = signals.seconds(rows), signals.values(rows, "angular_velocity", 3)
    size = np.zeros(1)
    if rates is not None:
        size = signals.from_start(rows, signals.norms(signals.finite_rows(rates)))
    if rates is not None and len(size) and size.min() > _AT_REST * size.max():
        part = -(-len(size) // _PARTS)
        shown = [float(one.mean()) for one in (size, size[:part], size[-part:])]
        shown += [float(size.max()), float(size.min())]
        mean, first, last, fast, slow = (period_text(_TURN / one, rows.attrs) for one in shown)
        text = mean if size.min() > _STEADY * size.max() else f"{fast} to {slow}"
        slower = max(shown[1:3]) > _SLOWER * min(shown[1:3])
        found.append(("turns once in", f"{first}, at the end {last}" if slower else text))
        if signals.energy_and_momentum(rows) is not None and len(rates) == len(seconds):
            flips = np.diff(_passes(seconds, rates @ rates[0]))
            found += [("between flips", period_text(float(flips.mean()), rows.attrs))] if len(flips) else []
    elif (turns := signals.values(rows, "quaternion", 4)) is not None:
        angle = 2 * np.arccos(min(abs(float(turns[0] @ turns[-1])), 1.0))
        found.append(("turned, start to end", angle_text(angle)))
    for words, plane in _circling(rows):
        round_once = None if plane is None else circulation(seconds, plane)
        if round_once is not None:
            found.append((words, turn_text(round_once, rows.attrs)))
    return found


def _circling(rows: xarray.Dataset) -> Iterator[tuple[str, Array | None]]:
    """Names of periods, and what goes round the origin once in each, as points of a plane (rows, 2)."""
    free, rates = signals.energy_and_momentum(rows), signals.principal_rates(rows)
    if signals.near_axis(rows) and not signals.is_top(rows):
        yield (
            "polar motion once round in",
            None if signals.wobble_aliased(rows) else signals.polar_motion(rows),
        )
    elif free is not None and rates is not None:
        moments, twice, square = free
        least, middle, most = np.argsort(moments)
        k = most if square > twice * moments[middle] else least  # the axis that the polhode is about
        yield "polhode once round in", None if signals.wobble_aliased(rows) else np.delete(rates, k, axis=1)
    along, axis = signals.steady_momentum(rows), signals.pole(rows, "figure")
    if along is not None and axis is not None and not signals.aliased(rows):
        yield (
            "axis circles the momentum in",
            np.stack([axis @ one for one in signals.across(along)], axis=1),
        )
    position = signals.place(rows)
    pulled = "rigid_body_position" in rows or scene_of(rows).attractors or scene_of(rows).sources
    if position is not None and pulled:
        normal = np.nanmean(np.cross(position[:-1], position[1:]), axis=0)
        if normal.any():
            one, other = signals.across(normal / np.linalg.norm(normal))
            yield "orbit once round in", np.stack([position @ one, position @ other], axis=1)


def _precession(rows: xarray.Dataset) -> list[tuple[str, str]]:
    """The rate of a top about the vertical, or the period and the tilt with which a body's axis precesses."""
    seconds, angle = signals.seconds(rows), signals.values(rows, "precession_angle")
    if angle is not None:
        mean = secular(seconds, angle)
        return [("precession", mean.about + turning_text(mean.rate))]
    follows = sources.librates(rows) and CURVES["latitude_libration"](rows) is None  # its orbit
    if not precesses(rows) or follows or signals.is_top(rows) or sources.pointing_angle(rows) is not None:
        return []
    name, (tilt, node) = next(iter(orientations(rows).items()))
    mean, found = secular(seconds, node), list[tuple[str, str]]()
    stray = float(np.nanmax(np.abs(node - mean.at(seconds))))
    if mean.known and abs(mean.rate) * np.ptp(seconds) > max(stray, _LEAST):
        found = [(f"{name} axis precesses in", turn_text(mean, rows.attrs))]
    if found or "obliquity" in rows:
        found += _from_to(rows, "obliquity", plotted(rows, "obliquity", "", tilt))
    return found


def _ranges(rows: xarray.Dataset) -> list[tuple[str, str]]:
    """From where to where the leading angles and rates of rotors go, and how much of a rotation remains."""
    names = [name for name in leading(rows)[0] if name in _FROM_TO]
    return [one for name in names for one in _from_to(rows, _FROM_TO[name], CURVES[name](rows))]


def _from_to(rows: xarray.Dataset, words: str, plot: Plot | None) -> Iterator[tuple[str, str]]:
    """Extremes of each curve of a plot, and how long it takes to swing between them and back; the first and
    last value of one that goes one way.
    """
    if plot is None:
        return
    for column, label in zip(plot.values.T, plot.labels, strict=False):
        values = column[np.isfinite(column)]
        if not len(values):
            continue
        ends, every = (min(values), max(values)), ""
        passes = _passes(signals.seconds(rows)[np.isfinite(column)], values - sum(ends) / 2)
        swings = np.diff(passes[::2])
        if plot.log or len(passes) == 1:
            ends = values[0], values[-1]
        elif len(swings) > 1 and np.std(swings) < _REGULAR * np.mean(swings):
            every = f", every {period_text(float(swings.mean()), rows.attrs, 4)}"
        texts = dict.fromkeys(typeset(float(x), 4) for x in ends)
        yield words.format(label), f"{' to '.join(texts)} {plot.unit}".strip() + every * (len(texts) > 1)


def _passes(seconds: Array, values: Array) -> Array:
    """Times (s) at which a curve passes zero, along straight lines between rows."""
    k = np.flatnonzero(np.diff(np.signbit(values)))
    share = values[k] / (values[k] - values[k + 1])
    return np.asarray(seconds[k] + share * (seconds[k + 1] - seconds[k]))


def summary_page(dataset: xarray.Dataset, thinned: xarray.Dataset) -> str:
    """Markdown page, short enough to be seen whole: what was run, and the motion's own numbers."""
    said = str(dataset.attrs.get("comment", "")).strip().replace("\n", " ")
    attributes = dataset.attrs
    start, end = (float(thinned["time"].values[i]) for i in (0, -1))
    words, total = TimeWords.of(attributes, start, end), dataset.sizes["time"]
    shown = "" if total == thinned.sizes["time"] else f", shown {thinned.sizes['time']:,}"
    facts = [("span", f"{words.moment(start)} to {words.moment(end)}"), ("samples", f"{total:,}{shown}")]
    ended = str(attributes.get("status") or "")
    if ended not in ("", "finished"):
        facts.append(("status", str(attributes.get("status_message") or ended.replace("_", " "))))
    heading = f"**{title_of(dataset)}**" + (f": {said}" if said else "")
    fitted = [f"fit: {attributes['fit']}", ""] if attributes.get("fit") else []
    # across, not down: a page that must be scrolled isn't read
    tables = [_table(found) for found in (facts, numbers(thinned)) if found]
    return legible("\n".join([heading, "", *fitted, *(line for table in tables for line in table)]))


def notes_page(kind: str, notes: list[str]) -> str:
    """Markdown page: what the picture shows, and how it is scaled."""
    return legible("\n".join([f"**Picture: {kind}**", "", *(f"- {note}" for note in notes), ""]))


def config_page(dataset: xarray.Dataset) -> str:
    """Markdown page of the config that was run; empty if there is none."""
    text = str(dataset.attrs.get("config", "")).strip()
    return legible("\n".join(["```toml", text, "```", ""])) if text else ""


def legible(text: str) -> str:
    """The text with characters that the viewer has glyphs for; it aborts on others (0.41, Inter alone)."""
    return _WITHOUT_GLYPH.sub("?", text)


# What Inter has of the blocks that texts about motion use; what lies outside is written as a question mark.


def _table(found: list[tuple[str, str]]) -> list[str]:
    names, texts = zip(*found, strict=True)
    rows = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in (names, texts)]
    rows.insert(1, ["---"] * len(found))
    return [*(f"| {' | '.join(cells)} |" for cells in rows), ""]
