"""Magnetic dipole: a moment of the body in a uniform field, or in that of a dipole about which it moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.capabilities import Attracting, SourcePlace, having
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term, loads_of
from rigidsim.model.load_words import length_text, orbit_text, value_text
from rigidsim.model.loads.central_gravity import CentralGravity
from rigidsim.model.loads.magnetic_keys import MagneticDipoleFields, numbers, refuse_contradictions
from rigidsim.model.magnetic_names import FIELD_NAMES
from rigidsim.model.names import written
from rigidsim.model.plausibility import about_orbit, implied_strength
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, across, cross, diagonal, dot, norm, unit_vectors
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Constant, Expression, ExpressionError, evaluate, states_read
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.orbits import KeplerOrbit, resolve_orbit
from rigidsim.scene.registry import Surroundings, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import narrow_parts, root_parts
from rigidsim.store.summary_parts import Caution

_FIELD_CONSTANT = "1e-7"
"""mu_0 / 4 pi, T m/A: CODATA 2022 has 0.99999999987(16) times this, measured since the SI of 2019."""


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
    name: str = ""
    Fields = MagneticDipoleFields
    title = "magnetic_dipole"
    described = "a magnetic dipole"

    @classmethod
    def resolve(cls, fields: MagneticDipoleFields, around: Surroundings) -> MagneticDipole:
        flies = around.free_flight and fields.source_moment is not None
        refuse_contradictions(fields, around)
        strength = fields.gravitational_parameter
        if strength is not None and (fields.orbit is None or strength.sign <= 0):
            allowed = "with orbit only" if fields.orbit is None else "as a positive number only"
            raise around.fault("gravitational_parameter", f"given {float(strength):g}; allowed {allowed}")
        made: Callable[..., MagneticDipole] = partial(cls, name=fields.name or "")
        if any(isinstance(x, str) for x in fields.moment):
            moment, law = [around.context.zero] * 3, _law(fields.moment, around)
            made = partial(SteeredDipole, name=fields.name or "", law=law, number=around.number)
        else:
            moment = numbers(fields.moment, around)
        if flies:
            place = [] if fields.position is None else numbers(fields.position, around)
            return made(moment, numbers(fields.source_moment or [], around), place=place)
        if fields.orbit is None:
            return made(moment, numbers(fields.field or [], around))
        motion = None if strength is None else strength.at(around.context)
        for key in ("body", "table"):
            if getattr(fields.orbit, key) is not None:
                what = "given for a magnetic_dipole, which takes elements alone; gravity_gradient takes a "
                raise around.fault(f"orbit.{key}", what + key)
        orbit = resolve_orbit(fields.orbit, motion, around)
        return made(moment, numbers(fields.source_moment or [], around), orbit)

    def acts(self) -> bool:
        return any(x != 0 for x in self.moment) and any(x != 0 for x in self.source)

    def read_by(self, names: frozenset[str]) -> bool:
        """On an orbit, whose states it brings: its field, or names of its source."""
        own = f"_{self.name} " if self.name else " no name "
        return self.orbit is not None and any(x in FIELD_NAMES or own in f"{x} " for x in names)

    def check(self, number: int, position: Vector | None) -> None:
        if self.place and self.place == position:
            what = "the body starts at the dipole; start it elsewhere"
            raise ConfigError(Problem(f"[[loads]] number {number + 1} position", what))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        if not self.acts():
            return frozenset()
        return frozenset({"attitude"} if self.place is None else {"attitude", "flight"})

    @property
    def uniform(self) -> bool:
        """Whether the field is the same everywhere."""
        return self.orbit is None and self.place is None

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        """Whether the field is uniform: along a flight its torque does work without a force."""
        return self.uniform or not self.acts()

    @property
    def has_source(self) -> bool:
        return self.orbit is not None

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        return None if self.orbit is None else m.seen(m.orbit(self.orbit).direction)

    # --- its field, and where it is from --------------------------------------------------------------------

    def source_place(self, m: Kinematics) -> SourcePlace:
        if self.orbit is not None:
            orbit = m.orbit(self.orbit)
            return SourcePlace(orbit.direction, orbit.inverse_distance, self.orbit.semi_major_axis)
        outward, inverse = m.seen_from(self._centre(m.scene))
        unit = m.scene.context.ldexp(m.scene.context.one, m.scaling.length)
        return SourcePlace([-x for x in outward], inverse, unit)

    def source_at_start(self, scene: Scene) -> Vector:
        if self.orbit is not None:
            return self.orbit.place(scene.context, scene.start)
        return [a - x for x, a in zip(scene.position or [], self._centre(scene), strict=True)]

    def flux_density(self, m: Kinematics) -> list[Symbolic]:
        if all(x == 0 for x in self.source):
            return [hy.expression(0.0)] * 3
        size = rounded(m.number(self._size(m.scene)))
        return [size * x for x in self._field(m)]

    def flux_density_at_start(self, scene: Scene) -> Vector:
        if self.uniform:
            return self.source
        place, context = self.source_at_start(scene), scene.context
        far = norm(context, place)
        along, size = dot(self.source, place) / far, context.mpf(_FIELD_CONSTANT) / far**3
        return [size * (3 * along * x / far - e) for e, x in zip(self.source, place, strict=True)]

    def same_field(self, other: object) -> bool:
        """Whether another load gives the same field once more."""
        own = self.source, self.orbit, self.place
        return isinstance(other, MagneticDipole) and own == (other.source, other.orbit, other.place)

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
        if not self.acts():
            return []
        moment, axes = self._moment(m), unit_vectors(m.scene.context)
        return [(cross(moment, axis), b) for axis, b in zip(axes, self._field(m), strict=True)]

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool:
        """Whether moment and field are both perpendicular to the axis, in a uniform field."""
        context = scene.context
        return self.uniform and across(context, self.moment, axis) and across(context, self.source, normal)

    def potential(self, m: Kinematics) -> Symbolic | None:
        if not self.acts():
            return None
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
        moment, largest = self._words(scene)
        if self.uniform:
            field = value_text(norm(scene.context, self.source), "T")
            return f"{moment} in a uniform field of {field}: {largest}"
        source = value_text(norm(scene.context, self.source), "A m^2")
        if self.orbit is None:
            where = f"{length_text(float(self._far(scene)))} away at the start"
        else:
            where = orbit_text(self.orbit, implied_strength(self.orbit))
        return f"{moment} in the field of a dipole of {source}, {where}; {largest}"

    def _words(self, scene: Scene) -> tuple[str, str]:
        """What the moment is, and what it does."""
        moment = f"magnetic dipole of {value_text(norm(scene.context, self.moment), 'A m^2')}"
        return moment, f"torque up to {value_text(self.amplitude(scene) / 2, 'N m')}"

    def cautions(self, fields: MagneticDipoleFields, where: str, scene: Scene) -> Iterator[Caution]:
        if self.orbit is not None and fields.orbit is not None:
            yield from about_orbit(fields.orbit, self.orbit, fields.gravitational_parameter, where, scene)


@dataclass(frozen=True)
class SteeredDipole(MagneticDipole):
    """A moment given by expressions, as by a law of magnetorquers."""

    law: tuple[Expression, ...] = ()  # its components, A m^2, body axes
    number: int = 0  # place in the config, for messages
    described = "a magnetic dipole given by expressions"
    conservative = False

    def acts(self) -> bool:
        return any(x != 0 for x in self.source)

    def read_by(self, names: frozenset[str]) -> bool:
        return False

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return super().reads.union(*map(states_read, self.law))

    def formulas(self) -> Iterator[tuple[str, Expression]]:
        for i, component in enumerate(self.law):
            yield f"[[loads]] number {self.number + 1} moment[{i}]", component

    def torque(self, m: Kinematics) -> list[Term]:
        size = m.scene.context.ldexp(self._size(m.scene), -m.scaling.energy)
        return list(zip(diagonal([size] * 3), cross(written(m, self.law), self._field(m)), strict=True))

    def potential(self, m: Kinematics) -> Symbolic | None:
        return None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return None

    def keeps_plane(self, scene: Scene, axis: Vector, normal: Vector) -> bool:
        return False

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        return written(m, (part for component in self.law for part in narrow_parts(component)))

    def roots(self, m: Kinematics) -> list[Symbolic]:
        return written(m, (part for component in self.law for part in root_parts(component)))

    def amplitude(self, scene: Scene) -> Any | None:
        return None

    def _words(self, scene: Scene) -> tuple[str, str]:
        values, context = start_values(scene), scene.context
        size = norm(context, [evaluate(component, values, context) for component in self.law])
        shown = ", ".join(component.text for component in self.law)
        return f"magnetic dipole of [{shown}] A m^2", f"{value_text(size, 'A m^2')} at the start"


def _law(given: list[Any], around: Surroundings) -> tuple[Expression, ...]:
    """Components of a moment, of which some are expressions."""
    found = []
    for i, x in enumerate(given):
        if isinstance(x, ExactNumber):
            found.append(Expression("", Constant(x, (0, 0))))
            continue
        try:
            found.append(parse_expression(x, around.names, parameters=around.parameters, unit="A m^2"))
        except ExpressionError as error:
            raise around.fault(f"moment[{i}]", str(error)) from None
    return tuple(found)
