"""A fit: residuals, correlations, predicted uncertainty along time as bands, and ellipses of the pole."""

from __future__ import annotations

import re

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigidsim.look.figures.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    VIOLET,
    X,
    Y,
    Z,
    sheet,
    square,
    styled,
)  # fmt: skip
from rigidsim.scene.readable import scaled

_MOST_SETS = 4
_WITHIN_95 = np.sqrt(-2 * np.log(0.05))  # sigmas of an ellipse that holds 95 % of a plane normal distribution
_COLORS = (X, Y, Z, ORANGE, VIOLET, GREY)
_MOST_NUMBERS = 12  # parameters whose correlations are written into their cells


@styled
def fitted_figure(dataset: xarray.Dataset) -> Figure:
    """The figure of a fit's dataset."""
    sets = [n for n in range(1, 1 + _MOST_SETS) if f"residual_{n}" in dataset]
    bands = [name for name in ("attitude", "angular_velocity") if f"{name}_sigma" in dataset]
    rows = len(sets) + len(bands)
    title = f"{dataset.attrs.get('title', '')}: {dataset.attrs.get('sentence', '')}"
    figure = sheet(title, 12.5, max(6.0, 2.1 * rows + 0.8))
    left, right = np.ravel(figure.subfigures(1, 2, width_ratios=[1.3, 1], squeeze=False))
    length, unit = scaled(_observed(dataset) - _observed(dataset).min(), "s", dataset.attrs)
    panels = left.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for axes, number in zip(panels, sets, strict=False):
        _residuals(axes, dataset, number, length)
    for axes, name in zip(panels[len(sets) :], bands, strict=True):
        _band(axes, dataset, name, length)
    panels[-1].set_xlabel(f"time [{unit}]")
    pole = "figure_axis" in dataset and "attitude_covariance" in dataset
    beside = right.subplots(1 + pole, 1, squeeze=False)[:, 0]
    _correlations(beside[0], dataset)
    if pole:
        _pole(beside[1], dataset, unit, length)
    return figure


def _observed(dataset: xarray.Dataset) -> np.ndarray:
    """Times of all observations, s."""
    return np.concatenate([x.values for n, x in dataset.coords.items() if str(n).startswith("time_")])


def _residuals(axes: Axes, dataset: xarray.Dataset, number: int, length: float) -> None:
    """Residuals in their sigmas; rows that were left out as crosses, at the edge where they are far off."""
    residuals = (dataset[f"residual_{number}"] / dataset[f"residual_sigma_{number}"]).values
    times = dataset[f"time_{number}"].values / length
    used = dataset[f"used_{number}"].values.astype(bool)
    observable = str(dataset[f"residual_{number}"].attrs["observable"])
    labels = [str(x).removeprefix(f"{observable}_") for x in dataset[f"component_{number}"].values]
    top = max(4.0, 1.15 * float(np.abs(residuals[used]).max(initial=0.0)))
    for share, shade in ((3, "#f1f5fa"), (1, "#dfe9f5")):
        axes.axhspan(-share, share, color=shade, zorder=0)
    size = 16 if len(times) < 300 else 4
    for n, (label, color) in enumerate(zip(labels, _COLORS, strict=False)):
        axes.scatter(times[used], residuals[used, n], s=size, color=color, label=label, linewidths=0)
        left = np.clip(residuals[~used, n], -0.92 * top, 0.92 * top)
        axes.scatter(times[~used], left, s=34, marker="x", color=color, linewidths=1.2)
    axes.set_ylim(-top, top)
    axes.set_ylabel("sigmas")
    left_out = int((~used).sum())
    more = f", {left_out} left out (crosses)" if left_out else ""
    axes.set_title(f"residuals of {dataset[f'residual_{number}'].attrs['long_name']}{more}")
    _above(axes, len(labels))


def _band(axes: Axes, dataset: xarray.Dataset, name: str, length: float) -> None:
    """One and two standard deviations of a prediction, to either side."""
    sigma = dataset[f"{name}_sigma"].values
    times = dataset["time"].values / length
    divisor, unit = scaled(sigma, "rad" if name == "attitude" else "rad/s", dataset.attrs)
    sigma = sigma / divisor
    labels = [str(x) for x in dataset[dataset[f"{name}_sigma"].dims[1]].values]
    for n, (label, color) in enumerate(zip(labels, _COLORS, strict=False)):
        for times_sigma, alpha in ((2, 0.10), (1, 0.22)):
            half = times_sigma * sigma[:, n]
            axes.fill_between(times, -half, half, color=color, alpha=alpha, linewidth=0)
        for sign in (-1, 1):
            axes.plot(times, sign * sigma[:, n], color=color, linewidth=0.9,
                      label=label if sign > 0 else None)  # fmt: skip
    observed = _observed(dataset) / length
    axes.plot(observed, np.zeros(observed.size), "|", color=INK, markersize=5, alpha=0.5)
    axes.set_ylabel(unit)
    where = "space axes" if name == "attitude" else "body axes"
    if np.isfinite(sigma).any():
        axes.set_title(f"predicted {name.replace('_', ' ')} ({where}): 1 and 2 sigmas")
        _above(axes, len(labels))
    else:
        axes.set_title(f"uncertainty of the {name.replace('_', ' ')}: unbounded, by undetermined parameters")


def _above(axes: Axes, count: int) -> None:
    """A key next to the title, where it hides nothing."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=count, handlelength=1.0, handletextpad=0.3,
        columnspacing=0.8, borderpad=0.1,
    )  # fmt: skip


def _correlations(axes: Axes, dataset: xarray.Dataset) -> None:
    names = [re.sub(r"^(parameters|initial|body)\.", "", str(x)) for x in dataset["parameter"].values]
    values = dataset["correlation"].values
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1)
    axes.set_facecolor(PALE)
    axes.grid(visible=False)
    axes.set_xticks(range(len(names)), names, rotation=40, ha="right")
    axes.set_yticks(range(len(names)), names)
    for (i, j), value in np.ndenumerate(values) if len(names) <= _MOST_NUMBERS else ():
        text = f"{value:.2f}".replace("-0.", "-.").replace("0.", ".") if np.isfinite(value) else "?"
        color = "white" if abs(value) > 0.6 else INK
        axes.text(j, i, text, ha="center", va="center", fontsize=7, color=color)
    unknown = " (? undetermined)" if not np.isfinite(values).all() else ""
    axes.set_title(f"correlations{unknown}")
    axes.figure.colorbar(image, ax=axes, shrink=0.7)


def _pole(axes: Axes, dataset: xarray.Dataset, unit: str, length: float) -> None:
    """Ellipses of the figure axis, about where it is predicted, seen from outside: the first and last
    observation, and where it is known best.
    """
    times, observed = dataset["time"].values, _observed(dataset)
    tangents = _across(dataset["figure_axis"].values, dataset["attitude_covariance"].values)
    sizes = np.trace(tangents, axis1=1, axis2=2)
    inside = (times >= observed.min()) & (times <= observed.max()) & np.isfinite(sizes)
    first, last = (int(np.argmin(np.abs(times - t))) for t in (observed.min(), observed.max()))
    best = int(np.argmin(np.where(inside, sizes, np.inf))) if inside.any() else first
    if not sizes[[first, last, best]].max() > 0:
        axes.set_axis_off()
        unbounded = not np.isfinite(sizes).any()
        why = "unbounded, by undetermined parameters" if unbounded else "none of the parameters moves it"
        axes.set_title(f"pole: {why}")
        return
    divisor, name = scaled(np.sqrt(sizes[[first, best, last]]), "rad")
    turn = np.linspace(0, 2 * np.pi, 181)
    circle, drawn = np.stack([np.cos(turn), np.sin(turn)], axis=1) / divisor, []
    for index, color in {first: ORANGE, last: BLUE, best: Y}.items():
        values, vectors = np.linalg.eigh(tangents[index])
        ring = circle * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        axes.fill(*ring.T, color=color, alpha=0.3, linewidth=0)
        drawn.append(_WITHIN_95 * ring)
        axes.plot(*drawn[-1].T, color=color, linewidth=1.2, label=f"at {times[index] / length:.4g} {unit}")
    square(axes, *np.vstack(drawn).T)
    axes.set(xlabel=f"east of the predicted pole, {name}", ylabel=f"north, {name}")
    axes.set_title("pole: 1 sigma filled, 95 % outlined")
    axes.legend(loc="upper right")


def _across(axis: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Covariances (rows, 2, 2), rad^2, of directions (rows, 3) by the attitude's, east and north about Z."""
    east = np.cross([0.0, 0.0, 1.0], axis)
    size = np.linalg.norm(east, axis=1, keepdims=True)
    east = np.where(size < 1e-9, [0.0, 1.0, 0.0], east / np.maximum(size, 1e-300))
    moved = np.stack([np.cross(axis, east), -east], axis=1)  # (turn x axis).east = turn.(axis x east)
    return np.asarray(moved @ covariance @ moved.swapaxes(1, 2))
