"""Stage of a top: its pivot on a ground, gravity, and the trace of its figure axis, also seen from above."""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Mesh, spinning_top
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import FIELD, Subject, vectors_of
from rigidsim.look.stages.parts import BODY, Array, Camera, Picture, lines, spot, trail

TRACE = 1.0  # where on the axis the traced point is, in reaches
_SYMMETRIC = 1e-9  # of the moments


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body on a fixed point off its centre of mass under uniform gravity; None for others."""
    arm = signals.lever(dataset)
    if arm is None or subject.quaternion is None:
        return None
    up = scene_of(dataset).vertical
    axis = _figure(dataset, arm)
    symbol = _symbol(dataset, subject, arm, axis)
    if symbol is not None:
        mesh, reach = symbol
        subject = replace(subject, meshes=[mesh.scaled(1 / reach)], points=np.zeros((0, 3)), reach=reach)
    shown, notes = vectors_of(dataset, subject, paths=False, longer=(1.25, 1.1))
    if symbol is not None:
        notes.append(
            "the config gives moments and no shape: the body is drawn as a top with its axis, its centre of "
            "mass and the radius of a disk of its mass and axial moment"
        )
    attitude = subject.attitude
    assert attitude is not None
    tip = TRACE * attitude @ axis
    lowest = min(float(np.nanmin(tip @ up)), float((subject.meshes[0].vertices @ axis).min()))
    # A top that dips below its pivot stands on a post, not on a floor that it would pass through.
    post = not (lowest > -0.02 and float(np.nanmin(tip @ up)) > 0.25)
    ground, center = (-1.35 if post else 0.0) * up, np.zeros(3)
    across = _across(up)
    rim, upright = parts.circle(1.6, up, ground), np.stack([ground, 1.5 * up])
    place, words = 1.25 * across[0] + 0.9 * up, "gravity"
    # on a post the label is below, where it is clear of the body's own
    pivot, size = (0.55 * ground, 0.0) if post else (center, 5.0)
    shown += [
        *parts.fixed_arrow(words, words, parts.PULL, place, -0.55 * up, words, radius=0.02),
        *trail("tip", parts.FIGURE, tip, "trace of the axis", head=True),
        lines("ground/rim", parts.FAINT, [rim], strength=0.8),
        parts.grid("ground", ground, *across, 1.6, 4, 0.4, round_=True),
        lines("vertical", parts.FAINT, [upright], "vertical", width=1.0),
        spot("pivot", "pivot", parts.PALE, pivot, size=size),
    ]
    if post:
        shown.append(lines("ground/post", parts.PALE, [np.stack([ground, center])], width=4.0))
    if symbol is None:
        com = arm / subject.reach
        shown.append(lines("arm", parts.PALE, [np.stack([center, com])], place=BODY, width=2.5))
        shown.append(spot("center_of_mass", "centre of mass", parts.PULL, com, BODY, 6.0))
    elevation = np.deg2rad(20.0)
    direction = np.cos(elevation) * (0.55 * across[0] - 0.83 * across[1]) + np.sin(elevation) * up
    target, radius = (-0.1 if post else 0.55) * up, 2.05 if post else 1.62
    camera = Camera(target + radius / np.sin(FIELD / 2) * direction, target, up)
    return Picture("top on a fixed point", [subject.stage(shown, "Top on its pivot", camera=camera)], notes)


def _figure(dataset: xarray.Dataset, arm: Array) -> Array:
    """The axis whose trace is shown: of symmetry if the centre of mass lies on it, else through that."""
    scene = scene_of(dataset)
    if scene.moments is not None:
        axis = scene.axes[scene.symmetry]
        along = float(axis @ arm) / float(np.linalg.norm(arm))
        if abs(along) > 1 - _SYMMETRIC:
            return np.asarray(np.sign(along) * axis)
    return np.asarray(arm / np.linalg.norm(arm))


def _symbol(dataset: xarray.Dataset, subject: Subject, arm: Array, axis: Array) -> tuple[Mesh, float] | None:
    """A toy top (in metres) and its reach, if only the moments of a symmetric body are known; else None."""
    scene = scene_of(dataset)
    only = len(subject.solids) == 1 and subject.solids[0].get("equivalent")
    if not only or scene.moments is None or scene.mass is None:
        return None
    moments, k = scene.moments, scene.symmetry
    a, b = np.delete(moments, k)
    along = abs(float(scene.axes[k] @ arm)) / float(np.linalg.norm(arm))
    if abs(a - b) > _SYMMETRIC * max(a, b) or along < 1 - _SYMMETRIC:
        return None
    length = float(np.linalg.norm(arm))
    # of a disk, C = m r^2/2; kept to what still looks like a top
    radius = float(np.clip(np.sqrt(2 * moments[k] / scene.mass), 0.35 * length, 1.3 * length))
    mesh = spinning_top(radius, length, 1.75 * length)
    other = _across(axis)
    return mesh.moved(np.stack([*other, axis], axis=1), np.zeros(3)), 1.75 * length


def _across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors that complete an axis to a right-handed frame; X and Y for Z."""
    second, first = signals.across(axis)
    return first, -second
