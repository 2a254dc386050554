"""The dataset of a sweep: all members labelled along its axes, gathered from its tiles."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.scene.sweeps.axes import Axis
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store import atomic
from rigidsim.store.atomic import sink
from rigidsim.store.netcdf import NetcdfFile, writing
from rigidsim.store.seal import seal
from rigidsim.store.sweeps.sources import Described, Gathered, Sources
from rigidsim.store.sweeps.tiles import plain
from rigidsim.store.variables import LABELS, OF_THE_RUN

_GZIP = 4
_BOX_NUMBERS = 1 << 22  # numbers of a variable that are gathered at once: 32 MB
_CHUNK_NUMBERS = 1 << 17
_SAMPLES = "sample"
_UNIT = "_unit"

RESERVED = {
    *LABELS,
    *OF_THE_RUN,
    *("time", "sample", "member", "status", "steps", "warnings", "time_reached", "drift_bound"),
    *(
        "attitude_error",
        "position_error",
        "modelling_error",
        "modelling_error_norm",
        "modelling_error_energy",
    ),
    *("failed", "failed_member", "failed_reason", "lyapunov", "megno", "fli", "line"),
}
"""Names that an axis can't have."""
OF_FITS = {
    *("parameter", "parameter_unit", "other_parameter", "value", "sigma", "scaled_sigma", "covariance"),
    *(
        "start",
        "converged",
        "undetermined",
        "chi_square",
        "freedom",
        "scale",
        "rows",
        "outliers",
        "evaluations",
    ),
}
"""Names that an axis can't have in a sweep of fits."""
SUFFIXES = ("_final", "_min", "_max", "_mean", "_largest", "_time", "_times", "_count", "_first", "_lo")
"""Suffixes of the names of variables that are kept."""


def write_dataset(
    path: Path,
    sweep: Sweep,
    sources: Sources,
    found: Gathered,
    attributes: Mapping[str, Any],
) -> str:
    """Write the dataset atomically; returns the digest of the file."""
    with atomic.replacing(path) as temporary:
        with sink(temporary) as target, writing(target) as file:
            file.attributes(attributes)
            beside = _coordinates(file, sweep)
            created = _declared(file, sweep, found, beside)
            for name, (target_variable, described) in created.items():
                item = next(item for item in sources.places if plain(item) == described.variable.item)
                for first, shape, flat in boxes(sweep.shape, math.prod(described.extra)):
                    values = _values(name, described, item, sources, flat)
                    place = tuple(slice(i, i + n) for i, n in zip(first, shape, strict=True))
                    target_variable[place] = values.reshape(*shape, *described.extra)
            _write_reasons(file, found.reasons)
        return seal(temporary)[1]


def _coordinates(file: NetcdfFile, sweep: Sweep) -> str:
    """Write the axes; returns the names of coordinates that aren't dimensions."""
    beside = []
    for dim, size in zip(sweep.dims, sweep.shape, strict=True):
        file.dimension(dim, size)
    for axis in sweep.axes:
        dim = axis.name if sweep.product else sweep.dims[0]
        described: dict[str, Any] = {"long_name": axis.key, "units": axis.unit, "swept_key": axis.key}
        if not axis.numeric:
            texts = [_bare(axis.values.text(i)) for i in range(axis.values.count)]
            del described["units"]
            file.texts(axis.name, dim, texts, described)
            beside += [] if dim == axis.name else [axis.name]
            continue
        numbers = label_numbers(axis)
        name = axis.name
        dims: tuple[str, ...] = (dim,)
        if axis.values.components:
            name = f"{axis.name}_value" if sweep.product else axis.name
            file.dimension(f"{axis.name}_component", axis.values.components)
            dims = (dim, f"{axis.name}_component")
        if dims != (name,):
            beside.append(name)
        file.variable(name, dims, described)[...] = numbers
    return " ".join(beside)


def label_numbers(axis: Axis) -> np.ndarray:
    """The values of an axis as doubles, (count,) or (count, components); their texts are exact."""
    found = np.array([[float(x) for x in axis.exact(i)] for i in range(axis.values.count)])
    return found if axis.values.components else found[:, 0]


def _bare(text: str) -> str:
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def _declared(
    file: NetcdfFile, sweep: Sweep, found: Gathered, beside: str
) -> dict[str, tuple[Any, Described]]:
    created = {}
    labelled = LABELS | {"rotor": [rotor.name for rotor in sweep.base.config.rotors]}
    samples = _SAMPLES
    if found.times is not None:
        samples = "time"
        file.dimension("time", len(found.times))
        labels = {"units": "s", "long_name": "time of the scene"}
        file.variable("time", ("time",), labels)[...] = found.times
    for name, described in sorted(found.variables.items()):
        if name == "time" and found.times is not None:
            continue
        dims = [samples if dim == _SAMPLES else dim for dim in described.variable.dims]
        known = {**labelled, **described.variable.labels}
        for dim, size in zip(dims, described.extra, strict=True):
            if dim in known:
                file.labels(dim, known[dim])
            else:
                file.dimension(dim, size)
        attributes = {k: v for k, v in described.variable.attributes.items() if v is not None}
        if more := " ".join(filter(None, [beside, *_labels(file, described)])):
            attributes["coordinates"] = more
        chunk = chunk_shape(sweep.shape, described.extra)
        small = math.prod(sweep.shape) * math.prod(described.extra) < 512
        variable = file.variable(
            name, (*sweep.dims, *dims), attributes,
            chunk=None if small else chunk, gzip=None if small else _GZIP, whole=described.whole,
        )  # fmt: skip
        created[name] = (variable, described)
    return created


def _labels(file: NetcdfFile, described: Described) -> list[str]:
    """Write a variable's own labels; returns the names of those that are no dimensions."""
    own = described.variable.labels
    for name, texts in own.items():
        if name.endswith(_UNIT):
            file.texts_once(name, name.removesuffix(_UNIT), texts)
    return [name for name in own if name.endswith(_UNIT)]


def chunk_shape(members: Sequence[int], extra: Sequence[int]) -> tuple[int, ...]:
    """Shape of chunks: whole trailing dimensions, and as much of the one before them as makes a megabyte."""
    left = max(1, _CHUNK_NUMBERS // max(1, math.prod(extra)))
    chunk = []
    for size in reversed(members):
        taken = max(1, min(size, left))
        chunk.append(taken)
        left = max(1, left // taken) if taken == size else 1
    return (*reversed(chunk), *(max(1, n) for n in extra))


def boxes(
    members: Sequence[int], extra: int, numbers: int = _BOX_NUMBERS
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...], range]]:
    """Cut consecutive members into boxes of their dimensions: first corner, shape, and the members' range.
    Each has ``extra`` numbers; a box of more than one has at most ``numbers``.
    """
    most = max(1, numbers // max(1, extra))
    axis, within = len(members) - 1, 1
    while axis > 0 and within * members[axis] <= most:
        within *= members[axis]
        axis -= 1
    step = max(1, min(members[axis], most // within))
    block = within * members[axis]
    for number in range(math.prod(members[:axis])):
        leading = np.unravel_index(number, members[:axis]) if axis else ()
        for low in range(0, members[axis], step):
            high = min(low + step, members[axis])
            first = (*(int(i) for i in leading), low, *(0 for _ in members[axis + 1 :]))
            shape = (*(1 for _ in leading), high - low, *members[axis + 1 :])
            begin = number * block + low * within
            yield first, shape, range(begin, begin + (high - low) * within)


def _values(name: str, described: Described, item: str, sources: Sources, flat: range) -> np.ndarray:
    places, part = sources.places[item], slice(flat.start, flat.stop)
    tiles, rows = places.tile[part], places.row[part]
    kind, lacking = (np.int64, 0) if described.whole else (np.float64, np.nan)
    values = np.full((len(tiles), *described.extra), lacking, dtype=kind)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(tiles)) + 1, [len(tiles)]])
    for low, high in pairwise(edges):
        held = sources.tile(int(tiles[low])).kept.get(name)
        if held is not None:
            place = (slice(low, high), *(slice(0, n) for n in held.values.shape[1:]))
            values[place] = held.values[rows[low:high]]
    return values


def _write_reasons(file: NetcdfFile, reasons: Mapping[int, str]) -> None:
    if not reasons:
        return
    members = sorted(reasons)
    file.dimension("failed", len(members))
    numbers = file.variable(
        "failed_member", ("failed",), {"long_name": "which members didn't end well, the last axis fastest"},
        chunk=None, gzip=None, whole=True,
    )  # fmt: skip
    numbers[...] = members
    file.texts("failed_reason", "failed", [reasons[m] for m in members], {"long_name": "why"})
