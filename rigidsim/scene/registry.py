"""Loads as a scene knows them, what their keys are worked out against, and the registries.

These are empty here: files of ``rigidsim.model`` that define a load or an observable register it, so that a
config, a schema or a message never needs a second list of names.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

from pydantic import Field

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Matrix, Vector
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Names, origin
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Expression, ExpressionError
from rigidsim.scene.fields import ConfigTable, Metre, Positive, VariableName
from rigidsim.scene.frame import Figure
from rigidsim.scene.kernels.reading import Ephemeris, RelativeEphemeris
from rigidsim.scene.point_masses import PointMasses


class LoadFields(ConfigTable):
    """Base of the keys that one kind of load takes; each adds ``kind: Literal["name"]``."""

    brings_state: ClassVar[bool] = False
    """whether it carries a state that is named after it"""
    name: VariableName | None = Field(None, examples=["sun"])
    """name of the load; expressions can then read ux_NAME uy_NAME uz_NAME r_NAME shadow_NAME"""

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        """States of the body (``Readable.states``) that the place of its source as seen from there depends
        on; None if there is no source at a known place.
        """
        return None

    def brought_states(self) -> Sequence[BroughtState]:
        """States that the load carries, which expressions read by their names."""
        return []


@dataclass(frozen=True)
class BroughtState:
    """A state that a load carries, by an expression of its value at the start and of its rate of change."""

    name: str
    unit: str
    initial: str
    derivative: str
    parameters: Mapping[str, ExactNumber]  # of both, besides [parameters]


class SourceFields(LoadFields):
    """Keys of a load whose source is a body at a known place."""

    radius: Positive[Metre] | None = Field(None, examples=["6378.137 km"])
    """radius of the source, for shadow_NAME and altitude in expressions; forces are a point's"""

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        """States of a flight, if its source is a body that moves by itself."""
        orbit = getattr(self, "orbit", None)
        relative = free_flight and orbit is not None and orbit.body is not None
        return frozenset({"flight"} if relative else ())


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What is known of a scene before its loads, events and states: these are worked out against it.

    Attributes:
        config: the whole config, validated.
        context: the scene's arithmetic, in which numbers are mpf, in SI units.
        body: the rigid body at the start.
        start, end: of the run, s.
        axes, epoch: what the space axes and time 0 are, if the config says so or a load implies it.
        position, velocity: of the centre of mass, space axes; None unless the body moves freely.
        names: what expressions may read.
        bodies: point masses besides the body; None if there are none.
        ephemeris: where bodies of a kernel are; None without one.
        host: the body of the kernel that this one is; empty for none.
        figure: the body's figure axis, see ``[frame] figure_axis``.
        table, number: the array of tables, and the place in it counted from 0, of what is being worked out.
    """

    config: Any
    context: Any
    body: RigidBody
    start: Any
    end: Any
    axes: str | None
    epoch: Epoch | None
    position: Vector | None
    velocity: Vector | None
    names: Names
    bodies: PointMasses | None
    ephemeris: Ephemeris | None
    host: str
    figure: Figure
    table: str = "loads"
    number: int = 0

    @property
    def free_flight(self) -> bool:
        """Whether the body moves with six degrees of freedom."""
        return self.position is not None

    def at(self, table: str, number: int) -> Setting:
        """The same for what stands at a place of an array of tables."""
        return replace(self, table=table, number=number)

    def where(self, key: str) -> str:
        """The place of a key of what is being worked out, for messages."""
        return f"[[{self.table}]] number {self.number + 1} {key}".rstrip()

    def fault(self, key: str, text: str) -> ConfigError:
        """The error that names a key of what is being worked out."""
        return ConfigError(Problem(self.where(key), text))

    def expression(self, key: str, text: str, unit: str | None = None, **options: Any) -> Expression:
        """The expression of a key, see ``parse_expression``; an error in it names the key."""
        options = {"parameters": self.config.parameters, "unit": unit, "where": self.where(key), **options}
        try:
            return parse_expression(text, self.names, **options)
        except ExpressionError as error:
            raise self.fault(key, str(error)) from None


@dataclass(frozen=True)
class EffectPart:
    """Part of what a load does, from ``SceneLoad.effect_parts``.

    Attributes:
        name: short; after the load's own name, its code.
        words: what it is.
        without: keys of the load's table with the values that leave it out; None removes a key.
        wider: names of parts of the same load that contain it.
        missing: why a scene has none of it, if so.
    """

    name: str
    words: str
    without: Mapping[str, Any] = field(default_factory=dict)
    wider: tuple[str, ...] = ()
    missing: str = ""


def degree_parts(
    degrees: Sequence[int],
    words: str,
    without: Callable[[int], Mapping[str, Any]],
    prefix: str = "degree",
    wider: tuple[str, ...] = (),
) -> Iterator[EffectPart]:
    """Each degree of a field together with those above it.

    Args:
        degrees: rising.
        without: keys that leave out a degree and those above it.
    """
    for place, n in reversed(list(enumerate(degrees))):
        which = f"degrees {n} to {degrees[-1]}" if n < degrees[-1] else f"degree {n}"
        contain = *wider, *(f"{prefix}-{d}" for d in degrees[:place])
        yield EffectPart(f"{prefix}-{n}", f"{which} {words}", without(n), contain)


class SceneLoad:
    """A load as the scene knows it; ``rigidsim.model.load.Load`` adds the mechanics.

    Attributes:
        Fields: its keys in a config; None for a load that only Python gives.
        title: name used in reasons and messages.
        uniform_field: acceleration (mpf, m/s^2, space axes) of a field that is the same everywhere; such
            loads add up to the scene's gravity. None for all others.
        axes: what the space axes are in its own equations; None if these hold in any axes.
        epoch: date of time 0 in its own equations; None if these have none.
        apart: tensor of inertia (mpf, kg m^2, body axes) of what doesn't turn with the body, a fluid core or
            a rotor about its axis, which is part of the body's own; None for all others.
        inner_momentum: angular momentum relative to the body at the start (mpf, body axes); None for none.
        sights: bodies of a kernel that it sees, each with the highest derivative of its place that is to be
            a state.
        nothing: keys of its table in ``[body]`` with values that make it nothing, where a preset brings it.
    """

    Fields: ClassVar[type[LoadFields] | None] = None
    title: str = "load"
    uniform_field: Vector | None = None
    axes: str | None = None
    epoch: Epoch | None = None
    apart: Matrix | None = None
    inner_momentum: Vector | None = None
    sights: tuple[tuple[RelativeEphemeris, int], ...] = ()
    nothing: ClassVar[Mapping[str, Any]] = {}

    @classmethod
    def resolve(cls, fields: Any, around: Setting) -> SceneLoad:
        """The load that the keys describe, every number worked out.

        Args:
            fields: an instance of ``Fields``; the whole config for a load that a key of ``[body]`` brings.

        Raises:
            ConfigError: a contradiction or a value out of range.
        """
        raise NotImplementedError

    @classmethod
    def beside_of(cls, load: SceneLoad, fields: Any, around: Setting) -> SceneLoad | None:
        """The load that a key of another load brings with it, on the same source; None where the key's
        value brings none.

        Args:
            load: the one that has the key, resolved.
            fields: its keys.

        Raises:
            ConfigError: the key contradicts something else.
        """
        raise NotImplementedError

    @classmethod
    def brought_by(cls, config: Any) -> bool:
        """Whether ``[body]`` of a config brings a load that is registered for one of its keys."""
        return True

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        """Parts of what it does that a scene can be without, wider ones after what they contain.

        Args:
            fields: as for ``resolve``.
        """
        yield from ()

    @staticmethod
    def without_loads(config: Any, names: Collection[str]) -> Mapping[str, Any]:
        """Keys of its table in ``[body]`` to be changed where ``[[loads]]`` of these names are left out."""
        return {}

    def acts(self) -> bool:
        """False for a load that is always zero."""
        return True

    def read_by(self, names: frozenset[str]) -> bool:
        """Whether one that is always zero is carried all the same, for what expressions read of it."""
        return False

    def with_point_masses(self, masses: PointMasses) -> SceneLoad:
        """The load where the point masses are elsewhere: itself, unless its source is one of them."""
        return self

    def with_partner(self, partner: Sequence[Vector]) -> SceneLoad:
        """The load with a second body's start that was found (see ``InitialRotation``)."""
        return self

    def pictured(self) -> dict[str, Any] | None:
        """The load's depiction as plain JSON values (see ``rigidsim.look.record``); None if it isn't
        drawn.
        """
        return None

    def formulas(self) -> list[Expression]:
        """Its expressions, to be tried at the start: those that are attributes, alone or in tuples."""
        values = (x if isinstance(x, tuple) else (x,) for x in vars(self).values())
        return [x for each in values for x in each if isinstance(x, Expression)]

    def never_negative(self) -> list[Expression]:
        """Expressions for what no body or medium has below zero."""
        return []


LOADS: dict[str, dict[str, Any]] = {"kind": {}, "table": {}, "body": {}, "beside": {}}
"""Classes of loads by where their keys stand, and by name there: kinds of ``[[loads]]``, arrays of tables of
their own such as ``[[rotors]]``, keys of ``[body]``, and keys of loads that bring another beside these
(``beside_of``).
"""

OBSERVABLES: dict[str, Any] = {}
"""What can be recorded, by name, in the order in which a dataset holds it."""
MESSAGES: dict[str, Callable[[str, str], Any]] = {}
"""Readers of messages that give a start, by their keys of ``[initial]``: from a file's name and its text to a
``Trajectory`` of one row.
"""


def one_of(table: str) -> str:
    """What a single table of an array is called: rotor for ``rotors``."""
    return f"{table[:-3]}y" if table.endswith("ies") else table[:-1]


def register_class(known: dict[str, Any], name: str, kind: type, what: str) -> None:
    """Put a class into a registry. The same class defined anew, as in a notebook, replaces its older self.

    Args:
        what: the kind of thing, for the message.

    Raises:
        ValueError: another class, or one of the same name from another module, has the name already.
    """
    older = known.get(name, kind)
    if origin(older) != origin(kind):
        raise ValueError(
            f'{what} "{name}" is registered already (by {origin(older)}, and now by {origin(kind)}); choose '
            "another name"
        )
    known[name] = kind


def register_load(kind: Any = None, **place: str) -> Any:
    """Register a class of loads (also as a class decorator), by default as a kind of ``[[loads]]``.

    Args:
        place: ``table``, ``body`` or ``beside`` with a name, see ``LOADS``.

    Raises:
        ValueError: a kind of ``[[loads]]`` has no ``Fields``, or the name is taken (see ``register_class``).
    """
    if kind is None:
        return partial(register_load, **place)
    if not place:
        if kind.Fields is None:
            raise ValueError(f"{kind.__name__} has no Fields; a load of a config declares its keys there")
        place = dict(zip(("kind",), kind.Fields.model_fields["kind"].annotation.__args__, strict=True))
    ((where, name),) = place.items()
    register_class(LOADS[where], name, kind, f"a load of {where}")
    return kind


def names_of(fields: Any) -> list[str]:
    """Names that a load is known by: its own, and its source's."""
    given = (
        fields.name,
        getattr(fields, "source", None),
        getattr(getattr(fields, "orbit", None), "body", None),
    )
    return [name for name in given if name]


def register_observable(observable: Any) -> None:
    """Register an observable, so that ``[output] record`` finds it; ``ValueError`` if its name is taken."""
    if observable.name in OBSERVABLES:
        raise ValueError(f'an observable named "{observable.name}" is registered already')
    OBSERVABLES[observable.name] = observable
