"""Square panels: where axes point (polar motion, pole, nutation, top), and paths of bodies."""

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import fits, signals, surroundings
from rigidsim.look.figures import eye as eyes
from rigidsim.look.figures import style, timelines
from rigidsim.look.figures.panel import angle_scale, angle_text, panel, recorded
from rigidsim.look.figures.style import BLUE, INK, ORANGE, Z, curve, key, square, titled
from rigidsim.look.solids import Array
from rigidsim.scene.readable import si_scale, span_text

_TURN = 2 * np.pi
_ROUND = 1e-6  # relative difference of two moments, below which a body is symmetric
_SMALL = 0.05  # rad: sines of smaller angles read as angles
_FAR = 0.5  # rad from its mean motion, up to which a pole's path is as on a plane to a tenth


def path_about(
    axes: Axes, path: Array, across: str, up: str, *, center: bool = True, sparse: bool = False
) -> None:
    """Draw a path (rows, 2) with equal scales, its labels, and a cross at the origin as its center."""
    x, y = path.T
    style.trace(axes, x, y, sparse=sparse)
    if center:
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        x, y = np.append(x, 0), np.append(y, 0)
    square(axes, x, y)
    axes.set(xlabel=across, ylabel=up)


@panel(lambda dataset: signals.polar_motion(dataset) if signals.near_axis(dataset) else None)
def polar_motion(axes: Axes, dataset: xarray.Dataset, plane: Array) -> None:
    """The spin axis seen from the figure axis, m1 to the right and m2 up, and its period."""
    scale, unit = angle_scale(plane)
    sparse = signals.aliased(dataset, _wobbling(dataset))
    path_about(axes, plane / scale, f"$m_1$ [{unit}]", f"$m_2$ [{unit}]", sparse=sparse)
    mean = None if sparse else fits.circulation(signals.seconds(dataset), plane)
    radius = np.hypot(*plane.T)
    least, most = float(np.nanmin(radius)), float(np.nanmax(radius))
    size = angle_text(float(np.nanmean(radius)))
    if not most - least < 1e-3 * most:
        size = f"{angle_text(least, like=most)} to {angle_text(most)}"
    title = "Polar motion (+: figure axis)"
    if mean is None:
        key(axes, f"{title}, {size}")
        return
    period = mean.about + span_text(_TURN / abs(mean.rate), 5)
    way = "counterclockwise" if mean.rate > 0 else "clockwise"
    if least > 0.55 * most:
        style.note(axes, 0.5, 0.62, f"{period}\n{way}", fontsize=11.5, fontweight="bold")
        style.note(axes, 0.5, 0.40, f"radius {size}", color=style.GREY)
        style.titled(axes, title)
    else:
        key(axes, f"{title}: once round in {period}, {way}")


def _wobbling(dataset: xarray.Dataset) -> float:
    """Rate of the free wobble over that of the spin, about the axis of largest or least moment."""
    found = signals.moments(dataset)
    if found is None:
        return 0.0
    low, middle, high = np.sort(found)
    return float(
        np.sqrt(
            max(
                (high - low) * (high - middle) / (low * middle),
                (high - low) * (middle - low) / (high * middle),
            )
        )
    )


def pole_paths(dataset: xarray.Dataset) -> tuple[dict[str, Array], str, str] | None:
    """Paths (rows, 2), rad, by axis; a description of the centre; and a title."""
    along = signals.steady_momentum(dataset)
    paths: dict[str, Array] = {}
    if along is not None:
        first, second = signals.across(along)
        for name in ("figure", "spin", "core"):
            axis = signals.pole(dataset, name)
            if axis is not None:
                paths[name] = flat(axis @ first, axis @ second, axis @ along)
        return (paths, "momentum", "Path of the figure axis in space") if paths else None
    for name in ("figure", "momentum"):
        found = signals.orientation(dataset, name)
        if found is not None:
            tilt, node = found
            paths[name] = np.stack([tilt * np.sin(node), -tilt * np.cos(node)], axis=1)
    if len(paths) == 2:
        one, other = paths["figure"], paths["momentum"]
        reach = float(np.nanmax(np.abs(one - np.nanmean(one, axis=0))))
        if float(np.nanmax(np.abs(one - other))) < 0.005 * max(reach, 1e-300):
            del paths["momentum"]
    return (paths, "reference pole", "Path of the pole in space") if paths else None


def flat(x: Array, y: Array, z: Array) -> Array:
    """Directions (rows,) each as points (rows, 2) whose distance from the centre is the angle from z, rad."""
    plane = np.stack([x, y], axis=1)
    size = np.linalg.norm(plane, axis=1)
    ratio = np.divide(np.arctan2(size, z), size, out=np.ones_like(size), where=size > 1e-12)
    return np.asarray(plane * ratio[:, None])


@panel(pole_paths)
def pole_path(axes: Axes, dataset: xarray.Dataset, found: tuple[dict[str, Array], str, str]) -> None:
    """Path of the figure axis in space, seen from outside along the pole that it circles: of a free body the
    momentum, else the reference plane's. Distances from the centre are angles.
    """
    shown, center, title = found
    scale, unit = angle_scale(np.concatenate([path.ravel() for path in shown.values()]))
    sparse = center == "momentum" and signals.aliased(dataset)
    for name, path in shown.items():
        x, y = (path / scale).T
        if name == "figure" or len(shown) == 1:
            style.trace(axes, x, y, sparse=sparse)
        else:
            color = timelines.AXIS_COLORS[name]
            curve(
                axes,
                x,
                y,
                in_plane=True,
                sparse=sparse,
                color=color,
                lw=0.7,
                alpha=0.6,
                zorder=1,
                label=f"{name}'s axis" if name == "core" else f"{name} axis",
            )
    points = np.vstack([path / scale for path in shown.values()])
    reach = float(np.nanmax(np.abs(points - np.nanmean(points, axis=0))))
    if np.nanmin(np.hypot(*points.T)) < 3 * reach:  # not so far that it would press the path flat
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        title += f" (+: {center})"
        points = np.vstack([points, [[0.0, 0.0]]])
    square(axes, *points.T)
    words = ("across the momentum",) * 2 if center == "momentum" else ("along X", "along Y")
    axes.set(xlabel=f"{words[0]} [{unit}]", ylabel=f"{words[1]} [{unit}]")
    first = next(iter(shown.values()))
    mean = None if sparse else fits.circulation(signals.seconds(dataset), first)
    if mean is not None:
        title += f", once round in {mean.about}{span_text(_TURN / abs(mean.rate), 4)}"
    key(axes, title)


def _wobble_and_spin(dataset: xarray.Dataset) -> Array | None:
    """Turns (rows, 2) of a symmetric body's figure axis about the momentum, which is fixed, and of the body
    about its figure axis; None for others, and where samples are too far apart to count them.
    """
    moments, rates = signals.moments(dataset), signals.values(dataset, "angular_velocity")
    pole, along = signals.pole(dataset, "figure"), signals.steady_momentum(dataset)
    if moments is None or rates is None or pole is None or along is None:
        return None
    k = signals.figure_index(moments)
    a, b = moments[(k + 1) % 3], moments[(k + 2) % 3]
    first, second = signals.across(along)
    if abs(a - b) > _ROUND * a or not np.abs(pole - along).max() > _ROUND or not signals.joined(pole):
        return None
    azimuth = np.unwrap(np.arctan2(pole @ second, pole @ first))
    rate, seconds = rates @ signals.figure_direction(dataset), signals.seconds(dataset)
    spin = np.concatenate([[0.0], np.cumsum(np.diff(seconds) * (rate[1:] + rate[:-1]) / 2)])
    return np.abs(np.stack([azimuth - azimuth[0], spin], axis=1)) / _TURN


@panel(_wobble_and_spin)
def wobble_and_spin(axes: Axes, dataset: xarray.Dataset, turns: Array) -> None:
    """Turns of the wobble in space, and of the body about its axis: two for one of a thin plate."""
    labels = ("the axis about the angular momentum: the wobble", "the body about its axis: the spin")
    timelines.lines(axes, dataset, turns, labels, (BLUE, ORANGE))
    key(axes, f"In space: {turns[-1, 0] / turns[-1, 1]:.3f} turns of the wobble to one of the spin")
    axes.set_ylabel("turns")


def precesses(dataset: xarray.Dataset) -> bool:
    """Whether the pole moves because the momentum does."""
    return timelines.orientations(dataset) is not None and signals.steady_momentum(dataset) is None


def nutation_path(dataset: xarray.Dataset) -> tuple[Array, fits.FittedEllipse | None] | None:
    """A precessing figure axis, else the momentum, less its mean motion (rows, 2), rad, if that stays small,
    and its strongest part.

    Longitude of the node, less its secular part, times sin of the mean obliquity; obliquity less its mean.
    """
    if not precesses(dataset):
        return None
    found = signals.orientation(dataset, "figure") or signals.orientation(dataset, "momentum")
    if found is None:
        return None
    tilt, node = found
    seconds = signals.seconds(dataset)
    mean = fits.secular(seconds, tilt).value
    across = (node - fits.secular(seconds, node).at(seconds)) * np.sin(mean)
    path = np.stack([across, tilt - mean], axis=1)
    if not np.nanmax(np.hypot(*path.T)) < _FAR:
        return None
    return path, fits.leading_ellipse(seconds, node, tilt, float(np.sin(mean)))


@panel(nutation_path)
def nutation(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, fits.FittedEllipse | None]) -> None:
    """Motion of the pole about its mean motion: longitude times sin(obliquity) across, obliquity up."""
    plane, ellipse = found
    scale, unit = angle_scale(plane)
    labels = f"Δlongitude · sin(obliquity) [{unit}]", f"Δobliquity [{unit}]"
    path_about(axes, plane / scale, *labels, center=False)
    title = "Nutation: the pole about its mean motion"
    if ellipse is None:
        style.titled(axes, title)
        return
    long, short = (angle_text(size, 3) for size in ellipse.semi_axes)
    label = f"{span_text(_TURN / ellipse.rate, 3)}: semi-axes {long}, {short}"
    axes.plot(*(ellipse.curve() / scale).T, color=INK, lw=1.1, ls=(0, (4, 2)), label=label)
    key(axes, title)


def _tip(dataset: xarray.Dataset) -> tuple[Array, str, str] | None:
    """A top's tip (rows, 3), its unit and description: recorded, or else the end of the unit figure axis."""
    if not signals.is_top(dataset):
        return None
    tip = signals.values(dataset, "tip")
    if tip is not None:
        return tip, "m", "Tip"
    direction = signals.pole(dataset, "figure")
    return None if direction is None else (direction, "", "Figure axis")


@panel(_tip)
def tip(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, str, str]) -> None:
    """The tip of a top seen from above; its first turn about the vertical stands out."""
    path, unit_name, what = found
    up = surroundings.vertical(dataset)
    across = np.eye(3)[1 if abs(up[0]) > 0.9 else 0]  # X and Y if Z is up
    across = across - (across @ up) * up
    across /= np.linalg.norm(across)
    plane = np.stack([path @ across, path @ np.cross(up, across)], axis=1)
    if unit_name:
        scale, unit = si_scale(plane, unit_name)
    else:  # a unit vector: its components are angles where they are small
        scale, unit = angle_scale(plane) if np.nanmax(np.abs(plane)) < _SMALL else (1.0, "")
    label = f" [{unit}]" if unit else " of the unit vector"
    names = ("X", "Y") if np.allclose(up, [0, 0, 1]) else ("across", "across")
    path_about(axes, plane / scale, names[0] + label, names[1] + label)
    key(axes, f"{what}, seen from above (+: vertical)")


_FLAT = 1e-3  # of a path's reach: it lies in a plane up to this thickness


@panel(recorded("position"))
def path(axes: Axes, dataset: xarray.Dataset, position: Array) -> None:
    """The path of the centre of mass; the start is marked."""
    scale, unit = si_scale(position - position[0], "m")
    attractors = surroundings.told(dataset, "attractor")
    if surroundings.gravity(dataset) is not None and not attractors:
        _thrown(axes, dataset, position, scale, unit)
        return
    finite = position[np.isfinite(position).all(axis=1)]
    _, spread, ways = np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] == 0 or spread[2] > _FLAT * spread[0]:
        _in_space(axes, position / scale, unit)
        return
    normal = ways[2] if ways[2, np.abs(ways[2]).argmax()] > 0 else -ways[2]
    across = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across -= (across @ normal) * normal
    across /= np.linalg.norm(across)
    x, y = position @ across / scale, position @ np.cross(normal, across) / scale
    curve(axes, x, y, in_plane=True, color=Z, lw=1.2)
    axes.plot(x[0], y[0], "o", color=Z, ms=4.5)
    title = "Path in its plane"
    size = float(np.hypot(x - x.mean(), y - y.mean()).max())
    if np.hypot(x, y).min() < 3 * size and any(not any(one["position"]) for one in attractors):
        axes.plot(0, 0, "+", color=INK, ms=10, mew=1.3)
        x, y = np.append(x, 0), np.append(y, 0)
        title += " (+: origin)"
    square(axes, x, y)
    names = ("X", "Y") if normal[2] > 1 - 1e-9 else ("across, in the plane",) * 2
    axes.set(xlabel=f"{names[0]} [{unit}]", ylabel=f"{names[1]} [{unit}]")
    titled(axes, title)


def _thrown(axes: Axes, dataset: xarray.Dataset, position: Array, scale: float, unit: str) -> None:
    up = surroundings.vertical(dataset)
    height = position @ up
    level = position - height[:, None] * up
    way = level[-1] - level[0]
    length = float(np.linalg.norm(way))
    seconds = signals.seconds(dataset)
    axes.set_ylabel(f"height [{unit}]")
    if length < 1e-6 * max(float(np.ptp(height)), 1e-300):
        curve(axes, seconds, height / scale, color=Z)
        axes.set_xlabel("time [s]")
        titled(axes, "Height")
        return
    run = (level - level[0]) @ (way / length)
    curve(axes, run / scale, height / scale, in_plane=True, color=Z, lw=1.5)
    axes.plot(run[0] / scale, height[0] / scale, "o", color=Z, ms=4.5)
    if max(np.ptp(run), np.ptp(height)) < 6 * min(np.ptp(run), np.ptp(height)):
        square(axes, run / scale, height / scale)
    axes.set_xlabel(f"horizontal distance [{unit}]")
    titled(axes, f"Path over {span_text(seconds[-1] - seconds[0])}, seen from the side")


def _in_space(axes: Axes, points: Array, unit: str) -> None:
    reach = float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max()) or 1.0
    view = eyes.eye_at(np.array([0.74, -0.52, 0.43]))
    eyes.line(axes, view, points, color=Z, lw=1.3, zorder=4, rasterized=len(points) > 6000)
    axes.plot(*view.flat(points[0]), "o", color=Z, ms=4.5, zorder=5)
    eyes.draw_box(axes, view, points, "XYZ", reach, floors=[2])
    titled(axes, f"Path in space [{unit}]")
