"""The kinds of scenes that have a stage of their own, the choice among them, and the stage of any other."""

from collections.abc import Callable

import xarray

from rigidsim.look.stages import free, orbits, planet, precession, top
from rigidsim.look.stages.bodies import Subject, source_arrows, vectors_of, with_track
from rigidsim.look.stages.parts import ARROW_REACH, Picture

KINDS: tuple[Callable[[xarray.Dataset, Subject], Picture | None], ...] = (
    top.picture,
    orbits.free_orbit,
    orbits.flight,
    orbits.satellite,
    planet.picture,
    precession.picture,
    free.picture,
)
"""Functions that return the picture of a scene of their kind, or None for others; the first that has one."""


def build_picture(dataset: xarray.Dataset) -> tuple[Picture, Subject]:
    """Picture of a thinned dataset in memory, and its body; ``ValueError`` for an unreadable ``drawing``."""
    subject = Subject.of(dataset)
    pictures = (kind(dataset, subject) for kind in KINDS)
    found = next((picture for picture in pictures if picture is not None), None) or _any(dataset, subject)
    found.notes.insert(0, f"lengths are in units of the body's reach: 1 unit = {subject.reach:.6g} m")
    return found, subject


def _any(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Any scene: the body with its momentum and angular velocity, and its track if it moves far."""
    arrows, trails, notes = vectors_of(dataset, subject)
    if subject.attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    else:
        arrows += source_arrows(dataset, subject, 0.95 * ARROW_REACH)
    stages = with_track(subject, subject.stage(arrows, trails), notes)
    return Picture("motion of a rigid body", stages, [], ("angular_velocity",), notes)
