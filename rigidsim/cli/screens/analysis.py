"""Output of ``rigidsim analyse``: numbers with as many digits as errors leave, in readable units."""

import math
from collections.abc import Sequence
from typing import Any

import mpmath
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from rigidsim.analysis.result import Analysis, SignalAnalysis, SpectralLine
from rigidsim.cli.screens.page import Page
from rigidsim.scene.readable import YEAR, span_text, unit_for
from rigidsim.workflows.analyse import Saved

_WIDE = 100  # columns, from which the tables of lines have all of theirs
_ROUNDINGS = 256.0  # spacings of a value: what rounding leaves of a constant over many steps
_SURE = 5.0  # errors, from which a secular rate is repeated
_DEGREE = math.pi / 180
_ANGLES = (
    (_DEGREE, "deg"), (_DEGREE / 3600, "arcsec"), (_DEGREE / 3.6e6, "mas"), (_DEGREE / 3.6e9, "µas"),
)  # fmt: skip
_RATES = ((_DEGREE, "deg/s"), (_DEGREE / 86400, "deg/d"), (_DEGREE / 3600 / YEAR, "arcsec/yr"))


def angle_unit(size: float) -> tuple[float, str]:
    """Factor and symbol of the unit in which an angle (rad) reads well."""
    return next(((u, name) for u, name in _ANGLES if abs(size) >= 0.1 * u), (1.0, "rad"))


def rate_unit(size: float) -> tuple[float, str]:
    """Factor and symbol of the unit in which a rate (rad/s) reads well."""
    return next(((u, name) for u, name in _RATES if abs(size) >= 0.5 * u), _RATES[-1])


def justified(value: Any, error: float, most: int) -> str:
    """A number without the digits that its error leaves uncertain."""
    size = abs(float(value))
    if size == 0 or not math.isfinite(size):
        return f"{float(value):g}"
    places = most
    if error > 0:
        places = math.floor(math.log10(size)) - math.floor(math.log10(error)) + 2
    places = min(max(places, 2), most)
    with mpmath.workdps(60):
        text = str(mpmath.nstr(mpmath.mpf(value), places, strip_zeros=False, min_fixed=-4, max_fixed=places))
    return text.rstrip(".")


def print_analysis(analysis: Analysis, saved: Saved) -> None:
    """Print a table for each signal, with remarks."""
    on = Page()
    span, spacing = span_text(analysis.length), span_text(analysis.spacing)
    periods = f"periods from {span_text(2 * math.pi / analysis.nyquist)}"
    on.say((analysis.title or "dataset", "bold"), f"  {span} of samples, one every {spacing}: {periods}")
    for signal in analysis.signals:
        _print_signal(signal, on, analysis.length)
    _print_secular([one for one in analysis.signals if not _is_constant(one, analysis.length)], on)
    rows = []
    for one in analysis.known:
        period = span_text(2 * math.pi / abs(float(one.value)), 8)
        rows.append([one.name, f"{'-' if float(one.value) < 0 else ''}{period}", one.source])
    if rows:
        on.table(["known frequency", "period", "from"], rows)
    if analysis.attitude_error is not None and analysis.rounding is not None:
        on.say(
            f"rounding  the run's own error of {analysis.attitude_error:.1e} rad at the end allows "
            f"frequencies to {analysis.rounding:.1e} rad/s; errors above are of the analysis alone",
            whole=True,
        )
    on.say(f"dataset   {saved.dataset}", whole=True)
    on.say(f"figure    {saved.figure}", whole=True)


def _print_secular(signals: Sequence[SignalAnalysis], on: Page) -> None:
    """Print once more, below all lines, the secular rates."""
    moving = [one for one in signals if one.rate is not None and abs(one.rate.real) > _SURE * one.rate_error]
    if moving:
        on.say("")
    for one in moving:
        words = _rate(one, one.units == "rad", _digits(one))
        on.say("secular   ", (one.name, "bold"), f"  {words}", whole=True)


def _digits(signal: SignalAnalysis) -> int:
    return max(int(signal.bits * 0.30103), 15)


def _is_constant(signal: SignalAnalysis, length: float) -> bool:
    """Whether nothing of a signal but its value is more than rounding, over so many seconds."""
    if signal.value is None or signal.lines:
        return False
    rounding = _ROUNDINGS * 2.0**-signal.bits * max(abs(float(signal.value.real)), 2.0**-1074)
    moved = 0.0 if signal.rate is None else abs(float(signal.rate.real)) * length
    return max(signal.left, moved) <= rounding


def _print_signal(signal: SignalAnalysis, on: Page, length: float) -> None:
    angle, digits = signal.units == "rad", _digits(signal)
    on.say("")
    if _is_constant(signal, length):
        on.say((signal.name, "bold"), f"  {_value(signal, angle, digits)}, constant to rounding", whole=True)
        return
    on.say((signal.name, "bold"), f"  {_secular(signal, angle, digits)}", whole=True)
    if signal.lines:
        on.console.print(_lines(signal, angle, digits, length, narrow=on.width < _WIDE))
    else:
        on.say(("  no line stands out of the residual", "dim"))
    left, level = (_with_unit(size, signal.units) for size in (signal.left, signal.level))
    more = "; more lines than were asked for (--lines)" if signal.exhausted else ""
    on.say((f"  left: rms {left}, lines below {level} aren't seen{more}", "dim"), whole=True)
    for note in signal.notes:
        on.say((f"  {note}", "yellow"), whole=True)


def _value(signal: SignalAnalysis, angle: bool, digits: int) -> str:
    """Its secular part in the middle of the samples."""
    unit, symbol = angle_unit(float(signal.value.real)) if angle else (1.0, signal.units)
    value = justified(signal.value.real / unit, signal.value_error / unit, digits)
    return value if symbol in ("", "1") else f"{value} {symbol}"


def _secular(signal: SignalAnalysis, angle: bool, digits: int) -> str:
    if signal.value is None:
        return ""
    text = f"{_value(signal, angle, digits)} at mid-span"
    return text if signal.rate is None else f"{text}; secular rate {_rate(signal, angle, digits)}"


def _rate(signal: SignalAnalysis, angle: bool, digits: int) -> str:
    unit, symbol = rate_unit(float(signal.rate.real)) if angle else (1.0, f"{signal.units}/s")
    rate = justified(signal.rate.real / unit, signal.rate_error / unit, digits)
    return f"{rate} +- {signal.rate_error / unit:.1e} {symbol}"


def _with_unit(value: float, units: str) -> str:
    return f"{value:.1e}" + (f" {units}" if units not in ("", "1") else "")


def _lines(signal: SignalAnalysis, angle: bool, digits: int, length: float, *, narrow: bool) -> Table:
    """Table of a signal's lines; ``narrow`` without the errors of frequencies, which their digits imply."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    largest = float(signal.lines[0].amplitude)
    unit, symbol = angle_unit(largest) if angle else (1.0, signal.units)
    amplitude = f"amplitude{'' if symbol in ('', '1') else ', ' + symbol}"
    for name in ("period", "rad/s", *(() if narrow else ("error",)), amplitude, "phase, deg"):
        table.add_column(name, justify="right" if name in ("period", "phase, deg") else "left", no_wrap=True)
    table.add_column("line", overflow="fold")
    for line in signal.lines:
        table.add_row(
            _period(line, length),
            justified(line.frequency, line.frequency_error, digits),
            *(() if narrow else (f"{line.frequency_error:.0e}",)),
            justified(line.amplitude / unit, line.amplitude_error / unit, 7),
            justified(line.phase / _DEGREE, line.phase_error / _DEGREE, 6),
            _label(line),
        )
    return table


def _period(line: SpectralLine, length: float) -> str:
    """The period; of a line without a label that hasn't come round once there is none to show."""
    period = line.period
    if not math.isfinite(period):
        return "-"
    if period > length and not line.label.text:
        return "beyond the span"
    unit = unit_for(period)
    own = line.frequency_error / abs(float(line.frequency)) * period / unit.seconds
    return f"{justified(period / unit.seconds, own, 9)} {unit.symbol}"


def _label(line: SpectralLine) -> Text:
    if line.ambiguous:
        others = ", ".join(line.label.doubtful)
        return Text(f"{line.label.text}? or {others}: ambiguous", style="yellow")
    if line.unfolded:
        return Text(f"{line.label.text} (beyond Nyquist, unfolded)")
    return Text(line.label.text or ("- (or an alias)" if line.can_be_alias else "-"))
