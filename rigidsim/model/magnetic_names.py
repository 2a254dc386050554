"""``bx by bz``: the magnetic field where the body is, body axes."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.sources import free_flight, in_body_axes, read_in
from rigidsim.scene.arithmetic import norm
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.registry import LOADS
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config

FIELD_NAMES = ("bx", "by", "bz")


@provides
class FieldNames(NameProvider):
    """The sum of all fields, in which one that several loads give counts once."""

    brings = "bx, by, bz with the field of a magnetic_dipole"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        flies, states, found = free_flight(config), {"attitude", PLACES}, False
        for fields in config.loads:
            if LOADS["kind"][fields.kind].magnetic:  # type: ignore[attr-defined]
                found, states = True, states | (fields.placed_by(free_flight=flies) or set())
        return (Readable(name, "T", frozenset(states)) for name in FIELD_NAMES if found)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if not read_in(scene) & set(FIELD_NAMES):
            return {}
        found = [load.flux_density_at_start(scene) for load in _fields_of(scene)]
        return dict(zip(FIELD_NAMES, in_body_axes(scene, _total(found)), strict=True))

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any field, about as large as at the start."""
        size = norm(scene.context, list(start.values())) if start else scene.context.zero
        return {name: size * scene.context.mpf(generator.gauss(0, 1)) for name in start}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if not set(names) & set(FIELD_NAMES):
            return {}
        found = [load.flux_density(m) for load in _fields_of(m.scene)]
        return dict(zip(FIELD_NAMES, _total(found), strict=True))


def _total(vectors: list[list[Any]]) -> list[Any]:
    return [sum(x[1:], x[0]) for x in zip(*vectors, strict=True)]


def _fields_of(scene: Scene) -> list[Any]:
    found: list[Any] = []
    for load in scene.given_loads:
        if load.magnetic and not any(load.same_field(x) for x in found):
            found.append(load)
    return found
