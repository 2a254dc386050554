"""The orbit given by a load's table and keys."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.orbit_tables.elements import ElementTable, TableError, read_table
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import PACES, Orbit, pace_of, rate_of
from rigidsim.scene.registry import Surroundings
from rigidsim.scene.tracing.exact import TracedExact
from rigidsim.scene.tracing.numbers import Traced, Untraceable


@lru_cache(8)
def tabulated_orbit(
    name: str,
    text: str,
    bits: int,
    constants: tuple[tuple[str, ExactNumber], ...],
    strength: tuple[Any, ...] | None,
) -> TabulatedOrbit:
    """A tabulated orbit, made once however often a scene is built, from the text of a table, the elements
    that it lacks, and the parts of an mpf: the gravitational parameter of Kepler's third law, if known.
    """
    table = read_table(text, bits)
    context = table.context
    given = dict(constants)
    for key in given:
        if key in table.columns:
            raise TableError(f"has a column {key}, which is given beside it, too; remove one of them")
    if "semi_major_axis" not in table.columns and "semi_major_axis" not in given:
        raise TableError("has no column semi_major_axis; add one, or give semi_major_axis beside table")
    paces = [(key, given.pop(key)) for key in PACES if key in given]
    if paces:
        rate = rate_of(paces[0], context)
        motion: Callable[[Any], Any] = lambda axis: rate  # noqa: E731
    elif strength is None:
        raise TableError("needs a mean motion; give period beside table")
    else:
        mass = context.make_mpf(strength)
        motion = lambda axis: context.sqrt(mass / axis**3)  # noqa: E731
    columns = {key: value.at(context) for key, value in given.items()}
    made_of = (name, text, bits, constants, strength)
    orbit = TabulatedOrbit(made_of, name, _listed(table), columns, motion)
    _ = orbit.error
    return orbit


def _listed(table: ElementTable) -> ElementTable:
    return ElementTable(list(table.times), {k: list(v) for k, v in table.columns.items()}, table.context)


_NO_CONSTANTS = ("table", "node_rate", "periapsis_rate")


def resolve_tabulated_orbit(fields: Orbit, strength: Any | None, around: Surroundings) -> TabulatedOrbit:
    """Work out the orbit of a table; ``strength`` is the gravitational parameter of Kepler's third law, if
    known.
    """
    name = fields.table
    assert name is not None
    given = [
        (key, getattr(fields, key)) for key in sorted(fields.model_fields_set) if key not in _NO_CONSTANTS
    ]
    if isinstance(strength, Traced) or any(isinstance(value, TracedExact) for _, value in given):
        raise Untraceable("an orbit by a table depends on it")
    for rate in ("node_rate", "periapsis_rate"):
        if getattr(fields, rate).sign != 0:
            raise around.fault(f"orbit.{rate}", "given beside table, whose columns say what moves; remove it")
    pace_of(fields, around)
    if name not in around.tables:
        known = ", ".join(around.tables) or "none"
        what = f'given "{name}", but this config was given as text, without files beside it; put the '
        raise around.fault("orbit.table", what + f'CSV into [tables."{name}"] text (there now: {known})')
    parts = None if strength is None else strength._mpf_
    constants = tuple((key, value.alone) for key, value in given if value is not None)
    try:
        orbit = tabulated_orbit(name, around.tables[name], around.context.prec, constants, parts)
    except TableError as error:
        raise around.fault("orbit.table", f'given "{name}": {error}') from None
    times = orbit.table.times
    if around.span is not None and not (times[0] <= around.span[0] and around.span[1] <= times[-1]):
        first, last, start, end = (around.context.nstr(t, 8) for t in (times[0], times[-1], *around.span))
        what = (
            f'given "{name}", which reaches from t = {first} s to {last} s, but the run goes from {start} s '
        )
        raise around.fault("orbit.table", what + f"to {end} s; give more rows, or change [time] start or end")
    return orbit
