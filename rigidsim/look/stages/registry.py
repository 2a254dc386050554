"""The kinds of scenes that have a stage of their own, and the choice among them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rigidsim.look.stages import flight, free, generic, orbit, planet, pole, satellite, top
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import Picture

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

KINDS: tuple[Callable[[Table, Subject], Picture | None], ...] = (
    top.picture,
    orbit.picture,
    flight.picture,
    satellite.picture,
    planet.picture,
    pole.picture,
    free.picture,
    generic.picture,
)
"""Functions that return the picture of a scene of their kind, or None; the last accepts every scene."""


def build_picture(dataset: Table) -> tuple[Picture, Subject]:
    """The picture of a thinned dataset, in memory, and its body.

    Raises:
        ValueError: an unreadable ``drawing``, see ``solids.body_meshes``.
    """
    subject = Subject.of(dataset)
    for kind in KINDS:
        found = kind(dataset, subject)
        if found is not None:
            found.notes.insert(0, f"lengths are in units of the body's reach: 1 unit = {subject.reach:.6g} m")
            return found, subject
    raise AssertionError("a generic stage takes every scene")
