"""Rotors on a body's stage: discs with a mark that turn about their axes, and whose momentum is whose.

A disc is drawn where its axis leaves the body, so that it is seen. Its radius is as of a disc of the body's
density: moments of inertia go with the fifth power of size; one too small to be seen is enlarged. It turns by
the integral of its rate relative to the body; if that were too fast for a screen it would seem to stand or to
go backwards, and is drawn slower by one factor for all such rotors and the whole run, which the legend shows:
a wheel that spins up is seen to do so, and which of several is the fastest.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals
from rigidsim.look.gyrostats import RecordedRotor
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Mesh, solid_mesh
from rigidsim.look.sources import integrated
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import BODY, Array, Color, Picture, Stage, arrow, lines, trail

OF_BODY: Color = (235, 140, 80)
OF_WHEELS: Color = (150, 205, 110)
_MARK, _METAL, _DARK = (255, 226, 120), (158, 164, 176), (104, 110, 124)
_MARKED = 0.5  # rad to either side
_FLATNESS, _GAP = 0.3, 0.06  # of a disc's radius: its thickness; of the body's reach: to what is below
_SMALLEST, _USUAL = 0.12, 0.3  # radii over the body's reach
_PICTURES = 30.0  # a second on the screen that are surely drawn
_TOO_FAST, _SLOWED = 1 / 3, 1 / 12  # turns from one picture to the next: from which on, and then


def add_wheels(dataset: xarray.Dataset, subject: Subject, picture: Picture) -> None:
    """Put the dataset's rotors on a picture's body, if it has some and the body is drawn to scale: discs
    where their axes leave it, one above the other if they share an axis.
    """
    found = gyrostats.rotors(dataset)
    drawn = {rotor.name for rotor in found}
    missing = [one["name"] for one in scene_of(dataset).rotors if one["name"] not in drawn]
    if missing:
        picture.notes.append(f"not drawn, since rotor_rate isn't recorded: rotor {', '.join(missing)}")
    to_scale = [stage for stage in picture.stages if stage.unit == subject.reach and stage.size]
    if not found or not to_scale:
        return
    stage, inertia = to_scale[0], gyrostats.tensor(dataset)
    corners = np.concatenate([mesh.vertices for mesh in subject.meshes])
    slowed, tops = [_slowing(dataset, rotor) for rotor in found], dict[tuple[float, ...], float]()
    for rotor, needed in zip(found, slowed, strict=True):
        name, slower = f"rotor_{rotor.name}", max(slowed) if needed > 1 else 1.0
        along = corners @ rotor.axis
        across = float(np.linalg.norm(corners - np.outer(along, rotor.axis), axis=1).max())
        whole = 0.0 if inertia is None else float(rotor.axis @ inertia @ rotor.axis)
        share = (rotor.moment / whole) ** 0.2 if whole > 0 and rotor.moment > 0 else _USUAL
        radius, key = max(share * across, _SMALLEST), tuple(np.round(rotor.axis, 3).tolist())
        middle = tops.get(key, float(along.max())) + _GAP + radius * _FLATNESS / 2
        tops[key] = middle + radius * _FLATNESS / 2
        mesh = _mesh(radius).moved(
            np.column_stack([*signals.across(rotor.axis), rotor.axis]), middle * rotor.axis
        )
        beside = middle * rotor.axis + 1.2 * radius * signals.across(rotor.axis)[0]
        words = f"rotor {rotor.name}" + (f", drawn turning {slower:g} times slower" if slower > 1 else "")
        axle, place = np.outer([0.0, tops[key]], rotor.axis), f"{BODY}/{name}"
        stage.parts.extend(parts.frame(place, quaternion=_turning(dataset, rotor, slower)))
        stage.parts.append(parts.solid(parts.around(place, "disc"), mesh))
        stage.parts.append(parts.spot(f"{name}/label", rotor.name, _MARK, beside, BODY))
        stage.parts.append(lines(f"{name}/axle", _MARK, [axle], words, place=BODY, width=2.0, strength=0.7))
    _momenta(dataset, stage, found, picture.notes)


def _slowing(dataset: xarray.Dataset, rotor: RecordedRotor) -> float:
    """How many times slower than it is a rotor has to be drawn: 1, or 2, 5, 10, 20, 50 and so on."""
    seconds = signals.seconds(dataset)
    if len(seconds) < 2:
        return 1.0
    picture = np.ptp(seconds) / (parts.screen_seconds(dataset) * _PICTURES)
    steps = np.maximum(np.abs(np.diff(seconds)), picture)
    most = float(np.nanmax(np.abs(rotor.rate[1:]) * steps, initial=0.0)) / (2 * np.pi)
    if most <= _TOO_FAST:
        return 1.0
    needed = most / _SLOWED
    decade = 10.0 ** np.floor(np.log10(needed))
    return float(next(factor * decade for factor in (1, 2, 5, 10) if factor * decade >= needed))


def _turning(dataset: xarray.Dataset, rotor: RecordedRotor, slower: float) -> Array:
    """Quaternions (rows, 4) w x y z by which it has turned in the body."""
    angle = integrated(signals.seconds(dataset), np.nan_to_num(rotor.rate) / slower)
    return np.column_stack([np.cos(angle / 2), np.sin(angle / 2)[:, None] * rotor.axis])


def _mesh(radius: float) -> Mesh:
    """A disc across z, one sector of it bright."""
    mesh = solid_mesh("cylinder", {"radius": [radius], "height": [radius * _FLATNESS]})
    middles = mesh.corners.mean(axis=1)
    marked = np.abs(np.arctan2(middles[:, 1], middles[:, 0])) < _MARKED
    rim = np.abs(mesh.normals[:, 0, 2]) < 0.5
    colors = np.where(marked[:, None], _MARK, np.where(rim[:, None], _DARK, _METAL))
    return replace(mesh, colors=colors.astype(np.uint8))


def _momenta(dataset: xarray.Dataset, stage: Stage, found: list[RecordedRotor], notes: list[str]) -> None:
    """Put the body's and the rotors' shares of the momentum, and its path, on a stage that has the whole."""
    whole = gyrostats.momentum(dataset)
    if whole is None or all(part.path != "centre/angular_momentum" for part in stage.parts):
        return
    inner = np.asarray(sum(rotor.inner for rotor in found))
    factor = parts.ARROW_REACH / parts.longest(whole)
    of_body, of_wheels = "L of the body, rotors locked", "L of the rotors relative to it"
    moving = "L's path in the body"
    shares = ((whole - inner, "body", OF_BODY, of_body, 0.8), (inner, "rotor", OF_WHEELS, of_wheels, 1.0))
    for vectors, name, color, words, at in shares:
        label, shown = "rotors" if name == "rotor" else name, vectors * factor
        more: dict[str, Any] = {"place": BODY, "label_at": at, "radius": 0.018}
        stage.parts.append(arrow(f"{name}_momentum", label, color, shown, words, **more))
    stage.parts.extend(trail("momentum_path", parts.POLHODE, whole * factor, moving, place=BODY))
    notes += [
        f"{of_body} (orange), and {of_wheels} (green): to the scale of L, which they add up to",
        f"{moving} (pink): on a sphere, if no torque from outside changes L",
    ]
