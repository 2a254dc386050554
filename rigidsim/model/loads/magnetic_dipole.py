"""Magnetic dipole: a moment of the body in a uniform field, or in that of a dipole about which it moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import heyoka as hy
from pydantic import Field

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.capabilities import Attracting, having
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term, loads_of
from rigidsim.model.load_words import length_text, orbit_text, value_text
from rigidsim.model.loads.central_gravity import CentralGravity
from rigidsim.model.plausibility import about_orbit, implied_strength
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, across, cross, norm, unit_vectors
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import GravitationalParameter, InUnit, Metre, Triple
from rigidsim.scene.orbits import KeplerOrbit, Orbit, resolve_orbit
from rigidsim.scene.registry import LoadFields, Surroundings, register_load
from rigidsim.scene.scene import Scene
from rigidsim.store.summary_parts import Caution

_FIELD_CONSTANT = "1e-7"
"""mu_0 / 4 pi, T m/A: CODATA 2022 has 0.99999999987(16) times this, measured since the SI of 2019."""

MagneticMoment = Annotated[ExactNumber, InUnit("A m^2")]
FluxDensity = Annotated[ExactNumber, InUnit("T")]


class MagneticDipoleFields(LoadFields):
    """Torque m x B on a dipole of the body, in a uniform ``field`` (space axes), or in the field of a centred
    dipole ``source_moment`` (space axes) around which the body moves on ``orbit``, or in flight as it flies.
    """

    kind: Literal["magnetic_dipole"]
    moment: Triple[MagneticMoment] = Field(
        description="magnetic moment of the body, body axes", examples=[["0 A m^2", "0 A m^2", "0.5 A m^2"]]
    )
    field: Triple[FluxDensity] | None = Field(
        default=None, description="uniform flux density, space axes", examples=[["30 uT", 0, 0]]
    )
    orbit: Orbit | None = Field(
        default=None,
        description="orbit of the source as seen from the body, instead of field; needs source_moment; not "
        "for a body with a position of its own, where which the field is taken",
    )
    source_moment: Triple[MagneticMoment] | None = Field(
        default=None, description="magnetic moment of the source, space axes", examples=[[0, 0, -7.7e22]]
    )
    position: Triple[Metre] | None = Field(
        default=None,
        description="place of the source, space axes, for a body with a position of its own; by default the "
        "point of its central_gravity",
        examples=[[0, 0, 0]],
    )
    gravitational_parameter: GravitationalParameter | None = Field(
        default=None, description="G M of the source, from which the orbit's period follows"
    )


@register_load
@dataclass(frozen=True)
class MagneticDipole(Load):
    """Torque m x B, potential -m . B (Jackson, Classical Electrodynamics, sections 5.6 and 5.7).

    The field of a centred dipole M is B = (mu_0 / 4 pi r^3) (3 (M . c) c - M) in direction c. The ``place``
    of the dipole about which the body flies (space axes, m) is empty where it is the point that attracts it.
    """

    moment: Vector  # m, body axes, A m^2 (mpf)
    source: Vector  # the field itself (T), or M (A m^2) of a dipole; space axes
    orbit: KeplerOrbit | None = None  # of the source seen from the body (which only reverses c)
    place: Vector | None = None  # None if it doesn't fly about a dipole
    Fields = MagneticDipoleFields
    title = "magnetic_dipole"
    described = "a magnetic dipole"

    @classmethod
    def resolve(cls, fields: MagneticDipoleFields, around: Surroundings) -> MagneticDipole:
        flies = around.free_flight and fields.source_moment is not None
        _refuse_contradictions(fields, around)
        strength = fields.gravitational_parameter
        if strength is not None and (fields.orbit is None or strength.sign <= 0):
            allowed = "with orbit only" if fields.orbit is None else "as a positive number only"
            raise around.fault("gravitational_parameter", f"given {float(strength):g}; allowed {allowed}")
        moment = _numbers(fields.moment, around)
        if flies:
            place = [] if fields.position is None else _numbers(fields.position, around)
            return cls(moment, _numbers(fields.source_moment or [], around), place=place)
        if fields.orbit is None:
            return cls(moment, _numbers(fields.field or [], around))
        motion = None if strength is None else strength.at(around.context)
        for key in ("body", "table"):
            if getattr(fields.orbit, key) is not None:
                what = "given for a magnetic_dipole, which takes elements alone; gravity_gradient takes a "
                raise around.fault(f"orbit.{key}", what + key)
        orbit = resolve_orbit(fields.orbit, motion, around)
        return cls(moment, _numbers(fields.source_moment or [], around), orbit)

    def acts(self) -> bool:
        return any(x != 0 for x in self.moment) and any(x != 0 for x in self.source)

    def check(self, number: int, position: Vector | None) -> None:
        if self.place and self.place == position:
            what = "the body starts at the dipole; start it elsewhere"
            raise ConfigError(Problem(f"[[loads]] number {number + 1} position", what))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude"} if self.place is None else {"attitude", "flight"})

    @property
    def uniform(self) -> bool:
        """Whether the field is the same everywhere."""
        return self.orbit is None and self.place is None

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        """Whether the field is uniform: along a flight its torque does work without a force."""
        return self.uniform

    @property
    def has_source(self) -> bool:
        return self.orbit is not None

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        return None if self.orbit is None else m.seen(m.orbit(self.orbit).direction)

    def _size(self, scene: Scene) -> Any:
        """Size of the field, T; of a dipole's, over its equator at the semi-major axis or at the start."""
        size = norm(scene.context, self.source)
        if self.uniform:
            return size
        far = self._far(scene) if self.orbit is None else self.orbit.semi_major_axis
        return scene.context.mpf(_FIELD_CONSTANT) * size / far**3

    def _centre(self, scene: Scene) -> Vector:
        """Position of the dipole about which the body flies, m; refused if it isn't told."""
        if self.place:
            return self.place
        points = [load.attracting_point for load in having(Attracting, loads_of(scene))]
        if not points or any(point != points[0] for point in points):
            found = "several points" if points else "no point at rest"
            what = f"missing; it is needed where {found} attracts the body by central_gravity"
            raise ConfigError(Problem("[[loads]] magnetic_dipole position", what))
        return points[0]

    def _far(self, scene: Scene) -> Any:
        """Distance from the dipole at the start, m."""
        pairs = zip(scene.position or [], self._centre(scene), strict=True)
        return norm(scene.context, [x - a for x, a in pairs])

    def _nearest(self, scene: Scene) -> Any:
        """Least distance from the dipole, m: that of the Kepler orbit about it, or the start's."""
        loads, centre = loads_of(scene), self._centre(scene)
        pulling = [x for x in loads if isinstance(x, CentralGravity) and x.position == centre]
        return pulling[0].nearest_approach(scene) if len(pulling) == 1 else self._far(scene)

    def _field(self, m: Kinematics) -> list[Symbolic]:
        """Field B divided by ``_size``, body axes."""
        length = norm(m.scene.context, self.source)
        unit = m.fixed([x / length for x in self.source])
        if self.uniform:
            return m.seen(unit)
        if self.orbit is None:
            c, inverse = m.seen_from(self._centre(m.scene))
            falling = (m.number(m.scene.context.ldexp(self._far(m.scene), -m.scaling.length)) * inverse) ** 3
        else:
            place = m.orbit(self.orbit)
            c, falling = place.direction, place.inverse_distance**3
        along = 3.0 * hy.sum([e * x for e, x in zip(unit, c, strict=True)])
        space = [falling * (along * x - e) for e, x in zip(unit, c, strict=True)]
        return m.seen(space)

    def _moment(self, m: Kinematics) -> Vector:
        """m times the field's size, internal units of energy."""
        size, exponent = self._size(m.scene), -m.scaling.energy
        return [m.scene.context.ldexp(x * size, exponent) for x in self.moment]

    def torque(self, m: Kinematics) -> list[Term]:
        moment, axes = self._moment(m), unit_vectors(m.scene.context)
        return [(cross(moment, axis), b) for axis, b in zip(axes, self._field(m), strict=True)]

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool:
        """Whether moment and field are both perpendicular to the axis, in a uniform field."""
        context = scene.context
        return self.uniform and across(context, self.moment, axis) and across(context, self.source, normal)

    def potential(self, m: Kinematics) -> Symbolic | None:
        pairs = zip(self._moment(m), self._field(m), strict=True)
        return -hy.sum([m.number(x) * b for x, b in pairs if x != 0])

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return (self.moment, self.source) if self.uniform else None

    def amplitude(self, scene: Scene) -> Any:
        """Largest 2 m B: of a dipole's field over its poles at pericentre."""
        size = 2 * norm(scene.context, self.moment) * self._size(scene)
        if self.uniform:
            return size
        if self.orbit is None:
            return 2 * size * (self._far(scene) / self._nearest(scene)) ** 3
        return 2 * size * (self.orbit.semi_major_axis / self.orbit.pericentre) ** 3

    def fastest_rate(self, scene: Scene) -> Any:
        """Angular rate at pericentre, rad/s; in flight that at the start."""
        if self.place is not None:
            return norm(scene.context, scene.velocity or []) / self._far(scene)
        return scene.context.zero if self.orbit is None else self.orbit.fastest_rate(scene.context)

    def told(self, scene: Scene) -> str:
        moment = f"magnetic dipole of {value_text(norm(scene.context, self.moment), 'A m^2')}"
        largest = f"torque up to {value_text(self.amplitude(scene) / 2, 'N m')}"
        if self.uniform:
            field = value_text(norm(scene.context, self.source), "T")
            return f"{moment} in a uniform field of {field}: {largest}"
        source = value_text(norm(scene.context, self.source), "A m^2")
        if self.orbit is None:
            where = f"{length_text(float(self._far(scene)))} away at the start"
        else:
            where = orbit_text(self.orbit, implied_strength(self.orbit))
        return f"{moment} in the field of a dipole of {source}, {where}; {largest}"

    def cautions(self, fields: MagneticDipoleFields, where: str, scene: Scene) -> Iterator[Caution]:
        if self.orbit is not None and fields.orbit is not None:
            yield from about_orbit(fields.orbit, self.orbit, fields.gravitational_parameter, where, scene)


def _numbers(values: list[ExactNumber], around: Surroundings) -> Vector:
    return [x.at(around.context) for x in values]


def _refuse_contradictions(fields: MagneticDipoleFields, around: Surroundings) -> None:
    """Require one field: uniform, of a dipole along an orbit, or in flight of a dipole where the body is."""
    host = around.bodies is not None and around.bodies.host is not None
    if fields.orbit is not None and (around.free_flight or host):
        why = "is one of [[bodies]]; a uniform field is allowed"
        if around.free_flight:
            why = "has a position of its own, where the field is taken: remove orbit and "
            why += "gravitational_parameter, and keep source_moment"
        raise around.fault("orbit", f"given for a body that {why}")
    other = fields.source_moment if around.free_flight else fields.orbit
    if (fields.field is None) == (other is None):
        given = "neither field nor" if fields.field is None else "both field and"
        name, why = ("source_moment", " for a body with a position") if around.free_flight else ("orbit", "")
        raise around.fault("field", f"given {given} {name}; exactly one of them is needed{why}")
    if not around.free_flight and (fields.source_moment is None) != (fields.orbit is None):
        what = "missing; it is needed with orbit" if fields.orbit else "given without orbit; remove it"
        raise around.fault("source_moment", what)
    if fields.position is not None and not (around.free_flight and fields.source_moment is not None):
        what = "given; allowed with source_moment, for a body with [initial] position and velocity"
        raise around.fault("position", what)
