"""A run in plain words: how its config was understood, the verdict, advice, and what to do next."""

import math
import shlex
from collections.abc import Iterable, Sequence

from rigidsim.scene.readable import epoch_of, instant_text, number_text, span_text, unit_of
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.status import Status
from rigidsim.store.summary import FoundStart, Span, Start, Summary, UnderstoodBody
from rigidsim.store.summary_parts import Advice, AdviceCode

_DIGITS = 6
_FEWER = 4
_FAR = 1e4  # m, from where on km read better
_STRAIGHT = 1e-9  # of a direction's component: what is less is shown as zero


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
    if start.equilibrium is not None:
        lines += _equilibrium(start.equilibrium)
    return "\n".join(lines)


def _equilibrium(found: FoundStart) -> Iterable[str]:
    yield found.described
    yield f"found {found.how}"
    grows = [real for real, _ in found.exponents if real > 0]
    fades = [-real for real, _ in found.exponents if real < 0]
    turns = [2 * math.pi / imaginary for real, imaginary in found.exponents if real <= 0 and imaginary > 0]
    if turns:
        yield f"librations about it: {', '.join(span_text(period, _FEWER) for period in turns)}"
    if grows:
        yield f"small displacements grow e-fold in {span_text(1 / max(grows), _FEWER)}"
    elif fades:
        yield f"the fastest fade e-fold in {span_text(1 / max(fades), _FEWER)}"


def time_text(time: Span) -> str:
    """Start and end in the config's unit or one that suits the span, and the number of samples."""
    unit = unit_of({"time_unit": time.unit}, max(abs(time.start_s), abs(time.end_s)))
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


def labelled(acting: str) -> tuple[str, str]:
    """The label and the text of what is among the loads: rotors and user-defined states say so first."""
    what, _, rest = acting.partition(" ")
    return (what, rest) if what in ("rotor", "state") else ("load", acting)


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


_STYLES = {
    Soundness.LIMITED: "bold yellow",
    Soundness.INACCURATE: "bold yellow",
    Soundness.LOST: "bold yellow",
    Soundness.DRIFTED: "bold red",
}
_SOUND = "sound: every drift is within what rounding explains{share}"
_WORDS = {
    Soundness.SOUND: _SOUND,
    Soundness.AMPLIFIED: _SOUND + "; the motion itself amplifies errors",
    Soundness.HELD: "sound: the corrections of invariants are within what rounding explains{share}; "
    "drifts themselves are projected away",
    Soundness.LIMITED: "sound except for the warning: every drift is within what rounding explains{share}",
    Soundness.UNCHECKED: "unchecked: nothing is conserved here that could be watched",
    Soundness.INACCURATE: "not accurate enough, or not known to be: see the warning; drifts are within what "
    "rounding explains{share}",
    Soundness.LOST: "drifts are within what rounding explains{share}, but digits are gone at "
    "the end: see the warning",
    Soundness.DRIFTED: "not sound: {worst} drifted by {times} times what rounding explains; see the warning",
}
_ADVICE = {
    AdviceCode.HOLD_INVARIANTS: "hold_invariants = true would bring {now} rad to about {then} for a few "
    "percent more CPU",
    AdviceCode.CLOSED_FORM: 'this scene has a closed form: method = "{code}" is right to {then} rad at '
    "any time, in place of {now}",
    AdviceCode.AVERAGED: '[model] level = "{level}" with short_period = true keeps the axes within {then} '
    "rad of this at 1/{times} of the steps",
}


def verdict_line(summary: Summary, *, brief: bool = False) -> tuple[str, str]:
    """The verdict, and its style on a terminal; unless ``brief``, with the largest share of its bound."""
    found = verdict_on(summary)
    words, share = _WORDS[found.soundness], found.share or 0.0
    if found.soundness is Soundness.DRIFTED and not share > 1:  # what drifted has no finite size
        words = "not sound: see the warning"
    most = "" if brief else f", {_percent(share)} of it at most"
    told = words.format(share=most, worst=found.worst, times=f"{share:.2g}")
    model = summary.modelling
    if found.soundness is not Soundness.INACCURATE and model is not None and model.momentum_axis is None:
        told += "; how far the averaged model is from the full one isn't known"
    return told, _STYLES.get(found.soundness, "green")


def _percent(share: float) -> str:
    return "0 %" if share == 0 else f"{100 * share:.2g} %" if share >= 0.001 else "less than 0.1 %"


def advice_line(advice: Advice) -> str | None:
    """One piece of advice; None if it is of a later version."""
    known = {code.value: text for code, text in _ADVICE.items()}
    text = known.get(advice.code)
    if text is None:
        return None
    times = f"{1 / advice.share:.2g}" if advice.share else "1"
    then = f"{advice.then:.1e}" if advice.level else f"{advice.then:.0e}"
    return text.format(code=advice.code, now=f"{advice.now:.1e}", then=then, level=advice.level, times=times)


def arcsec_text(angle: float) -> str:
    """An angle that is known in arcseconds; from a degree on in degrees."""
    return f"{angle / 3600:.4g}°" if angle >= 3600 else f"{angle:.4g}″"


def next_lines(status: str, exit_code: int, place: str) -> list[str]:
    """Commands that may be useful next; none for a run in memory."""
    if not place:
        return []
    where = shlex.quote(place)
    if exit_code == 0 and status in _DONE:
        return [f"rigidsim view {where}", f"rigidsim plot {where}"]
    return [f"rigidsim resume {where}"] if exit_code == 130 or status in _RESUMABLE else []


_DONE = {s.value for s in (Status.FINISHED, Status.EVENT)}
_RESUMABLE = {s.value for s in (Status.RUNNING, Status.WALL_TIME, Status.MAX_STEPS)}
