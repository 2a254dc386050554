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
_SURE = 5.0  # errors, from which a secular rate is told once more
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
        _print_signal(signal, on)
    _print_secular(analysis.signals, on)
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


def _print_signal(signal: SignalAnalysis, on: Page) -> None:
    angle, digits = signal.units == "rad", _digits(signal)
    on.say("")
    on.say((signal.name, "bold"), f"  {_secular(signal, angle, digits)}", whole=True)
    if signal.lines:
        on.console.print(_lines(signal, angle, digits, narrow=on.width < _WIDE))
    else:
        on.say(("  no line stands out of what is left", "dim"))
    left, level = (_with_unit(size, signal.units) for size in (signal.left, signal.level))
    more = "; more lines than were asked for (--lines)" if signal.exhausted else ""
    on.say((f"  left: rms {left}, lines below {level} aren't seen{more}", "dim"), whole=True)
    for note in signal.notes:
        on.say((f"  {note}", "yellow"), whole=True)


def _secular(signal: SignalAnalysis, angle: bool, digits: int) -> str:
    if signal.value is None:
        return ""
    unit, symbol = angle_unit(float(signal.value.real)) if angle else (1.0, signal.units)
    value = justified(signal.value.real / unit, signal.value_error / unit, digits)
    text = f"{value} {symbol} at mid-span".replace(" 1 at", " at")
    return text if signal.rate is None else f"{text}; secular rate {_rate(signal, angle, digits)}"


def _rate(signal: SignalAnalysis, angle: bool, digits: int) -> str:
    unit, symbol = rate_unit(float(signal.rate.real)) if angle else (1.0, f"{signal.units}/s")
    rate = justified(signal.rate.real / unit, signal.rate_error / unit, digits)
    return f"{rate} +- {signal.rate_error / unit:.1e} {symbol}"


def _with_unit(value: float, units: str) -> str:
    return f"{value:.1e}" + (f" {units}" if units not in ("", "1") else "")


def _lines(signal: SignalAnalysis, angle: bool, digits: int, *, narrow: bool) -> Table:
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
            _period(line),
            justified(line.frequency, line.frequency_error, digits),
            *(() if narrow else (f"{line.frequency_error:.0e}",)),
            justified(line.amplitude / unit, line.amplitude_error / unit, 7),
            justified(line.phase / _DEGREE, line.phase_error / _DEGREE, 6),
            _label(line),
        )
    return table


def _period(line: SpectralLine) -> str:
    period = line.period
    if not math.isfinite(period):
        return "-"
    unit = unit_for(period)
    own = line.frequency_error / abs(float(line.frequency)) * period / unit.seconds
    return f"{justified(period / unit.seconds, own, 9)} {unit.symbol}"


def _label(line: SpectralLine) -> Text:
    if line.ambiguous:
        others = ", ".join(line.label.doubtful)
        return Text(f"{line.label.text}? or {others}: ambiguous", style="yellow")
    if line.unfolded:
        return Text(f"{line.label.text} (beyond Nyquist, unfolded)")
    return Text(line.label.text or "-")
