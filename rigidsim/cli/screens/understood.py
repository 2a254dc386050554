"""How a config was understood, in everyday units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rigidsim.scene.readable_time import (
    TimeUnit,
    epoch_of,
    instant_text,
    named_unit,
    number_text,
    span_text,
    unit_for,
)
from rigidsim.store.summary import Span, Start, UnderstoodBody

_DIGITS = 6
_FEWER = 4
_FAR = 1e4  # m, from where on km read better
_STRAIGHT = 1e-9  # of a direction's component: what is less is shown as zero


def understood(
    body: UnderstoodBody | None, start: Start | None, time: Span | None, loads: Sequence[str] = ()
) -> Iterator[tuple[str, str]]:
    """Labels and texts for whatever is present (older summaries have less)."""
    if body is not None:
        yield "body", body_text(body)
    if start is not None:
        yield "start", start_text(start)
    if time is not None:
        yield "time", time_text(time)
    for load in loads:
        yield "load", load


def body_text(body: UnderstoodBody) -> str:
    """Mass, centre of mass, and moments with their axes."""
    parts = [f"from {body.source.partition(' (')[0]}"]
    if body.mass is not None:
        parts.append(f"mass {_number(body.mass)} kg")
    if body.center_of_mass is not None and any(body.center_of_mass):
        parts.append(f"centre of mass at ({_numbers(body.center_of_mass)}) m from the point it turns about")
    elif body.center_of_mass is not None:
        parts.append("turns about its centre of mass")
    moments = f"principal moments {_numbers(body.principal_moments)} kg m^2 about "
    axes = [_direction(axis) for axis in body.principal_axes]
    return ", ".join(parts) + "\n" + moments + ", ".join(axes)


def start_text(start: Start) -> str:
    """Attitude in degrees, rates with the time of a turn, position and velocity."""
    angles = _numbers(start.euler_angles_deg)
    attitude = f"attitude {start.euler_sequence} {angles} deg"
    if not any(start.euler_angles_deg):
        attitude = "attitude: body axes along space axes"
    rate = math.hypot(*start.angular_velocity)
    turning = f"angular velocity {_numbers(start.angular_velocity)} rad/s about x, y, z"
    if rate:
        turn = span_text(2 * math.pi / rate, _FEWER)
        turning += f" ({number_text(math.degrees(rate), _FEWER)} deg/s, a turn in {turn})"
    lines = [attitude, turning]
    if start.position is not None and start.velocity is not None:
        size, unit = (1000.0, "km") if max(map(abs, start.position)) >= _FAR else (1.0, "m")
        place = _numbers([x / size for x in start.position])
        lines.append(f"position {place} {unit}, velocity {_numbers(start.velocity)} m/s in space axes")
    return "\n".join(lines)


def time_text(time: Span) -> str:
    """Start and end in the config's unit or one that suits the span, and the number of samples."""
    unit = _unit(time)
    ends = [
        f"{number_text(seconds / unit.seconds, _DIGITS)}{'' if seconds == 0 else ' ' + unit.symbol}"
        for seconds in (time.start_s, time.end_s)
    ]
    every = ", at listed times" if time.every_s is None else f", one every {span_text(time.every_s, _DIGITS)}"
    text = f"{ends[0]} to {ends[1]}, {time.samples:,} samples{every if time.samples > 1 else ''}"
    epoch = epoch_of({"epoch": time.epoch})
    if epoch is None:
        return text
    span = time.end_s - time.start_s
    dates = [instant_text(epoch, seconds, span) for seconds in (time.start_s, time.end_s)]
    return f"{text}\n{dates[0]} to {dates[1]}"


def _unit(time: Span) -> TimeUnit:
    try:
        return named_unit(time.unit) if time.unit else unit_for(max(abs(time.start_s), abs(time.end_s)))
    except ValueError:  # of a summary that was tampered with
        return unit_for(time.end_s)


def _number(value: float) -> str:
    return number_text(value, _DIGITS)


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(_number(value) for value in values)


def _direction(axis: Sequence[float]) -> str:
    """``z``, ``-z``, or components."""
    straight = [0.0 if abs(x) < _STRAIGHT else x for x in axis]
    if straight.count(0.0) == 2:
        along = next(i for i, x in enumerate(straight) if x)
        return ("-" if straight[along] < 0 else "") + "xyz"[along]
    return "(" + ", ".join(number_text(x, _FEWER) for x in straight) + ")"
