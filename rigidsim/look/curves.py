"""What scenes are about over time: recorded quantities, and what follows from them; each a plot or None."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals, sources
from rigidsim.look.fits import secular
from rigidsim.look.plots import XYZ, Plot, drift_plot, uncertain, variable_plot
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Array
from rigidsim.look.units import angle_text, clock, scaled, turning_text
from rigidsim.scene.readable import DAY, named_unit

Curve = Callable[[xarray.Dataset], Plot | None]

_TURN = 2 * np.pi
_ROUND = 1e-6  # relative difference of two moments, below which a body is symmetric
_STILL = 1e-9  # of an angle's growth, below which what is left of it is rounding
_VISIBLE = 0.01  # of its start, from which a change is seen on an axis from zero
_QUICK = np.deg2rad(1.0)  # a day, from which a node's motion is shown in the axis' own unit
_LEGIBLE = 0.01  # of an angle, from which the ticks along its swing need four digits at most
_AS_FAR = 0.7  # of the whole swing: what a straight line must leave of it to be of no help
_STEEP = 1.5  # rad of pitch, near which roll and yaw are ill-defined
_ROUNDING = 1e-11  # of rates, below which their difference is rounding
_DECADES = 3.0  # by which a rate falls, from which its axis is logarithmic
_LOOPS, _WINDOW = 3, 8  # of a long fast path that are shown bright; times as many, that a plot shows
_AXES = {"figure": "blue", "spin": "orange", "momentum": "violet"}
STATES = tuple(f"states_{place}" for place in range(3))


def recorded(
    variable: str, title: str, word: str = "angle", labels: tuple[str, ...] = (), **options: Any
) -> Curve:
    """The curves of a variable as it was recorded."""

    def found(dataset: xarray.Dataset) -> Plot | None:
        if signals.values(dataset, variable) is None:
            return None
        plot = variable_plot(dataset, dataset[variable].transpose("time", ...), "leading")
        error = uncertain(dataset, plot.values, plot.recorded) if word != "ω" else None
        return replace(plot, title=title, word=word, labels=labels or plot.labels, error=error, **options)

    return found


def plotted(
    dataset: xarray.Dataset, name: str, title: str, table: Array | None, *, of: str = "rad", **options: Any
) -> Plot | None:
    """A plot of columns (rows, n), or one (rows,), in the unit that suits them; None of nothing."""
    if table is None:
        return None
    table = table.reshape(len(table), -1)
    divisor, unit = scaled(table, of)
    error = uncertain(dataset, table / divisor, divisor) if of == "rad" else None
    return Plot(name, title, table / divisor, unit=unit, error=error, **({"word": "angle"} | options))


def row(name: str, title: str, find: Callable[[xarray.Dataset], Array | None], **options: Any) -> Curve:
    """The curves of what is found in a dataset."""
    return lambda dataset: plotted(dataset, name, title, find(dataset), **options)


def attitude(dataset: xarray.Dataset) -> Plot | None:
    """Recorded Euler angles less their fast growth, which would press the others flat, or else the body's z
    axis in space.
    """
    angles = signals.values(dataset, "euler_angles", 3)
    if angles is None:
        table, sparse = signals.in_space(dataset, np.eye(3)[2]), signals.aliased(dataset)
        title = "Direction of the body's z axis in space" + (", samples" if sparse else "")
        options: dict[str, Any] = {"word": "cosine", "hues": XYZ, "begins": True, "sparse": sparse}
        return None if table is None else Plot("z_axis", title, table, ("Z on X", "on Y", "on Z"), **options)
    labels, wrapped = ["φ", "θ", "ψ"], "angles_wrapped_from" in dataset.attrs
    title = "Euler angles" + (" within one turn" if wrapped else "")
    for k, symbol in enumerate(labels):
        if not wrapped and np.ptp(signals.finite_rows(angles)[:, k]) > 2 * _TURN:
            angles[:, k], line = grown(dataset, angles[:, k])
            labels[k] = symbol + line
    return plotted(dataset, "euler_angles", title, angles, labels=labels, sparse=wrapped, begins=True)


def grown(dataset: xarray.Dataset, angle: Array) -> tuple[Array, str]:
    """An angle less its mean motion, unless that leaves only rounding, and words for what was taken off."""
    trend = secular(signals.seconds(dataset), angle)
    rest = angle - trend.at(signals.seconds(dataset))
    if np.nanmax(np.abs(rest)) <= _STILL * (np.nanmax(angle) - np.nanmin(angle)):
        return angle, f", uniform: {turning_text(trend.rate)}"
    return rest, f" less its mean motion, {trend.about}{turning_text(trend.rate)}"


def orientations(dataset: xarray.Dataset) -> dict[str, tuple[Array, Array]]:
    """Obliquity and node longitude of the distinguishable axes that are shown together, figure axis first."""
    found = {name: signals.orientation(dataset, name) for name in _AXES}
    known = {name: pair for name, pair in found.items() if pair and np.isfinite(pair[0]).any()}
    if not known:
        return {}
    first, (tilt, node) = next(iter(known.items()))
    reach = max(float(np.nanmax(np.abs(tilt - np.nanmean(tilt)))), 1e-300)

    def distinct(pair: tuple[Array, Array]) -> bool:
        longitude = pair[1] - node  # of half a turn and more: it goes about another pole
        near = float(np.nanmax(longitude) - np.nanmin(longitude)) < np.pi
        return float(np.nanmax(np.abs(pair[0] - tilt))) > 0.03 * reach and near

    return {name: pair for name, pair in known.items() if name == first or distinct(pair)}


def precesses(dataset: xarray.Dataset) -> bool:
    """Whether the pole moves because the momentum does."""
    return bool(orientations(dataset)) and signals.steady_momentum(dataset) is None


def _of_axes(dataset: xarray.Dataset, which: int) -> tuple[Array, dict[str, Any]] | None:
    shown = orientations(dataset)
    if not shown:
        return None
    options: dict[str, Any] = {
        "labels": [f"{name} axis" for name in shown],
        "hues": [_AXES[n] for n in shown],
        "begins": True,
    }
    return np.stack([pair[which] for pair in shown.values()], axis=1), options


def obliquity(dataset: xarray.Dataset) -> Plot | None:
    """Obliquities, less the mean of the first axis shown where that would hide their swings."""
    found = _of_axes(dataset, 0)
    if found is None:
        return None
    (table, options), title, word = found, "Obliquity", "obliquity"
    if not _legible(table):
        mean = secular(signals.seconds(dataset), table[:, 0]).value
        table, word = table - mean, "obliquity − mean"
        title = f"Obliquity less its mean, {angle_text(mean, 7)}"
    return plotted(dataset, "obliquity", title, table, word=word, **options)


def longitude(dataset: xarray.Dataset) -> Plot | None:
    """Longitudes of the node, less the straight line through that of the first axis shown unless they swing
    as far about it as without it.
    """
    found = _of_axes(dataset, 1)
    if found is None:
        return None
    (table, options), seconds, unit = found, signals.seconds(dataset), clock(dataset)[1]
    trend = secular(seconds, table[:, 0])
    rest = table - trend.at(seconds)[:, None]
    title, word = "Longitude of the node", "longitude"
    if not _legible(table) or np.nanmax(rest) - np.nanmin(rest) < _AS_FAR * (
        np.nanmax(table) - np.nanmin(table)
    ):
        # precession is shown by the year, whatever the axis of time is in
        per = unit if abs(trend.rate) * DAY > _QUICK else named_unit("yr")
        rate = f"{trend.about}{angle_text(trend.rate * per.seconds, 3)}/{per.symbol}"
        table, title, word = rest, f"{title} less its mean motion, {rate}", "longitude − line"
    return plotted(dataset, "node_longitude", title, table, word=word, **options)


def _legible(table: Array) -> bool:
    """Whether ticks along angles (rows, n) show their swings with few digits, nothing taken off."""
    finite = table[np.isfinite(table)]
    return bool(len(finite) and np.ptp(finite) >= _LEGIBLE * np.abs(finite).max())


def braking(dataset: xarray.Dataset) -> Plot | None:
    """Recorded size of the angular momentum and energy that change visibly, as shares of their start."""
    shares = {}
    for name, words in (("angular_momentum_norm", "angular momentum"), ("energy", "energy")):
        table = signals.values(dataset, name)
        if table is not None and np.isfinite(table).all() and table[0] > 0:
            share = table / table[0]
            if np.abs(share - 1).max() > _VISIBLE:
                shares[words] = share
    table = np.stack([*shares.values()], axis=1) if shares else np.empty(0)
    options: dict[str, Any] = {"hues": ("violet", "orange"), "word": "share of the start", "from_zero": True}
    return Plot("braking", "Remaining rotation", table, [*shares], **options) if shares else None


def spin_down(dataset: xarray.Dataset) -> Plot | None:
    """The size of an angular velocity that falls by decades."""
    table = signals.values(dataset, "angular_velocity", 3)
    if table is None or not len(size := signals.norms(signals.finite_rows(table))) or not size.min() > 0:
        return None
    if np.log10(size[0] / size[-1]) < _DECADES:
        return None
    options: dict[str, Any] = {"of": "rad/s", "word": "|ω|", "log": True}
    return plotted(dataset, "spin", "Size of the angular velocity", signals.norms(table), **options)


def swings(dataset: xarray.Dataset) -> tuple[Array | None, list[str]]:
    """Libration angles (rows, 2), rad, less half turns so that they swing about zero, and their names."""
    table = signals.values(dataset, "libration", 2)
    if table is None:
        return None, []
    halves = [int(np.round(np.nanmean(column) / np.pi)) for column in table.T]
    names = zip(("in the orbit's plane", "out of it"), halves, strict=True)
    return table - np.pi * np.array(halves), [name + (f" − {180 * k}°" if k else "") for name, k in names]


def libration(dataset: xarray.Dataset) -> Plot | None:
    """The long axis about the direction to the source, in the orbit's plane and out of it."""
    title, (table, labels) = "Libration: the long axis from the direction to the source", swings(dataset)
    return plotted(dataset, "libration", title, table, labels=labels, word="libration", begins=True)


def regular(dataset: xarray.Dataset) -> Array | None:
    """Roll, pitch and yaw where roll and yaw are defined: pitch stays away from a right angle."""
    table = signals.values(dataset, "roll_pitch_yaw", 3)
    return None if table is None or not np.nanmax(np.abs(table[:, 1])) < _STEEP else table


def tilt(dataset: xarray.Dataset) -> Plot | None:
    """Tilt of a top against the vertical."""
    angle, title = signals.values(dataset, "tilt"), "Tilt against the vertical"
    if angle is None and signals.is_top(dataset):
        direction, title = signals.pole(dataset, "figure"), "Tilt of the figure axis against the vertical"
        angle = None if direction is None else signals.angle_between(direction, scene_of(dataset).vertical)
    return plotted(dataset, "tilt", title, angle, word="θ", begins=True)


def precession(dataset: xarray.Dataset) -> Plot | None:
    """Precession angle of a top about the vertical, less its mean motion if it goes round."""
    angle, line = signals.values(dataset, "precession_angle"), ""
    if angle is not None and np.nanmax(angle) - np.nanmin(angle) > _TURN:
        angle, line = grown(dataset, angle)
    options: dict[str, Any] = {"hues": ("orange",), "word": "φ", "begins": True}
    return plotted(dataset, "precession_angle", "Precession" + line, angle, **options)


def nutation_angle(dataset: xarray.Dataset) -> Array | None:
    """Angle between the figure axis and the momentum."""
    angle = signals.values(dataset, "nutation_angle")
    direction, along = signals.pole(dataset, "figure"), signals.pole(dataset, "momentum")
    if angle is None and direction is not None and along is not None:
        return signals.angle_between(direction, along)
    return angle


def wobble_and_spin(dataset: xarray.Dataset) -> Plot | None:
    """Turns of a symmetric body's figure axis about the momentum, which is fixed, and of the body about its
    figure axis, two to one of a thin plate; None where samples are too far apart to count them.
    """
    scene, rates = scene_of(dataset), signals.values(dataset, "angular_velocity", 3)
    pole, along = signals.pole(dataset, "figure"), signals.steady_momentum(dataset)
    if scene.moments is None or rates is None or pole is None or along is None:
        return None
    a, b = np.delete(scene.moments, scene.symmetry)
    first, second = signals.across(along)
    if abs(a - b) > _ROUND * a or not np.abs(pole - along).max() > _ROUND or not signals.joined(pole):
        return None
    azimuth = np.unwrap(np.arctan2(pole @ second, pole @ first))
    spin = sources.integrated(signals.seconds(dataset), rates @ scene.figure)
    turns = np.abs(np.stack([azimuth - azimuth[0], spin], axis=1)) / _TURN
    labels = ("wobble: the axis about the momentum", "spin: the body about its axis")
    title = f"In space: {turns[-1, 0] / turns[-1, 1]:.3f} turns of the wobble to one of the spin"
    return Plot("wobble_and_spin", title, turns, labels, word="turns")


def longitude_libration(dataset: xarray.Dataset) -> Array | None:
    """The physical libration in longitude."""
    found = sources.librations(dataset)
    return None if found is None else found.longitude


def latitude_libration(dataset: xarray.Dataset) -> Plot | None:
    """The physical librations of the figure axis."""
    found = sources.librations(dataset)
    if found is None or found.inclination is None or found.node is None:
        return None
    labels = ("inclination less its mean", "node less its mean motion, × sin(inclination)")
    table, title = np.stack([found.inclination, found.node], axis=1), "Physical librations in latitude"
    window = _WINDOW * loop_rows(found.inclination)
    hues = ("orange", "violet")
    return plotted(dataset, "latitude_libration", title, table, labels=labels, hues=hues, window=window)


def loop_rows(swing: Array) -> int:
    """Rows in some loops of a path that goes to and fro; 0 if it has few loops."""
    about = swing - np.mean(swing)
    crossings = int(np.count_nonzero(about[1:] * about[:-1] < 0))
    return round(2 * _LOOPS * len(swing) / crossings) if crossings > 8 * _LOOPS else 0


def pointing(dataset: xarray.Dataset) -> Plot | None:
    """How far a body axis points away from where the air or the light comes from."""
    found = sources.pointing_angle(dataset)
    if found is None:
        return None
    axis, towards, angle = found
    title = f"Angle between the body's {axis} axis and {towards}"
    return plotted(dataset, "pointing", title, angle, begins=True, from_zero=True)


def locked_longitude(dataset: xarray.Dataset) -> Array | None:
    """Longitude (rows,), rad, turns counted, under a source that a body faces in the end alone."""
    found, rates = sources.seen(dataset), signals.values(dataset, "angular_velocity", 3)
    if found is None or rates is None or not np.isfinite(found.directions).all():
        return None
    if found.stays() or not found.stays(found.last):
        return None
    longitude = found.coordinates(scene_of(dataset).figure)[:, 0]
    whole = _TURN * np.round(np.mean(longitude[found.last]) / _TURN)
    return longitude - whole if np.abs(np.diff(longitude)).max() < 3 else None


def locking(dataset: xarray.Dataset) -> Plot | None:
    """Turns of the body before its source, until it keeps one face to it."""
    longitude, title = locked_longitude(dataset), "The point under the source, until the rotation is locked"
    if longitude is None:
        return None
    return Plot("locking", title, longitude[:, None] / _TURN, unit="turns", word="longitude")


def rotor_tilts(dataset: xarray.Dataset) -> Plot | None:
    """Angles of the rotors' axes from the angular momentum."""
    whole, rotors = gyrostats.momentum(dataset), gyrostats.rotors(dataset)
    columns = [] if whole is None else [signals.angle_between(whole, rotor.axis) for rotor in rotors]
    options: dict[str, Any] = {"labels": [rotor.name for rotor in rotors], "begins": _undriven(dataset)}
    title, table = (
        "Axes of the rotors, from the angular momentum",
        np.stack(columns, axis=1) if columns else None,
    )
    return plotted(dataset, "rotor_tilts", title, table, **options)


def rotor_rates(dataset: xarray.Dataset) -> Plot | None:
    """Rates of the rotors relative to the body, if one changes."""
    rotors = gyrostats.rotors(dataset)
    columns = [rotor.rate for rotor in rotors] if any(rotor.varies for rotor in rotors) else []
    options: dict[str, Any] = {"labels": [rotor.name for rotor in rotors], "begins": _undriven(dataset)}
    title, table = "Rates of the rotors, relative to the body", np.stack(columns, axis=1) if columns else None
    return plotted(dataset, "rotor_rate", title, table, of="rad/s", word="rate", **options)


def _undriven(dataset: xarray.Dataset) -> bool:
    """Whether no motor drives a rotor: what motors do takes the whole run."""
    return all(rotor.drive != "driven" for rotor in gyrostats.rotors(dataset))


def _core(dataset: xarray.Dataset) -> tuple[Array, Array] | None:
    """Rates (rows, 3) of a fluid core and of the mantle, body axes."""
    core, mantle = (
        signals.values(dataset, name, 3) for name in ("core_angular_velocity", "angular_velocity")
    )
    return None if core is None or mantle is None else (core, mantle)


def core_axis(dataset: xarray.Dataset) -> Plot | None:
    """Angle between the axes about which core and mantle turn."""
    found, title = _core(dataset), "Axis of the core, from the mantle's spin axis"
    if found is None:
        return None
    apart = signals.angle_between(*found)
    level = bool(np.nanmin(apart) > (1 - _VISIBLE) * np.nanmax(apart))
    return plotted(dataset, "core_axis", title, apart, hues=("pink",), from_zero=level)


def core_slip(dataset: xarray.Dataset) -> Array | None:
    """By how much faster the core turns than the mantle, rad/s; None if that is only rounding."""
    found = _core(dataset)
    if found is None:
        return None
    core, mantle = found
    both = signals.norms(core) + signals.norms(mantle)
    # of vectors nearly alike: less is lost than by taking the difference of their norms
    difference = np.einsum("ti,ti->t", core - mantle, core + mantle)
    return difference / both if (np.abs(difference) > _ROUNDING * both**2).any() else None


def own_states(place: int) -> Curve:
    """Those states of ``[[states]]`` that have the unit in some place."""

    def found(dataset: xarray.Dataset) -> Plot | None:
        own = [v for v in dataset.data_vars.values() if v.attrs.get("given_by") == "[[states]]"]
        units = list(dict.fromkeys(str(v.attrs.get("units", "1")) for v in own))
        if place >= len(units):
            return None
        shown = [str(v.name) for v in own if v.attrs.get("units", "1") == units[place]]
        table = np.stack([np.asarray(dataset[name].values, dtype=np.float64) for name in shown], axis=1)
        options: dict[str, Any] = {"of": units[place], "labels": shown, "word": "value", "begins": True}
        title = "Own states" if len(shown) > 1 else f"Own state {shown[0]}"
        return plotted(dataset, f"own states {place}", title, table, **options)

    return found


def published(dataset: xarray.Dataset) -> Plot | None:
    """Angles from a published orientation to the attitude, and between the poles."""
    found = [signals.values(dataset, f"published_{name}") for name in ("angle", "pole_angle")]
    if found[0] is None or found[1] is None:
        return None
    kernel = dataset["published_angle"].attrs.get("kernel", "a kernel")
    table = np.column_stack([table.ravel() for table in found if table is not None])
    title = f"From the published orientation ({kernel})"
    return plotted(dataset, "published_angle", title, table, labels=("attitude", "pole"))


def published_rotation(dataset: xarray.Dataset) -> Array | None:
    """The rotation vector between them, less its mean, which is an offset of the body's axes."""
    table = signals.values(dataset, "published_rotation", 3)
    return None if table is None else table - table.mean(axis=0)


def sensitivity(variable: str, moved: str) -> Curve:
    """Sizes of derivatives by each parameter, for one SI unit of it."""

    def found(dataset: xarray.Dataset) -> Plot | None:
        table = signals.values(dataset, variable)
        if table is None:
            return None
        attributes = dataset[variable].attrs
        keys = [str(label) for label in dataset["parameter"].values]
        units = str(attributes.get("parameter_units", "")).split(", ") + [""] * len(keys)
        titles = [k if unit in ("1", "") else f"{k} [{unit}]" for k, unit in zip(keys, units, strict=False)]
        size = np.linalg.norm(table, axis=2)
        labels = [k if (s > 0).any() else f"{k}: 0 throughout" for k, s in zip(titles, size.T, strict=True)]
        unit = str(attributes.get("units", "1")).replace("rad s-1", "rad/s")
        title = f"How far the {moved}, per SI unit of"
        return Plot(variable, title, size, labels, f"{unit} per unit", word="size", log=True)

    return found


CURVES: dict[str, Curve] = {
    "rates": recorded("angular_velocity", "Angular velocity, body axes", "ω", begins=True),
    "moments": recorded("principal_moments", "Principal moments of inertia", "I", tuple("xyz"), hues=XYZ),
    "polar_motion": row(
        "polar_motion", "Polar motion: the spin axis seen from the figure axis", signals.polar_motion,
        labels=("m₁", "m₂"), word="polar motion", begins=True,
    ),
    "roll_pitch_yaw": row(
        "roll_pitch_yaw", "Attitude against the local frame of the orbit", regular,
        labels=("roll", "pitch", "yaw"), begins=True,
    ),
    "wobble": row(
        "nutation_angle", "Nutation angle: the figure axis from the momentum", nutation_angle, hues=("grey",)
    ),
    "longitude_libration": row(
        "longitude_libration", "Physical libration in longitude, less the mean rotation", longitude_libration,
        word="longitude",
    ),
    "core_slip": row(
        "core_slip", "Rate of the core, less the mantle's", core_slip, of="rad/s", word="difference",
        hues=("violet",),
    ),
    "published_rotation": row(
        "published_rotation", "The same about the body's axes, less its mean", published_rotation,
        labels=("about x", "about y", "about z"), hues=XYZ,
    ),
    "sensitivity_attitude": sensitivity("attitude_sensitivity", "attitude moves"),
    "sensitivity_rates": sensitivity("angular_velocity_sensitivity", "angular velocity changes"),
    "sensitivity_position": sensitivity("position_sensitivity", "body moves"),
    "drift": drift_plot,
    **{f"states_{place}": own_states(place) for place in range(3)},
    **{
        curve.__name__: curve
        for curve in (
            attitude, obliquity, longitude, braking, spin_down, libration, tilt, precession, wobble_and_spin,
            latitude_libration, pointing, locking, rotor_tilts, rotor_rates, core_axis, published,
        )
    },
}  # fmt: skip
"""All of them by name."""
