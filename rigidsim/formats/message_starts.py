"""Starts from a CCSDS attitude parameter message (APM), whose numbers are read in double precision. A message
against a local frame of the orbit (LVLH, LVLH_ROTATING, ...) implies ``relative_to``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from rigidsim.errors import RigidsimError, ensure
from rigidsim.formats.messages import MESSAGE_COLUMNS, message_columns
from rigidsim.formats.trajectories import KNOWN_AXES, Trajectory
from rigidsim.scene.attitude import unit_quaternion
from rigidsim.scene.registry import MESSAGES
from rigidsim.scene.schema import LOCAL_FRAMES
from rigidsim.scene.starts import STARTS, InitialRotation, refusal
from rigidsim.scene.text_tables import text_of

_LATE = 1e-6  # s, by which the start may miss the message's date


@lru_cache(8)
def read_apm(name: str, text: str) -> Trajectory:
    """The row of a message; of a local frame its axes are a choice of ``relative_to``. Raises
    ``RigidsimError``: it can't be read, or has axes that nothing can turn.
    """
    found = Trajectory(source=name, **message_columns(Path(name), "APM", text))
    if (local := found.axes.replace(" ", "_").removesuffix("_ROTATING").lower()) in LOCAL_FRAMES:
        found = replace(found, axes=local)
    what = f"{name}: its attitude is against {found.axes or 'no named frame'}; "
    allowed = ", ".join((*sorted(KNOWN_AXES), *LOCAL_FRAMES)).replace(", ecliptic J2000", "")
    ensure(
        found.axes in {*KNOWN_AXES, *LOCAL_FRAMES} and found.settled,
        RigidsimError(f"{what}allowed: {allowed}"),
    )
    return found


def _start(scene: Any) -> InitialRotation:
    table, context = scene.config.initial, scene.context
    found = read_apm(table.apm, text_of(scene.config.texts, table.apm, partial(refusal, "apm")))
    ahead = float(scene.epoch.since(found.epochs[0])) + float(scene.start)
    what = f"is of {found.epochs[0]}, {abs(ahead):.6g} s {'before' if ahead > 0 else 'after'} the start; set "
    ensure(abs(ahead) <= _LATE, refusal("apm", f"{what}[time] epoch and start so that the run starts then"))
    local, given = found.axes if found.axes in LOCAL_FRAMES else None, table.relative_to
    what = f'given "{given}", but {table.apm} is against {local or found.axes}; remove relative_to'
    ensure(given == local, refusal("relative_to", what))
    columns = found.in_axes(scene.axes).columns
    quaternion, rates = (
        [context.mpf(float(columns[x][0])) for x in MESSAGE_COLUMNS[name] if x in columns]
        for name in ("quaternion", "angular_velocity")
    )
    given = table.angular_velocity or table.angular_momentum or table.spin_period
    what = "has rates, too; remove angular_velocity, angular_momentum and spin_period, or the rates there"
    ensure(not (rates and given), refusal("apm", what))
    what = "has no rates; give angular_velocity, angular_momentum or spin_period"
    ensure(rates or given, refusal("apm", what))
    degree = context.pi / 180
    return InitialRotation(unit_quaternion(context, quaternion), [w * degree for w in rates] or None)


MESSAGES["apm"], STARTS["apm"] = read_apm, _start
