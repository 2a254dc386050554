"""Scenes: a config with every number worked out and every physical contradiction refused.

Principal moments may be functions of time, [[states]] and [parameters]; the scene's body is the one at the
start. States of [[states]] are carried by need: recorded, or read by a load, an event or a carried one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import starts
from rigidsim.scene.arithmetic import Matrix, Vector, context_for, cross, diagonal, dot, eigen, vector
from rigidsim.scene.bodies.body import (
    Body,
    RigidBody,
    build_body,
    field_of_mesh,
    inverse_inertia,
    surfaces_of,
    with_surfaces,
)
from rigidsim.scene.bodies.gravity_field import asked_degree, gravity_field_of
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber, UnitError, conversion
from rigidsim.scene.expressions.names import EULER_NAMES, PROVIDERS, Names, names_of
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    ExpressionError,
    as_line,
    evaluate,
    names_used,
    states_read,
)
from rigidsim.scene.frame import figure_of, reference_normal
from rigidsim.scene.kernels.reading import host_of, resolve_ephemeris
from rigidsim.scene.point_masses import resolve_point_masses
from rigidsim.scene.registry import LOADS, BroughtState, SceneLoad, Setting
from rigidsim.scene.sample_times import SampleTimes, sample_times
from rigidsim.scene.schema import Config, EventTable
from rigidsim.scene.swept import plain

if TYPE_CHECKING:
    from rigidsim.scene.kernels.spice import Orientation

T = TypeVar("T")


@dataclass(frozen=True)
class Impulse:
    """What changes at once at an event.

    Attributes:
        body: name of the second body that it acts on; empty for ``[body]``.
        axes: of the change of velocity: space, body or rtn.
        velocity: change of velocity (mpf, m/s); None for none.
        rates: change of angular velocity (mpf, rad/s, body axes); None for none.
        momentum: angular impulse in its place (mpf, kg m^2/s, body axes).
        where: its place in the config.
    """

    body: str
    axes: str
    velocity: Vector | None
    rates: Vector | None
    momentum: Vector | None
    where: str

    @property
    def reads(self) -> set[str]:
        """States that it needs or changes, see ``Load.reads``."""
        needs = {"flight": self.velocity is not None, "attitude": self.axes == "body"}
        return {need for need, holds in needs.items() if holds}

    def fault(self, key: str, text: str) -> ConfigError:
        """The error that names a key of it."""
        return ConfigError(Problem(f"{self.where} {key}", text))


@dataclass(frozen=True)
class Event:
    """One event of a scene: its direction is any, up or down; with ``stop`` the run ends there.

    Attributes:
        time: of a single crossing that depends on the time alone (mpf, s); None for any other.
        impulse: what it changes; None for nothing.
    """

    name: str
    expression: Expression
    direction: str
    stop: bool
    time: Any = None
    impulse: Impulse | None = None

    @property
    def reads(self) -> frozenset[str]:
        """States that it needs, see ``Load.reads``."""
        return states_read(self.expression) | (set() if self.impulse is None else self.impulse.reads)


@dataclass(frozen=True, kw_only=True)
class Scene(Setting):
    """Everything that the equations of motion depend on: a setting with its loads, events, states and start.

    Attributes:
        samples: the times at which a run is recorded.
        loads: those that act, or that something reads, without uniform fields.
        given_loads: all of ``[[loads]]``, in their order.
        tabled: all of loads with separate tables, such as rotors, by the table's name.
        gravity: sum of all uniform fields, space axes, m/s^2; None without such a load.
        states: the states of ``[[states]]`` that are carried.
        events: crossings that are recorded, or end the run.
        turning_inertia: tensor of what turns with the body: ``body.inertia``, the one of the mass
            distribution, less the moments about their axes of what turns on bearings, and a fluid core's.
        inverse_inertia: its pseudo-inverse.
        reference: unit normal (space axes) of the plane that obliquity and longitudes count from; None for
            a source's own, moving plane.
        orientation: the published one recorded with the attitude; None without one.
        quaternion: initial unit quaternion, body to space.
        angular_velocity: initial angular velocity, body axes, rad/s.
        euler_angles: as given in ``euler_sequence`` (radians), or None if given otherwise.
        found_start: how an equilibrium was found that it starts from; None for any other start.
    """

    config: Config
    samples: SampleTimes
    loads: tuple[Any, ...]
    given_loads: tuple[Any, ...] = ()
    tabled: Mapping[str, tuple[SceneLoad, ...]] = field(default_factory=dict)
    gravity: Vector | None
    states: tuple[OwnState, ...] = ()
    events: tuple[Event, ...]
    turning_inertia: Matrix
    inverse_inertia: Matrix
    reference: Vector | None
    orientation: Orientation | None = None
    quaternion: Vector
    angular_velocity: Vector
    euler_angles: Vector | None = None
    found_start: Any = None

    @property
    def name(self) -> str:
        """As in the config."""
        return self.config.name

    @property
    def description(self) -> str:
        """As in the config."""
        return self.config.description

    @property
    def duration(self) -> Any:
        """Length of the run, s (mpf), whichever way it goes."""
        return abs(self.end - self.start)

    @property
    def reach(self) -> tuple[float, float]:
        """Times, s, as far before and after the start as the run ends."""
        start, far = float(self.start), float(max(self.duration, abs(self.samples.last - self.start)))
        return start - far, start + far

    @property
    def torque_arm(self) -> Vector | None:
        """Mass times centre of mass (kg m, body axes) on which gravity acts; None without a torque."""
        if self.gravity is None or self.free_flight or self.body.mass is None:
            return None
        if all(x == 0 for x in self.body.center_of_mass) or all(g == 0 for g in self.gravity):
            return None
        return [self.body.mass * x for x in self.body.center_of_mass]

    def as_motion(self, **keys: Any) -> Scene:
        """The scene of the same motion alone (see ``Config.as_motion``)."""
        return replace(self, config=self.config.as_motion(**keys), events=self.impulses)

    @property
    def impulses(self) -> tuple[Event, ...]:
        """Those of the events that change the motion."""
        return tuple(event for event in self.events if event.impulse is not None)

    def formulas(self) -> list[Expression]:
        """All expressions."""
        return [*self.acting_formulas(), *(event.expression for event in self.events)]

    def never_negative(self) -> list[Expression]:
        """Expressions of loads that may not fall below zero."""
        return [formula for load in self.loads for formula in load.never_negative()]

    def acting_formulas(self) -> list[Expression]:
        """Those in the equations of motion: of loads and of ``[[states]]``."""
        found = [formula for load in self.loads for formula in load.formulas()]
        return found + [state.derivative for state in self.states]

    def started(self, start: starts.InitialRotation) -> Scene:
        """The same scene with another start."""
        rates = self.angular_velocity if start.angular_velocity is None else start.angular_velocity

        def begun(loads: tuple[Any, ...]) -> tuple[Any, ...]:
            return tuple(load.with_partner(start.partner) for load in loads) if start.partner else loads

        return replace(
            self,
            loads=begun(self.loads),
            tabled={name: begun(loads) for name, loads in self.tabled.items()},
            quaternion=start.quaternion,
            angular_velocity=rates,
            euler_angles=start.euler_angles,
            found_start=start.found,
        )


def build_scene(experiment: Experiment, context: Any = None) -> Scene:
    """Work out the scene of a config: what its loads are worked out against, then these, then its start.

    Args:
        context: arithmetic for its numbers; by default the config's precision.

    Raises:
        ConfigError: a value contradicts mechanics or another key; names the file.
    """
    config, source = experiment.config, experiment.source
    context = context or context_for(config.integrator.precision)
    problems: list[Problem] = []

    def attempt(part: Callable[..., T], *arguments: Any) -> T | None:
        try:
            return part(*arguments)
        except ConfigError as error:
            problems.extend(error.problems)
            return None

    body = attempt(_body_at_start, config, context)
    attempt(starts.check_ways, config)
    times = attempt(sample_times, config.time, context, config.texts)
    if body is None or times is None or problems:
        raise ConfigError(problems, source)
    start, end, samples = times
    try:
        setting = _setting(config, context, body, (start, end), source)
        scene = _with_loads(setting, samples, source)
        scene = scene.started(starts.attitude_of(scene))
        return _begun(scene.started(starts.rotation_of(scene)))
    except ConfigError as error:
        raise error.at(source) from None


def _setting(config: Config, context: Any, body: RigidBody, span: tuple[Any, Any], source: str) -> Setting:
    position, velocity = _translation(config, body, context)
    axes, epoch, table = config.frame.axes, config.time.epoch, config.body
    ephemeris = resolve_ephemeris(config.ephemeris, axes, epoch, span, source)
    host = host_of(ephemeris, table.host, [one.name for one in config.bodies])
    masses = resolve_point_masses(
        config.bodies, None if host else table.host, table.coupling, body.mass, context,
        free_flight=position is not None, ephemeris=ephemeris,
    )  # fmt: skip
    return Setting(
        config=config, context=context, body=body, start=span[0], end=span[1], axes=axes, epoch=epoch,
        position=position, velocity=velocity, names=names_of(config), bodies=masses, ephemeris=ephemeris,
        host=host, figure=figure_of(config.frame, body, context),
    )  # fmt: skip


def _resolved(
    setting: Setting,
) -> tuple[Setting, list[SceneLoad], dict[str, tuple[SceneLoad, ...]], list[SceneLoad]]:
    """The setting with the axes and the date that loads imply; the loads of ``[[loads]]``; those with tables
    of their own, by the table's name; all of them, with what ``[body]`` and keys of other loads bring.
    """
    config = setting.config
    places = enumerate(config.loads)
    given = [LOADS["kind"][x.kind].resolve(x, setting.at("loads", n)) for n, x in places]
    tabled = {
        name: tuple(kind.resolve(x, setting.at(name, n)) for n, x in enumerate(getattr(config, name)))
        for name, kind in LOADS["table"].items()
    }
    known = setting.axes if setting.ephemeris is None else setting.axes or setting.ephemeris.axes
    setting = _dated(replace(setting, axes=known), given)
    brought = [kind.resolve(config, setting) for kind in LOADS["body"].values() if kind.brought_by(config)]
    for n, (load, fields) in enumerate(zip(given, config.loads, strict=True)):
        kinds = [kind for key, kind in LOADS["beside"].items() if getattr(fields, key, None) is not None]
        brought += [kind.beside_of(load, fields, setting.at("loads", n)) for kind in kinds]
    found = [*given, *(load for loads in tabled.values() for load in loads)]
    found += [load for load in brought if load is not None]
    return _dated(setting, found), given, tabled, found


def _with_loads(begun: Setting, samples: SampleTimes, source: str) -> Scene:
    """The scene with any start."""
    setting, given, tabled, resolved = _resolved(begun)
    config, context, body = setting.config, setting.context, setting.body
    apart = [load.apart for load in resolved if load.apart is not None]
    turning = body.inertia, inverse_inertia(context, body)
    if apart:
        turning = turning_inertia(context, body, apart)
    fields = [load.uniform_field for load in resolved if load.uniform_field is not None]
    gravity = [sum(x, context.zero) for x in zip(*fields, strict=True)] if fields else None
    pulled = setting.free_flight or any(x != 0 for x in body.center_of_mass)
    if gravity is not None and body.mass is None and pulled:
        raise _fail("body", "mass", "missing; uniform_gravity needs it")
    acting = [load for load in resolved if load.acts() and load.uniform_field is None]
    events = _resolved_events(setting)
    readers = [(load.title, formula) for load in acting for formula in load.formulas()]
    readers += [(f"event {event.name}", event.expression) for event in events]
    states = carried_states(resolve_states(setting), readers, config.output.record)
    read = names_used(*(formula for _, formula in readers), *(state.derivative for state in states))
    return Scene(
        **vars(setting),
        samples=samples,
        loads=tuple(x for x in resolved if any(x is one for one in acting) or x.read_by(read)),
        given_loads=tuple(given),
        tabled=tabled,
        gravity=gravity,
        states=states,
        events=events,
        turning_inertia=turning[0],
        inverse_inertia=turning[1],
        reference=reference_normal(config.frame, context),
        orientation=_orientation(setting, source),
        quaternion=[context.one] + [context.zero] * 3,
        angular_velocity=[context.zero] * 3,
    )


def _resolved_events(setting: Setting) -> tuple[Event, ...]:
    """Read the expressions of ``[[events]]``."""
    found = []
    for number, table in enumerate(setting.config.events):
        here = setting.at("events", number)
        if table.time is None:
            expression = here.expression("expression", table.expression, jumps=False)
        else:
            known = {**setting.config.parameters, "time__": table.time}
            expression = here.expression("time", "t - time__", parameters=known)
        if not names_used(expression):
            what = f'given "{table.expression}", which never changes; use {", ".join(setting.names)}'
            raise here.fault("expression", what)
        line = as_line(expression, setting.context)
        rises = {"any": 0, "up": 1, "down": -1}[table.direction]
        time = line.zero if line is not None and line.slope * rises >= 0 else None
        impulse = _impulse(table, time, here) if table.action == "impulse" else None
        found.append(Event(table.name, expression, table.direction, table.action == "stop", time, impulse))
    return tuple(found)


FROM_BEHIND = (
    "given for an impulse, whose root can't be found from behind, after what it changed; give time in its "
    "place, or go forwards"
)


def _impulse(table: EventTable, time: Any, here: Setting) -> Impulse:
    context, names = here.context, [one.name for one in here.config.rigid_bodies]
    if table.body not in (None, *names):
        allowed = f"allowed: {', '.join(names)}" if names else "there are no [[rigid_bodies]]"
        raise here.fault("body", f'given "{table.body}"; {allowed}; leave it out for [body]')
    moves = here.free_flight or bool(names)
    what = "given, but [body] has no place; give [initial] position or velocity, or change angular_velocity"
    ensure(table.velocity is None or moves, here.fault("velocity", what))
    if time is None and here.end < here.start:
        raise here.fault("expression", FROM_BEHIND)
    if time == here.start:
        what = f"is the start ({context.nstr(time, 6)} s); let it begin with other velocities instead"
        raise here.fault("time" if table.time else "expression", what)
    velocity, rates, momentum = (
        None if given is None else vector(context, given)
        for given in (table.velocity, table.angular_velocity, table.angular_impulse)
    )
    return Impulse(table.body or "", table.axes, velocity, rates, momentum, here.where(""))


def _dated(setting: Setting, loads: Iterable[SceneLoad]) -> Setting:
    """The setting with the space axes and the date of time 0 that the first of loads implies, if need be."""
    axes = (setting.axes, *(load.axes for load in loads))
    epochs = (setting.epoch, *(load.epoch for load in loads))
    return replace(setting, axes=next(filter(None, axes), None), epoch=next(filter(None, epochs), None))


def _orientation(setting: Setting, source: str) -> Orientation | None:
    table = setting.config.output
    if table.orientation is None and table.orientation_of is None:
        return None
    from rigidsim.scene.kernels.spice import resolve_orientation

    span, host = (setting.start, setting.end), setting.config.body.host
    asked = table.orientation, table.orientation_of
    return resolve_orientation(*asked, host, setting.axes, setting.epoch, span, source)


def _body_at_start(config: Config, context: Any) -> RigidBody:
    moments = moments_at_start(config, context, config.time.start.at(context))
    body = whole_body(config.body, config, context, moments)
    outside = surfaces_of(config.body.surfaces, body.center_of_mass, context)
    if outside:
        drawing = with_surfaces(body.drawing, config.body.surfaces, outside)
        body = replace(body, surfaces=outside, drawing=drawing)
    return body


def whole_body(table: Body, config: Config, context: Any, moments: Vector | None = None) -> RigidBody:
    """A body of a config with its gravity field; ``moments`` as for ``build_body``."""
    body = build_body(table, context, config.integrator.euler_sequence, moments, config.texts)
    field = table.gravity_field or field_of_mesh(table, config.texts)
    if field is None:
        return body
    degree = asked_degree(field, config.loads)
    return replace(body, gravity=gravity_field_of(field, body, context, config.texts, degree))


def _fail(table: str, key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[{table}] {key}".strip(), text))


def _translation(config: Config, body: RigidBody, context: Any) -> tuple[Vector | None, Vector | None]:
    if not config.initial.flies:
        if config.initial.frame is not None:
            raise _fail(
                "initial", "frame", "given without position or velocity, whose axes it names; add one"
            )
        return None, None
    if any(x != 0 for x in body.center_of_mass):
        raise _fail(
            "body",
            "center_of_mass" if config.body.center_of_mass is not None else "reference",
            "a body with a position or velocity turns about its centre of mass, but the inertia is given "
            "about another point; give it about the centre of mass (remove reference or center_of_mass)",
        )
    if body.mass is None:
        raise _fail("body", "mass", "missing; a body with a position or velocity needs it")
    return starts.flight_start(config, context)


# --- moments given as expressions ---------------------------------------------------------------------------

_MOMENTS = "[body] principal_moments"
_LEAST = 1e-9
"""Least part of their sum that a moment which varies may become: 1/I has a pole at zero."""
_LEAST_SINGLE = 2e-4
_JUMPS = re.compile(r"\b(sign|step|pulse|wrap)\s*\(")


def least_part(precision: str | int) -> float:
    """``_LEAST`` in a precision that resolves it."""
    return _LEAST_SINGLE if precision == "single" else _LEAST


def formulas_of(config: Config, names: Names | None = None) -> list[Expression]:
    """The three moments, parsed where the config has expressions; empty if none is one.

    Raises:
        ConfigError: an expression that can't be read, jumps, or reads what moments can't.
    """
    given = config.body.principal_moments
    if given is None or all(isinstance(x, ExactNumber) for x in given):
        return []
    names = names_of(config) if names is None else names
    allowed = {"t", *(state.name for state in config.states)}
    found: list[Expression] = []
    for axis, text in enumerate(given):
        if isinstance(text, ExactNumber):
            found.append(Constant(text))
            continue
        where = f"{_MOMENTS}[{axis}]"
        try:
            formula = parse_expression(text, names, parameters=config.parameters, unit="kg m^2", where=where)
            others = ", ".join(sorted(names_used(formula) - allowed))
            what = f"it reads {others}; moments may read t, [[states]] and [parameters]"
            ensure(not others, ExpressionError(f"{what}: let a state of [[states]] follow it"))
            what = "it jumps, and mass takes time to move; make the change smooth with tanh"
            ensure(
                not _JUMPS.search(text), ExpressionError(f"{what}, or let a state of [[states]] follow it")
            )
        except ExpressionError as error:
            said = f'given "{text}", which is no number and no expression that is allowed here: {error}'
            raise ConfigError(Problem(where, said)) from None
        found.append(formula)
    return found


def moments_at_start(config: Config, context: Any, start: Any) -> Vector | None:
    """The three moments at the start (mpf, kg m^2); None if all are plain numbers.

    Raises:
        ConfigError: as ``formulas_of``, or one has no finite value there, or is too small to vary.
    """
    values = {"t": start, **{state.name: state.initial.at(context) for state in config.states}}
    moments = []
    for axis, formula in enumerate(found := formulas_of(config)):
        try:
            moments.append(evaluate(formula, values, context))
        except ExpressionError as error:
            raise ConfigError(
                Problem(f"{_MOMENTS}[{axis}]", f"no finite value at the start: {error}")
            ) from None
    if names_used(*found):
        least = least_part(config.integrator.precision)
        for axis, moment in enumerate(moments):
            what = (
                f"given {context.nstr(moment, 6)} kg m^2 at the start, with moments that vary; each has to "
            )
            fault = Problem(f"{_MOMENTS}[{axis}]", what + f"be more than {least:.1g} of their sum")
            ensure(not 0 <= moment <= least * sum(moments), ConfigError(fault))
    return moments or None


# --- user-defined states ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OwnState:
    """A user-defined state that is carried; ``why`` says by whom it is needed."""

    name: str
    unit: str | None  # SI; "1" for a number, None if it isn't known
    initial: Any  # mpf
    derivative: Expression  # SI
    why: str = ""
    begins: Expression | None = None  # of the start, from which ``initial`` follows

    @property
    def described(self) -> str:
        """What it is, in a reader's terms."""
        start = f"{float(self.initial):.4g}" + ("" if self.unit in (None, "1") else f" {self.unit}")
        return f'state {self.name}: from {start}, changes by "{self.derivative.text}"'


def resolve_states(setting: Setting) -> list[OwnState]:
    """All states of the config, their derivatives parsed.

    Raises:
        ConfigError: an expression that can't be read, or another dimension than the unit's.
    """
    found = []
    for number, table in enumerate(setting.config.states):
        here, start = setting.at("states", number), table.initial
        if start.unit and table.unit is not None:
            try:
                conversion(start.unit, table.unit)
            except UnitError as error:
                raise here.fault("initial", f"given a value in {start.unit}; {error}") from None
        rate = None if table.unit is None else "s^-1" if table.unit == "1" else f"{table.unit}/s"
        derivative = here.expression("derivative", table.derivative, rate, read_too=True)
        found.append(OwnState(table.name, table.unit, start.at(setting.context), derivative))
    for key, number, x in setting.config.every_state:
        if isinstance(x, BroughtState):
            here, known = setting.at(key, number), {**setting.config.parameters, **x.parameters}
            slope, begins = (
                here.expression("name", text, unit, parameters=known)
                for text, unit in ((x.derivative, f"{x.unit}/s"), (x.initial, x.unit))
            )
            found.append(OwnState(x.name, x.unit, setting.context.zero, slope, begins=begins))
    return found


def _begun(scene: Scene) -> Scene:
    """The scene with the states that loads bring as they follow from its start."""
    if not any(state.begins for state in scene.states):
        return scene
    values = start_values(scene)
    begun = (
        x if x.begins is None else replace(x, initial=evaluate(x.begins, values, scene.context))
        for x in scene.states
    )
    return replace(scene, states=tuple(begun))


def carried_states(
    states: Sequence[OwnState], readers: Iterable[tuple[str, Expression]], record: Sequence[str] | None
) -> tuple[OwnState, ...]:
    """Those that something needs.

    Args:
        readers: who reads, for ``plan``, and what.
        record: names of what is recorded; None for all that the scene has.
    """
    slopes = {state.name: state.derivative for state in states}
    why: dict[str, dict[str, None]] = {x: {"recorded": None} for x in slopes if record is None or x in record}
    waiting = [*readers, *((f"state {name}", slopes[name]) for name in why)]
    for who, expression in waiting:
        for name in sorted(states_read(expression) & set(slopes)):
            if who == f"state {name}":
                continue
            if name not in why:
                waiting.append((f"state {name}", slopes[name]))
            why.setdefault(name, {})[f"{who} reads it"] = None
    return tuple(replace(x, why="; ".join(why[x.name])) for x in states if x.name in why)


# --- what turns with the body -------------------------------------------------------------------------------

_ROUNDING_OF_INPUT = 1e-14  # relative, of moments that a double-precision program printed


def without_apart(scene: Scene, loads: Sequence[SceneLoad]) -> Scene:
    """The scene with loads given from Python, whose tensors ``apart`` don't turn with the body either."""
    apart = [load.apart for load in (*scene.loads, *loads) if load.apart is not None]
    if all(load.apart is None for load in loads):
        return scene
    turning, inverse = turning_inertia(scene.context, scene.body, apart)
    return replace(scene, turning_inertia=turning, inverse_inertia=inverse)


def turning_inertia(context: Any, body: RigidBody, apart: Sequence[Matrix]) -> tuple[Matrix, Matrix]:
    """Tensor of what turns with the body, its own less the tensors of what turns ``apart``, and its inverse:
    by elements, so that numbers of a sweep stay in it.

    Raises:
        ConfigError: no body has such a tensor.
    """
    tensor = body.inertia
    for other in apart:
        tensor = [[x - y for x, y in zip(*rows, strict=True)] for rows in zip(tensor, other, strict=True)]
    half = sum((tensor[i][i] for i in range(3)), context.zero) / 2
    spread = [[(half if i == j else context.zero) - tensor[i][j] for j in range(3)] for i in range(3)]
    size = context.maximum([abs(x) for row in body.inertia for x in row])
    slack = context.mpf(_ROUNDING_OF_INPUT)
    fits = all(minor >= -slack * size**order for order, minor in _minors(spread))
    if not (fits and all(minor > slack * size**order for order, minor in _minors(tensor))):
        moments, _ = eigen(context, [[plain(x) for x in row] for row in tensor])
        listed = ", ".join(context.nstr(x, 8) for x in moments)
        what = (
            "given moments that the body's tensor can't include: the tensor without the rotors has the "
            f"principal moments {listed} kg m^2, which no body has (all must be positive, and none more than "
            "the sum of the others); make the rotors smaller, or add the locked rotors to [body]"
        )
        raise ConfigError(Problem("[[rotors]] moment", what))
    return tensor, _inverse(context, tensor)


def _minors(m: Matrix) -> list[tuple[int, Any]]:
    """(order, value) of all principal minors of a symmetric matrix."""
    pairs = [(0, 1), (1, 2), (0, 2)]
    return [
        *((1, m[i][i]) for i in range(3)),
        *((2, m[i][i] * m[j][j] - m[i][j] ** 2) for i, j in pairs),
        (3, dot(m[0], cross(m[1], m[2]))),
    ]


def _inverse(context: Any, m: Matrix) -> Matrix:
    """Inverse of a symmetric matrix: its adjugate over the determinant."""
    if all(m[i][j] == 0 for i in range(3) for j in range(3) if i != j):
        return diagonal([1 / m[i][i] for i in range(3)])
    rows = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])]
    determinant = dot(m[0], rows[0])
    return [[x / determinant for x in row] for row in rows]


# --- its expressions at the start: those without a finite value are refused before anything runs ------------

_SINGULAR = 2.0**-30  # rad from a singularity of Euler angles, where no step would be long enough
_TIMES = 8  # of a run's span, at which functions of time alone are tried


def start_values(scene: Scene) -> dict[str, Any]:
    """Values (mpf, SI) at the start of all names that expressions may read."""
    found: dict[str, Any] = {}
    for provider in PROVIDERS:
        found |= provider.at_start(scene)
    return found


def check_start(scene: Scene) -> None:
    """Evaluate the components of loads and the events at the start, and what depends on time alone later."""
    values = start_values(scene)
    problems = _check_branch(scene) or _check_singular(scene, values)
    for expression in scene.formulas():
        problems += _check(expression, values, scene.context)
        problems += _check_span(expression, scene)
    problems = problems or _check_signs(scene, values)
    if problems:
        raise ConfigError(problems)


def _check_branch(scene: Scene) -> list[Problem]:
    """Refuse expressions that read Euler angles if the start is given by the other of an attitude's two
    triples: they use the one whose middle angle is in its range, as found in every formulation.
    """
    read = names_used(*scene.formulas()) & set(EULER_NAMES)
    if scene.euler_angles is None or not read:
        return []
    sequence, middle, pi = scene.config.integrator.euler_sequence, scene.euler_angles[1], scene.context.pi
    low, high, shown = (
        (0, pi, "0 to pi") if sequence[0] == sequence[2] else (-pi / 2, pi / 2, "-pi/2 to pi/2")
    )
    if low <= middle <= high:
        return []
    what = (
        f"given {scene.context.nstr(middle, 8)} rad for the middle angle, while {', '.join(sorted(read))} "
        f"is in an expression; {shown} is allowed for {sequence}: give the same attitude with such an "
        "angle, or as a quaternion"
    )
    return [Problem("[initial] euler_angles", what)]


def _check_singular(scene: Scene, values: dict[str, Any]) -> list[Problem]:
    """Refuse loads that read Euler angles where these are singular at the start and have no derivatives."""
    reading = [(x.where, names_used(x) & set(EULER_NAMES)) for x in scene.acting_formulas()]
    if not any(names for _, names in reading):
        return []
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    middle = values[EULER_NAMES[1]]
    proper = sequence[0] == sequence[2]
    if abs(context.sin(middle) if proper else context.cos(middle)) > _SINGULAR:
        return []
    why = (
        f"which the start leaves open: the middle angle of the sequence {sequence} is "
        f"{context.nstr(middle, 8)} rad there, where its outer axes coincide; choose another [integrator] "
        "euler_sequence, start elsewhere, or write the load with the quaternion (qw, qx, qy, qz)"
    )
    return [Problem(where, f"reads {', '.join(sorted(names))}, {why}") for where, names in reading if names]


def _check(expression: Expression, values: dict[str, Any], context: Any) -> list[Problem]:
    error = _refusal(expression, values, context)
    names = [name for name in values if name in names_used(expression)]
    given = ", ".join(f"{name} = {context.nstr(values[name], 8)}" for name in names if error)
    what = f"no finite value at the start ({given}); start elsewhere or rewrite it: {error}"
    return [Problem(expression.where, what)] if error else []


def _check_signs(scene: Scene, values: dict[str, Any]) -> list[Problem]:
    """Refuse what is below zero at the start and can't be."""
    found = [(x, evaluate(x, values, scene.context)) for x in scene.never_negative()]
    what = 'given "{}", which is {} at the start; at least 0 is allowed'
    return [
        Problem(x.where, what.format(x.text, scene.context.nstr(value, 6)))
        for x, value in found
        if value is not None and value < 0
    ]


def _check_span(expression: Expression, scene: Scene) -> list[Problem]:
    """Refuse a function of time alone, such as sqrt(-t) or log(2 - t), that has a value at the start and at
    no later time that is tried; the last time at which it has one is found by bisection.
    """
    problems, context = [], scene.context
    for part in _functions_of_time(expression):
        span = scene.end - scene.start
        tried = [_refusal(part, {"t": scene.start + span * n / _TIMES}, context) for n in range(_TIMES + 1)]
        if tried[0] is not None or None in tried[1:]:
            continue
        last, beyond = scene.start, scene.start + span / _TIMES
        for _ in range(context.prec):
            middle = (last + beyond) / 2
            passed = _refusal(part, {"t": middle}, context)
            last, beyond = (middle, beyond) if passed is None else (last, middle)
        what = f"no finite value after t = {context.nstr(last, 8)} s, but the run ends at "
        what += f"{context.nstr(scene.end, 8)} s; rewrite it, or end the run before: {tried[1]}"
        problems.append(Problem(expression.where, what))
    return problems


def _refusal(expression: Expression, values: dict[str, Any], context: Any) -> ExpressionError | None:
    """Why an expression has no value; None if it has one."""
    try:
        evaluate(expression, values, context)
    except ExpressionError as error:
        return error
    return None


def _functions_of_time(expression: Expression) -> list[Expression]:
    """The largest parts of an expression that depend on time and on nothing else."""
    found, waiting = [], [expression]
    while waiting:
        node = waiting.pop()
        names = names_used(node)
        if names == {"t"}:
            found.append(node)
        elif names:
            waiting += node.operands
    return found
