"""Registries of what a config can name beyond the schema: kinds of loads, and observables.

Both are empty here. The files of ``rigidsim.model`` that define a load or an observable register it, so
that a config, a schema or a message never needs a second list of names.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol

from pydantic import Field, field_validator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Matrix, Vector
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Names, origin
from rigidsim.scene.expressions.tree import Expression
from rigidsim.scene.fields import ConfigTable, Metre, VariableName, refuse
from rigidsim.scene.kernels.ephemeris import Ephemeris
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.point_masses import PointMasses


class LoadFields(ConfigTable):
    """Base of the keys that one kind of load takes; each adds ``kind: Literal["name"]``."""

    name: VariableName | None = Field(None, examples=["sun"])
    """name of the load; expressions then read ux_NAME uy_NAME uz_NAME r_NAME shadow_NAME of its source"""

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        """States of the body (``Readable.states``) that the place of its source as seen from there depends
        on; None if there is no source at a known place.
        """
        return None


class SourceFields(LoadFields):
    """Keys of a load whose source is a body at a known place."""

    radius: Metre | None = Field(None, examples=["6378.137 km"])
    """radius of the source, for shadow_NAME and altitude in expressions; the load itself takes a point"""

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        """Those of a flight, if its source is a body that moves by itself."""
        orbit = getattr(self, "orbit", None)
        relative = free_flight and orbit is not None and orbit.body is not None
        return frozenset({"flight"} if relative else ())

    @field_validator("radius")
    @classmethod
    def _positive(cls, value: ExactNumber | None) -> ExactNumber | None:
        if value is not None and value.sign <= 0:
            raise refuse(f"given {float(value):g}; a positive length is allowed")
        return value


@dataclass(frozen=True)
class Surroundings:
    """What the keys of a load are worked out against.

    Attributes:
        number: place of the load in the config, counted from 0.
        context: the scene's arithmetic.
        parameters: named constants for expressions.
        center_of_mass: from the body's reference point to its centre of mass, body axes, m (mpf).
        free_flight: whether the body has a position.
        axes: what the space axes are, if the config says so.
        epoch: date of the scene's time 0, if the config says so.
        tables: texts of the tables that belong to the config, by name.
        span: start and end of the run, s (mpf).
        bodies: point masses besides the body.
        names: what expressions may read.
        table: array of tables that it stands in.
        body: the rigid body.
        ephemeris: where bodies of a kernel are; None without one.
        host: the body of the kernel that this one is; empty for none.
    """

    number: int
    context: Any
    parameters: Mapping[str, ExactNumber]
    center_of_mass: Vector
    free_flight: bool
    axes: str | None = None
    epoch: Epoch | None = None
    tables: Mapping[str, str] = field(default_factory=dict)
    span: tuple[Any, Any] | None = None
    bodies: PointMasses | None = None
    names: Names = field(default_factory=Names)
    table: str = "loads"
    body: RigidBody | None = None
    ephemeris: Ephemeris | None = None
    host: str = ""

    @property
    def carried_bodies(self) -> PointMasses:
        """The point masses, which the caller knows to exist."""
        assert self.bodies is not None
        return self.bodies

    def fault(self, key: str, text: str) -> ConfigError:
        """The error that names a key of this load."""
        return ConfigError(Problem(f"[[{self.table}]] number {self.number + 1} {key}".rstrip(), text))


class SceneLoad:
    """A load as the scene knows it; ``rigidsim.model.load.Load`` adds the mechanics.

    Attributes:
        Fields: its keys in a config; None for a load that only Python gives.
        described: description with an article, for sentences.
        stands_in: array of tables of the config that it stands in.
        uniform_field: acceleration (mpf, m/s^2, space axes) of a field that is the same everywhere; such
            loads add up to the scene's gravity. None for all others.
        axes: what the space axes are in its own equations; None if these hold in any axes.
        epoch: date of time 0 in its own equations; None if these have none.
        bearing: moment (mpf, kg m^2) and unit axis (body axes) of what turns on a bearing of its own, which
            torques on the body don't accelerate about that axis; None for all others.
        apart: tensor of inertia (mpf, kg m^2, body axes) of what doesn't turn with the body, a fluid core's,
            which is part of the body's own; None for all others.
        inner_momentum: angular momentum relative to the body at the start (mpf, body axes); None for none.
        sights: bodies of a kernel that it sees, each with the highest derivative of its place that is to be
            a state.
        nothing: keys of its table in ``[body]`` with values that make it nothing, where a preset brings it.
    """

    Fields: ClassVar[type[LoadFields] | None] = None
    described: str = "a load"
    stands_in: ClassVar[str] = "loads"
    uniform_field: Vector | None = None
    axes: str | None = None
    epoch: Epoch | None = None
    bearing: tuple[Any, Vector] | None = None
    apart: Matrix | None = None
    inner_momentum: Vector | None = None
    sights: tuple[tuple[Sight, int], ...] = ()
    nothing: ClassVar[Mapping[str, Any]] = {}

    @classmethod
    def resolve(cls, fields: Any, around: Surroundings) -> SceneLoad:
        """The load that the keys describe, every number worked out.

        Args:
            fields: an instance of ``Fields``.

        Raises:
            ConfigError: a contradiction or a value out of range.
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

    def check(self, number: int, position: Vector | None) -> None:
        """Refuse the load if this scene can't have it.

        Args:
            number: its place in the config, counted from 0.
            position: position of the body's centre of mass; None if it has none.

        Raises:
            ConfigError: says what to do instead.
        """

    def among(self, masses: PointMasses) -> SceneLoad:
        """The load where the point masses are elsewhere: itself, unless its source is one of them."""
        return self

    def pictured(self) -> dict[str, Any] | None:
        """The load's depiction as plain JSON values (see ``rigidsim.look.surroundings``); None if it isn't
        drawn.
        """
        return None

    def formulas(self) -> Iterator[tuple[str, Expression]]:
        """Its expressions with their places in the config, to be tried at the start."""
        yield from ()

    def never_negative(self) -> Iterator[tuple[str, Expression]]:
        """Expressions for what no body or medium has below zero, with their places in the config."""
        yield from ()


class Companion(Protocol):
    """A class of loads that a key of another load brings beside it, on the same source."""

    @classmethod
    def beside_of(cls, load: SceneLoad, fields: Any, around: Surroundings) -> SceneLoad | None:
        """The load that acts beside another one; None where the key's value brings none.

        Args:
            load: the one that has the key, resolved.
            fields: its keys.

        Raises:
            ConfigError: the key contradicts something else.
        """

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        """As of ``SceneLoad``; ``fields`` are those of the load that has the key."""


class Named(Protocol):
    """An observable as far as a config needs to know it."""

    @property
    def name(self) -> str:
        """Name by which a config asks for the observable."""


LOAD_KINDS: dict[str, type[SceneLoad]] = {}
"""Kinds of ``[[loads]]`` by name."""

TABLES: dict[str, type[SceneLoad]] = {}
"""Loads with an array of tables of their own, by its name in the config: ``[[rotors]]``."""

OF_BODY: dict[str, type[SceneLoad]] = {}
"""Loads that keys of ``[body]`` bring, by the key: ``resolve`` is given the whole config."""

BESIDE: dict[str, Any] = {}
"""Loads that a key of a load brings beside it (``Companion``), by the key."""

OBSERVABLES: dict[str, Any] = {}
"""What can be recorded, by name, in the order in which a dataset holds it (``Named``)."""


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


def register_load(kind: type[SceneLoad]) -> type[SceneLoad]:
    """Register a kind of load, so that ``[[loads]] kind = "..."`` finds it (usable as a class decorator).

    Raises:
        ValueError: the kind has no ``Fields``, or its name is taken.
    """
    if kind.Fields is None:
        raise ValueError(f"{kind.__name__} has no Fields; a load of a config declares its keys there")
    annotation = kind.Fields.model_fields["kind"].annotation
    (name,) = annotation.__args__  # type: ignore[union-attr]
    register_class(LOAD_KINDS, name, kind, "a load of kind")
    return kind


def register_table(name: str) -> Callable[[type[SceneLoad]], type[SceneLoad]]:
    """Register loads whose keys are an array of tables of their own in the config (a class decorator)."""

    def register(kind: type[SceneLoad]) -> type[SceneLoad]:
        register_class(TABLES, name, kind, "a load with the tables")
        return kind

    return register


def register_of_body(key: str) -> Callable[[type[SceneLoad]], type[SceneLoad]]:
    """Register a load that a key of ``[body]`` brings (a class decorator)."""

    def register(kind: type[SceneLoad]) -> type[SceneLoad]:
        register_class(OF_BODY, key, kind, "a load by the key of [body]")
        return kind

    return register


def register_beside(key: str) -> Callable[[Any], Any]:
    """Register loads that a key of other loads brings beside these (a class decorator)."""

    def register(kind: Any) -> Any:
        register_class(BESIDE, key, kind, "a load beside others by the key")
        return kind

    return register


def companions(
    loads: Sequence[SceneLoad], tables: Sequence[LoadFields], around: Surroundings
) -> list[SceneLoad]:
    """What the keys of loads bring beside them."""
    found = []
    for number, (load, fields) in enumerate(zip(loads, tables, strict=True)):
        for key, kind in BESIDE.items():
            if getattr(fields, key, None) is not None:
                found.append(kind.beside_of(load, fields, replace(around, number=number)))
    return [load for load in found if load is not None]


def names_of(fields: Any) -> list[str]:
    """Names that a load is known by: its own, and that of the body that is its source."""
    given = (
        fields.name,
        getattr(fields, "source", None),
        getattr(getattr(fields, "orbit", None), "body", None),
    )
    return [name for name in given if name]


def register_observable(observable: Named) -> None:
    """Register an observable, so that ``[output] record`` finds it; ``ValueError`` if its name is taken."""
    if observable.name in OBSERVABLES:
        raise ValueError(f'an observable named "{observable.name}" is registered already')
    OBSERVABLES[observable.name] = observable
