"""Loads by a source that is placed somehow."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load
from rigidsim.model.placements.placement import Placement, SourcePlace
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.scene import Scene


def _of_placement(name: str) -> Any:
    return property(attrgetter(f"placement.{name}"))


@dataclass(frozen=True, kw_only=True)
class Placed(Load):
    """Base of loads whose source is where its ``placement`` says."""

    placement: Placement

    orbit, table, sights = map(_of_placement, ("orbit", "table", "sights"))
    axes, epoch, seconds_ahead = map(_of_placement, ("axes", "epoch", "seconds_ahead"))
    plane, without_plane = map(_of_placement, ("plane", "without_plane"))
    wide, of_time = map(_of_placement, ("wide", "of_time"))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude", "flight"} if self.placement.flies else {"attitude"})

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], SourcePlace]:
        """``SourcePlace.line`` in body axes, and the place."""
        place = self.placement.seen(m)
        return m.seen(place.line), place

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        line, place = self.seen(m)
        return [-x for x in line] if place.outward else line

    def source_place(self, m: Kinematics) -> SourcePlace:
        return self.placement.seen(m)

    def source_at_start(self, scene: Scene) -> Vector:
        return self.placement.at_start(scene)

    def motion(self, m: Kinematics) -> list[Symbolic]:
        """Velocity of a body in flight as seen from its source, space axes, units of speed."""
        return self.placement.velocity(m)

    def motion_at_start(self, scene: Scene) -> Vector:
        return self.placement.velocity_at_start(scene)

    def fastest_rate(self, scene: Scene) -> Any:
        return self.placement.fastest_rate(scene)
