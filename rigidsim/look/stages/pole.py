"""Stage of a body of which only axes are known, as in an averaged model: their directions and precession."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import signals
from rigidsim.look.stages import precession
from rigidsim.look.stages.bodies import Subject, eye_at
from rigidsim.look.stages.parts import FAINT, FIGURE, MOMENTUM, SPACE, Arrow, Line, Picture, trail
from rigidsim.look.symbols import graticule

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

_APART = 0.02  # rad, from which two arrows are told apart
_LEADING = ("obliquity", "node_longitude", "momentum_axis", "figure_axis")
_COLORS = {"figure": FIGURE, "momentum": MOMENTUM}


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Picture of a body without attitude and rates whose figure axis or momentum is known in space; None for
    others.

    With a figure axis the body points along it; a tumbling body isn't drawn, as its attitude is unknown.
    """
    if subject.attitude is not None or subject.position is not None or "angular_velocity" in dataset:
        return None
    known = {name: precession.axis_in_space(dataset, name) for name in ("figure", "momentum")}
    axes = {name: axis for name, axis in known.items() if axis is not None}
    if not axes:
        return None
    leading = next(iter(axes))
    if len(axes) == 2 and np.linalg.norm(axes["figure"] - axes["momentum"], axis=1).max() < _APART:
        del axes["momentum"]
    notes: list[str] = []
    subject = precession.pointed(dataset, subject, signals.figure_direction(dataset))
    stage = replace(subject.stage([], []), title="Axes in space", axis_length=0.0)
    if leading == "figure":
        notes.append(precession.standing_note(dataset, "body"))
    else:
        stage = replace(stage, meshes=[], points=np.empty((0, 3)))
        rings = enumerate(graticule(np.full(3, 0.6), lift=1.0))
        stage.lines.extend(Line(f"directions/{k}", FAINT, line, SPACE, 0.7, 0.4) for k, line in rings)
        notes.append("the body isn't drawn: of its attitude only the momentum's direction is known")
    for name, axis in axes.items():
        shown, words = precession.POLE_REACH * axis, f"{name} axis"
        stage.arrows.append(Arrow(words.replace(" ", "_"), words, _COLORS[name], shown, False, words))
        path = trail(f"{name}_path", _COLORS[name], shown, words=f"path of the {words}")
        # of samples too far apart it would be a cloud; on the circle of precession it wouldn't be seen
        if path.line and np.ptp(axis[:, 2]) > _APART:
            stage.trails.append(path)
    precession.reference_plane(stage)
    precession.circle_of_precession(dataset, stage, axes[leading], leading, notes)
    stage.arrows.extend(precession.followed_sources(dataset, subject, 1.75, notes))
    eye = eye_at(float(np.deg2rad(22.0)), float(np.deg2rad(-52.0)), 1.95, np.array([0.0, 0.0, 0.05]))
    planes = precession.nutation_planes(dataset, leading)
    return Picture("axes in space", [replace(stage, camera=eye)], planes, _LEADING, notes)
