"""The figure of an analysis: amplitude spectra with lines marked and labelled."""

import math
from typing import Any

import numpy as np
import xarray
from matplotlib.figure import Figure

from rigidsim.look.figures.style import INK, sheet, styled
from rigidsim.scene.readable import YEAR, unit_for

_CURVE, _LINE, _FOLDED, _UNKNOWN = "#9fb6cd", "#2166ac", "#b2182b", "#636363"
_ARCSEC = math.pi / 648000
_MOST_LABELS = 14
_MOST_SIGNALS = 8
_DECADES_BELOW = 1.5  # of the faintest line, that are shown
_FAST_DECADES = 2.5  # of frequency from which on the axis is logarithmic


@styled
def spectrum_figure(analysis: xarray.Dataset) -> Figure:
    """Draw amplitude spectra, lines and labels of the first eight signals of an analysis' ``.dataset``."""
    analysis = analysis.isel(signal=(analysis["amplitude"].values > 0).any(axis=1))
    count = min(analysis.sizes["signal"], _MOST_SIGNALS)
    title = f"{analysis.attrs.get('title') or 'dataset'}: lines of the spectrum"
    if analysis.sizes["signal"] > count:
        title += f", the first {count} of {analysis.sizes['signal']} signals"
    figure = sheet(title, 11, 3.6 * max(count, 0.5) + 0.5)
    if not count:
        figure.text(0.5, 0.5, "no line stands out of the residual", ha="center", color="#555555")
    for number in range(count):
        axes = figure.add_subplot(count, 1, number + 1)
        _draw(axes, analysis.isel(signal=number), float(analysis.attrs["nyquist_frequency"]))
    return figure


def _draw(axes: Any, signal: xarray.Dataset, nyquist: float) -> None:
    lines = signal.isel(line=signal["amplitude"].values > 0)
    rates, amplitude = lines["frequency"].values, lines["amplitude"].values
    units, real = str(signal["signal_units"].item()), int(signal["real"].item()) == 1
    scale, symbol = (_ARCSEC, "arcsec") if units == "rad" and amplitude.max() < 0.03 else (1.0, units)
    moving = np.abs(rates[rates != 0])  # of the median line some turns are in the axis' unit of time
    time = unit_for(40 * math.pi / float(np.median(moving)) if len(moving) else 0.0)
    turns = time.seconds / (2 * math.pi)  # rad/s to turns per unit
    x, y = rates * turns, amplitude / scale
    curve_x, curve_y = (
        signal["spectrum_frequency"].values * turns,
        signal["spectrum_amplitude"].values / scale,
    )
    bottom = float(y.min()) * 10**-_DECADES_BELOW
    shown = np.isfinite(curve_y) & (curve_y > bottom * 1e-3)
    axes.plot(curve_x[shown], curve_y[shown], color=_CURVE, linewidth=0.8, zorder=1)
    axes.set_yscale("log")
    axes.set_ylim(bottom, float(y.max()) * (float(y.max()) / bottom) ** 0.55)
    _limits(axes, x, real)
    folded, doubtful = (lines[name].values == 1 for name in ("unfolded", "ambiguous"))
    labels = [str(label) for label in lines["label"].values]
    named = np.array([bool(label) for label in labels]) & ~doubtful
    colors = np.where(folded, _FOLDED, np.where(named, _LINE, _UNKNOWN))
    axes.vlines(x, bottom, y, colors=colors, linewidth=1.3, zorder=2)
    axes.scatter(x, y, c=colors, s=12, zorder=3)
    texts = [_text(*one) for one in zip(labels, rates, doubtful, strict=True)]
    _annotate(axes, np.column_stack([x, y]), texts, np.where(folded, _FOLDED, INK))
    limit, (left, right) = nyquist * turns, axes.get_xlim()
    if folded.any() and left < limit < right:
        axes.axvline(limit, color=_FOLDED, linewidth=0.8, linestyle="--")
        axes.text(limit, 0.03, " Nyquist", fontsize=8, color=_FOLDED, transform=axes.get_xaxis_transform())
    axes.set_xlabel(f"frequency [turns per {'second' if time.symbol == 's' else time.symbol}]")
    axes.set_ylabel(f"amplitude [{symbol}]" if symbol not in ("", "1") else "amplitude")
    title, slope = str(signal["signal"].item()), float(signal["secular_rate"].item())
    if math.isfinite(slope) and units == "rad":
        rate = slope / _ARCSEC * YEAR
        rate_text = f"{rate:.6g} arcsec/yr" if abs(rate) < 1e7 else f"{slope:.6g} rad/s"
        title += f", without its secular rate of {rate_text}"
    axes.set_title(title)


def _limits(axes: Any, x: np.ndarray, real: bool) -> None:
    """Set scale and limits that show all lines, and some of the curve next to them."""
    size, low, high = np.abs(x[x != 0]), float(x.min()), float(x.max())
    wide = len(size) > 1 and math.log10(size.max() / size.min()) > _FAST_DECADES
    if real and wide:
        axes.set(xscale="log", xlim=(float(size.min()) / 3, 3 * high))
        return
    reach = max(high, -low) if real or low * high <= 0 else high - low
    pad = 2 * reach if wide else 0.25 * (reach or abs(high) or 1.0)
    if wide:
        axes.set_xscale("symlog", linthresh=float(size.min()) / 3)
    axes.set_xlim(0 if real else low - pad, high + pad)


def _text(label: str, rate: float, doubtful: bool) -> str:
    if rate == 0 or label == "0":
        return "constant"
    period = 2 * math.pi / abs(rate)
    unit = unit_for(period)
    said = f"{period / unit.seconds:.4g} {unit.symbol}"
    return f"{label}{'?' if doubtful else ''}\n{said}" if label or doubtful else said


def _annotate(axes: Any, places: np.ndarray, texts: list[str], colors: np.ndarray) -> None:
    """Labels of the strongest lines, each at the first height above its line where it covers no other."""
    figure = axes.figure
    figure.draw_without_rendering()
    taken: list[Any] = []
    frame, points = axes.get_window_extent(), axes.transData.transform(places)
    for n in np.argsort(-places[:, 1])[:_MOST_LABELS].tolist():
        label = axes.annotate(
            texts[n], places[n], xytext=(0, 0), textcoords="offset points", ha="center", va="bottom",
            fontsize=7.5, color=colors[n], linespacing=1.05,
        )  # fmt: skip
        lowest = label.get_window_extent().expanded(1.03, 1.06)
        others = np.delete(points, n, axis=0)
        for lift in range(4, 160, 4):
            box = lowest.translated(0, lift * figure.dpi / 72)
            inside = box.x0 >= frame.x0 and box.x1 <= frame.x1 and box.y1 <= frame.y1
            covers = (box.x0 <= others[:, 0]) & (others[:, 0] <= box.x1) & (others[:, 1] >= box.y0)
            if inside and not covers.any() and not any(box.overlaps(other) for other in taken):
                label.xyann = (0, lift)
                taken.append(box)
                if lift > 14:
                    arrow = {"arrowstyle": "-", "color": "#b0b7be", "linewidth": 0.6}
                    axes.annotate(
                        "", places[n], xytext=(0, lift), textcoords="offset points", arrowprops=arrow
                    )
                break
        else:
            label.remove()
