"""One of ``[[bodies]]`` as the source of a body that is one of them, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.orbits.point_mass_states import PointMassPair
from rigidsim.model.placements.placement import Circuit, Placement, SourceMotion
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.scene import Scene

_ALMOST_PARABOLIC = 0.99  # a larger eccentricity's harmonics, of which a few thousand are told, hardly differ


@dataclass(frozen=True)
class PlacedAsMass(Placement):
    """A point mass that moves under mutual gravity; it is judged by its osculating orbit of the start."""

    pair: PointMassPair
    untracked = ""
    moves: ClassVar[bool] = True

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.pair.name

    @property
    def without_elements(self) -> tuple[str, str]:  # type: ignore[override]
        against = f'the orbit of the point mass "{self.name}" is integrated, so that there is no '
        remedy = 'choose "spin_averaged", or write the elements of the orbit into a table '
        return against + "ellipse to average over", remedy + '(orbit = {table = "elements.csv"})'

    def distance(self, context: Any) -> Any:
        """Semi-major axis at the start, or the least distance of one that isn't bound."""
        ellipse = self.pair.ellipse(context)
        return self.pair.encounter(context)[0] if ellipse is None else ellipse[0]

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        states = m.carried(m.point_masses)
        place = states.between(self.pair.host, self.pair.number)
        ends = min(self.pair.host, self.pair.number), max(self.pair.host, self.pair.number)
        inverse = states.inverse_distances[ends]
        unit = m.scene.context.ldexp(self.distance(m.scene.context), -m.scaling.length)
        return [x * inverse for x in place], m.number(unit) * inverse

    def motion(self, m: Kinematics) -> SourceMotion:
        """Under the mutual gravity of all as points."""
        found = m.carried(m.point_masses).relative(self.pair.host, self.pair.number)
        _, inverse = self.seen(m)
        context, exponent = m.scene.context, m.scaling.length
        unit = context.ldexp(context.one, exponent)
        ratio = m.number(unit / self.distance(context))
        return SourceMotion(*found, ratio * inverse, unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        return self.pair.masses.relative(self.pair.host, self.pair.number, scene.context)

    def at_start(self, scene: Scene) -> Vector:
        return self.pair.place

    def circuit(self, context: Any) -> Circuit:
        least, rate = self.pair.encounter(context)
        if (ellipse := self.pair.ellipse(context)) is None:
            return Circuit(passing_rate=float(rate))
        # what the others do to axis and eccentricity is of the size of their share in the acceleration
        perturbed, (axis, e, motion) = self.pair.perturbation(context), ellipse
        closer = float(least / axis) * max(1 - 2 * perturbed, 0.5)
        e = min(e + 2 * perturbed, _ALMOST_PARABOLIC)
        doubt = perturbed * motion
        return Circuit(motion, e, closer**-3, doubt, doubt, float(rate))
