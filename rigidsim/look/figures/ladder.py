"""The ladder of a scene's physics: what each effect is worth, and error against cost of the models tried."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigidsim.look.figures.style import BLUE, GREY, INK, ORANGE, PALE, sheet, styled

_LEAST = 1e-12  # arcsec: below, nothing is seen


@styled
def ladder_figure(plan: Mapping[str, Any]) -> Figure:
    """The figure of the values of a ``PhysicsPlan``."""
    title = f"{plan['name']}: what the scene requires within {plan['error_arcsec']:.4g} arcsec"
    figure = sheet(title, 12, max(4.2, 1.8 + 0.3 * len(plan["effects"])))
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1))
    _worths(left, plan)
    _models(right, plan)
    return figure


def _worths(axes: Axes, plan: Mapping[str, Any]) -> None:
    effects = plan["effects"][::-1]
    places = range(len(effects))
    sizes = [max(row["largest_arcsec"], _LEAST) for row in effects]
    colors = [BLUE if row["required"] else PALE for row in effects]
    axes.barh(places, sizes, color=colors, left=min(sizes) / 10, height=0.65)
    axes.plot([max(row["rms_arcsec"], _LEAST) for row in effects], places, "|", color=INK, markersize=11)
    axes.axvline(plan["error_arcsec"], color=ORANGE, linewidth=1.3)
    axes.set_xscale("log")
    axes.set_yticks(places, [row["code"] for row in effects])
    axes.set_ylim(-1.0, max(len(effects), 4))  # a single effect is no giant bar
    axes.set_xlabel("angle that leaving it out makes, arcsec (bar: largest, line: rms)")
    axes.set_title("blue: in the least model")


def _models(axes: Axes, plan: Mapping[str, Any]) -> None:
    whole = plan["full"]["operations"] * max(plan["full"]["steps"], 1)
    for row in plan["effects"]:
        cost = row["operations"] * max(row["steps"], 1) / whole
        axes.plot(cost, max(row["largest_arcsec"], _LEAST), "o", color=PALE, markersize=5)
    for row in plan["tried"]:
        if row["left_out"]:
            color = BLUE if row["within"] else GREY
            size = max(row["largest_arcsec"], _LEAST)
            axes.plot(row["cost"] / whole, size, "s", color=color, markersize=5.5)
    least = plan["least"]
    size = max(least["largest_arcsec"], _LEAST)
    axes.plot(least["cost"] / whole, size, "*", color=BLUE, markersize=15, markeredgecolor=INK)
    axes.axhline(plan["error_arcsec"], color=ORANGE, linewidth=1.3)
    axes.axvline(1, color=GREY, linewidth=0.8)
    axes.set_yscale("log")
    axes.set_xlabel("cost: steps times operations, over the full model's")
    axes.set_ylabel("largest angle from the full model, arcsec")
    axes.set_title("without one effect (dots) or several; star: least")
