"""Rotors on a body's stage: discs with a mark that turn about their axes, and whose momentum is whose.

A disc is drawn where its axis leaves the body, so that it is seen. Its radius is as of a disc of the body's
density: moments of inertia go with the fifth power of size. One too small to be seen is enlarged, which the
page "Picture" tells. It turns by the integral of its rate relative to
the body; if that were too fast for a screen it would seem to stand or to go backwards, and is drawn slower by
one factor for all such rotors and the whole run, which the legend tells: a wheel that spins up is seen to do
so, and which of several is the fastest.
"""

from dataclasses import dataclass, replace

import numpy as np
import xarray

from rigidsim.look import gyrostats, signals
from rigidsim.look.gyrostats import RecordedRotor
from rigidsim.look.record import scene_of
from rigidsim.look.solids import Mesh, solid_mesh
from rigidsim.look.sources import integrated
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import BODY, Array, Arrow, Color, Line, Picture, Solid, Spot, Stage, Trail

OF_BODY: Color = (235, 140, 80)
OF_WHEELS: Color = (150, 205, 110)
_MARK, _METAL, _DARK = (255, 226, 120), (158, 164, 176), (104, 110, 124)
_MARKED = 0.5  # rad to either side
_FLATNESS, _GAP = 0.3, 0.06  # of a disc's radius: its thickness; of the body's reach: to what is below
_SMALLEST, _USUAL = 0.12, 0.3  # radii over the body's reach
_PICTURES = 30.0  # a second on the screen that are surely drawn
_TOO_FAST, _SLOWED = 1 / 3, 1 / 12  # turns from one picture to the next: from which on, and then


@dataclass(frozen=True)
class _Disc:
    """Where a disc is: its middle along the axis, its radius, and that of one of the body's density (0: not
    known), in units of the body's reach.
    """

    rotor: RecordedRotor
    middle: float
    radius: float
    true_radius: float

    @property
    def top(self) -> float:
        """Where it ends on the axis."""
        return self.middle + self.radius * _FLATNESS / 2

    def size(self) -> str:
        """What its size means."""
        if not self.true_radius:
            return "of no particular size"
        larger = self.radius / self.true_radius
        enlarged = f", enlarged {larger:.1f} times to be seen" if larger > 1 else ""
        return f"of the size of a disc of the body's density{enlarged}"


def with_wheels(dataset: xarray.Dataset, subject: Subject, picture: Picture) -> Picture:
    """The picture with the dataset's rotors on its body, if it has some and the body is drawn to scale."""
    found = gyrostats.rotors(dataset)
    drawn = {rotor.name for rotor in found}
    missing = [one["name"] for one in scene_of(dataset).rotors if one["name"] not in drawn]
    if missing:
        unseen = f"not drawn, since rotor_rate isn't recorded: rotor {', '.join(missing)}"
        picture = replace(picture, notes=[*picture.notes, unseen])
    to_scale = [stage for stage in picture.stages if stage.unit == subject.reach and stage.meshes]
    if not found or not to_scale:
        return picture
    stage = to_scale[0]
    frames, solids, spots, lines, notes = {}, [], [], [], []
    slowed = [_slowing(dataset, rotor) for rotor in found]
    for disc, needed in zip(_placed(dataset, subject, found), slowed, strict=True):
        rotor, name = disc.rotor, f"rotor_{disc.rotor.name}"
        slower = max(slowed) if needed > 1 else 1.0
        frames[f"{BODY}/{name}"] = parts.viewer_quaternion(_turning(dataset, rotor, slower))
        solids.append(Solid("disc", _mesh(disc), f"{BODY}/{name}"))
        beside = disc.middle * rotor.axis + 1.2 * disc.radius * signals.across(rotor.axis)[0]
        spots.append(Spot(f"{name}/label", rotor.name, _MARK, beside, BODY))
        words = f"rotor {rotor.name}" + (f", drawn turning {slower:g} times slower" if slower > 1 else "")
        ends = np.outer([0.0, disc.top], rotor.axis)
        lines.append(Line(f"{name}/axle", _MARK, ends, BODY, 2.0, 0.7, words))
        notes.append(f"{words}: on its axis, outside of the body; {disc.size()}")
    arrows, trails, told = _momenta(dataset, stage, found)
    changed = replace(
        stage,
        frames={**stage.frames, **frames},
        solids=[*stage.solids, *solids],
        spots=[*stage.spots, *spots],
        lines=[*stage.lines, *lines],
        arrows=[*stage.arrows, *arrows],
        trails=[*stage.trails, *trails],
    )
    stages = [changed if one is stage else one for one in picture.stages]
    return replace(picture, stages=stages, notes=[*picture.notes, *notes, *told])


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


def _placed(dataset: xarray.Dataset, subject: Subject, found: list[RecordedRotor]) -> list[_Disc]:
    """Discs where their axes leave the body, one above the other if they share an axis."""
    corners, inertia = np.concatenate([mesh.vertices for mesh in subject.meshes]), gyrostats.tensor(dataset)
    placed: list[_Disc] = []
    for rotor in found:
        along = corners @ rotor.axis
        across = float(np.linalg.norm(corners - np.outer(along, rotor.axis), axis=1).max())
        whole = 0.0 if inertia is None else float(rotor.axis @ inertia @ rotor.axis)
        true_radius = (rotor.moment / whole) ** 0.2 * across if whole > 0 else 0.0
        radius = max(true_radius or _USUAL * across, _SMALLEST)
        below = [disc.top for disc in placed if disc.rotor.axis @ rotor.axis > 0.9]
        middle = max([float(along.max()), *below]) + _GAP + radius * _FLATNESS / 2
        placed.append(_Disc(rotor, middle, radius, true_radius))
    return placed


def _mesh(disc: _Disc) -> Mesh:
    """The disc at its place, in body axes, one sector of it bright."""
    size = {"radius": [disc.radius], "height": [disc.radius * _FLATNESS]}
    mesh = solid_mesh("cylinder", size)
    middles = mesh.vertices[mesh.triangles].mean(axis=1)
    marked = np.abs(np.arctan2(middles[:, 1], middles[:, 0])) < _MARKED
    rim = np.abs(mesh.normals[mesh.triangles[:, 0], 2]) < 0.5
    colors = np.where(rim[:, None], _DARK, _METAL)
    colors = np.where(marked[:, None], _MARK, colors)
    worn = np.empty_like(mesh.colors)
    worn[mesh.triangles] = colors[:, None].astype(np.uint8)
    first, second = signals.across(disc.rotor.axis)
    turn = np.column_stack([first, second, disc.rotor.axis])
    return replace(mesh, colors=worn).moved(turn, disc.middle * disc.rotor.axis)


def _momenta(
    dataset: xarray.Dataset, stage: Stage, found: list[RecordedRotor]
) -> tuple[list[Arrow], list[Trail], list[str]]:
    """The body's and the rotors' shares of the momentum, and its path, if the whole is on the stage."""
    whole = gyrostats.momentum(dataset)
    if whole is None or all(arrow.name != "angular_momentum" for arrow in stage.arrows):
        return [], [], []
    inner = np.asarray(sum(rotor.inner for rotor in found))
    factor = parts.ARROW_REACH / parts.longest(whole)
    of_body, of_wheels, moving = (
        "L of the body, rotors locked",
        "L of the rotors relative to it",
        "L's path in the body",
    )
    arrows = [
        Arrow("body_momentum", "body", OF_BODY, (whole - inner) * factor, True, of_body, 0.8, 0.018),
        Arrow("rotor_momentum", "rotors", OF_WHEELS, inner * factor, True, of_wheels, 1.0, 0.018),
    ]
    trail = Trail("momentum_path", parts.POLHODE, whole * factor, in_body=True, words=moving)
    notes = [
        f"{of_body} (orange), and {of_wheels} (green): to the scale of L, which they add up to",
        f"{moving} (pink): on a sphere, if no torque from outside changes L",
    ]
    return arrows, [trail], notes
