"""A cone about the figure axis: where a fit predicts this axis along time, to one standard deviation.

A turn d (rad) of the attitude moves an axis a by d x a. With the covariance P of d, the axis has the
covariance M P M' across itself, where the rows of M are a x u and a x v for unit vectors u and v across it.
The roots of its eigenvalues are the half-angles of an elliptical cone, which the body carries. A cone too
narrow or too wide to be seen is drawn with its angles multiplied by one factor for the whole motion, which
the legend states.
"""

from dataclasses import dataclass, replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.curves import plotted
from rigidsim.look.record import scene_of
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import Array, Cone, Picture, Stage

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
_LEADING = "figure_axis_uncertainty"


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


def with_cone(dataset: xarray.Dataset, subject: Subject, picture: Picture) -> Picture:
    """The picture with the cone of the dataset's uncertain attitude, if it has one and the body turns."""
    covariance = signals.values(dataset, COVARIANCE)
    if covariance is None or subject.attitude is None:
        return picture
    found = AxisUncertainty.of(scene_of(dataset).figure, subject.attitude, covariance)
    angles = found.half_angles
    largest = float(np.nanmax(angles, initial=0.0))
    if not largest > _ROUNDING * float(np.nanmax(found.about, initial=0.0)):
        why = "none of the fitted numbers moves it" if np.isfinite(angles).any() else "it has no bounds"
        return replace(picture, notes=[*picture.notes, f"no uncertainty of the figure axis is drawn: {why}"])
    factor = drawn_factor(largest)
    words = "1 sigma of the figure axis" + ("" if factor == 1 else f", drawn × {factor:g}")
    rim = np.nan_to_num(found.rim(factor))
    # the other side of a top's axis goes through the ground
    cone = Cone(_LEADING, COLOR, _REACH * rim, words, double=not signals.is_top(dataset))
    short = replace(cone, rim=_ON_DISC * rim)
    notes = [
        f"{words} (white cone): the standard deviation that the fit predicts by the sigmas of its data and "
        "priors; the half-angles are the roots of the covariance across the axis, times that factor if there "
        "is one; their true values are plotted"
    ]
    if not np.isfinite(angles).all():
        notes.append("where there is no cone, an undetermined parameter would move the axis without bounds")
    table, title = np.column_stack([angles, found.about]), "1 sigma of the figure axis"
    labels = ("widest", "narrowest", "about it")
    plot = plotted(dataset, _LEADING, title, table, labels=labels, word="1 sigma")
    return replace(
        picture,
        stages=[
            replace(one, cones=[short if one.flat else cone]) if _to_scale(one) else one
            for one in picture.stages
        ],
        notes=[*picture.notes, *notes],
        plots=[*picture.plots, *([replace(plot, error=None)] if plot else [])],
    )


def drawn_factor(largest: float) -> float:
    """By what half-angles are multiplied of which the largest (rad) is given: 1, or a power of ten."""
    return 1.0 if _NARROW <= largest <= _WIDE else float(10.0 ** np.floor(np.log10(_SHOWN / largest)))


def _to_scale(stage: Stage) -> bool:
    """Whether a body that turns is drawn at its own size on a stage."""
    turns = stage.quaternion is not None or bool(stage.turns_with)
    return turns and max((mesh.reach() for mesh in stage.meshes), default=0.0) > _TO_SCALE
