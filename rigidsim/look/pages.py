"""What a scene is about: the curves and planes that pictures show first, and its numbers in words."""

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals, sources
from rigidsim.look.curves import CURVES, STATES, orientations, precesses
from rigidsim.look.fits import circulation, secular
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Array
from rigidsim.look.units import angle_text, turning_text
from rigidsim.scene.readable import span_text

Names = list[str]


def leading(rows: xarray.Dataset) -> tuple[Names, Names]:
    """Names of curves, and of planes, that suit a dataset in memory, with rates of rotors and user-defined
    states; those that it has nothing for are left out by whoever draws them.
    """
    curves, planes = _of_body(rows)
    extra = [] if "rotor_rates" in curves else ["rotor_rates"]
    return [*curves, *extra, *STATES], planes


def _of_body(rows: xarray.Dataset) -> tuple[Names, Names]:
    moving = ["path"] if "position" in rows else []
    near, core = signals.near_axis(rows), "core_angular_velocity" in rows and "angular_velocity" in rows
    if scene_of(rows).has_rotors and gyrostats.Gyrostat.of(rows, 0) is not None:
        return ["rotor_tilts", "rotor_rates", "rates"], ["momentum_sphere", "momentum_sphere_at_end"]
    if sources.librates(rows):
        if CURVES["latitude_libration"](rows) is not None:  # its figure axis precesses, as the Moon's
            return ["longitude_libration", "latitude_libration", "libration"], ["sub_source", "nadir"]
        return ["libration", "roll_pitch_yaw", "pointing"], ["nadir", *(moving or ["phases"])]
    if signals.is_top(rows):
        turning = "precession" if "precession_angle" in rows else "attitude"
        return ["tilt", turning], ["tip"]
    if CURVES["locking"](rows) is not None:
        return ["rates", "locking"], [*moving, "locking_phases"]
    if core:
        precessing = precesses(rows) or not near
        return ["core_axis", "core_slip"], [*moving, "polar_motion" if precessing else "pole_path"]
    if near and "principal_moments" in rows:
        return ["rates", "moments", "wobble"], [*moving, "polar_motion"]
    if near and CURVES[STATES[0]](rows) is not None:
        return ["wobble", "rates"], [*moving, "polar_motion"]
    if near and precesses(rows) and not moving:
        return ["braking", "obliquity", "longitude"], ["nutation", "pole_path"]
    if near:
        return ["braking", *(["wobble_and_spin"] if moving else []), "polar_motion"], [
            "polar_motion",
            *moving,
        ]
    if moving and sources.pointing_angle(rows) is not None:
        return ["pointing", "rates", "spin_down"], [*moving, "polhode"]
    if not {"quaternion", "euler_angles", "angular_velocity"} & set(rows):  # only axes, of an averaged model
        axes = ["obliquity", "longitude"] if precesses(rows) else ["wobble"]
        return ["braking", *axes], ["nutation", "pole_path"]
    return ["rates", "attitude", "spin_down"], [*moving, "polhode", *([] if moving else ["herpolhode"])]


def numbers(rows: xarray.Dataset) -> list[tuple[str, str]]:
    """The motion's own numbers: names and texts of periods, rates of precession, ranges of tilts."""
    found: list[tuple[str, str]] = []
    seconds, rates = signals.seconds(rows), signals.values(rows, "angular_velocity", 3)
    if len(seconds) < 3:
        return found
    if (
        rates is not None
        and np.isfinite(rates).any()
        and (size := float(np.nanmean(signals.norms(rates)))) > 0
    ):
        found.append(("turns once in", span_text(2 * np.pi / size, 5)))
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
        if abs(mean.rate) * np.ptp(seconds) > _LEAST and np.isfinite(node).all():
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


_LEAST = 1e-9  # rad, of a longitude's advance, below which it is rounding


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
