"""What a scene is about: the curves and planes shown first, its numbers in words, and pages of text."""

import re
from collections.abc import Callable

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals, sources
from rigidsim.look.curves import CURVES, STATES, orientations, precesses
from rigidsim.look.fits import circulation, secular
from rigidsim.look.record import scene_of
from rigidsim.look.signals import title_of
from rigidsim.look.solids import Array
from rigidsim.scene.readable import TimeWords, angle_text, span_text, turning_text

Names = list[str]
_STEADY = 0.3  # of the largest rate, above which a body is said to turn at its mean rate
_LEAST = 1e-9  # rad, of a longitude's advance, below which it is rounding
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
    """The motion's own numbers: names and texts of periods, rates of precession, ranges of tilts."""
    found: list[tuple[str, str]] = []
    seconds, rates = signals.seconds(rows), signals.values(rows, "angular_velocity", 3)
    if len(seconds) < 3:
        return found
    size = np.zeros(1) if rates is None else signals.norms(signals.finite_rows(rates))
    if rates is not None and len(size) and size.min() > _STEADY * size.max():
        found.append(("turns once in", span_text(2 * np.pi / float(size.mean()), 5)))
        flips = _flips(seconds, signals.finite_rows(rates))
        found += [("between flips", span_text(flips, 4))] if flips else []
    plane = (
        signals.polar_motion(rows) if signals.near_axis(rows) and not signals.wobble_aliased(rows) else None
    )
    wobbling = None if plane is None else circulation(seconds, plane)
    if wobbling is not None:
        found.append(
            ("polar motion once round in", wobbling.about + span_text(2 * np.pi / abs(wobbling.rate), 5))
        )
    precessing = signals.values(rows, "precession_angle")
    if precessing is not None:
        found.append(("precession", turning_text(secular(seconds, precessing).rate)))
    elif precesses(rows):
        name, (_, node) = next(iter(orientations(rows).items()))
        mean = secular(seconds, node)
        stray = float(np.nanmax(np.abs(node - mean.at(seconds))))
        if mean.known and abs(mean.rate) * np.ptp(seconds) > max(stray, _LEAST):
            found.append((f"{name} axis precesses in", mean.about + span_text(2 * np.pi / abs(mean.rate), 4)))
    for name, words in (("tilt", "tilt"), ("nutation_angle", "nutation angle"), ("obliquity", "obliquity")):
        table = signals.values(rows, name)
        if table is not None and np.isfinite(table).any():
            column = table if table.ndim == 1 else table[:, 0]
            found.append((words, _range(column)))
    pointing = sources.pointing_angle(rows)
    if pointing is not None:
        axis, towards, angle = pointing
        found.append(
            (f"{axis} axis from {towards}", f"{angle_text(angle[0])}, at the end {angle_text(angle[-1])}")
        )
    librating = signals.values(rows, "libration", 2)
    if librating is not None:
        swing = librating - np.pi * np.round(np.nanmean(librating, axis=0) / np.pi)
        found.append(("largest libration", angle_text(float(np.nanmax(np.abs(swing))))))
    return found


def _range(angle: Array) -> str:
    low, high = float(np.nanmin(angle)), float(np.nanmax(angle))
    texts = [angle_text(x, 6, like=high) for x in (low, high)]
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def _flips(seconds: Array, rates: Array) -> float:
    """Mean time (s) between changes of sign of the rate that the body begins with; 0 with fewer than two."""
    if len(rates) != len(seconds):
        return 0.0
    along = rates @ (rates[0] / (np.linalg.norm(rates[0]) or 1.0))
    changes = seconds[1:][np.diff(np.signbit(along))]
    return float(abs(changes[-1] - changes[0])) / (len(changes) - 1) if len(changes) > 1 else 0.0


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
