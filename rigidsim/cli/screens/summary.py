"""Output of ``rigidsim run``, ``resume``, ``info``, ``check``, ``verify``: verdict, errors, start, cost."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console

from rigidsim.cli.screens.page import Page, Styled, answer
from rigidsim.scene.choices import method_named, variables_named
from rigidsim.scene.readable import YEAR, TimeWords, epoch_of, instant_text, number_text, span_text, unit_of
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.status import Status
from rigidsim.store.run import Run
from rigidsim.store.summary import (
    ENGINE,
    Accuracy,
    Advice,
    AdviceCode,
    Brief,
    FoundStart,
    Modelling,
    Span,
    Start,
    Summary,
    Understood,
    UnderstoodBody,
)

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
    if body.reference is not None and any(body.reference):
        place = f"at ({_numbers(body.reference)}) m of its description"
        parts.append(f"{place}, to which tensors are moved by the parallel-axis theorem")
    moments = f"principal moments {_numbers(body.principal_moments)} kg m^2 about "
    axes = [_direction(axis) for axis in body.principal_axes]
    return ", ".join(parts) + "\n" + moments + ", ".join(axes)


def start_text(start: Start) -> str:
    """Attitude in degrees, rates with the time of a turn, position and velocity."""
    angles = _numbers(start.euler_angles_deg)
    attitude = f"attitude {start.euler_sequence} {angles} deg"
    if not any(start.euler_angles_deg):
        attitude = "attitude: body axes along space axes"
    if start.relative_euler_angles_deg is not None:
        given = f"{start.euler_sequence} {_numbers(start.relative_euler_angles_deg)} deg"
        attitude += f" in space, {given} against {start.relative_to}"
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
    "rad of this run at 1/{times} of the steps",
}


def verdict_line(summary: Summary, *, brief: bool = False) -> tuple[str, str]:
    """The verdict, and its style on a terminal; unless ``brief``, with the largest share of its bound."""
    found = verdict_on(summary)
    words, share = _WORDS[found.soundness], found.share or 0.0
    if found.soundness is Soundness.DRIFTED and not share > 1:  # what drifted has no finite size
        words = "not sound: see the warning"
    most = "" if brief else f", {_percent(share)} of it at most"
    verdict = words.format(share=most, worst=found.worst, times=f"{share:.2g}")
    model = summary.modelling
    if found.soundness is not Soundness.INACCURATE and model is not None and model.momentum_axis is None:
        verdict += "; how far the averaged model is from the full one isn't known"
    return verdict, _STYLES.get(found.soundness, "green")


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
        return [f"rigidsim {command} {where}" for command in ("view", "plot", "analyse")]
    return [f"rigidsim resume {where}"] if exit_code == 130 or status in _RESUMABLE else []


_DONE = {s.value for s in (Status.FINISHED, Status.EVENT)}
_RESUMABLE = {s.value for s in (Status.RUNNING, Status.WALL_TIME, Status.MAX_STEPS)}


_EVENTS = 2
"""Events that are shown with their times unless all is asked for; of more only their number."""


def print_run(result: Run, as_json: bool, *, verbose: bool = False) -> int:
    """Print how a run ended; returns its exit code."""
    show = lambda: print_summary(result.outcome, result.place, verbose=verbose)  # noqa: E731
    answer(as_json, result.summary, show)
    code = result.outcome.exit_code
    if code:
        print(f"rigidsim: {result.outcome.message}", file=sys.stderr)
    return code


def print_summary(
    summary: Brief, folder: str, out: Console | None = None, *, verbose: bool = True, loads: bool = False
) -> None:
    """Print what can be relied on first, then cost and what to do next; ``verbose`` with body, start, model
    and invariants, and with ``loads`` what acts, too. Warnings are never left out.
    """
    on = Page(out)
    color = "green" if summary.status == "finished" else "yellow"
    on.say((summary.name, "bold"), "  ", (summary.status, f"bold {color}"))
    if verbose and summary.description:
        on.say((summary.description, "dim"))
    if summary.status != "finished":
        on.say(summary.message)
    if isinstance(summary, Summary):
        _print_found(summary, on, verbose)
        if verbose:
            print_understood(summary, summary.loads if loads else (), on)
            _print_model(summary, on)
            _print_invariants(summary, on)
        _print_cost(summary, on, verbose)
    more = f"rigidsim info {shlex.quote(folder)}   (invariants, start, cost by phase)"
    commands = next_lines(summary.status, summary.exit_code, folder)
    for number, command in enumerate([*commands, *([] if verbose or not folder else [more])]):
        on.line("" if number else "next", command, "cyan")


def _print_found(summary: Summary, on: Page, verbose: bool) -> None:
    on.line("verdict", *verdict_line(summary, brief=not verbose))
    on.lines("warning", summary.warnings, "bold red")
    _print_errors(summary.accuracy, on, "attitude" if summary.modelling is None else "axis", verbose)
    if summary.modelling is not None:
        _print_modelling(summary.modelling, on, verbose)
    if (chaos := summary.lyapunov) is not None:
        what = "chaotic" if chaos.chaotic else "regular"
        moved = f" (moved by {chaos.moved_over_second_half:.1g} over the second half)" if verbose else ""
        on.line("motion", f"{what}: largest Lyapunov exponent {chaos.largest_exponent:.3g} 1/s{moved}")
    if verbose or len(summary.events) <= _EVENTS:
        on.lines("event", (_event_text(summary, name) for name in summary.events))
    else:
        on.line("events", ", ".join(f"{name}: {count:,}" for name, count in summary.events.items()))
    if summary.undefined_samples:
        lost = [f"{name} at {n:,} sample{'s' * (n > 1)}" for name, n in summary.undefined_samples.items()]
        on.line("missing", f"{', '.join(lost)}: undefined there, NaN is recorded")
    if summary.tides is not None:
        on.line("tides", summary.tides)
    on.lines("advice", filter(None, map(advice_line, summary.advice)), "cyan")
    for name, found in summary.tables.items() if verbose else ():
        on.line(
            "table",
            f'"{name}": interpolation misses the source by {found.direction:.1e} rad at most with every '
            f"other row left out, by about {found.direction * found.expected:.0e} rad with all rows",
        )


def _event_text(summary: Summary, name: str) -> str:
    """How often an event happened, and when."""
    count, times = summary.events[name], summary.event_times.get(name)
    if times is None:
        return f"{name}: {count:,}"
    early = times.early or (times.first,)
    if count > len(early):  # a few, and the last one
        early = early[:3]
    span = summary.time  # none of an older version
    start, end = (span.start_s, span.end_s) if span else (0.0, summary.time_reached)
    words = TimeWords.of({"epoch": span.epoch, "time_unit": span.unit} if span else {}, start, end)
    said = [words.moment(time) for time in early]
    if count > len(said):
        said += ["..."] * (count > len(said) + 1) + [words.moment(times.last)]
    return f"{name}: {count:,}, at {', '.join(said)}"


def _print_errors(accuracy: Accuracy, on: Page, what: str, verbose: bool) -> None:
    """Print announced and certified errors, ``verbose`` with how they were chosen and found."""
    if accuracy.chosen and verbose:
        on.line("chosen", f"{accuracy.chosen}: {accuracy.chosen_why}")
    estimate = accuracy.estimated_attitude_error
    if accuracy.certified is not None:
        asked = "" if accuracy.requested is None else f", {accuracy.requested:.1e} asked for"
        text = f"certified to {accuracy.certified:.1e} rad{asked} ({accuracy.how}, "
        on.line(what, f"{text}{accuracy.times_compared} times)")
    elif estimate is not None:
        factor, share = accuracy.amplification or 1.0, accuracy.examined_share
        unstable = f" ({factor:.1g} times a stable motion's)" if factor > 1 and verbose else ""
        size = f"uncertain by about {estimate:.1e} rad at the end{unstable}"
        if what == "axis":
            size = f"momentum's direction integrated to about {estimate:.1e} rad at the end{unstable}"
        on.line(what, size if estimate < math.pi else "unknown at the end")
        if verbose and share is not None and share < 1 and estimate < math.pi:
            seen = f"the growth of errors was followed over the first {100 * share:.2g} % of the run"
            on.line("examined", f"{seen} (estimated_how in the summary says more)")
    elif accuracy.amplification is None:
        on.line("errors", accuracy.estimated_how)
    place, speed = accuracy.estimated_position_error, accuracy.estimated_velocity_error
    if accuracy.certified_position is not None:
        length = accuracy.requested_position or math.nan
        on.line("path", f"certified to {accuracy.certified_position:.1e} m, {length:.1e} m asked for")
    elif place is not None and speed is not None:
        text = f"position uncertain by about {place:.1e} m, velocity by {speed:.1e} m/s, at the end"
        on.line("path", text)


def _print_modelling(found: Modelling, on: Page, verbose: bool) -> None:
    """Print how far a reduced model is from the full one, ``verbose`` with how that is known."""
    if found.momentum_axis is None:
        on.line("averaged", f"modelling error {found.how}")
        return
    text = f"momentum's direction within {found.momentum_axis:.1e} rad of the full model's"
    if found.figure_axis is not None:
        text += f", figure axis within {found.figure_axis:.1e} rad"
    on.line("averaged", text)
    if not verbose:
        return
    if found.angular_momentum_norm is not None and found.energy is not None:
        text = f"size of the angular momentum within {found.angular_momentum_norm:.1e} of itself, energy of "
        on.line("", text + f"rotation within {found.energy:.1e}")
    if not found.whole and found.growth is not None and found.oscillation is not None:
        span = found.windows[0].end - found.windows[0].start
        text = f"{len(found.windows)} spans of {span_text(span)} integrated with every rotation: "
        text += f"{found.oscillation:.1e} rad in each, growing by {found.growth * YEAR:.1e} rad/yr"
        on.line("", text)
    if not (found.short_period or found.resonance or found.energy is not None):
        on.line("", "[model] short_period = true adds the nutation back that averaging removed")


def _print_cost(summary: Summary, on: Page, verbose: bool) -> None:
    cost = summary.cost
    seconds = sum(spent for phase, spent in cost.seconds.items() if phase != ENGINE)
    said = f"{cost.steps:,} steps, {summary.samples:,} of {summary.samples_planned:,} samples, "
    on.line("cost", f"{said}{span_text(seconds)} wall, {span_text(cost.cpu_seconds)} CPU")
    if verbose and cost.cpu_by_phase:
        spent = [f"{name.replace('_', ' ')} {span_text(s)}" for name, s in cost.cpu_by_phase.items()]
        on.line("CPU", f"{', '.join(spent)}; steps alone {span_text(cost.seconds[ENGINE])} wall")


def print_understood(understood: Understood, loads: Sequence[str], on: Page) -> None:
    """Print body, start, time (as far as an older summary has them) and what acts as they were understood."""
    if understood.body is not None:
        on.line("body", body_text(understood.body))
    if understood.start is not None:
        on.line("start", start_text(understood.start))
    if understood.time is not None:
        on.line("time", time_text(understood.time))
    for load in loads:
        on.line(*labelled(load))


def from_step(step: int | None) -> str:
    """From which step on something is done, if that isn't all of them."""
    return "" if step is None else f" from step {step:,} on"


def _shortened(states: Sequence[str]) -> list[str]:
    """Names of states, of those that place a kernel's bodies only the first and the last."""
    placing = [name for name in states if name.startswith("kernel_")]
    if len(placing) < 3:
        return list(states)
    first = states.index(placing[0])
    rest = [name for name in states[first:] if name not in placing]
    return [*states[:first], placing[0], "...", placing[-1], *rest]


def _print_model(summary: Summary, on: Page) -> None:
    method = method_named(summary.method)
    how = f"tolerance {summary.tolerance:.3g}" if method.has_steps else f"in {method.title}"
    if summary.held:
        how += ", invariants projected" + from_step(summary.hold_from_step)
    on.line(
        "model",
        f"{summary.formulation}, {len(summary.states)} states ({' '.join(_shortened(summary.states))}), "
        f"{summary.precision} precision, {how}",
    )
    if caveat := variables_named(summary.formulation).caveat:
        on.line("", caveat)


def _print_invariants(summary: Summary, on: Page) -> None:
    """Print the invariants, without the final drifts if the table doesn't fit."""
    held = ["correction"] if summary.held else []
    columns = ["invariant", "initial", "largest drift", "final", "bound", *held]
    rows: list[list[Styled]] = []
    scales: dict[str, list[str]] = {}  # of drifts; invariants with the same one together
    for name, row in summary.invariants.items():
        sound = row.largest_drift is None or row.largest_drift <= row.bound
        largest = (_drift(row.largest_drift), "" if sound else "red")
        rows.append([name, _initial(row.initial), largest, _drift(row.final_drift), _drift(row.bound)])
        rows[-1] += [_drift(row.put_back)] if held else []
        scales.setdefault("absolute" if row.scale_name == "1" else row.scale_name, []).append(name)
    if not on.fits(columns, rows):
        columns, rows = columns[:3] + columns[4:], [row[:3] + row[4:] for row in rows]
    on.table(columns, rows)
    said = "; ".join(f"{scale} ({', '.join(names)})" for scale, names in scales.items())
    on.line("drifts", f"relative to: {said}")
    on.lines("", (f"{name} isn't monitored: {why}" for name, why in summary.unwatched.items()))
    if held:
        text = "correction: what the drift would have been; the residual is no independent check"
        on.line("projected", text)


def _initial(value: float | tuple[float, ...] | None) -> str:
    """A number, or the norm of a vector, to recognise it by; all digits are in summary.json."""
    if value is None:
        return "-"
    return f"|{math.hypot(*value):.6g}|" if isinstance(value, tuple) else f"{value:.6g}"


def _drift(value: float | None) -> str:
    return "-" if value is None else f"{value:.2e}"


def print_verdict(verdict: dict[str, Any], what: str = "sample") -> None:
    """Print a verification in words, from ``Verdict.as_dict``; ``what`` names the things compared."""
    on = Page()
    if verdict["identical"]:
        on.say(f"identical: {verdict['samples']:,} {what}s, every variable, every bit")
    else:
        on.say(f"different: {verdict['path']}")
    for problem in verdict["problems"]:
        on.say(f"  {problem}")
    if (reversal := verdict.get("reversal")) is not None:
        on.say(f"  {reversal['words']}")
    first = verdict["first_difference"]
    if first is not None:
        on.say(
            f"  first difference: {first['variable']} at {what} {first['sample']}: saved "
            f"{first['saved']!r}, again {first['again']!r}, {first['size']:.3g} apart"
        )
    names = verdict["differing_variables"]
    if names:
        on.say(f"  variables that differ: {', '.join(names)}")
    if verdict["environment"]:
        on.say(
            "  changed since:" if verdict["identical"] else "  changed since, which can explain other bits:"
        )
        for line in verdict["environment"]:
            on.say(f"    {line}")
    elif names:
        on.say("  versions, CPU features and settings are the same, so they don't explain it")
