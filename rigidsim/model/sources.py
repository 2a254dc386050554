"""Names of sources in expressions: where the body sees the source of a load that has a name.

Directions are in body axes and take the attitude; distances don't, and neither do shadows.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import apply, transpose
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, norm
from rigidsim.scene.arithmetic import apply as apply_numbers
from rigidsim.scene.arithmetic import transpose as transposed
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import names_used
from rigidsim.scene.registry import LoadFields
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config

_AXES = "xyz"


@dataclass(frozen=True)
class SeenSource:
    """A load whose source is at a known place.

    Attributes:
        number: place of the load in ``[[loads]]``, from 0.
        fields: its keys in the config.
        states: those that the place takes, see ``Readable.states``.
    """

    number: int
    fields: LoadFields
    states: frozenset[str]

    @property
    def name(self) -> str:
        """Empty for a load without one."""
        return self.fields.name or ""

    @property
    def extended(self) -> bool:
        """Whether its radius is given."""
        return getattr(self.fields, "radius", None) is not None

    def radius(self, context: Any) -> Any:
        """Radius of the source, m (mpf)."""
        return self.fields.radius.at(context)  # type: ignore[attr-defined]

    def of(self, scene: Scene) -> Any:
        """The load itself."""
        return scene.given_loads[self.number]


def sources_of(config: Config) -> list[SeenSource]:
    """All loads of a config whose sources are at known places."""
    flies, found = free_flight(config), []
    for number, fields in enumerate(config.loads):
        states = fields.placed_by(free_flight=flies)
        if states is not None:
            found.append(SeenSource(number, fields, states | {PLACES}))
    return found


def free_flight(config: Config) -> bool:
    """Whether the body has a position."""
    return config.initial.flies


def read_in(scene: Scene) -> frozenset[str]:
    """Names that any of a scene's expressions reads."""
    return names_used(*scene.formulas())


def in_body_axes(scene: Scene, space: Vector) -> Vector:
    """A vector of space axes at the start (mpf), in body axes."""
    return apply_numbers(transposed(rotation_matrix(scene.quaternion)), space)


@provides
class SourceNames(NameProvider):
    """Direction of each named source and its distance."""

    brings = "ux_NAME, uy_NAME, uz_NAME, r_NAME with a load that has this name and a source at a known place"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        for source in _named(config):
            for axis in _AXES:
                yield Readable(f"u{axis}_{source.name}", "", source.states | {"attitude"}, 1)
            yield Readable(f"r_{source.name}", "m", source.states)

    def elsewhere(self, config: Config) -> str:
        """Any load may have a name."""
        return self.brings

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """Of those that are read: the series of an ephemeris takes a while."""
        found: dict[str, Any] = {}
        read = read_in(scene)
        for source in _named(scene.config):
            directions, far = _names(source)
            if read & {*directions, far}:
                place = source.of(scene).source_at_start(scene)
                distance = norm(scene.context, place)
                found |= zip(directions, in_body_axes(scene, [x / distance for x in place]), strict=True)
                found[far] = distance
        return found

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any directions, and distances about as large as at the start."""
        found: dict[str, Any] = {}
        for source in _named(scene.config):
            directions, far = _names(source)
            if far in start:
                vector = [scene.context.mpf(generator.gauss(0, 1)) for _ in _AXES]
                size = norm(scene.context, vector)
                found |= zip(directions, [x / size for x in vector], strict=True)
                found[far] = start[far] * scene.context.mpf(generator.uniform(0.5, 2))
        return found

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        found: dict[str, Any] = {}
        for source in _named(m.scene.config):
            directions, far = _names(source)
            if not {*directions, far} & set(names):
                continue
            place = source.of(m.scene).source_place(m)
            found[far] = hy.expression(rounded(m.number(place.unit))) / place.inverse
            if set(directions) & set(names):
                found |= zip(directions, apply(transpose(m.matrix), place.direction), strict=True)
        return found


def _named(config: Config) -> Iterator[SeenSource]:
    return (source for source in sources_of(config) if source.name)


def _names(source: SeenSource) -> tuple[list[str], str]:
    return [f"u{axis}_{source.name}" for axis in _AXES], f"r_{source.name}"
