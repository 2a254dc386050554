"""A cone about the figure axis: where a fit predicts this axis along time, to one standard deviation.

A turn d (rad) of the attitude moves an axis a by d x a. With the covariance P of d, the axis has the
covariance M P M' across itself, where the rows of M are a x u and a x v for unit vectors u and v across it.
The roots of its eigenvalues are the half-angles of an elliptical cone, which the body carries. A cone too
narrow or too wide to be seen is drawn with its angles multiplied by one factor for the whole motion, which
the legend states.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import rerun as rr
import xarray

from rigidsim.look import signals
from rigidsim.look.curves import plotted
from rigidsim.look.record import scene_of
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import BODY, Array, Columns, Part, Picture, Rows

COVARIANCE = "attitude_covariance"
"""Variable (time, 3, 3) of a dataset, rad^2, of the attitude as a rotation vector in space axes."""
COLOR: parts.Color = (236, 232, 222)
_REACH = 1.7  # length of the cone, in units of the body's reach
_ON_DISC = 1.12  # where a globe is seen as a disc that fills the view
_CORNERS = 72
_ROUNDING = 1e-7  # of the uncertainty about the axis: the root of what rounding leaves of its square
_NARROW, _WIDE = np.deg2rad(12.0), np.deg2rad(60.0)  # half-angles (rad) that are drawn as they are
_SHOWN = np.deg2rad(50.0)  # the largest (rad) that others are drawn with
_TO_SCALE = 0.5  # reaches: a body drawn smaller is a mark on its orbit
_CLEAR = 46  # of 255: of a cone, through which labels are read
_LEADING = "figure_axis_uncertainty"
CONE = f"{BODY}/{_LEADING}"
"""Path of the cone on a stage."""


@dataclass(frozen=True)
class AxisUncertainty:
    """One standard deviation (rad) of an axis fixed to a body along time.

    Attributes:
        axis: unit vector (3,), body axes. spread: (rows, 2, 2), the symmetric root of the covariance across
            it, along ``signals.across(axis)``. about: (rows,), of the rotation about the axis. All are nan
            where the covariance is.
    """

    axis: Array
    spread: Array
    about: Array

    @classmethod
    def of(cls, axis: Array, attitude: Array, covariance: Array) -> "AxisUncertainty":
        """The uncertainty of an axis (3,), body axes, by attitudes (rows, 3, 3), body to space, and their
        covariances (rows, 3, 3) as rotation vectors in space axes.
        """
        first, second = signals.across(axis)
        moved = np.stack([second, -first, axis])  # a x u, a x v, and about a
        known = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
        in_space = np.einsum("tij,kj->tki", attitude, moved)
        found = np.einsum(
            "tki,tij,tlj->tkl", in_space, np.where(known[:, None, None], covariance, 0.0), in_space
        )
        values, vectors = np.linalg.eigh(found[:, :2, :2])
        roots = np.sqrt(np.maximum(values, 0.0))  # below zero by rounding
        spread = np.einsum("tik,tk,tjk->tij", vectors, roots, vectors)
        spread[~known] = np.nan
        return cls(axis, spread, np.where(known, np.sqrt(np.maximum(found[:, 2, 2], 0.0)), np.nan))

    @property
    def half_angles(self) -> Array:
        """(rows, 2), rad: the largest and the smallest of the cone."""
        return np.linalg.svd(np.where(np.isfinite(self.spread), self.spread, 0.0), compute_uv=False) + (
            0.0 * self.spread[:, 0]
        )

    def rim(self, factor: float = 1.0, corners: int = _CORNERS) -> Array:
        """Unit vectors (rows, corners, 3), body axes, along the cone, its angles multiplied by a factor."""
        angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
        turns = factor * np.einsum("tij,jn->tni", self.spread, np.stack([np.cos(angle), np.sin(angle)]))
        size = np.linalg.norm(turns, axis=2, keepdims=True)
        sideways = turns @ np.stack(signals.across(self.axis))
        return np.asarray(np.cos(size) * self.axis + np.sinc(size / np.pi) * sideways)


def add_cone(dataset: xarray.Dataset, subject: Subject, picture: Picture) -> None:
    """Put the cone of the dataset's uncertain attitude on a picture, if it has one and the body turns."""
    covariance = signals.values(dataset, COVARIANCE)
    if covariance is None or subject.attitude is None:
        return
    found = AxisUncertainty.of(scene_of(dataset).figure, subject.attitude, covariance)
    angles = found.half_angles
    largest = float(np.nanmax(angles, initial=0.0))
    if not largest > _ROUNDING * float(np.nanmax(found.about, initial=0.0)):
        why = "none of the fitted numbers moves it" if np.isfinite(angles).any() else "it has no bounds"
        picture.notes.append(f"no uncertainty of the figure axis is drawn: {why}")
        return
    fitting = 10.0 ** np.floor(np.log10(_SHOWN / largest))
    factor = 1.0 if _NARROW <= largest <= _WIDE else float(fitting)
    words = "1 sigma of the figure axis" + ("" if factor == 1 else f", drawn × {factor:g}")
    rim = np.nan_to_num(found.rim(factor))
    # the other side of a top's axis goes through the ground
    sides = [rim] if signals.is_top(dataset) else [rim, -rim]
    picture.notes.append(
        f"{words} (white cone): the standard deviation that the fit predicts by the sigmas of its data and "
        "priors; the half-angles are the roots of the covariance across the axis, times that factor if there "
        "is one; their true values are plotted"
    )
    if not np.isfinite(angles).all():
        picture.notes.append(
            "where there is no cone, an undetermined parameter would move the axis without bounds"
        )
    table, title = np.column_stack([angles, found.about]), "1 sigma of the figure axis"
    labels = ("widest", "narrowest", "about it")
    plot = plotted(dataset, _LEADING, title, table, labels=labels, word="1 sigma")
    picture.plots.extend([replace(plot, error=None)] if plot else [])
    for stage in [one for one in picture.stages if one.size > _TO_SCALE]:
        stage.parts.extend(_cone(sides, _ON_DISC if stage.flat else _REACH, words))


def _cone(rims: Sequence[Array], reach: float, words: str) -> list[Part]:
    """Translucent cones of some length along time, from the reference point to the corners (rows, corners, 3)
    of their rims, unit vectors in body axes.
    """
    corners = np.stack(rims, axis=1) * reach  # (rows, sides, corners, 3)
    _, sides, count, _ = corners.shape
    numbers = 1 + np.arange(sides * count, dtype=np.uint32).reshape(sides, count)  # 0 is the apex
    triangles = np.stack([np.zeros_like(numbers), numbers, np.roll(numbers, -1, axis=1)], axis=2)

    def surface(rows: Rows) -> Columns:
        shown = corners[rows].astype(np.float32).reshape(-1, sides * count, 3)
        vertices = np.concatenate([np.zeros_like(shown[:, :1]), shown], axis=1)
        columns = rr.Mesh3D.columns(vertex_positions=vertices.reshape(-1, 3))
        return columns.partition([vertices.shape[1]] * len(vertices))

    def edge(rows: Rows) -> Columns:
        shown = corners[rows].astype(np.float32)
        closed = np.concatenate([shown, shown[:, :, :1]], axis=2).reshape(-1, count + 1, 3)
        return rr.LineStrips3D.columns(strips=list(closed)).partition([sides] * len(shown))

    clear = rr.Mesh3D.from_fields(triangle_indices=triangles.reshape(-1, 3), albedo_factor=(*COLOR, _CLEAR))
    rim = rr.LineStrips3D.from_fields(colors=[COLOR], radii=parts.points_wide(0.9))
    return [
        Part(f"{CONE}/surface", [clear], surface, corners[:, 0], words, COLOR),
        Part(f"{CONE}/rim", [rim], edge),
    ]
