"""The figure of an analysis: amplitude spectra with lines marked and labelled."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.figure import Figure

from rigidsim.look.figures.style import ShownFigure, save, styled
from rigidsim.scene.readable import YEAR, TimeUnit, unit_for

_CURVE, _LINE, _FOLDED, _UNKNOWN = "#9fb6cd", "#2166ac", "#b2182b", "#636363"
_ARCSEC = math.pi / 648000
_MOST_LABELS = 14
_MOST_SIGNALS = 8
_DECADES_BELOW = 1.5  # of the faintest line, that are shown
_FAST_DECADES = 2.5  # of frequency from which on the axis is logarithmic


@styled
def spectrum_figure(analysis: xarray.Dataset) -> Figure:
    """Draw amplitude spectra, lines and labels of the first eight signals of an analysis' ``.dataset``."""
    analysis = analysis.isel(signal=np.isfinite(analysis["amplitude"].values).any(axis=1))
    count = min(analysis.sizes["signal"], _MOST_SIGNALS)
    figure = ShownFigure(figsize=(11, 3.6 * max(count, 0.5) + 0.5), layout="constrained")
    if not count:
        figure.text(0.5, 0.5, "no line stands out of the residual", ha="center", color="#555555")
    for number in range(count):
        axes = figure.add_subplot(count, 1, number + 1)
        _draw(axes, analysis.isel(signal=number), float(analysis.attrs["nyquist_frequency"]))
    title = f"{analysis.attrs.get('title') or 'dataset'}: lines of the spectrum"
    if analysis.sizes["signal"] > count:
        title += f", the first {count} of {analysis.sizes['signal']} signals"
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold")
    return figure


def save_spectrum(analysis: xarray.Dataset, path: Path, *, file_format: str | None = None) -> Path:
    """Draw the spectra into a PNG or SVG file; returns its path."""
    return save(spectrum_figure, analysis, path, file_format)


def _draw(axes: Any, signal: xarray.Dataset, nyquist: float) -> None:
    amplitude = signal["amplitude"].values
    chosen = np.isfinite(amplitude) & (amplitude > 0)
    rate, amplitude = signal["frequency"].values[chosen], amplitude[chosen]
    labels = [str(x) for x in signal["label"].values[chosen]]
    unfolded = signal["unfolded"].values[chosen] == 1
    ambiguous = signal["ambiguous"].values[chosen] == 1
    units = str(signal["signal_units"].item())
    small = units == "rad" and amplitude.max(initial=0) < 0.03
    scale, symbol = (_ARCSEC, "arcsec") if small else (1.0, units)
    time = _time_unit(rate)
    turns = time.seconds / (2 * math.pi)  # rad/s to turns per unit
    real = int(signal["real"].item()) == 1
    curve_rate, curve = signal["spectrum_frequency"].values, signal["spectrum_amplitude"].values
    low = amplitude.min(initial=np.inf)
    low = low if np.isfinite(low) else float(np.nanmax(curve, initial=1e-300))
    bottom, top = low * 10**-_DECADES_BELOW, amplitude.max(initial=low)
    axes.set_yscale("log")
    _frequency_axis(axes, rate * turns, real)
    shown = np.isfinite(curve) & (curve > bottom * 1e-3)
    axes.plot(curve_rate[shown] * turns, curve[shown] / scale, color=_CURVE, linewidth=0.8, zorder=1)
    axes.set_ylim(bottom / scale, (top * (top / bottom) ** 0.55 if len(rate) else top * 10) / scale)
    _limits(axes, rate * turns, curve_rate * turns, real)
    for x, y, apart, doubt, name in zip(
        rate * turns, amplitude / scale, unfolded, ambiguous, labels, strict=True
    ):
        color = _FOLDED if apart else _UNKNOWN if doubt or not name else _LINE
        axes.vlines(x, bottom / scale, y, color=color, linewidth=1.3, zorder=2)
        axes.plot([x], [y], "o", color=color, markersize=3.5, zorder=3)
    texts = [_text(n, r, time, u, d) for n, r, u, d in zip(labels, rate, unfolded, ambiguous, strict=True)]
    _annotate(axes, rate * turns, amplitude / scale, texts, unfolded)
    limit = nyquist * turns
    left, right = axes.get_xlim()
    if unfolded.any() and left < limit < right:
        axes.axvline(limit, color=_FOLDED, linewidth=0.8, linestyle="--")
        axes.annotate(
            "Nyquist", (limit, 0.03), xycoords=("data", "axes fraction"), fontsize=8, color=_FOLDED,
            xytext=(3, 0), textcoords="offset points",
        )  # fmt: skip
    per = "turns per second" if time.symbol == "s" else f"turns per {time.symbol}"
    axes.set_xlabel(f"frequency [{per}]")
    axes.set_ylabel(f"amplitude [{symbol}]" if symbol not in ("", "1") else "amplitude")
    title, slope = str(signal["signal"].item()), float(signal["secular_rate"].item())
    if math.isfinite(slope) and units == "rad":
        rate = slope / _ARCSEC * YEAR
        rate_text = f"{rate:.6g} arcsec/yr" if abs(rate) < 1e7 else f"{slope:.6g} rad/s"
        title += f", without its secular rate of {rate_text}"
    axes.set_title(title)


def _time_unit(rate: np.ndarray) -> TimeUnit:
    """The unit of time of the axis: such that the median line has some turns in it."""
    moving = np.abs(rate[np.abs(rate) > 0])
    return unit_for(40 * math.pi / float(np.median(moving)) if len(moving) else 0.0)


def _frequency_axis(axes: Any, rate: np.ndarray, real: bool) -> None:
    size = np.abs(rate[rate != 0])
    wide = len(size) > 1 and math.log10(size.max() / size.min()) > _FAST_DECADES
    if real and wide:
        axes.set_xscale("log")
    elif wide:
        axes.set_xscale("symlog", linthresh=float(size.min()) / 3)


def _limits(axes: Any, rate: np.ndarray, curve: np.ndarray, real: bool) -> None:
    """Set limits that show all lines, and some of the curve beside them."""
    if not len(rate):
        return
    if axes.get_xscale() == "log":
        axes.set_xlim(float(rate[rate > 0].min()) / 3, float(rate.max()) * 3)
        return
    low, high = float(rate.min()), float(rate.max())
    reach = max(high, -low) if real or low * high <= 0 else high - low
    pad = 0.25 * (reach or abs(high) or 1.0)
    if axes.get_xscale() == "symlog":
        pad = 2 * reach
    axes.set_xlim(0 if real else low - pad, high + pad)


def _text(label: str, rate: float, time: TimeUnit, unfolded: bool, doubtful: bool) -> str:
    if rate == 0 or label == "0":
        return "constant"
    period = 2 * math.pi / abs(rate)
    unit = unit_for(period)
    name = f"{label}?" if doubtful else label
    said = f"{period / unit.seconds:.4g} {unit.symbol}"
    return f"{name}\n{said}" if name else said


def _annotate(axes: Any, x: np.ndarray, y: np.ndarray, texts: Sequence[str], unfolded: np.ndarray) -> None:
    """Labels of the strongest lines, each at the first height above its line where it covers no other."""
    figure = axes.figure
    figure.draw_without_rendering()
    taken: list[Any] = []
    frame = axes.get_window_extent()
    points = axes.transData.transform(np.column_stack([x, y])) if len(x) else np.empty((0, 2))
    for n in np.argsort(-y)[:_MOST_LABELS].tolist():
        label = axes.annotate(
            texts[n], (x[n], y[n]), xytext=(0, 0), textcoords="offset points", ha="center", va="bottom",
            fontsize=7.5, color=_FOLDED if unfolded[n] else "#1b2733", linespacing=1.05,
        )  # fmt: skip
        lowest = label.get_window_extent().expanded(1.03, 1.06)
        for lift in range(4, 160, 4):
            box = lowest.translated(0, lift * figure.dpi / 72)
            inside = box.x0 >= frame.x0 and box.x1 <= frame.x1 and box.y1 <= frame.y1
            covers = any(
                box.x0 <= px <= box.x1 and py >= box.y0 for k, (px, py) in enumerate(points) if k != n
            )
            if inside and not covers and not any(box.overlaps(other) for other in taken):
                label.xyann = (0, lift)
                taken.append(box)
                if lift > 14:
                    axes.annotate(
                        "", (x[n], y[n]), xytext=(0, lift), textcoords="offset points",
                        arrowprops={"arrowstyle": "-", "color": "#b0b7be", "linewidth": 0.6},
                    )  # fmt: skip
                break
        else:
            label.remove()
