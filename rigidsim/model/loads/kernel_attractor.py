"""A body of a kernel that attracts a freely flying one: force and torque to second degree.

Space axes have their origin at ``[body] host``, which the source accelerates as well. What is felt there is
the difference, the tidal or third-body acceleration (Montenbruck & Gill 2000, Satellite Orbits, ch. 3):

    a = G M (s - x) / |s - x|^3 - G M s / |s|^3,

s being the source's place and x the body's. Without a host the origin is the solar system's barycentre, which
nothing accelerates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.model.gradient import tidal_range
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term
from rigidsim.model.loads.point_attraction import PointAttraction
from rigidsim.model.placements.kernel_body import PlacedByKernel, kernel_body
from rigidsim.model.rotations import Symbolic, length
from rigidsim.scene.arithmetic import Vector, dot, norm, unit_vectors
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class KernelAttractor(PointAttraction):
    """The attraction of a free body by one of a kernel."""

    gravitational_parameter: Any
    placement: PlacedByKernel
    title = "central_gravity"
    reads = frozenset({"attitude", "flight"})
    wide = True

    @classmethod
    def of(cls, source: str, strength: Any, around: Setting) -> KernelAttractor:
        """The body of this name, seen from the host or from the barycentre."""
        ephemeris = kernel_body(source, around)
        made = cls(strength, PlacedByKernel(ephemeris, ephemeris.sight(source, around.host)))
        assert around.position is not None
        if norm(around.context, made._apart(around.context, around.position)) == 0:
            raise around.fault("kind", "the body starts at the attracting point; start it elsewhere")
        return made

    @property
    def axes(self) -> str:  # type: ignore[override]
        return self.placement.axes

    @property
    def sights(self) -> tuple[tuple[Sight, int], ...]:  # type: ignore[override]
        return ((self.placement.sight, 1),)

    @property
    def strength(self) -> Any:
        return self.gravitational_parameter

    def pictured(self) -> dict[str, Any]:
        strength = float(self.gravitational_parameter)
        return {"what": "source", "gravitational_parameter": strength, **self.placement.pictured()}

    # --- expressions --------------------------------------------------------------------------------------

    def _place(self, m: Kinematics) -> list[Symbolic]:
        """The source's place, units of length."""
        context = m.scene.context
        unit = m.number(context.ldexp(self.placement.distance(context), -m.scaling.length))
        return [unit * x for x in m.carried(m.sky).seen(self.placement.sight)]

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        offset = [x - s for x, s in zip(m.carried(m.position), self._place(m), strict=True)]
        inverse = 1.0 / length(offset)
        return [x * inverse for x in offset], inverse

    def motion(self, m: Kinematics) -> list[Symbolic]:
        context, scaling = m.scene.context, m.scaling
        unit = m.number(context.ldexp(self.placement.distance(context), -scaling.time - scaling.speed))
        moving = m.carried(m.sky).seen(self.placement.sight, 1)
        return [v - unit * x for v, x in zip(m.carried(m.velocity), moving, strict=True)]

    def _falling(self, m: Kinematics, extra: int) -> list[Symbolic] | None:
        """The host's acceleration times 2^extra, internal units; None without a host."""
        if not self.placement.sight.host:
            return None
        direction, inverse = self.placement.seen(m)
        context = m.scene.context
        size = self.strength / self.placement.distance(context) ** 2
        factor = m.number(context.ldexp(size, extra)) * inverse**2
        return [factor * x for x in direction]

    def force(self, m: Kinematics) -> list[Term]:
        parts = [[-x - y for x, y in zip(*self.pull(m, as_point=True), strict=True)]]
        falling = self._falling(m, m.scaling.time - m.scaling.speed)
        parts += [[-x for x in falling]] if falling is not None else []
        return [pair for part in parts for pair in zip(unit_vectors(m.scene.context), part, strict=True)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Of the source at its place, and of the inertial force of the falling host."""
        own = -self.as_point(m) - self.second_degree(m)
        falling = self._falling(m, m.scaling.length - m.scaling.energy)
        if falling is None:
            return own
        return own + m.number(m.carried(m.scene.body.mass)) * dot(falling, m.carried(m.position))

    # --- sizes, at the start ------------------------------------------------------------------------------

    def _apart(self, context: Any, position: Vector) -> Vector:
        """From the source to the body at the start, m."""
        begin = self.placement.ephemeris.run[0]
        return [x - s for x, s in zip(position, self.placement.at(context, begin), strict=True)]

    def _distance(self, scene: Scene) -> Any:
        return norm(scene.context, self._apart(scene.context, scene.position or []))

    def source_at_start(self, scene: Scene) -> Vector:
        return [-x for x in self._apart(scene.context, scene.position or [])]

    def motion_at_start(self, scene: Scene) -> Vector:
        ephemeris, sight = self.placement.ephemeris, self.placement.sight
        moving = ephemeris.place(scene.context, sight, scene.start, 1)
        return [v - x for v, x in zip(scene.velocity or [], moving, strict=True)]

    def amplitude(self, scene: Scene) -> Any:
        return tidal_range(scene, self.strength, self._distance(scene))

    def fastest_rate(self, scene: Scene) -> Any:
        return self.placement.fastest_rate(scene.context)
