"""A magnetic field as loads know it: uniform, of a dipole along an orbit or in flight, or the Earth's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, SourcePlace, loads_of
from rigidsim.model.load_words import length_text, value_text
from rigidsim.model.loads.central_gravity import CentralGravity
from rigidsim.model.loads.earth_field import EarthField
from rigidsim.model.loads.magnetic_keys import (
    IGRF,
    MagneticFieldFields,
    field_parts,
    numbers,
    refuse_contradictions,
)
from rigidsim.model.magnetic_names import FIELD_NAMES
from rigidsim.model.plausibility import about_orbit
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, dot, norm
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.cautions import Caution
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.orbits import KeplerOrbit, resolve_orbit
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain

_FIELD_CONSTANT = "1e-7"
"""mu_0 / 4 pi, T m/A: CODATA 2022 has 0.99999999987(16) times this, measured since the SI of 2019."""


@dataclass(frozen=True, kw_only=True)
class InMagneticField(Load):
    """Base of loads by a magnetic field (Jackson, Classical Electrodynamics, sections 5.6 and 5.7).

    The field of a centred dipole M is B = (mu_0 / 4 pi r^3) (3 (M . c) c - M) in direction c. The ``place``
    of the dipole about which the body flies (space axes, m) is empty where it is the point that attracts it.
    """

    source: Vector  # the field itself (T), or M (A m^2) of a dipole; space axes
    orbit: KeplerOrbit | None = None  # of the source seen from the body (which only reverses c)
    place: Vector | None = None  # None if it doesn't fly about a dipole
    name: str = ""
    earth: EarthField | None = None  # whose field it is; the source is then its dipole at time 0
    magnetic = True

    @classmethod
    def field_of(cls, fields: MagneticFieldFields, around: Setting) -> dict[str, Any]:
        """What the keys say of the field, worked out: source, orbit, place and name."""
        flies = around.free_flight and fields.of_place
        refuse_contradictions(fields, around)
        strength = fields.gravitational_parameter
        if strength is not None and (fields.elements is None or strength.sign <= 0):
            allowed = "with an orbit only" if fields.elements is None else "as a positive number only"
            raise around.fault("gravitational_parameter", f"given {float(strength):g}; allowed {allowed}")
        found: dict[str, Any] = {"name": fields.name or ""}
        if fields.field == IGRF:
            earth = EarthField.of(fields, around)
            found |= {"earth": earth, "source": earth.dipole(around.context.mpf(_FIELD_CONSTANT))}
        elif flies or fields.elements is not None:
            found["source"] = numbers(fields.source_moment or [], around)
        else:
            found["source"] = numbers(cast("list[ExactNumber]", fields.field), around)
        if flies:
            found["place"] = [] if fields.position is None else numbers(fields.position, around)
            if found["place"] == around.position:
                raise around.fault("position", "the body starts at the dipole; start it elsewhere")
        elif fields.elements is not None:
            motion = None if strength is None else strength.at(around.context)
            for key in ("body", "table"):
                if getattr(fields.elements, key, None) is not None:
                    what = f"given for a {fields.kind}, which takes elements alone; gravity_gradient takes a "
                    raise around.fault(f"{fields.elements.key}.{key}", what + key)
            found["orbit"] = resolve_orbit(fields.elements, motion, around)
        return found

    @staticmethod
    def effect_parts(fields: MagneticFieldFields) -> Iterator[EffectPart]:
        return field_parts(fields)

    def read_by(self, names: frozenset[str]) -> bool:
        """On an orbit, whose states it brings: its field, or names of its source."""
        own = f"_{self.name} " if self.name else " no name "
        return self.orbit is not None and any(x in FIELD_NAMES or own in f"{x} " for x in names)

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
    def wide(self) -> bool:  # type: ignore[override]
        """Whether its expressions are too long to be unrolled: those of an Earth that turns take seconds."""
        return self.earth is not None

    @property
    def has_source(self) -> bool:  # type: ignore[override]
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
        if self.earth is not None:
            return self.earth.at(context, [-x for x in place], scene.start)
        far = norm(context, place)
        along, size = dot(self.source, place) / far, context.mpf(_FIELD_CONSTANT) / far**3
        return [size * (3 * along * x / far - e) for e, x in zip(self.source, place, strict=True)]

    def same_field(self, other: object) -> bool:
        """Whether another load gives the same field once more."""
        own = self.source, self.orbit, self.place, self.earth
        return isinstance(other, InMagneticField) and own == (
            other.source, other.orbit, other.place, other.earth,
        )  # fmt: skip

    def most(self, scene: Scene) -> Any:
        """Largest field, T: of a dipole over its poles at pericentre."""
        if self.earth is not None:
            return self.earth.most(self._nearest(scene))
        size = self._size(scene)
        if self.uniform:
            return size
        if self.orbit is None:
            return 2 * size * (self._far(scene) / self._nearest(scene)) ** 3
        return 2 * size * (self.orbit.semi_major_axis / self.orbit.pericentre) ** 3

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
            return self._checked(self.place, scene)
        points = [load.attracting_point for load in loads_of(scene) if load.attracting_point is not None]
        if not points or any(point != points[0] for point in points):
            found = "several points" if points else "no point at rest"
            what = f"missing; it is needed where {found} attracts the body by central_gravity"
            raise ConfigError(Problem(f"[[loads]] {self.title} position", what))
        return self._checked(points[0], scene)

    def _checked(self, centre: Vector, scene: Scene) -> Vector:
        """The place; refused where the Earth's field is that of another body, or the body starts inside."""
        if self.earth is None:
            return centre
        where, given = f"[[loads]] {self.title} field", f'given "{IGRF}", the Earth\'s, '
        for load in loads_of(scene):
            if not isinstance(load, CentralGravity) or load.position != centre:
                continue
            if not EARTH.attracts_by(load.strength):
                what = f"where {value_text(load.strength, 'm^3/s^2')} attracts the body, which isn't the "
                what += f"Earth; give source_moment, or {EARTH.gravitational_parameter:g} m^3/s^2"
                raise ConfigError(Problem(where, given + what))
        far = norm(scene.context, [x - a for x, a in zip(scene.position or [], centre, strict=True)])
        if self.earth.within(far):
            what = f"but the body starts {length_text(float(plain(far)))} from its centre, inside it; check "
            raise ConfigError(Problem(where, f"{given}{what}[initial] position and its unit"))
        return centre

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
        if self.earth is not None:
            return m.seen(self.earth.over(m, self._centre(m.scene), self._size(m.scene)))
        if self.orbit is None:
            c, inverse = m.seen_from(self._centre(m.scene))
            falling = (m.number(m.scene.context.ldexp(self._far(m.scene), -m.scaling.length)) * inverse) ** 3
        else:
            place = m.orbit(self.orbit)
            c, falling = place.direction, place.inverse_distance**3
        along = 3.0 * hy.sum([e * x for e, x in zip(unit, c, strict=True)])
        space = [falling * (along * x - e) for e, x in zip(unit, c, strict=True)]
        return m.seen(space)

    def fastest_rate(self, scene: Scene) -> Any:
        """Angular rate at pericentre, rad/s; in flight that at the start."""
        if self.place is not None:
            return norm(scene.context, scene.velocity or []) / self._far(scene)
        return scene.context.zero if self.orbit is None else self.orbit.fastest_rate(scene.context)

    def cautions(self, fields: MagneticFieldFields, where: str, scene: Scene) -> Iterator[Caution]:
        if self.orbit is not None and fields.elements is not None:
            yield from about_orbit(fields.elements, self.orbit, fields.gravitational_parameter, where, scene)
