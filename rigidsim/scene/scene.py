"""The scene: a config with every number worked out and every physical contradiction refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, TypeVar

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import attitude, schema
from rigidsim.scene.arithmetic import Matrix, Vector, apply, context_for, dot, transpose
from rigidsim.scene.body import RigidBody, build_body, inverse_inertia
from rigidsim.scene.config import Experiment
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.events import Event, resolve_events
from rigidsim.scene.exact import rounded
from rigidsim.scene.registry import LOAD_KINDS, SceneLoad, Surroundings
from rigidsim.scene.validation_messages import shown

_MOST_SAMPLES = 10**12
T = TypeVar("T")


@dataclass(frozen=True)
class SampleTimes:
    """Where samples lie, seconds, as exactly as they were written: ``begin + i * step``, or a list.

    Attributes:
        begin: of the motion.
        step: from one sample of a grid to the next; zero for a list.
        times: the list, or None.
        count: number of samples.
        context: of the scene.
    """

    begin: Fraction
    step: Fraction
    times: tuple[Fraction, ...] | None
    count: int
    context: Any

    @classmethod
    def listed(cls, begin: Fraction, times: Sequence[Fraction], context: Any) -> SampleTimes:
        """A list."""
        return cls(begin, Fraction(0), tuple(times), len(times), context)

    @property
    def exact_last(self) -> Fraction:
        """Time of the last sample."""
        return self.times[-1] if self.times is not None else self.begin + self.step * (self.count - 1)

    @property
    def start(self) -> Any:
        """Of the motion (mpf)."""
        return rounded(self.begin, self.context)

    @property
    def last(self) -> Any:
        """Time of the last sample (mpf)."""
        return rounded(self.exact_last, self.context)


@dataclass(frozen=True)
class Scene:
    """All that the equations of motion depend on; numbers are mpf of ``context`` in SI units.

    Attributes:
        angular_velocity: initial, body axes, rad/s.
        quaternion: initial, unit, body to space.
        euler_angles: as given in ``euler_sequence`` (radians), or None where another attitude was given.
        position, velocity: of the centre of mass, space axes; None unless the body moves freely.
        gravity: sum of all uniform fields, space axes, m/s^2; None without such a load.
        loads: the others, without those that are zero whatever happens.
        events: crossings that are recorded, or end the run.
        inverse_inertia: pseudo-inverse of ``body.inertia``.
        axes, epoch: what the space axes and time 0 are, where the config says it or a load implies it.
    """

    name: str
    description: str
    context: Any
    body: RigidBody
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
    config: schema.Config

    @property
    def free_flight(self) -> bool:
        """True in six degrees of freedom, False about a fixed point or in free rotation."""
        return self.position is not None

    @property
    def torque_arm(self) -> Vector | None:
        """Mass times centre of mass (kg m, body axes) on which gravity pulls; None without a torque."""
        if self.gravity is None or self.free_flight or self.body.mass is None:
            return None
        if all(x == 0 for x in self.body.center_of_mass) or all(g == 0 for g in self.gravity):
            return None
        return [self.body.mass * x for x in self.body.center_of_mass]


def build_scene(experiment: Experiment) -> Scene:
    """Work out the scene of a config.

    Raises:
        ConfigError: something in it contradicts mechanics or another key; names the file.
    """
    config = experiment.config
    context = context_for(config.integrator.precision)
    problems: list[Problem] = []

    def attempt(part: Callable[..., T], *arguments: Any) -> T | None:
        try:
            return part(*arguments)
        except ConfigError as error:
            problems.extend(error.problems)
            return None

    body = attempt(build_body, config.body, context)
    orientation = attempt(_initial_attitude, config, context)
    times = attempt(_times, config, context)
    attempt(_check_limits, config)
    if body is None or orientation is None or times is None or problems:
        raise ConfigError(problems, experiment.source)
    quaternion, angles = orientation
    start, end, samples = times
    try:
        inverse = inverse_inertia(context, body)
        position, velocity = _translation(config, body, context)
        resolved = _resolve_loads(config, body, context, free_flight=position is not None)
        gravity = _gravity(resolved, context)
        for number, load in enumerate(resolved):
            load.check(number, position)
        if gravity is not None and body.mass is None:
            off_center = any(x != 0 for x in body.center_of_mass)
            if position is not None or off_center:
                raise _fail("body", "mass", "missing; uniform_gravity needs it")
        return Scene(
            name=config.name,
            description=config.description,
            context=context,
            body=body,
            inverse_inertia=inverse,
            angular_velocity=_initial_rates(config, body, inverse, quaternion, context),
            quaternion=quaternion,
            euler_angles=angles,
            position=position,
            velocity=velocity,
            gravity=gravity,
            loads=tuple(load for load in resolved if load.acts() and load.uniform_field is None),
            events=resolve_events(config, free_flight=position is not None),
            start=start,
            end=end,
            samples=samples,
            axes=config.frame.axes or next((load.axes for load in resolved if load.axes), None),
            epoch=config.time.epoch or next((load.epoch for load in resolved if load.epoch), None),
            config=config,
        )
    except ConfigError as error:
        raise error.at(experiment.source) from None


def _fail(table: str, key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[{table}] {key}".strip(), text))


def _initial_attitude(config: schema.Config, context: Any) -> tuple[Vector, Vector | None]:
    table = config.initial
    if table.quaternion is not None and table.euler_angles is not None:
        raise _fail(
            "initial",
            "euler_angles",
            "given beside quaternion; only one attitude is allowed: remove one of them",
        )
    if table.euler_angles is not None:
        angles = [x.at(context) for x in table.euler_angles]
        sequence = config.integrator.euler_sequence
        return attitude.quaternion_from_euler(context, angles, sequence), angles
    if table.quaternion is None:
        return [context.one] + [context.zero] * 3, None
    q = [x.at(context) for x in table.quaternion]
    if all(x == 0 for x in q):
        raise _fail(
            "initial", "quaternion", "given zero; [w, x, y, z] with a norm that is not zero is allowed"
        )
    return attitude.unit_quaternion(context, q), None


def _initial_rates(
    config: schema.Config, body: RigidBody, inverse: Matrix, quaternion: Vector, context: Any
) -> Vector:
    table = config.initial
    if (table.angular_velocity is None) == (table.angular_momentum is None):
        given, joined = ("neither", "nor") if table.angular_velocity is None else ("both", "and")
        raise _fail(
            "initial",
            "angular_velocity",
            f"given {given} this {joined} angular_momentum; exactly one is needed",
        )
    if table.angular_velocity is not None:
        rates = [x.at(context) for x in table.angular_velocity]
        key = "angular_velocity"
    else:
        assert table.angular_momentum is not None
        to_body = transpose(attitude.rotation_matrix(quaternion))
        momentum = apply(to_body, [x.at(context) for x in table.angular_momentum])
        rates = apply(inverse, momentum)
        key = "angular_momentum"
        for moment, axis in zip(body.principal_moments, body.principal_axes, strict=True):
            if moment == 0 and abs(dot(axis, momentum)) > max(abs(m) for m in momentum) * 1e-14:
                raise _fail(
                    "initial",
                    key,
                    "has a part along the axis that has no moment of inertia; make that part zero",
                )
    for moment, axis in zip(body.principal_moments, body.principal_axes, strict=True):
        if moment == 0 and abs(dot(axis, rates)) > max(abs(r) for r in rates) * 1e-14:
            raise _fail(
                "initial",
                key,
                "has a spin about the axis that has no moment of inertia, where a spin means nothing; "
                "make that component zero",
            )
    return rates


def _resolve_loads(
    config: schema.Config, body: RigidBody, context: Any, *, free_flight: bool
) -> list[SceneLoad]:
    found = []
    for number, fields in enumerate(config.loads):
        fixed = config.parameters, body.center_of_mass, free_flight, config.frame.axes, config.time.epoch
        around = Surroundings(number, context, *fixed)
        kind = LOAD_KINDS[fields.kind]  # type: ignore[attr-defined]
        found.append(kind.resolve(fields, around))
    return found


def _gravity(resolved: list[SceneLoad], context: Any) -> Vector | None:
    fields = [load.uniform_field for load in resolved if load.uniform_field is not None]
    if not fields:
        return None
    return [sum(components, context.zero) for components in zip(*fields, strict=True)]


def _translation(config: schema.Config, body: RigidBody, context: Any) -> tuple[Vector | None, Vector | None]:
    table = config.initial
    if table.position is None and table.velocity is None:
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
    zero = [context.zero] * 3
    position = [x.at(context) for x in table.position] if table.position else zero
    velocity = [x.at(context) for x in table.velocity] if table.velocity else list(zero)
    return position, velocity


def _times(config: schema.Config, context: Any) -> tuple[Any, Any, SampleTimes]:
    table = config.time
    ways = [key for key in ("samples", "every", "times") if getattr(table, key) is not None]
    if len(ways) > 1:
        raise _fail("time", ways[1], f"given beside {ways[0]}; only one of samples, every, times is allowed")

    def shortly(time: Fraction, digits: int = 12) -> str:
        return str(context.nstr(rounded(time, context), digits))

    start = table.start.fraction(context)
    if table.times is not None:
        times = [t.fraction(context) for t in table.times]
        if not times:
            raise _fail("time", "times", "given an empty array; at least one time is needed")
        for i, (a, b) in enumerate(pairwise(times)):
            if not a < b:
                raise _fail(
                    "time", f"times[{i + 1}]", f"given {shortly(b)} after {shortly(a)}; times must increase"
                )
        if times[0] < start:
            raise _fail(
                "time",
                "times[0]",
                f"given {shortly(times[0])} s; start ({shortly(start)} s) or later is allowed",
            )
        end = table.end.fraction(context) if table.end is not None else times[-1]
        if times[-1] > end:
            raise _fail(
                "time",
                f"times[{len(times) - 1}]",
                f"given {shortly(times[-1])} s; end ({shortly(end)} s) or earlier is allowed",
            )
        return rounded(start, context), rounded(end, context), SampleTimes.listed(start, times, context)
    if table.end is None:
        raise _fail("time", "end", "missing; it must be given, unless times are")
    end = table.end.fraction(context)
    if not end > start:
        raise _fail("time", "end", f"given {shortly(end)} s; after start ({shortly(start)} s) is allowed")
    if table.every is not None:
        step = table.every.fraction(context)
        if not step > 0:
            raise _fail("time", "every", f"given {shortly(step)} s; a positive time is allowed")
        irrational = any(t is not None and t.pi_power for t in (table.start, table.end, table.every))
        slack = Fraction(1, 2**100) if irrational else 0  # an end on the grid is a sample, rounded or not
        intervals = math.floor((end - start) / step + slack)
        if intervals > _MOST_SAMPLES:
            ratio = shortly((end - start) / step, 3)
            raise _fail("time", "every", f"asks for {ratio} samples; at most 1e12 are allowed")
        if intervals == 0:
            raise _fail(
                "time",
                "every",
                f"given {shortly(step)} s, longer than the whole run; at most end - start "
                f"({shortly(end - start)} s) is allowed",
            )
    else:
        count = table.samples if table.samples is not None else 1001
        if not 2 <= count <= _MOST_SAMPLES:
            raise _fail(
                "time",
                "samples",
                f"given {shown(count)}; 2 to 1e12 are allowed (the first at start, the last at end)",
            )
        intervals = count - 1
        step = (end - start) / intervals
    samples = SampleTimes(start, step, None, intervals + 1, context)
    return rounded(start, context), rounded(end, context), samples


def _check_limits(config: schema.Config) -> None:
    for key in ("wall_time", "max_drift"):
        value = getattr(config.limits, key)
        if value is not None and value.sign <= 0:
            raise _fail("limits", key, f"given {float(value):g}; a positive number is allowed")
