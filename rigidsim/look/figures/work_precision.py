"""The work-precision figure: attitude error against cost of every measured setting, and the Pareto front."""

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rigidsim.look.figures.style import sheet, styled
from rigidsim.scene.choices import method_named
from rigidsim.scene.readable import span_text

_COLORS = {"single": "#8c8c8c", "double": "#2166ac", "extended": "#e08214", "quadruple": "#762a83"}
_OTHER = "#1b9e77"
_OTHERS = "#c0392b"
_MARKERS = {"quaternion": "o", "rotation_matrix": "s", "euler_angles": "^", "canonical": "D"}
_STEPLESS = "*"
_FRONT = "#1b2733"


@styled
def work_precision_figure(dataset: xarray.Dataset) -> Figure:
    """The figure of a tradeoff dataset: the plot, and a key to its numbered points."""
    attrs = dataset.attrs
    over = "over its first" if attrs["measured_seconds"] < attrs["horizon_seconds"] else "over"
    words = f"{attrs['title']}: speed against accuracy {over} {span_text(attrs['measured_seconds'], 4)}"
    figure = sheet(words, 12, 6.4)
    left, right = figure.subplots(1, 2, width_ratios=(1.55, 1))
    draw_points(left, dataset)
    _key(right, dataset)
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the numbers are placed by what is drawn now
    error, cost, front = _plotted(dataset)
    _number(left, cost[front], error[front])
    return figure


def draw_points(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw error against cost on logarithmic axes, with the front as a staircase."""
    error, cost, front = _plotted(dataset)
    held, short = dataset["held"].values.astype(bool), dataset["status"].values == "measured over less"
    for n in np.nonzero(np.isfinite(error) & np.isfinite(cost))[0]:
        color, marker = _look(dataset, int(n))
        axes.plot(
            cost[n], error[n], marker, markersize=11 if marker == _STEPLESS else 6.5, color=color,
            markerfacecolor=color if held[n] or marker == _STEPLESS else "white", markeredgewidth=1.3,
            alpha=0.45 if short[n] else 1.0, linestyle="none", zorder=3,
        )  # fmt: skip
    _draw_others(axes, dataset)
    axes.set_xscale("log")
    axes.set_yscale("log")
    if len(front):
        axes.step(cost[front], error[front], where="post", color=_FRONT, linewidth=1.1, zorder=2)
    axes.set_xlabel("CPU time, relative to double precision in quaternions (measured in the same processes)")
    axes.set_ylabel("largest attitude error, rad")
    axes.margins(0.08)
    _legend(axes, dataset, short=bool(short.any()))


def _draw_others(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw averaged models, with errors of axes at the end of the whole motion, and other tools' files."""
    for kind, marker, color, place in (("model", "P", _OTHER, 9), ("other", "X", _OTHERS, -8)):
        for n in range(dataset.sizes.get(kind, 0)):
            one = dataset.isel({kind: n})
            at = float(one[f"{kind}_cpu_ratio"]), float(one[f"{kind}_error"])
            axes.plot(*at, marker, markersize=9, color=color, linestyle="none", zorder=3)
            axes.annotate(
                str(one[kind].item()).replace("_", " "), at, xytext=(place, 0), textcoords="offset points",
                ha="left" if place > 0 else "right", va="center", fontsize=8.5, color=color,
            )  # fmt: skip


def _number(axes: Axes, cost: np.ndarray, error: np.ndarray) -> None:
    """Numbers left of the front's points, where nothing else is; where two are near, one goes below."""
    points = axes.transData.transform(np.column_stack([cost, error])) * 72.0 / axes.figure.dpi
    places: list[np.ndarray] = []
    for number, point in enumerate(points, start=1):
        place = np.array([point[0] - 7.0, point[1]])
        while any(abs(place[0] - x) < 15.0 and abs(place[1] - y) < 9.5 for x, y in places):
            place[1] -= 1.0
        places.append(place)
        axes.annotate(
            str(number), point, xytext=(place[0], place[1]), xycoords="figure points",
            textcoords="figure points",
            ha="right", va="center", fontsize=8.5, fontweight="bold", color=_FRONT, zorder=4,
        )  # fmt: skip


def _plotted(dataset: xarray.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors, costs, and the indices of the front from cheap to dear."""
    error = np.maximum(dataset["attitude_error_largest"].values, dataset["reference_error"].values)
    cost = dataset["cpu_ratio"].values
    front = np.nonzero(dataset["on_front"].values)[0]
    return error, cost, front[np.argsort(cost[front])]


def _look(dataset: xarray.Dataset, n: int) -> tuple[str, str]:
    one = dataset.isel(setting=n)
    formulation, method = str(one["formulation"].item()), method_named(str(one["method"].item()))
    marker = _MARKERS.get(formulation, "o") if method.has_steps else _STEPLESS
    return _COLORS.get(str(one["precision"].item()), _OTHER), marker


def _legend(axes: Axes, dataset: xarray.Dataset, *, short: bool) -> None:
    shown = dataset.isel(setting=np.isfinite(dataset["cpu_ratio"].values))
    precisions, kinds = (set(shown[name].values) for name in ("precision", "formulation"))
    methods = [method_named(str(name)) for name in dict.fromkeys(shown["method"].values)]
    models, others = ("model" in dataset.sizes), ("other" in dataset.sizes)
    grey = {"color": "#444444", "markerfacecolor": "white", "markeredgewidth": 1.3}
    entries: list[tuple[str, dict[str, Any]]] = [
        *((p, {"marker": "o", "color": c}) for p, c in _COLORS.items() if p in precisions),
        *((k.replace("_", " "), {"marker": m, **grey}) for k, m in _MARKERS.items() if k in kinds),
        *((m.title, {"marker": _STEPLESS, "color": "#444444"}) for m in methods if not m.has_steps),
        ("filled: invariants projected", {"marker": "o", "color": "#444444"}),
        *[("averaged model: axes, to the end", {"marker": "P", "color": _OTHER})] * models,
        *[("another tool's file", {"marker": "X", "color": _OTHERS})] * others,
        *[("pale: over less of the motion", {"marker": "o", "color": "#444444", "alpha": 0.45})] * short,
    ]
    handles = [Line2D([], [], linestyle="none", label=text, markersize=7, **look) for text, look in entries]
    handles.append(Line2D([], [], color=_FRONT, linewidth=1.1, label="best of all (numbered)"))
    # models are cheap, and not exact; another tool's file may be anywhere
    place: Any = "best" if others else "lower left" if models else "upper right"
    axes.legend(handles=handles, loc=place, ncols=2, fontsize=8, frameon=True, framealpha=0.9)


def _key(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw the key to the numbered points."""
    error, cost, front = _plotted(dataset)
    axes.axis("off")
    axes.set_title("The best settings, from the cheapest")
    size = 9.0 if len(front) <= 22 else 9.0 * 22 / len(front)
    lines = 1.0 / max(len(front) + 1, 16)
    columns = ((0.0, "left"), (0.05, "left"), (0.82, "right"), (1.0, "right"))
    for (x, align), text in zip(columns, ("", "setting", "cost", "error, rad"), strict=True):
        axes.text(x, 1.0, text, ha=align, va="top", color="#666666", fontsize=size, transform=axes.transAxes)
    for row, n in enumerate(front, start=1):
        shown = (str(row), str(dataset["setting"].values[n]), f"{cost[n]:.3g}", f"{error[n]:.1e}")
        for (x, align), text, weight in zip(columns, shown, ("bold", *["normal"] * 3), strict=True):
            axes.text(
                x, 1.0 - row * lines, text, ha=align, va="top", fontsize=size, fontweight=weight,
                transform=axes.transAxes,
            )  # fmt: skip
