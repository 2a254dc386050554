"""Results kept of a sweep's members, from their samples: last values, extremes, means, drifts, whole series.

Everything here works on blocks of many members at once and on samples alone, wherever they come from.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.model.tangents import GROWTH
from rigidsim.scene.parts_of_values import part_name
from rigidsim.solve.indicators import indicators
from rigidsim.store.sweeps.tiles import ALWAYS, Kept, KeptVariable
from rigidsim.store.variables import Variable


def kept(
    values: np.ndarray,
    units: str,
    long_name: str,
    item: str = ALWAYS,
    dims: tuple[str, ...] = (),
    **more: Any,
) -> KeptVariable:
    """A kept variable with its labels."""
    return KeptVariable(dims, values, {"units": units, "long_name": long_name, **more}, item)


@dataclass(frozen=True)
class MemberSeries:
    """Samples of some members: parts of (members, samples, components); missing ones at the end are nan."""

    variable: Variable
    parts: Sequence[np.ndarray]

    def shaped(self, values: np.ndarray) -> np.ndarray:
        """Values (members, components) or (members, samples, components) in the variable's own shape."""
        return values.reshape(*values.shape[:-1], *self.variable.shape)

    @property
    def drift_of(self) -> str | None:
        """The invariant whose drift this variable is; None for any other variable."""
        return self.variable.attributes.get("drift_of")


def kept_of_series(
    series: Sequence[MemberSeries],
    times: np.ndarray,
    lengths: np.ndarray,
    keep: Collection[str],
    hidden: str = "",
) -> Kept:
    """What is asked for of recorded variables; drifts are always kept. Times in s are (samples,), or
    (members, samples) if each has its own; ``lengths``: samples that each member has; ``hidden``: what is
    recorded only for indicators.
    """
    found: Kept = {}
    for one in series:
        if one.variable.name == GROWTH:
            found |= _indicators(one, times, keep)
    series = [one for one in series if one.variable.name != hidden]
    for one in series:
        if one.drift_of is not None:
            found |= _drifts(one, lengths)
            continue
        if "put_back_of" in one.variable.attributes:
            continue
        if "final" in keep:
            found |= _final(one, lengths)
        if "extremes" in keep:
            found |= _extremes(one, times)
        if "means" in keep:
            found |= _means(one)
    if "series" in keep:
        found |= _series(series, times)
    return found


def _indicators(one: MemberSeries, times: np.ndarray, keep: Collection[str]) -> Kept:
    """Chaos indicators from the growth of a tangent vector."""
    since = times if times.ndim == 1 else times.T
    way = -1.0 if since.size and (since[-1] < since[0]).any() else 1.0  # growth is that along the run
    told = indicators(way * since, one.parts[0][:, :, 0].T)
    labels = {
        "megno": ("1", "mean exponential growth of nearby orbits: 2 for regular motion", told.megno),
        "fli": ("1", "fast Lyapunov indicator: largest logarithm of the growth", told.fli),
        "lyapunov": ("s-1", "largest Lyapunov exponent, as far as the samples reach", told.largest_exponent),
    }
    found: Kept = {}
    for name, (units, long_name, values) in labels.items():
        if name in keep:
            found[name] = kept(values, units, long_name, name)
            until = "time up to which the growth of a tangent vector is known"
            found["growth_time"] = kept(way * told.until, "s", until, name)
    return found


def _last(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Last sample of each member from (members, samples, components), nan if it has none."""
    rows = np.maximum(lengths - 1, 0)
    last = values[np.arange(len(values)), rows]
    return np.where((lengths > 0)[:, None], last, np.nan)


def _final(one: MemberSeries, lengths: np.ndarray) -> Kept:
    variable = one.variable
    name = f"{variable.name}_final"
    found = {}
    for part, values in enumerate(one.parts):
        attributes = variable.part_attributes(part)
        if part:
            attributes |= {"residual_of": name}
        attributes.pop("exact_value", None)
        attributes["long_name"] = f"{attributes.get('long_name', variable.name)}, at the last sample"
        attributes.pop("coordinates", None)
        found[part_name(name, part)] = KeptVariable(
            variable.dims, one.shaped(_last(values, lengths)), attributes, "final"
        )
    return found


def _extremes(one: MemberSeries, times: np.ndarray) -> Kept:
    variable, values = one.variable, one.parts[0]
    found = {}
    units = variable.attributes.get("units", "1")
    for what, filled, place in (("min", np.inf, np.argmin), ("max", -np.inf, np.argmax)):
        rows = place(np.where(np.isnan(values), filled, values), axis=1)
        extreme = np.take_along_axis(values, rows[:, None, :], axis=1)[:, 0]
        when = times[rows] if times.ndim == 1 else np.take_along_axis(times, rows, axis=1)
        when = np.where(np.isnan(extreme), np.nan, when)
        words = "smallest" if what == "min" else "largest"
        long_name = f"{words} {variable.attributes.get('long_name', variable.name)} at a sample"
        common = {k: v for k, v in variable.attributes.items() if k in ("frame", "euler_sequence", "angle")}
        found[f"{variable.name}_{what}"] = kept(
            one.shaped(extreme), units, long_name, "extremes", variable.dims, **common
        )
        found[f"{variable.name}_{what}_time"] = kept(
            one.shaped(when), "s", f"time of the {long_name}", "extremes", variable.dims
        )
    return found


def _means(one: MemberSeries) -> Kept:
    variable = one.variable
    present = ~np.isnan(one.parts[0])
    count = np.maximum(present.sum(axis=1), 1)
    # in the order of the samples: ``sum`` takes another order if a member is alone in its block
    total = sum(np.cumsum(np.where(present, part, 0), axis=1)[:, -1] for part in reversed(one.parts))
    mean = np.where(present.any(axis=1), total / count, np.nan)
    units = variable.attributes.get("units", "1")
    long_name = f"mean of the {variable.attributes.get('long_name', variable.name)} over the samples"
    return {f"{variable.name}_mean": kept(one.shaped(mean), units, long_name, "means", variable.dims)}


def _drifts(one: MemberSeries, lengths: np.ndarray) -> Kept:
    values = one.parts[0]
    size = np.abs(values[:, :, 0])
    largest = np.where(lengths > 0, np.fmax.reduce(size, axis=1, initial=0.0), np.nan)
    of_a_member = ("coordinates", "scale", "scale_units")
    attributes = {k: v for k, v in one.variable.attributes.items() if k not in of_a_member}
    named = one.variable.attributes.get("long_name", one.variable.name)
    return {
        f"{one.variable.name}_largest": KeptVariable(
            (), largest, {**attributes, "long_name": f"largest {named} at a sample, without its sign"}
        ),
        f"{one.variable.name}_final": KeptVariable(
            (), _last(values, lengths)[:, 0], {**attributes, "long_name": f"{named} at the last sample"}
        ),
    }


def _series(series: Sequence[MemberSeries], times: np.ndarray) -> Kept:
    found: Kept = {}
    for one in series:
        for part, values in enumerate(one.parts):
            attributes = {k: v for k, v in one.variable.part_attributes(part).items() if k != "coordinates"}
            found[part_name(one.variable.name, part)] = KeptVariable(
                ("sample", *one.variable.dims), one.shaped(values), attributes, "series"
            )
    rows = np.broadcast_to(times, (len(next(iter(found.values())).values), times.shape[-1]))
    found["time"] = kept(np.array(rows), "s", "time of the scene", "series", ("sample",))
    return found


Points = Mapping[str, tuple[Variable, Sequence[np.ndarray]]]
"""Values recorded at events by name: for each member (times, ...)."""


def kept_events(
    name: str, times: Sequence[np.ndarray], most: int, points: Points, keep: Collection[str]
) -> Kept:
    """How often an event happened and when (s); only the first times that fit are kept."""
    count = len(times)
    found: Kept = {}
    along, first_times = (f"{name}_occurrence",), f"times of {name}, the first {most}"
    table = _padded(times, most, ())
    if "events" in keep:
        counts = np.array([len(t) for t in times], dtype=np.int64)
        found[f"{name}_count"] = kept(counts, "1", f"how often {name} happened", "events")
        found[f"{name}_times"] = kept(table, "s", first_times, "events", along)
        first = table[:, 0] if most else np.full(count, np.nan)
        found[f"{name}_first"] = kept(first, "s", f"first time of {name}", "events")
    if "section" in keep:
        for what, (variable, values) in points.items():
            labels = {k: v for k, v in variable.attributes.items() if k in ("units", "frame", "angle")}
            labels["long_name"] = f"{variable.attributes.get('long_name', what)} at {name}"
            padded = _padded(values, most, variable.shape)
            found[f"{name}_{what}"] = KeptVariable((*along, *variable.dims), padded, labels, "section")
        found[f"{name}_time"] = kept(table, "s", first_times, "section", along)
    return found


def _padded(rows: Sequence[np.ndarray], most: int, shape: tuple[int, ...]) -> np.ndarray:
    table = np.full((len(rows), most, *shape), np.nan)
    for row, values in zip(table, rows, strict=True):
        taken = values[:most]
        row[: len(taken)] = np.reshape(taken, (-1, *shape))
    return table


def assembled(parts: Sequence[tuple[np.ndarray, Kept]], count: int) -> Kept:
    """Groups of members, each at its places, as one; nan (0 for counts) where a group lacks a variable."""
    found: Kept = {}
    for name in dict.fromkeys(name for _, part in parts for name in part):
        held = [(places, part[name]) for places, part in parts if name in part]
        like = held[0][1]
        shape = np.max([one.values.shape[1:] for _, one in held], axis=0).astype(int)
        lacking = 0 if like.values.dtype.kind == "i" else np.nan
        table = np.full((count, *shape), lacking, dtype=like.values.dtype)
        for places, one in held:
            there: tuple[Any, ...] = (places, *(slice(0, size) for size in one.values.shape[1:]))
            table[there] = one.values
        found[name] = replace(like, values=table)
    return found
