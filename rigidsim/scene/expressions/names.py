"""What an expression may read, besides numbers and ``[parameters]``: names, and who provides them.

A scene has the names that its providers give for its config: time and the body's own always, others with what
brings them, such as names of a flight with a position in ``[initial]``. Whoever brings something that others
may read registers a provider: one class, in a file with what it speaks of. That is all: the parser checks its
units, an expression that reads it is tried at the start, and its kinks and jumps become surfaces. For the
distance ``r_NAME`` of a named source, say:

    @provides
    class Distances(NameProvider):
        brings = "r_NAME with a load that has this name"

        def names(self, config):
            return [Readable(f"r_{x.name}", "m") for x in config.loads if getattr(x, "name", None)]

        def at_start(self, scene):
            return {f"r_{x.name}": x.distance_at_start(scene) for x in scene.loads if ...}

        def expressions(self, m, names):
            return {name: ... in SI ... for name in names}

``names`` knows the config alone, because loads and states are worked out with the names; ``at_start`` knows
the scene, in mpf. If a value takes states that are carried by need only, ``Readable.states`` says which.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from rigidsim.errors import ConfigError, Problem

PLACES = "places of sources"
"""In ``Readable.states``: carried with a load, and known to no average over the rotation."""

P = TypeVar("P", bound="type[NameProvider]")


@dataclass(frozen=True)
class Readable:
    """What a name in an expression stands for.

    Attributes:
        unit: its SI unit; empty for numbers and angles, None if it isn't known.
        states: those without which it has no value, carried by need: "attitude", "flight", or the name of a
            user-defined state.
        bound: of its absolute value; of an angle that turns, within one turn.
        changes_sign: with the quaternion's sign, which means nothing.
        turns: whether it is an angle that is continued over full turns.
        jumps: what to do about it, if it isn't continuous: no event can read it then.
        long: whether its expression is too long to be compiled unrolled.
        formula: what it is written out as, in terms of ``parts``, if it has kinks or jumps.
    """

    name: str
    unit: str | None = ""
    states: frozenset[str] = frozenset()
    bound: float = float("inf")
    changes_sign: bool = False
    turns: bool = False
    jumps: str = ""
    long: bool = False
    formula: str = ""
    parts: Mapping[str, Readable] = field(default_factory=dict, compare=False)


class NameProvider:
    """A family of names in expressions.

    Attributes:
        brings: its names and what brings them, for the message about an unknown name in a scene without any.
    """

    brings = ""

    def names(self, config: Any) -> Iterable[Readable]:
        """The names that scenes of this config have, in the order in which messages list them."""
        raise NotImplementedError

    def elsewhere(self, config: Any) -> str:
        """What would bring further names; empty if scenes of this config have them all."""
        return "" if list(self.names(config)) else self.brings

    def at_start(self, scene: Any) -> Mapping[str, Any]:
        """Their values at the start of a scene (mpf, SI)."""
        raise NotImplementedError

    def at_random(self, scene: Any, start: Mapping[str, Any], generator: random.Random) -> Mapping[str, Any]:
        """Values at a random state similar to the start, where expressions are compared.

        Args:
            start: what ``at_start`` gave.
        """
        draw, number = generator.uniform, scene.context.mpf
        return {name: x * number(draw(0.5, 2)) + number(draw(-1, 1)) for name, x in start.items()}

    def expressions(self, m: Any, names: Collection[str]) -> Mapping[str, Any]:
        """heyoka expressions of the state, SI, for its names that are asked for.

        Args:
            m: the ``rigidsim.model.kinematics.Kinematics``, in internal units.
        """
        raise NotImplementedError


class Names(dict[str, Readable]):
    """The names that expressions of a scene may read; ``elsewhere``: what would bring others."""

    elsewhere: tuple[str, ...] = ()


PROVIDERS: list[NameProvider] = []
"""All providers of names; the body's own first."""


def origin(kind: type) -> str:
    """Where a class was defined: equal for a class that is defined anew, as in a notebook."""
    return f"{kind.__module__}.{kind.__qualname__}"


def provides(kind: P) -> P:
    """Register a provider of names (a class decorator); the same class defined anew replaces the older."""
    PROVIDERS[:] = [x for x in PROVIDERS if origin(type(x)) != origin(kind)]
    PROVIDERS.append(kind())
    return kind


def names_of(config: Any) -> Names:
    """The names that expressions of a config may read.

    Raises:
        ConfigError: two things of one name.
    """
    known = Names()
    bringing: dict[str, str] = {}
    elsewhere = []
    for provider in PROVIDERS:
        elsewhere.append(provider.elsewhere(config))
        for readable in provider.names(config):
            if readable.name in known:
                raise ConfigError(_taken(config, readable.name, (bringing[readable.name], provider.brings)))
            known[readable.name], bringing[readable.name] = readable, provider.brings
    for name in known:
        if name in config.parameters:
            what = f'given the name "{name}", which expressions of this scene use already; rename it'
            raise ConfigError(Problem(f"[parameters] {name}", what))
    known.elsewhere = tuple(filter(None, elsewhere))
    return known


def _taken(config: Any, name: str, brings: tuple[str, str]) -> Problem:
    """Where a name is given that another thing has in expressions; ``brings`` of both providers."""
    both = "; ".join(filter(None, brings))
    what = f'two things are called "{name}" in expressions ({both}); rename one'
    found = [f"[[{where}]] number {i + 1} name" for where, i, x in config.every_state if x.name == name]
    return Problem(found[-1] if found else "names", what)


# --- time and the body's own --------------------------------------------------------------------------------

RATE_NAMES = ("wx", "wy", "wz")
QUATERNION_NAMES = ("qw", "qx", "qy", "qz")
EULER_NAMES = ("phi", "theta", "psi")
POSITION_NAMES = ("x", "y", "z")
VELOCITY_NAMES = ("vx", "vy", "vz")
_ATTITUDE, _FLIGHT = frozenset({"attitude"}), frozenset({"flight"})

BODY_NAMES: Mapping[str, Readable] = {
    x.name: x
    for x in (
        Readable("t", "s"),
        *(Readable(name, "rad/s") for name in RATE_NAMES),
        *(Readable(name, "", _ATTITUDE, 1, changes_sign=True) for name in QUATERNION_NAMES),
        *(Readable(name, "", _ATTITUDE, 4, turns=name != "theta") for name in EULER_NAMES),
        *(Readable(name, "m", _FLIGHT) for name in POSITION_NAMES),
        *(Readable(name, "m/s", _FLIGHT) for name in VELOCITY_NAMES),
    )
}
"""Time and the body's own names, which nothing else may have in any scene."""
