"""Scenes: a config with every number worked out and every physical contradiction refused."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import schema, starts
from rigidsim.scene.arithmetic import Matrix, Vector, context_for
from rigidsim.scene.bodies.body import RigidBody, build_body, inverse_inertia
from rigidsim.scene.bodies.gravity_field import asked_degree, gravity_field_of
from rigidsim.scene.bodies.outside import surfaces_of, with_surfaces
from rigidsim.scene.config import Experiment
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.events import Event, resolve_events
from rigidsim.scene.expressions.names import Names, names_of
from rigidsim.scene.expressions.tree import Expression, names_used
from rigidsim.scene.flight_starts import flight_start
from rigidsim.scene.frame import Figure, figure_of, reference_normal
from rigidsim.scene.kernels.ephemeris import Ephemeris, host_of, resolve_ephemeris
from rigidsim.scene.moving_moments import moments_at_start
from rigidsim.scene.own_states import OwnState, carried_states, resolve_states
from rigidsim.scene.point_masses import PointMasses, resolve_point_masses
from rigidsim.scene.registry import LOAD_KINDS, OF_BODY, TABLES, SceneLoad, Surroundings, companions
from rigidsim.scene.rotors import refuse_odd_rotors, turning_inertia
from rigidsim.scene.sample_times import SampleTimes, sample_times

if TYPE_CHECKING:
    from rigidsim.scene.kernels.spice import Orientation

T = TypeVar("T")


@dataclass(frozen=True)
class Scene:
    """Everything that the equations of motion depend on; numbers are mpf of ``context`` in SI units.

    Attributes:
        angular_velocity: initial angular velocity, body axes, rad/s.
        quaternion: initial unit quaternion, body to space.
        euler_angles: as given in ``euler_sequence`` (radians), or None if given otherwise.
        position, velocity: those of the centre of mass, space axes; None unless the body moves freely.
        gravity: sum of all uniform fields, space axes, m/s^2; None without such a load.
        loads: the others, without those that are always zero.
        given_loads: all of ``[[loads]]``, in their order.
        tabled: all of loads with tables of their own, such as rotors, by the table's name.
        states: those of one's own that are carried.
        events: crossings that are recorded, or end the run.
        turning_inertia: tensor of what turns with the body: ``body.inertia``, the one of the mass
            distribution, less the moments about their axes of what turns on bearings, and a fluid core's.
        inverse_inertia: its pseudo-inverse.
        axes, epoch: what the space axes and time 0 are, if the config says so or a load implies it.
        figure: the body's figure axis, see ``[frame] figure_axis``.
        bodies: point masses besides the body; None if there are none.
        ephemeris: where bodies of a kernel are; None without one.
        orientation: the published one beside which the attitude is recorded; None without one.
        host: the body of the kernel that this one is; empty for none.
        found_start: how an equilibrium was found that it starts from; None for any other start.
        reference: unit normal (space axes) of the plane that obliquity and longitudes count from; None for
            a source's own, moving plane.
    """

    name: str
    description: str
    context: Any
    body: RigidBody
    turning_inertia: Matrix
    inverse_inertia: Matrix
    angular_velocity: Vector
    quaternion: Vector
    euler_angles: Vector | None
    position: Vector | None
    velocity: Vector | None
    gravity: Vector | None
    loads: tuple[SceneLoad, ...]
    events: tuple[Event, ...]
    start: Any
    end: Any
    samples: SampleTimes
    axes: str | None
    epoch: Epoch | None
    figure: Figure
    reference: Vector | None
    config: schema.Config
    bodies: PointMasses | None = None
    given_loads: tuple[SceneLoad, ...] = ()
    tabled: Mapping[str, tuple[SceneLoad, ...]] = field(default_factory=dict)
    found_start: Any = None
    states: tuple[OwnState, ...] = ()
    ephemeris: Ephemeris | None = None
    host: str = ""
    orientation: Orientation | None = None

    @property
    def free_flight(self) -> bool:
        """Whether the body moves with six degrees of freedom."""
        return self.position is not None

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
        return replace(self, config=self.config.as_motion(**keys), events=())

    def formulas(self) -> list[tuple[str, Expression]]:
        """All expressions, with their places in the config."""
        events = enumerate(self.events, start=1)
        found = [(f"[[events]] number {n} expression", event.expression) for n, event in events]
        return self.acting_formulas() + found

    def never_negative(self) -> list[tuple[str, Expression]]:
        """Those of loads that may not fall below zero."""
        return [formula for load in self.loads for formula in load.never_negative()]

    def acting_formulas(self) -> list[tuple[str, Expression]]:
        """Those in the equations of motion: of loads and of own states."""
        found = [formula for load in self.loads for formula in load.formulas()]
        return found + [(state.where, state.derivative) for state in self.states]


def build_scene(experiment: Experiment, context: Any = None) -> Scene:
    """Work out the scene of a config.

    Args:
        context: arithmetic for its numbers; by default that of the config's precision.

    Raises:
        ConfigError: a value contradicts mechanics or another key; names the file.
    """
    config = experiment.config
    context = context or context_for(config.integrator.precision)
    problems: list[Problem] = []

    def attempt(part: Callable[..., T], *arguments: Any) -> T | None:
        try:
            return part(*arguments)
        except ConfigError as error:
            problems.extend(error.problems)
            return None

    body = attempt(_body_at_start, config, context)
    attempt(starts.check_ways, config.initial, context)
    texts = {name: table.text for name, table in config.tables.items()}
    times = attempt(sample_times, config.time, context, texts)
    attempt(_check_limits, config.limits)
    if body is None or times is None or problems:
        raise ConfigError(problems, experiment.source)
    start, end, samples = times
    try:
        position, velocity = _translation(config, body, context)
        free_flight, table = position is not None, config.body
        axes, epoch = config.frame.axes, config.time.epoch
        ephemeris = resolve_ephemeris(config.ephemeris, axes, epoch, (start, end), experiment.source)
        host = host_of(ephemeris, table.host, [one.name for one in config.bodies])
        masses = resolve_point_masses(
            config.bodies, None if host else table.host, table.coupling, body.mass, context,
            free_flight=free_flight, ephemeris=ephemeris,
        )  # fmt: skip
        names = names_of(config)
        given, tabled = _resolve_loads(
            config, body, context, masses, names,
            free_flight=free_flight, span=(start, end), ephemeris=ephemeris, host=host,
        )  # fmt: skip
        around = Surroundings(
            0, context, config.parameters, body.center_of_mass, free_flight, axes=axes, epoch=epoch,
            span=(start, end), names=names, body=body, ephemeris=ephemeris, host=host,
        )  # fmt: skip
        brought = [kind.resolve(config, around) for kind in OF_BODY.values() if kind.brought_by(config)]
        known = ephemeris.axes if ephemeris is not None else _first(given, "axes")
        named: str | None = config.frame.axes or known
        dated = replace(around, axes=named, epoch=config.time.epoch or _first(given, "epoch"))
        brought += companions(given, config.loads, dated)
        resolved = [*given, *(load for found in tabled.values() for load in found), *brought]
        bearings = [load.bearing for load in resolved if load.bearing is not None]
        inverse = inverse_inertia(context, body)
        apart = [load.apart for load in resolved if load.apart is not None]
        turning = body.inertia, inverse
        if bearings or apart:
            turning = turning_inertia(context, body, bearings, apart)
        fields = [load.uniform_field for load in resolved if load.uniform_field is not None]
        gravity = [sum(x, context.zero) for x in zip(*fields, strict=True)] if fields else None
        for number, load in enumerate(resolved):
            load.check(number, position)
        if gravity is not None and body.mass is None:
            off_center = any(x != 0 for x in body.center_of_mass)
            if position is not None or off_center:
                raise _fail("body", "mass", "missing; uniform_gravity needs it")
        loads = tuple(load for load in resolved if load.acts() and load.uniform_field is None)
        events = resolve_events(config.events, config.parameters, names)
        states = resolve_states(config.states, config.parameters, names, context)
        readers = [(load.described, formula) for load in loads for _, formula in load.formulas()]
        readers += [(f"event {event.name}", event.expression) for event in events]
        carried = carried_states(states, readers, config.output.record)
        formulas = [formula for _, formula in readers] + [state.derivative for state in carried]
        read = frozenset[str]().union(*map(names_used, formulas))
        loads = tuple(load for load in resolved if _is_among(load, loads) or load.read_by(read))
        all_axes, date = named or _first(resolved, "axes"), config.time.epoch or _first(resolved, "epoch")
        published = config.output, table.host, all_axes, date, (start, end), experiment.source
        scene = Scene(
            name=config.name,
            description=config.description,
            context=context,
            body=body,
            turning_inertia=turning[0],
            inverse_inertia=turning[1],
            angular_velocity=[context.zero] * 3,
            quaternion=[context.one] + [context.zero] * 3,
            euler_angles=None,
            position=position,
            velocity=velocity,
            gravity=gravity,
            loads=loads,
            events=events,
            start=start,
            end=end,
            samples=samples,
            axes=all_axes,
            epoch=date,
            figure=figure_of(config.frame, body, context),
            reference=reference_normal(config.frame, context),
            config=config,
            bodies=masses,
            given_loads=tuple(given),
            tabled=tabled,
            states=carried,
            ephemeris=ephemeris,
            host=host,
            orientation=_orientation(*published),
        )
        return _with_start(scene, starts.start_of(scene, _with_start))
    except ConfigError as error:
        raise error.at(experiment.source) from None


def _orientation(table: schema.Output, *around: Any) -> Orientation | None:
    if table.orientation is None and table.orientation_of is None:
        return None
    from rigidsim.scene.kernels.spice import resolve_orientation

    return resolve_orientation(table, *around)


def _body_at_start(config: schema.Config, context: Any) -> RigidBody:
    moments = moments_at_start(config, context, config.time.start.at(context))
    body = build_body(config.body, context, config.integrator.euler_sequence, moments)
    outside = surfaces_of(config.body.surfaces, body.center_of_mass, context)
    if outside:
        drawing = with_surfaces(body.drawing, config.body.surfaces, outside)
        body = replace(body, surfaces=outside, drawing=drawing)
    if config.body.gravity_field is None:
        return body
    texts = {name: table.text for name, table in config.tables.items()}
    degree = asked_degree(config.body.gravity_field, config.loads)
    return replace(body, gravity=gravity_field_of(config.body.gravity_field, body, context, texts, degree))


def _first(loads: Iterable[SceneLoad], what: str) -> Any:
    """The first that a load implies; None if none does."""
    return next((found for load in loads if (found := getattr(load, what))), None)


def _is_among(load: SceneLoad, loads: Iterable[SceneLoad]) -> bool:
    return any(load is x for x in loads)


def _fail(table: str, key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[{table}] {key}".strip(), text))


def _with_start(scene: Scene, start: starts.InitialRotation) -> Scene:
    rates = scene.angular_velocity if start.angular_velocity is None else start.angular_velocity
    return replace(
        scene,
        quaternion=start.quaternion,
        angular_velocity=rates,
        euler_angles=start.euler_angles,
        found_start=start.found,
    )


def _resolve_loads(
    config: schema.Config,
    body: RigidBody,
    context: Any,
    masses: PointMasses | None,
    names: Names,
    *,
    free_flight: bool,
    span: tuple[Any, Any],
    ephemeris: Ephemeris | None,
    host: str,
) -> tuple[list[SceneLoad], dict[str, tuple[SceneLoad, ...]]]:
    """Those of ``[[loads]]``, and those with tables of their own by the table's name."""
    found = []
    tables = {name: table.text for name, table in config.tables.items()}
    fixed = config.parameters, body.center_of_mass, free_flight, config.frame.axes, config.time.epoch
    around = Surroundings(
        0, context, *fixed, tables, span, masses, names, body=body, ephemeris=ephemeris, host=host
    )
    for number, fields in enumerate(config.loads):
        kind = LOAD_KINDS[fields.kind]  # type: ignore[attr-defined]
        found.append(kind.resolve(fields, replace(around, number=number)))
    refuse_odd_rotors(config.rotors, body, context)
    tabled = {}
    for name, kind in TABLES.items():
        places = enumerate(getattr(config, name))
        tabled[name] = tuple(kind.resolve(x, replace(around, number=n, table=name)) for n, x in places)
    return found, tabled


def _translation(config: schema.Config, body: RigidBody, context: Any) -> tuple[Vector | None, Vector | None]:
    if not config.initial.flies:
        if config.initial.frame is not None:
            raise _fail("initial", "frame", "given without position or velocity, which it is of; add them")
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
    return flight_start(config, context)


def _check_limits(limits: schema.Limits) -> None:
    for key in ("wall_time", "max_drift"):
        value = getattr(limits, key)
        if value is not None and value.sign <= 0:
            raise _fail("limits", key, f"given {float(value):g}; a positive number is allowed")
