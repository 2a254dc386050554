"""What is drawn over time, in one form for figures and timelines: curves of scenes, drifts, all variables."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals, sources
from rigidsim.look.fits import secular
from rigidsim.look.record import scene_of
from rigidsim.look.signals import clock, from_start, in_words, is_averaged, need, optional
from rigidsim.look.solids import Array, Color
from rigidsim.scene.readable import DAY, angle_text, named_unit, scaled, turning_text, with_unit

HUES: dict[str, tuple[str, Color]] = {
    "red": ("#d1495b", (235, 97, 89)),
    "green": ("#3a9a5b", (104, 190, 110)),
    "blue": ("#2f6fbf", (92, 148, 235)),
    "orange": ("#d9822b", (240, 175, 70)),
    "violet": ("#8f5bb5", (165, 135, 235)),
    "teal": ("#17a2b0", (80, 200, 215)),
    "pink": ("#c2327a", (225, 115, 190)),
    "brown": ("#8c6d46", (200, 170, 120)),
    "grey": ("#6b7280", (170, 170, 175)),
}
"""Colours by name: on paper, and on the dark ground of the screen."""
XYZ = ("red", "green", "blue")
PALETTE = ("blue", "orange", "violet", "green", "red", "teal", "brown", "grey", "pink")
_STILL = 1e-9  # of a curve's size, or of an angle's growth, below which the rest is rounding
_SEEN = 2e-3  # of a curve's range: a narrower band is no wider than the line
_MOST_CURVES = 16  # of one variable, so that a recorded matrix history stays readable
TYPICAL, MOST = 0.5, 50.0
"""In units of tolerance times sqrt(steps): a random walk of one rounding per step (Brouwer 1937), and the
drift above which a summary warns (a few roundings of several operations per step).
"""
_TURN = 2 * np.pi
_ROUND = 1e-6  # relative difference of two moments, below which a body is symmetric
_VISIBLE = 0.01  # of its start, from which a change is seen on an axis from zero
_QUICK = np.deg2rad(1.0)  # a day, from which a node's motion is shown in the axis' own unit
_LEGIBLE = 0.01  # of an angle, from which the ticks along its swing need four digits at most
_AS_FAR = 0.7  # of the whole swing: what a straight line must leave of it to be of no help
_ROUNDING = 1e-11  # of rates, below which their difference is rounding
_DECADES = 1.0  # by which a rate or an angle falls, from which its axis is logarithmic
_LOOPS, _WINDOW = 3, 8  # of a long fast path that are shown bright; times as many, that a plot shows
_AXES = {"figure": "blue", "spin": "orange", "momentum": "violet"}
STATES = tuple(f"states_{place}" for place in range(3))


def paper(hue: str | Color) -> Any:
    """A colour as matplotlib draws it, by its name or itself."""
    return HUES[hue][0] if isinstance(hue, str) else tuple(x / 255 for x in hue)


def screen(hue: str | Color) -> Color:
    """A colour on the dark ground of the screen, by its name or itself."""
    return HUES[hue][1] if isinstance(hue, str) else hue


@dataclass(frozen=True)
class Plot:
    """Curves over time.

    Attributes:
        name: of its entity, and of the variable that it shows, if that is one.
        values: (rows, curves) in the unit; error: (rows,) to both sides, where that is known and can be seen.
        labels, hues: by curve; a single one needs no label.
        word: what the axis of values says before the unit.
        place: "leading", "more" or "drift".
        begins: the start is shown next to the whole, if that is a solid band.
        sparse: samples too far apart to be joined. log: on a logarithmic axis. from_zero: it begins there.
        levels: values for the whole run by label. band: lower and upper edge (rows,).
        window: rows about the cursor that a timeline shows of a long fast motion; 0 for the whole run.
        recorded: divisor of the recorded variable `name` that the values are; 0 if they are something else.
    """

    name: str
    title: str
    values: Array
    labels: Sequence[str] = ("",)
    unit: str = ""
    hues: Sequence[str | Color] = PALETTE
    word: str = "value"
    place: str = "leading"
    error: Array | None = None
    begins: bool = False
    sparse: bool = False
    log: bool = False
    from_zero: bool = False
    levels: Mapping[str, float] = field(default_factory=dict)
    band: tuple[Array, Array] | None = None
    window: int = 0
    recorded: float = 0.0

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return with_unit(self.title, self.unit) + (", log10" if self.log else "")

    @property
    def steady(self) -> tuple[float, float] | None:
        """Limits for curves that are constant, which don't magnify rounding errors; None for others."""
        error = 0.0 if self.error is None else float(np.nanmax(self.error, initial=0.0))
        for part in (self.values[::64], self.values):  # most curves move among few rows already
            low, high = (reduce(part, axis=0) for reduce in (np.fmin.reduce, np.fmax.reduce))
            sizes = np.maximum(np.abs(low), np.abs(high))
            if self.log or not (high - low <= np.maximum(_STILL * sizes, 2 * error)).all():
                return None
        margin = 0.05 * float(sizes.max()) or 1.0
        return float(low.min()) - margin, float(high.max()) + margin


Curve = Callable[[xarray.Dataset], Plot | None]
Found = Array | tuple[Array, dict[str, Any]]
"""Columns (rows, n), or one (rows,), and what a dataset says of how they are drawn."""


def moves(values: Array) -> bool:
    """Whether a curve is more than a constant and its rounding errors."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and np.ptp(finite) > _STILL * np.abs(finite).max())


def crossings(column: Array) -> int:
    """How often a curve passes its mean; 0 if it is constant but for rounding."""
    return int(np.count_nonzero(np.diff(np.signbit(column - np.nanmean(column))))) if moves(column) else 0


def uncertain(dataset: xarray.Dataset, values: Array, divisor: float) -> Array | None:
    """The announced attitude error of angles, growing like t^1.5 to that at the end, if it can be seen."""
    error, finite = dataset.attrs.get("attitude_error"), values[np.isfinite(values)]
    if error is None or not len(finite) or not float(error) / divisor > _SEEN * float(np.ptp(finite)):
        return None
    return np.asarray(float(error) / divisor * _share(dataset) ** 1.5)


def _share(dataset: xarray.Dataset) -> Array:
    """The share of the run until each row (rows,); a run that goes back begins at the last one."""
    seconds = np.asarray(dataset["time"].values, dtype=np.float64)
    return np.abs(seconds - from_start(dataset, seconds)[0]) / (abs(seconds[-1] - seconds[0]) or 1.0)


def drift_plot(dataset: xarray.Dataset) -> Plot | None:
    """Magnitudes of all relative drifts, and of corrections by projection, over the band that rounding
    explains; None without any.
    """
    columns = {}
    for variable, table in _along_time(dataset):
        drifting, projected = (variable.attrs.get(role) for role in ("drift_of", "put_back_of"))
        if drifting or projected:
            size = np.abs(table).max(axis=1)
            name = in_words(str(drifting)) if drifting else f"correction of {in_words(str(projected))}"
            columns[name if (size > 0).any() else f"{name}: exactly 0"] = np.where(size > 0, size, np.nan)
    if not columns:
        return None
    error, law = float(dataset.attrs.get("attitude_error", 0.0)), rounding_law(dataset)
    what = "axis" if is_averaged(dataset.attrs) else "attitude"
    levels = {f"error of the {what} at the end, rad": error} if np.isfinite(error) and error > 0 else {}
    band, table = None if law is None else (TYPICAL * law, MOST * law), np.stack([*columns.values()], axis=1)
    options: dict[str, Any] = {"word": "relative drift", "place": "drift", "log": True}
    return Plot("drift", "Drift of invariants", table, [*columns], levels=levels, band=band, **options)


def rounding_law(dataset: xarray.Dataset) -> Array | None:
    """tolerance sqrt(steps until then) (rows,), steps spread evenly over the run; None if there were none."""
    steps, tolerance = (float(dataset.attrs.get(name) or 0.0) for name in ("steps", "tolerance"))
    if not (steps > 0 and tolerance > 0 and _share(dataset).any()):
        return None
    return tolerance * np.sqrt(np.maximum(steps * _share(dataset), 1.0))


def other_plots(dataset: xarray.Dataset, shown: Sequence[str]) -> list[Plot]:
    """Plots of all further numeric variables along time: of each vector, and of scalars that share a unit.

    A new observable or invariant needs no line anywhere.
    """
    roles = {"drift_of", "put_back_of", "covariance_of"}
    left = [v for v, _ in _along_time(dataset) if str(v.name) not in shown and not roles & set(v.attrs)]
    plots = [variable_plot(dataset, variable) for variable in left if variable.ndim > 1]
    for unit, columns in by_unit([variable for variable in left if variable.ndim == 1]).items():
        table, labels = np.stack([*columns.values()], axis=1), [name.replace("_", " ") for name in columns]
        divisor, shown_unit = scaled(table, unit, dataset.attrs)
        title = labels[0][:1].upper() + labels[0][1:]
        plots.append(Plot(f"scalars {unit}", title, table / divisor, labels, shown_unit, place="more"))
    return plots


def by_unit(scalars: Iterable[xarray.DataArray]) -> dict[str, dict[str, Array]]:
    """Columns (rows,) of scalars along time by their unit and name."""
    found: dict[str, dict[str, Array]] = {}
    for one in scalars:
        column = np.asarray(one.values, dtype=np.float64)
        found.setdefault(str(one.attrs.get("units", "")), {})[str(one.name)] = column
    return found


def variable_plot(dataset: xarray.Dataset, variable: xarray.DataArray, place: str = "more") -> Plot:
    """The plot of one recorded variable, with the labels of its components."""
    name, table = str(variable.name), _table(variable)
    dimension = str(variable.dims[1]) if variable.ndim == 2 else ""
    named = variable.coords[dimension].values if dimension in variable.coords else range(table.shape[1])
    labels = [str(label) for label in named[: table.shape[1]]] if variable.ndim > 1 else [""]
    hues = XYZ if dimension in ("body_axis", "space_axis") else PALETTE
    divisor, unit = scaled(table, str(variable.attrs.get("units", "")), dataset.attrs)
    wrapped = "angle" in variable.attrs and "angles_wrapped_from" in dataset.attrs
    title = name[:1].upper() + name[1:].replace("_", " ") + (" within one turn" if wrapped else "")
    return Plot(name, title, table / divisor, labels, unit, hues, place=place, recorded=divisor)


def _along_time(dataset: xarray.Dataset) -> Iterator[tuple[xarray.DataArray, Array]]:
    # Angles before quaternions, because people read them; the rest as recorded.
    for name in sorted(map(str, dataset.data_vars), key=lambda name: name != "euler_angles"):
        if "time" in dataset[name].dims and dataset[name].dtype.kind in "fiub":
            variable = dataset[name].transpose("time", ...)
            yield variable, _table(variable)


def _table(variable: xarray.DataArray) -> Array:
    table = np.asarray(variable.values, dtype=np.float64).reshape(variable.shape[0], -1)
    return table[:, :_MOST_CURVES]


def recorded(
    variable: str, title: str, word: str = "angle", labels: tuple[str, ...] = (), **options: Any
) -> Curve:
    """The curves of a variable as it was recorded."""

    @optional
    def found(dataset: xarray.Dataset) -> Plot:
        need(signals.values(dataset, variable) is not None)
        plot = variable_plot(dataset, dataset[variable].transpose("time", ...), "leading")
        return replace(plot, title=title, word=word, labels=labels or plot.labels, **options)

    return found


def plotted(
    dataset: xarray.Dataset, name: str, title: str, found: Found | None, *, of: str = "rad", **options: Any
) -> Plot | None:
    """A plot of what was found in a dataset, in the unit that suits it; None of nothing. An option `more` is
    what the title goes on with, and `of` the unit of what was found: empty if it isn't scaled.
    """
    if found is None:
        return None
    table, own = found if isinstance(found, tuple) else (found, {})
    options = {"name": name, "title": title, "of": of, "word": "angle", **options, **own}
    of, table = options.pop("of"), table.reshape(len(table), -1)
    options["title"] += options.pop("more", "")
    divisor, unit = scaled(table, of, dataset.attrs)
    error = uncertain(dataset, table / divisor, divisor) if of == "rad" else None
    return Plot(values=table / divisor, error=error, **{"unit": unit} | options)


def row(name: str, title: str, find: Callable[[xarray.Dataset], Found], **options: Any) -> Curve:
    """The curves of what is found in a dataset."""
    return lambda dataset: plotted(dataset, name, title, optional(find)(dataset), **options)


def attitude(dataset: xarray.Dataset) -> Found:
    """Recorded Euler angles less their fast growth, which would press the others flat, or else the body's z
    axis in space.
    """
    angles, wrapped = signals.values(dataset, "euler_angles", 3), "angles_wrapped_from" in dataset.attrs
    if angles is None:
        sparse, words = signals.aliased(dataset), "Direction of the body's z axis in space"
        return need(signals.in_space(dataset, np.eye(3)[2])), {
            "name": "z_axis", "title": words + (", samples" if sparse else ""), "word": "cosine", "of": "",
            "labels": ("X", "Y", "Z"), "hues": XYZ, "sparse": sparse,
        }  # fmt: skip
    labels = ["φ", "θ", "ψ"]
    for k, symbol in enumerate(labels):
        if not wrapped and np.ptp(signals.finite_rows(angles)[:, k]) > 2 * _TURN:
            angles[:, k], line = grown(dataset, angles[:, k])
            labels[k] = symbol + line
    return angles, {"labels": labels, "sparse": wrapped, "more": " within one turn" if wrapped else ""}


def grown(dataset: xarray.Dataset, angle: Array) -> tuple[Array, str]:
    """An angle less its mean motion, unless that leaves only rounding, and words for what was taken off."""
    trend = secular(signals.seconds(dataset), angle)
    rest = angle - trend.at(signals.seconds(dataset))
    if np.nanmax(np.abs(rest)) <= _STILL * (np.nanmax(angle) - np.nanmin(angle)):
        return angle, f", uniform: {turning_text(trend.rate)}"
    return rest, f" less its mean motion, {trend.about}{turning_text(trend.rate)}"


def orientations(dataset: xarray.Dataset) -> dict[str, tuple[Array, Array]]:
    """Obliquity and node longitude of the distinguishable axes that are shown together, figure axis first."""
    shown: dict[str, tuple[Array, Array]] = {}
    for name in _AXES:
        pair = signals.orientation(dataset, name)
        if pair is None or not np.isfinite(pair[0]).any():
            continue
        tilt, node = next(iter(shown.values()), pair)
        reach = max(float(np.nanmax(np.abs(tilt - np.nanmean(tilt)))), 1e-300)
        longitude = pair[1] - node  # of half a turn and more: it goes about another pole
        near = float(np.nanmax(longitude) - np.nanmin(longitude)) < np.pi
        if not shown or (near and float(np.nanmax(np.abs(pair[0] - tilt))) > 0.03 * reach):
            shown[name] = pair
    return shown


def precesses(dataset: xarray.Dataset) -> bool:
    """Whether the pole moves because the momentum does."""
    return signals.steady_momentum(dataset) is None and bool(orientations(dataset))


def _of_axes(dataset: xarray.Dataset, which: int) -> Found:
    """Obliquities, less the mean of the first axis shown where that would hide their swings, or longitudes of
    nodes, less the straight line through the first unless they swing as far about it as without it.
    """
    shown, seconds = orientations(dataset), signals.seconds(dataset)
    need(bool(shown))
    table = np.stack([pair[which] for pair in shown.values()], axis=1)
    options = {"labels": [f"{name} axis" for name in shown], "hues": [_AXES[name] for name in shown]}
    trend = secular(seconds, table[:, 0])
    rest = table - (trend.at(seconds)[:, None] if which else trend.value)
    whole, swing = (float(np.nanmax(values) - np.nanmin(values)) for values in (table, rest))
    if whole >= _LEGIBLE * float(np.nanmax(np.abs(table))) and not (which and swing < _AS_FAR * whole):
        return table, options
    # precession is shown by the year, whatever the axis of time is in
    unit = clock(dataset)[1]
    per = unit if abs(trend.rate) * DAY > _QUICK else named_unit("yr")
    rate = f"{trend.about}{angle_text(trend.rate * per.seconds, 3)}/{per.symbol}"
    said = {"more": f" less its mean motion, {rate}", "word": "longitude − line"}
    mean = {"more": f" less its mean, {angle_text(trend.value, 7)}", "word": "obliquity − mean"}
    return rest, options | (said if which else mean)


def climatic(dataset: xarray.Dataset) -> Found:
    """Climatic precession within the eccentricity."""
    found, e = (
        need(signals.values(dataset, "climatic_precession")),
        signals.values(dataset, "orbit_eccentricity"),
    )
    if e is None:
        return found
    return np.stack([found, e], axis=1), {"labels": ("e sin ϖ", "eccentricity")}


def obliquity_of_date(dataset: xarray.Dataset) -> Found:
    """The figure axis' obliquity as it is."""
    need("climatic_precession" in dataset or "insolation" in dataset)
    table = need(signals.values(dataset, "obliquity"))
    return table[:, list(dataset["axis"].values).index("figure")] if table.ndim == 2 else table


def braking(dataset: xarray.Dataset) -> Found:
    """Recorded size of the angular momentum and energy that change visibly, as shares of their start."""
    shares = {}
    for name, words in (("angular_momentum_norm", "angular momentum"), ("energy", "energy")):
        table = signals.values(dataset, name)
        if table is not None and np.isfinite(table).all() and table[0] > 0:
            shares[words] = table / table[0]
    shares = {words: share for words, share in shares.items() if np.abs(share - 1).max() > _VISIBLE}
    need(bool(shares))
    return np.stack([*shares.values()], axis=1), {"labels": [*shares]}


def spin_down(dataset: xarray.Dataset) -> Found:
    """The size of an angular velocity that falls by decades."""
    size = signals.norms(need(signals.values(dataset, "angular_velocity", 3)))
    known = size[np.isfinite(size)]
    need(len(known) > 0 and known.min() > 0 and known[0] > 10**_DECADES * known[-1])
    return size


@optional
def swings(dataset: xarray.Dataset) -> tuple[Array, dict[str, Any]]:
    """Libration angles (rows, 2), rad, less half turns so that they swing about zero, and their names."""
    table = need(signals.values(dataset, "libration", 2))
    halves = np.round(np.nanmean(table, axis=0) / np.pi)
    names = zip(("libration in plane", "out of plane"), halves, strict=True)
    labels = [name + (f" − {180 * k:.0f}°" if k else "") for name, k in names]
    return table - np.pi * halves, {"labels": labels}


@optional
def regular(dataset: xarray.Dataset) -> tuple[Array, dict[str, Any]]:
    """Roll, pitch and yaw where roll and yaw are defined: pitch stays away from a right angle."""
    table = need(signals.values(dataset, "roll_pitch_yaw", 3))
    need(not sources.steep(table))
    return table, {"labels": ("roll", "pitch", "yaw")}


def tilt(dataset: xarray.Dataset) -> Found:
    """Tilt of a top against the vertical."""
    angle, title = signals.values(dataset, "tilt"), "Tilt of the figure axis against the vertical"
    if angle is not None:
        return angle
    need(signals.is_top(dataset))
    direction = need(signals.pole(dataset, "figure"))
    return signals.angle_between(direction, scene_of(dataset).vertical), {"title": title}


def precession(dataset: xarray.Dataset) -> Found:
    """Precession angle of a top about the vertical, less its mean motion if it goes round."""
    angle, line = need(signals.values(dataset, "precession_angle")), ""
    if np.nanmax(angle) - np.nanmin(angle) > _TURN:
        angle, line = grown(dataset, angle)
    return angle, {"more": line}


def nutation_angle(dataset: xarray.Dataset) -> Found:
    """Angle between the figure axis and the momentum."""
    angle = signals.values(dataset, "nutation_angle")
    if angle is not None:
        return angle
    return signals.angle_between(*(need(signals.pole(dataset, name)) for name in ("figure", "momentum")))


def wobble_and_spin(dataset: xarray.Dataset) -> Found:
    """Turns of a symmetric body's figure axis about the momentum, which is fixed, and of the body about its
    figure axis, two to one of a thin plate; None where samples are too far apart to count them.
    """
    scene, rates = scene_of(dataset), need(signals.values(dataset, "angular_velocity", 3))
    pole, along = need(signals.pole(dataset, "figure")), need(signals.steady_momentum(dataset))
    a, b = np.delete(need(scene.moments), scene.symmetry)
    need(abs(a - b) <= _ROUND * a and np.abs(pole - along).max() > _ROUND and signals.joined(pole))
    azimuth = np.unwrap(np.arctan2(*(pole @ way for way in signals.across(along)[::-1])))
    spin = sources.integrated(signals.seconds(dataset), rates @ scene.figure)
    turns = np.abs(np.stack([azimuth - azimuth[0], spin], axis=1)) / _TURN
    return turns, {"more": f"{turns[-1, 0] / turns[-1, 1]:.3f} turns of the wobble to one of the spin"}


def latitude_libration(dataset: xarray.Dataset) -> Found:
    """The physical librations of the figure axis."""
    found = need(need(sources.librations(dataset))[1])
    return found, {"window": _WINDOW * loop_rows(found[:, 0])}


def loop_rows(swing: Array) -> int:
    """Rows in some loops of a path that goes to and fro; 0 if it has few loops."""
    passes = crossings(swing)
    return round(2 * _LOOPS * len(swing) / passes) if passes > 8 * _LOOPS else 0


def pointing(dataset: xarray.Dataset) -> Found:
    """How far a body axis points away from where the air or the light comes from."""
    axis, towards, angle = need(sources.pointing_angle(dataset))
    part = -(-len(angle) // 10)  # whose means differ less than single values of what swings
    falls = bool(np.nanmean(angle[:part]) > 10**_DECADES * np.nanmean(angle[-part:]))
    return angle, {"more": f"{axis} axis and {towards}", "log": falls, "from_zero": not falls}


@optional
def locked_longitude(dataset: xarray.Dataset) -> Array:
    """Longitude (rows,), rad, turns counted, under a source that a body faces in the end alone."""
    found = need(sources.seen(dataset))
    need("angular_velocity" in dataset and np.isfinite(found.directions).all())
    need(found.stays(found.last) and not found.stays())
    longitude = found.coordinates(scene_of(dataset).figure)[:, 0]
    whole = _TURN * np.round(np.mean(longitude[found.last]) / _TURN)
    need(np.abs(np.diff(longitude)).max() < 3)
    return longitude - whole


def _of_rotors(dataset: xarray.Dataset, columns: list[Array]) -> Found:
    """A column for each rotor; what motors do takes the whole run."""
    rotors = gyrostats.rotors(dataset)
    options = {"labels": [r.name for r in rotors], "begins": not any(r.works for r in rotors)}
    need(bool(columns))
    return np.stack(columns, axis=1), options


def rotor_tilts(dataset: xarray.Dataset) -> Found:
    """Angles of the rotors' axes from the angular momentum."""
    whole, rotors = need(gyrostats.momentum(dataset)), gyrostats.rotors(dataset)
    return _of_rotors(dataset, [signals.angle_between(whole, rotor.axes) for rotor in rotors])


def rotor_rates(dataset: xarray.Dataset) -> Found:
    """Rates of the rotors relative to the body, if one changes."""
    rotors = gyrostats.rotors(dataset)
    need(any(rotor.varies for rotor in rotors))
    return _of_rotors(dataset, [rotor.rate for rotor in rotors])


def _core(dataset: xarray.Dataset) -> list[Array]:
    """Rates (rows, 3) of a fluid core and of the mantle, body axes."""
    return [need(signals.values(dataset, f"{part}angular_velocity", 3)) for part in ("core_", "")]


def core_axis(dataset: xarray.Dataset) -> Found:
    """Angle between the axes about which core and mantle turn."""
    apart = signals.angle_between(*_core(dataset))
    return apart, {"from_zero": bool(np.nanmin(apart) > (1 - _VISIBLE) * np.nanmax(apart))}


def core_slip(dataset: xarray.Dataset) -> Found:
    """By how much faster the core turns than the mantle, rad/s; None if that is only rounding."""
    core, mantle = _core(dataset)
    both = signals.norms(core) + signals.norms(mantle)
    # of vectors nearly alike: less is lost than by taking the difference of their norms
    difference = np.einsum("ti,ti->t", core - mantle, core + mantle)
    need((np.abs(difference) > _ROUNDING * both**2).any())
    return difference / both


def own_states(place: int) -> Curve:
    """Those states of ``[[states]]`` that have the unit in some place."""

    def found(dataset: xarray.Dataset) -> Found:
        own = [v for v in dataset.data_vars.values() if v.attrs.get("given_by") == "[[states]]"]
        groups = [*by_unit(own).items()]
        need(place < len(groups))
        unit, columns = groups[place]
        title = "User-defined states" if len(columns) > 1 else f"User-defined state {next(iter(columns))}"
        return np.stack([*columns.values()], axis=1), {"title": title, "labels": [*columns], "of": unit}

    return row(f"own states {place}", "", found, word="value", begins=True)


def published(dataset: xarray.Dataset) -> Found:
    """Angles from a published orientation to the attitude, and between the poles."""
    found = [need(signals.values(dataset, f"published_{name}")).ravel() for name in ("angle", "pole_angle")]
    kernel = dataset["published_angle"].attrs.get("kernel", "a kernel")
    return np.column_stack(found), {"more": f" ({kernel})"}


def published_rotation(dataset: xarray.Dataset) -> Found:
    """The rotation vector between them, less its mean, which is an offset of the body's axes."""
    table = need(signals.values(dataset, "published_rotation", 3))
    return table - table.mean(axis=0)


def sensitivity(variable: str, moved: str) -> Curve:
    """Sizes of derivatives by each parameter, for one SI unit of it."""

    def found(dataset: xarray.Dataset) -> Found:
        size, labels = np.linalg.norm(need(signals.values(dataset, variable)), axis=2), []
        attributes = dataset[variable].attrs
        units = str(attributes.get("parameter_units", "")).split(", ")
        for k, key in enumerate(map(str, dataset["parameter"].values)):
            unit = units[k] if k < len(units) else ""
            zero = "" if (size[:, k] > 0).any() else ": 0 throughout"
            labels.append(key + (f" [{unit}]" if unit not in ("1", "") else "") + zero)
        unit = str(attributes.get("units", "1")).replace("rad s-1", "rad/s")
        return size, {"labels": labels, "unit": f"{unit} per unit"}

    return row(variable, f"How far the {moved}, per SI unit of", found, of="", word="size", log=True)


CURVES: dict[str, Curve] = {
    "rates": recorded("angular_velocity", "Angular velocity, body axes", "ω", begins=True),
    "moments": recorded("principal_moments", "Principal moments of inertia", "I", tuple("xyz"), hues=XYZ),
    "attitude": row("euler_angles", "Euler angles", attitude, begins=True),
    "obliquity": row("obliquity", "Obliquity", partial(_of_axes, which=0), word="obliquity", begins=True),
    "longitude": row(
        "node_longitude", "Longitude of the node", partial(_of_axes, which=1), word="longitude", begins=True
    ),
    "obliquity_of_date": row("obliquity", "Obliquity", obliquity_of_date, word="obliquity"),
    "climatic": row(
        "climatic_precession", "Climatic precession", climatic, of="", word="e sin ϖ", hues=("orange", "grey")
    ),
    "insolation": recorded("insolation", "Insolation", "insolation", hues=("red",)),
    "braking": row(
        "braking", "Remaining rotation", braking, of="", word="share of the start", from_zero=True,
        hues=("violet", "orange"),
    ),
    "spin_down": row(
        "spin", "Size of the angular velocity", spin_down, of="rad/s", word="|ω|", log=True, begins=True
    ),
    "polar_motion": row(
        "polar_motion", "Polar motion: the spin axis seen from the figure axis",
        lambda dataset: need(signals.polar_motion(dataset)),
        labels=("m₁", "m₂"), word="polar motion", begins=True,
    ),
    "libration": row(
        "libration", "Libration: the long axis from the direction to the source",
        lambda dataset: need(swings(dataset)), word="libration", begins=True,
    ),
    "yaw": recorded("yaw", "Yaw: second body's long axis from the line to the first", "yaw", begins=True),
    "separation": recorded(
        "separation", "Distance of both bodies", "distance", begins=True, hues=("violet",)
    ),
    "mutual_period": recorded(
        "mutual_period", "Time of a turn at the orbit's present rate", "period", begins=True, hues=("orange",)
    ),
    "roll_pitch_yaw": row(
        "roll_pitch_yaw", "Attitude against the local frame of the orbit",
        lambda dataset: need(regular(dataset)), begins=True,
    ),
    "tilt": row("tilt", "Tilt against the vertical", tilt, word="θ", begins=True),
    "precession": row("precession_angle", "Precession", precession, hues=("orange",), word="φ", begins=True),
    "wobble": row(
        "nutation_angle", "Nutation angle: the figure axis from the momentum", nutation_angle, hues=("grey",)
    ),
    "wobble_and_spin": row(
        "wobble_and_spin", "In space: ", wobble_and_spin, of="", word="turns",
        labels=("wobble: the axis about the momentum", "spin: the body about its axis"),
    ),
    "longitude_libration": row(
        "longitude_libration", "Physical libration in longitude, less the mean rotation",
        lambda dataset: need(sources.librations(dataset))[0], word="longitude",
    ),
    "latitude_libration": row(
        "latitude_libration", "Physical librations in latitude", latitude_libration,
        labels=("inclination less its mean", "node less its mean motion, × sin(inclination)"),
        hues=("orange", "violet"),
    ),
    "pointing": row("pointing", "Angle between the body's ", pointing, begins=True),
    "locking": row(
        "locking", "The point under the source, until the rotation is locked",
        lambda dataset: need(locked_longitude(dataset)) / _TURN, of="", unit="turns", word="longitude",
    ),
    "rotor_tilts": row("rotor_tilts", "Axes of the rotors, from the angular momentum", rotor_tilts),
    "rotor_rates": row(
        "rotor_rate", "Rates of the rotors, relative to the body", rotor_rates, of="rad/s", word="rate"
    ),
    "core_axis": row(
        "core_axis", "Axis of the core, from the mantle's spin axis", core_axis, hues=("pink",)
    ),
    "core_slip": row(
        "core_slip", "Rate of the core, less the mantle's", core_slip, of="rad/s", word="difference",
        hues=("violet",),
    ),
    "published": row(
        "published_angle", "From the published orientation", published, labels=("attitude", "pole")
    ),
    "published_rotation": row(
        "published_rotation", "The same about the body's axes, less its mean", published_rotation,
        labels=("about x", "about y", "about z"), hues=XYZ,
    ),
    "sensitivity_attitude": sensitivity("attitude_sensitivity", "attitude moves"),
    "sensitivity_rates": sensitivity("angular_velocity_sensitivity", "angular velocity changes"),
    "sensitivity_position": sensitivity("position_sensitivity", "body moves"),
    "drift": drift_plot,
    **{name: own_states(place) for place, name in enumerate(STATES)},
}  # fmt: skip
"""All of them by name."""
