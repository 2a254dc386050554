"""Central gravity: a point that attracts a freely flying body, force and torque to second degree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field

from rigidsim.model.gradient import tidal_range
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.loads.attractor_keys import AttractorFieldTable
from rigidsim.model.loads.kernel_attractor import KernelAttractor
from rigidsim.model.loads.point_attraction import (
    MovingAttractor,
    PointAttraction,
    kernel_strength,
    positive_strength,
)
from rigidsim.model.loads.source_figure import FigureFields
from rigidsim.model.plausibility import (
    about_named_strength,
    about_start,
    about_strength,
    attracting,
    named_body,
)
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, cross, norm, unit_vectors
from rigidsim.scene.cautions import Caution
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import BodyName, GravitationalParameter, Metre, Rate, Triple
from rigidsim.scene.orbit_keys import Orbit
from rigidsim.scene.orbits import attracting_body
from rigidsim.scene.point_masses import closest
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene

_ROUNDED = 0.999  # of the distance for which estimates are made, and the pericentre but for rounding


class CentralGravityFields(FigureFields):
    """A point that attracts a freely flying body: force and torque to second degree."""

    kind: Literal["central_gravity"]
    gravitational_parameter: GravitationalParameter | None = Field(
        default=None, description="G M of the attracting point", examples=["3.986004418e14 m^3/s^2"]
    )
    source: BodyName | None = Field(
        default=None,
        description="the attracting body of the [ephemeris] kernel, instead of position; a package gives its "
        "gravitational_parameter",
        examples=["moon"],
    )
    orbit: Orbit | None = Field(
        default=None,
        description="the attracting point mass in [[bodies]], instead of gravitational_parameter and "
        "position",
        examples=[{"body": "earth"}],
    )
    position: Triple[Metre] = Field(
        default_factory=lambda: [ZERO] * 3,
        description="position of the attracting point, space axes",
        json_schema_extra={"default": [0, 0, 0]},
    )

    atmosphere_rate: Triple[Rate] | None = Field(
        default=None,
        description="angular velocity of its atmosphere, space axes, for vrx vry vrz in expressions",
        examples=[[0, 0, "7.292115e-5 rad/s"]],
    )
    gravity_field: AttractorFieldTable | None = Field(
        default=None,
        description="gravity of the attracting body beyond a point, in axes that turn with it: its force",
        examples=[{"radius": "6378.1366 km", "C": {"3,0": 2.5e-6}, "pole": [0, 0, 1]}],
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        return frozenset({"flight"})


@register_load
@dataclass(frozen=True)
class CentralGravity(PointAttraction):
    """A point at rest that attracts a free body."""

    gravitational_parameter: Any
    position: Vector  # space axes, m (mpf)
    Fields = CentralGravityFields
    title = "central_gravity"
    reads = frozenset({"attitude", "flight"})
    conservative = True

    @classmethod
    def resolve(cls, fields: CentralGravityFields, around: Setting) -> Load:
        if fields.orbit is not None:
            if fields.orbit.body is None:
                raise around.fault("orbit", "given without body; the name of one of [[bodies]] is allowed")
            number = attracting_body(fields.orbit, around)
            for key in ("gravitational_parameter", "position", "source"):
                if key in fields.model_fields_set:
                    raise around.fault(key, "given with orbit.body, which determines it; remove it")
            if around.carried_bodies.host is not None:
                what = 'given "central_gravity", but [body] host makes the body one of [[bodies]], which '
                raise around.fault("kind", what + 'attract each other anyway; give "gravity_gradient"')
            return MovingAttractor(around.carried_bodies, number)
        if around.position is None:
            what = 'given "central_gravity" for a body without a position; give [initial] position and '
            raise around.fault("kind", f'{what}velocity, or use "gravity_gradient" for a prescribed orbit')
        if fields.source is not None:
            if "position" in fields.model_fields_set:
                raise around.fault("position", "given with source, which determines it; remove it")
            strength = kernel_strength(fields.gravitational_parameter, fields.source, around)
            if fields.source != around.host:  # which is the origin of the space axes
                return KernelAttractor.of(fields.source, strength, around)
        else:
            strength = positive_strength(fields.gravitational_parameter, around)
        place = [x.at(around.context) for x in fields.position]
        if around.position == place:
            raise around.fault("kind", "the body starts at the attracting point; start it elsewhere")
        return cls(strength, place)

    def pictured(self) -> dict[str, Any]:
        place = [float(x) for x in self.position]
        strength = float(self.gravitational_parameter)
        return {"what": "attractor", "gravitational_parameter": strength, "position": place}

    @property
    def attracting_point(self) -> Vector:  # type: ignore[override]
        return self.position

    @property
    def strength(self) -> Any:
        return self.gravitational_parameter

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        return m.seen_from(self.position)

    def force(self, m: Kinematics) -> list[Term]:
        """-GM r/r^3 - (3GM / 2 M r^4)[(tr I - 5 c . I c) r/|r| + 2 R I c] (physics of MacCullagh)."""
        pairs = zip(unit_vectors(m.scene.context), *self.pull(m, as_point=True), strict=True)
        return [([-x for x in axis], radial + turned) for axis, radial, turned in pairs]

    def potential(self, m: Kinematics) -> Symbolic | None:
        return -self.as_point(m) - self.second_degree(m)

    def source_at_start(self, scene: Scene) -> Vector:
        return [a - x for x, a in zip(scene.position or [], self.position, strict=True)]

    def motion(self, m: Kinematics) -> list[Symbolic]:
        return list(m.carried(m.velocity))

    def motion_at_start(self, scene: Scene) -> Vector:
        return scene.velocity or []

    # --- estimates, from the Kepler orbit through the initial state --------------------------------------

    def _start(self, scene: Scene) -> tuple[Vector, Any, Any]:
        """Position from the point (m), distance, and energy over mass (m^2/s^2) at the start."""
        assert scene.position is not None
        assert scene.velocity is not None
        context = scene.context
        offset = [x - a for x, a in zip(scene.position, self.position, strict=True)]
        distance = norm(context, offset)
        return offset, distance, norm(context, scene.velocity) ** 2 / 2 - self.strength / distance

    def nearest_approach(self, scene: Scene) -> Any:
        """Pericentre distance, m, but a thousandth of the first one at least: a scale must not vanish."""
        return closest(scene.context, self._start(scene)[0], scene.velocity or [], self.strength)[0]

    def amplitude(self, scene: Scene) -> Any:
        return tidal_range(scene, self.gravitational_parameter, self.nearest_approach(scene))

    def fastest_rate(self, scene: Scene) -> Any:
        momentum = norm(scene.context, cross(self._start(scene)[0], scene.velocity or []))
        return momentum / self.nearest_approach(scene) ** 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any]:
        context, strength = scene.context, self.gravitational_parameter
        assert scene.position is not None
        horizon = scene.duration
        _, distance, energy = self._start(scene)
        swiftest = context.sqrt(2 * abs(energy + strength / self.nearest_approach(scene)))
        if energy < 0:
            farthest = strength / -energy  # twice the semi-major axis
            reach = min(farthest, distance + swiftest * horizon) + fed * horizon
            return norm(context, self.position) + reach, swiftest + fed
        return norm(context, scene.position) + (swiftest + fed) * horizon, swiftest + fed

    def cautions(self, fields: CentralGravityFields, where: str, scene: Scene) -> Iterator[Caution]:
        given, name = fields.gravitational_parameter, fields.source
        offset, distance, _ = self._start(scene)
        if name is not None:
            yield from about_named_strength(given, name, where)
            body = named_body(name)
        else:
            assert given is not None
            yield from about_strength(given, float(distance), where)
            body = attracting(given, float(distance))
        yield from about_start(scene, body, offset, scene.velocity or [])
