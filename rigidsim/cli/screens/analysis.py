"""Output of ``rigidsim analyse``: numbers with as many digits as errors leave, in readable units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mpmath
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from rigidsim.cli.screens.page import Page
from rigidsim.scene.readable_time import YEAR, span_text, unit_for

if TYPE_CHECKING:
    from rigidsim.analysis.result import Analysis, SignalAnalysis, SpectralLine
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


def print_analysis(analysis: Analysis, saved: Saved | None = None, out: Console | None = None) -> None:
    """Print a table for each signal, with remarks."""
    out = Page(out).console
    nyquist = 2 * math.pi / analysis.nyquist
    out.print(
        Text.assemble(
            (analysis.title or "dataset", "bold"),
            f"  {span_text(analysis.length)} of samples, one every {span_text(analysis.spacing)}: periods "
            f"from {span_text(nyquist)}",
        )
    )
    for signal in analysis.signals:
        _print_signal(signal, out)
    _print_secular(analysis.signals, out)
    if analysis.known:
        out.print(_known(analysis))
    if analysis.attitude_error is not None and analysis.rounding is not None:
        out.print(
            Text(
                f"rounding  the run's own error of {analysis.attitude_error:.1e} rad at the end allows "
                f"frequencies to {analysis.rounding:.1e} rad/s; errors above are of the analysis alone"
            ),
            soft_wrap=True,
        )
    if saved is not None:
        out.print(Text(f"dataset   {saved.dataset}"), soft_wrap=True)
        out.print(Text(f"figure    {saved.figure}"), soft_wrap=True)


def _print_secular(signals: Sequence[SignalAnalysis], out: Console) -> None:
    """Print once more, below all lines, the secular rates."""
    moving = [one for one in signals if one.rate is not None and abs(one.rate.real) > _SURE * one.rate_error]
    if moving:
        out.print()
    for one in moving:
        digits = max(int(one.bits * 0.30103), 15)
        words = _rate(one, one.units == "rad", digits)
        out.print(Text.assemble("secular   ", (one.name, "bold"), f"  {words}"), soft_wrap=True)


def _known(analysis: Analysis) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for name in ("known frequency", "period", "from"):
        table.add_column(name, overflow="fold")
    for one in analysis.known:
        period = 2 * math.pi / abs(float(one.value))
        sign = "-" if float(one.value) < 0 else ""
        table.add_row(Text(one.name), sign + span_text(period, 8), Text(one.source))
    return table


def _print_signal(signal: SignalAnalysis, out: Console) -> None:
    angle = signal.units == "rad"
    digits = max(int(signal.bits * 0.30103), 15)
    out.print()
    out.print(Text.assemble((signal.name, "bold"), f"  {_secular(signal, angle, digits)}"), soft_wrap=True)
    if signal.lines:
        out.print(_lines(signal, angle, digits, narrow=out.width < _WIDE))
    else:
        out.print(Text("  no line stands out of what is left", style="dim"))
    left = _with_unit(signal.left, signal.units)
    level = _with_unit(signal.level, signal.units)
    more = "; more lines than were asked for (--lines)" if signal.exhausted else ""
    out.print(Text(f"  left: rms {left}, lines below {level} aren't seen{more}", style="dim"), soft_wrap=True)
    for note in signal.notes:
        out.print(Text(f"  {note}", style="yellow"), soft_wrap=True)


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
    """Table of a signal's lines.

    Args:
        narrow: leave out the errors of frequencies, which their digits imply, to make room for the names.
    """
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    largest = float(signal.lines[0].amplitude)
    unit, symbol = angle_unit(largest) if angle else (1.0, signal.units)
    table.add_column("period", justify="right", no_wrap=True)
    table.add_column("rad/s", no_wrap=True)
    if not narrow:
        table.add_column("error", no_wrap=True)
    table.add_column(f"amplitude{'' if symbol in ('', '1') else ', ' + symbol}", no_wrap=True)
    table.add_column("phase, deg", justify="right", no_wrap=True)
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
