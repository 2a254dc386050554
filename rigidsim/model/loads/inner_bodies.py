"""What turns within the body: rotors and a fluid core.

**Rotors** are free, driven by a motor, or at a fixed rate, any number of them. With the tensor I of the body,
which includes each rotor as if it were locked, a rotor's moment J about its unit axis a and its rate s
relative to the body,

    L = I w + sum of J s a,    T = w . I w / 2 + sum of (J s a . w + J s^2 / 2).

On a bearing its momentum about the axis h = J (s + a . w) changes by its motor's torque alone, h' = torque,
and is a constant of a free rotor. In terms of h and I_b = I - sum of J a a^T over the rotors on bearings,

    L = I_b w + sum of h a,    T = w . I_b w / 2 + sum of h^2 / 2 J,
    I_b w' = (I_b w) x w + sum of (h a x w - torque a) + N

(Hughes, Spacecraft Attitude Dynamics, 1986, sections 3.3 and 3.4). Of a motor's work the part h^2 / 2 J is
the rotor's, and only the rest, -torque a . w, has to be integrated. One that keeps a rate does the work
J s a . (w - w0): what stays then is w . I w / 2 of the body with that rotor locked.

The axis of a rotor on a driven gimbal turns about the gimbal g by the angle d, a state: the momentum
J s (cos d a + sin d g x a) of a kept rate exerts -J s d' g x a(d) on the body (Schaub & Junkins, Analytical
Mechanics of Space Systems, 2018, section 4.5, without the gimbal's own inertia), and its power is that
torque's on the body.

**A fluid core** turns apart, by friction and by the pressure of a flattened boundary. Its axis p is the
body's axis of largest moment, its tensor I_c = A_c + (C_c - A_c) p p^T stays in body axes, and with its rate
v and the body's w, both in body axes,

    N_c = K (v - w) + (C_c - A_c) (p . v) p x v,
    d(I_m w)/dt + w x I_m w = N + N_c,    d(I_c v)/dt + w x I_c v = -N_c,    I_m = I - I_c

(Poincare's model to first order in the flattening, as in Williams, Boggs, Yoder, Ratcliff & Dickey 2001, JGR
106, 27933). The angular momentum I_m w + I_c v is kept, and of the energy w . I_m w / 2 + v . I_c v / 2
friction takes K |v - w|^2. With d = w - v, f = (C_c - A_c) / C_c and M = 1 - f p p^T the core's equation is

    v' = M (v x d + K / A_c d) + f / (1 - f) (p . v) p x d,

in which everything is small where the core follows the body. Other torques act on the whole tensor I.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.kinematics import Kinematics, in_common_unit
from rigidsim.model.load import Load, Term
from rigidsim.model.names import in_si, written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import exponent, largest_rates
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, dot, norm, unit_vectors
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.expressions.names import NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import Expression, states_read
from rigidsim.scene.frame import unique_axis
from rigidsim.scene.readable import value_text
from rigidsim.scene.registry import EffectPart, Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config, RotorTable
from rigidsim.scene.swept import plain

_ACROSS = 1e-12  # cosine of a right angle, but for rounding


@register_load(table="rotors")
@dataclass(frozen=True)
class Rotor(Load):
    """A rotor: unit axis (body axes), moment (kg m^2), rate relative to the body at the start (rad/s); mpf.

    Attributes:
        motor: torque of its motor on it, N m; None for a rotor that is free, or has a fixed rate.
        fixed: whether the rate is kept.
    """

    name: str
    axis: Vector
    moment: Any
    rate: Any
    motor: Expression | None
    fixed: bool

    conservative = True  # all that isn't is in ``supplied_power``

    @classmethod
    def resolve(cls, fields: RotorTable, around: Setting) -> Rotor:
        context, body = around.context, around.body
        axis, moment = [x.at(context) for x in fields.axis], fields.moment.at(context)
        ensure(
            min(body.principal_moments) != 0,
            around.fault(
                "",
                "given in a body without a moment about one of its axes, which a rotor can't turn; "
                "remove the rotor, or give the body all three moments",
            ),
        )
        ensure(
            moment != 0 or fields.fixed,
            around.fault("moment", "given 0; a positive moment is allowed"),
        )
        ensure(
            not fields.fixed or fields.torque is None,
            around.fault(
                "torque",
                "given with fixed = true, which keeps the rate with any torque needed; remove one",
            ),
        )
        own = dot(axis, apply(body.inertia, axis)) / dot(axis, axis)
        if moment > own:
            raise around.fault(
                "moment",
                f"given {context.nstr(moment, 8)} kg m^2, more than the body's moment about this axis, "
                f"{context.nstr(own, 8)} kg m^2, which must include the locked rotor; make the rotor's "
                "moment smaller, or add the rotor's tensor to [body]",
            )
        motor = None if fields.torque is None else around.expression("torque", fields.torque, "N m")
        size = norm(context, axis)
        axis = [x / size if x != 0 else context.zero for x in axis]
        rotor = cls(fields.name, axis, moment, fields.rate.at(context), motor, fields.fixed)
        return rotor if fields.gimbal is None else GimballedRotor.on(rotor, fields, around)

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"rotor {self.name}"

    @property
    def apart(self) -> Matrix | None:  # type: ignore[override]
        """On a bearing, J a a^T: torques on the body don't accelerate it about its axis."""
        return None if self.fixed else [[self.moment * x * y for y in self.axis] for x in self.axis]

    @property
    def inner_momentum(self) -> Vector:  # type: ignore[override]
        return [self.moment * self.rate * x for x in self.axis]

    def acts(self) -> bool:
        """A rotor that is fixed at rest is part of the body."""
        return not self.fixed or (self.rate != 0 and self.moment != 0)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset() if self.motor is None else states_read(self.motor)

    # --- its momentum ---------------------------------------------------------------------------------------

    def starting_momentum(self, scene: Scene) -> Any:
        """Momentum about its axis at the start, kg m^2/s: of a fixed one only relative to the body."""
        with_body = 0 if self.fixed else dot(self.axis, scene.angular_velocity)
        return self.moment * (self.rate + with_body)

    def _unit(self, m: Kinematics) -> int:
        """Binary exponent of the unit of h, kg m^2/s: as large as h may become, and no less than the body's.

        What the motor adds it takes from the body, whose energy of rotation the estimate is about.
        """
        context, scene = m.scene.context, m.scene
        largest = abs(self.starting_momentum(scene))
        if m.scaling.drive is not None:
            heaviest = context.maximum(scene.body.principal_moments)
            largest = largest + context.sqrt(2 * heaviest * m.scaling.drive.energy)
        return exponent(context, context.maximum([largest, context.ldexp(context.one, m.scaling.momentum)]))

    @property
    def _state(self) -> str:
        return f"momentum_{self.name}"

    def extra_states(self, m: Kinematics) -> StateBlock | None:
        if self.motor is None:
            return None
        context, unit = m.scene.context, self._unit(m)
        factor = m.scaled(1, m.scaling.time - unit)
        start = context.ldexp(self.starting_momentum(m.scene), -unit)
        slope = factor * written(m, [self.motor])[0]
        return StateBlock(
            [self._state],
            [slope],
            [start],
            exponents=[unit],
            why=f"momentum of {self.title} about its axis, which its motor changes",
        )

    def _momentum(self, m: Kinematics) -> tuple[Any, Symbolic]:
        """The momentum about its axis, kg m^2/s, as a constant (mpf) times an expression."""
        context = m.scene.context
        if self.motor is not None:
            return context.ldexp(context.one, self._unit(m)), hy.make_vars(self._state)
        return self.starting_momentum(m.scene), hy.expression(1.0)

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        constant, expression = self._momentum(m)
        size = m.scene.context.ldexp(constant, -m.scaling.momentum)
        return [([size * x for x in self.axis], expression)]

    def relative_rate(self, m: Kinematics) -> Symbolic:
        """Its rate relative to the body, in units of 1/time."""
        scaling = m.scaling
        if self.fixed:
            return hy.expression(m.scaled(self.rate, scaling.time))
        constant, expression = self._momentum(m)
        own = m.scaled(constant / self.moment, scaling.time) * expression
        return own - self._about_axis(m)

    def _about_axis(self, m: Kinematics) -> Symbolic:
        """The body's rate a . w about the axis, in units of 1/time."""
        return hy.sum([m.number(x) * w for x, w in zip(self.axis, m.rates, strict=True) if x != 0])

    # --- energy and torque ----------------------------------------------------------------------------------

    def lends(self, m: Kinematics) -> bool:
        """See ``carriers.Lending``: J s a . w of a fixed rate, h^2 / 2 J of a driven one."""
        return self.fixed or self.motor is not None

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        scaling = m.scaling
        if self.fixed:
            own = m.scaled(self.moment * self.rate**2 / 2, -scaling.energy)
            size = m.scaled(self.moment * self.rate, scaling.time - scaling.inertia)
            return own + size * self._about_axis(m)
        constant, expression = self._momentum(m)
        size = m.scaled(constant**2 / (2 * self.moment), -scaling.energy)
        return size * expression**2.0

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        if self.motor is None:
            return []
        size = m.scene.context.ldexp(m.scene.context.one, -m.scaling.energy)
        return [([-size * x for x in self.axis], written(m, [self.motor])[0])]

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """What the motor does on the body, -torque a . w."""
        if self.motor is None:
            return None
        size = m.scaled(1, -m.scaling.energy)
        return -(size * (written(m, [self.motor])[0] * self._about_axis(m)))

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        momentum = self.starting_momentum(scene)
        if self.fixed:
            energy = momentum * (dot(self.axis, scene.angular_velocity) + self.rate / 2)
        else:
            energy = momentum**2 / (2 * self.moment)
        return [momentum * x for x in self.axis], energy

    # --- sizes ----------------------------------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any | None:
        """A motor's effect is estimated; without one, the body's own energy of rotation stays."""
        return scene.context.zero if self.motor is None else None

    def gyroscopic_momentum(self, scene: Scene) -> Vector:
        """See ``scaling.Gyroscopic``."""
        return self.carried_at_start(scene)[0]

    # --- what readers and pictures show -------------------------------------------------------------------

    def pictured(self) -> dict[str, Any]:
        return {
            "what": "rotor",
            "name": self.name,
            "axis": [float(plain(x)) for x in self.axis],
            "moment": float(plain(self.moment)),
            "rate": float(plain(self.rate)),
            "drive": "fixed" if self.fixed else "free" if self.motor is None else "driven",
        }


@dataclass(frozen=True)
class GimballedRotor(Rotor):
    """A rotor at a fixed rate on a gimbal: a control moment gyro.

    Attributes:
        gimbal: unit axis of the gimbal, body axes, at right angles to the rotor's axis (mpf).
        angle, gimbal_rate: the gimbal's angle, a state, rad; its rate, rad/s.
        begins: unit axis of the rotor at the start, body axes (mpf).
    """

    gimbal: Vector
    angle: Expression
    gimbal_rate: Expression
    begins: Vector

    @classmethod
    def on(cls, rotor: Rotor, fields: RotorTable, around: Setting) -> GimballedRotor:
        """A rotor on the gimbal that the keys describe."""
        gimbal = [x.at(around.context) for x in required(fields.gimbal)]
        size = norm(around.context, gimbal)
        across = dot(gimbal, rotor.axis) / size
        what = f"given an axis whose cosine with the rotor's is {float(plain(across)):.3g}; 0 is allowed"
        ensure(abs(across) < _ACROSS, around.fault("gimbal", what))
        what = "missing; a rotor on a gimbal needs fixed = true, by which its motor keeps its rate"
        ensure(fields.fixed, around.fault("fixed", what))
        rate = around.expression("gimbal_rate", required(fields.gimbal_rate), "rad/s")
        context, angle = around.context, fields.gimbal_angle.at(around.context)
        unit = [x / size for x in gimbal]
        ways, parts = (rotor.axis, cross(unit, rotor.axis)), (context.cos(angle), context.sin(angle))
        begins = [sum(part * way[i] for part, way in zip(parts, ways, strict=True)) for i in range(3)]
        turned = around.expression("gimbal", f"gimbal_{rotor.name}", "rad")
        return cls(**vars(rotor), gimbal=unit, angle=turned, gimbal_rate=rate, begins=begins)

    @property
    def inner_momentum(self) -> Vector:  # type: ignore[override]
        return [self.moment * self.rate * x for x in self.begins]

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return states_read(self.gimbal_rate, self.angle)

    def _turned(self, ahead: bool) -> list[tuple[Vector, int]]:
        """Axes of the angle's cosine and sine in the momentum, or in its derivative by the angle."""
        side = cross(self.gimbal, self.axis)
        return [(side, 0), ([-x for x in self.axis], 1)] if ahead else [(self.axis, 0), (side, 1)]

    def _terms(self, m: Kinematics, exponent: int, *, ahead: bool = False) -> list[Term]:
        (angle,) = written(m, [self.angle])
        size = m.scene.context.ldexp(self.moment * self.rate, exponent)
        parts = hy.cos(angle), hy.sin(angle)
        return [([size * x for x in axis], parts[which]) for axis, which in self._turned(ahead)]

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        return self._terms(m, -m.scaling.momentum)

    def lends(self, m: Kinematics) -> bool:
        return False

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        """None: the rotor's own is a constant."""
        return None

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        (rate,) = written(m, [self.gimbal_rate])
        return [
            ([-x for x in vector], rate * part)
            for vector, part in self._terms(m, -m.scaling.energy, ahead=True)
        ]

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        parts = [
            m.number(x) * (part * w) for vector, part in self.exerted_torque(m)
            for x, w in zip(vector, m.rates, strict=True) if x != 0
        ]  # fmt: skip
        return hy.sum(parts)

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        return self.inner_momentum, scene.context.zero

    def amplitude(self, scene: Scene) -> Any | None:
        """None: its effect is estimated."""
        return None

    def pictured(self) -> dict[str, Any]:
        gimbal = [float(plain(x)) for x in self.gimbal]
        return super().pictured() | {"drive": "gimballed", "gimbal": gimbal}


@provides
class RotorRates(NameProvider):
    """The rates of rotors relative to the body."""

    brings = "rate_NAME with one of [[rotors]] that has this name"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        return (Readable(f"rate_{rotor.name}", "rad/s") for rotor in config.rotors)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        return {f"rate_{rotor.name}": rotor.rate for rotor in rotors_of(scene)}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        found = {f"rate_{rotor.name}": rotor for rotor in rotors_of(m.scene)}
        units = -m.scaling.time
        return {name: in_si(m, x.relative_rate(m), units) for name, x in found.items() if name in names}


def rotors_of(scene: Scene) -> list[Rotor]:
    """All rotors of a scene, in the order of the config; those that are locked, too."""
    return [rotor for rotor in scene.tabled.get("rotors", ()) if isinstance(rotor, Rotor)]


# --- a fluid core -------------------------------------------------------------------------------------------

STATES = ("core_wx", "core_wy", "core_wz")
_ROUNDING_OF_INPUT = 1e-14  # relative, of moments that a double-precision program printed
_MOST_DAMPED = 1e12  # times within a run that friction may take the core to the mantle's rate: as many steps
_STIFF = 100.0  # by which friction may be faster than the rotation before the run warns of it


@register_load(body="core")
@dataclass(frozen=True)
class FluidCore(Load):
    """The core; numbers are mpf.

    Attributes:
        axis: its axis of symmetry (unit, body axes).
        polar: its moment about that, kg m^2.
        flattening: (C_c - A_c) / C_c.
        friction: K, kg m^2/s.
        rate: its angular velocity at the start (rad/s, body axes); None for the body's.
    """

    axis: Vector
    polar: Any
    flattening: Any
    friction: Any
    rate: Vector | None

    title = "fluid core"
    conservative = True  # what friction takes is in ``supplied_power``
    loose = True  # see ``Load``
    nothing = {"moment": 0}  # noqa: RUF012

    @classmethod
    def brought_by(cls, config: Config) -> bool:
        return config.body.core is not None

    @staticmethod
    def effect_parts(fields: Config) -> Iterator[EffectPart]:
        for key in ("friction", "flattening"):
            missing = "" if getattr(fields.body.core, key).sign else "it is 0"
            yield EffectPart(key, f"{key} of the fluid core", {key: 0}, missing=missing)

    @classmethod
    def resolve(cls, fields: Config, around: Setting) -> FluidCore:
        context, body, table = around.context, required(around.body), required(fields.body.core)
        moment, flattening, friction = (
            x.at(context) for x in (table.moment, table.flattening, table.friction)
        )
        ensure(
            all(x == 0 for x in body.center_of_mass),
            ConfigError(
                Problem(
                    "[body] core",
                    "given for a body that turns about another point than its centre of mass, the centre "
                    "of the core; remove reference or center_of_mass",
                )
            ),
        )
        ensure(
            fields.initial.angular_momentum is None or table.angular_velocity is None,
            ConfigError(
                Problem(
                    "[initial] angular_momentum",
                    "given with angular_velocity of [body] core, from which the body's own would follow; "
                    "give angular_velocity here, too",
                )
            ),
        )
        ensure(
            fields.initial.equilibrium is None,
            ConfigError(
                Problem(
                    "[initial] equilibrium",
                    "given for a body with a fluid core, and equilibria are found for rigid bodies; give "
                    "the attitude and rates themselves",
                )
            ),
        )
        largest = context.maximum(body.principal_moments)
        axis = unique_axis(body, context, largest=True)
        if axis is None and flattening != 0 and moment != 0:
            raise _fault(
                "flattening",
                f"given {_text(flattening)}, but the body's two largest moments are equal, so that the "
                "core has no axis of largest moment; 0 is allowed",
            )
        rate = None if table.angular_velocity is None else [x.at(context) for x in table.angular_velocity]
        axis = axis or unit_vectors(context)[2]
        made = cls(axis, moment * largest, flattening, friction * largest, rate)
        if made.acts():
            _refuse_odd_mantle(made, body, context)
            _refuse_stiff(made, friction, around)
        return made

    def acts(self) -> bool:
        """Without a moment the body is rigid."""
        return bool(self.polar != 0)

    # --- its tensor and rate --------------------------------------------------------------------------------

    @property
    def tensor(self) -> Matrix:
        """I_c, kg m^2, body axes."""
        equatorial, more = self.polar * (1 - self.flattening), self.polar * self.flattening
        return [
            [more * p * q + (equatorial if i == j else 0) for j, q in enumerate(self.axis)]
            for i, p in enumerate(self.axis)
        ]

    @property
    def apart(self) -> Matrix | None:  # type: ignore[override]
        """See ``SceneLoad``."""
        return self.tensor if self.acts() else None

    def at_start(self, scene: Scene) -> Vector:
        """Its rate at the start, rad/s, body axes."""
        return scene.angular_velocity if self.rate is None else self.rate

    def unit(self, m: Kinematics) -> int:
        """Binary exponent of the unit of its rate, relative to 1 / (unit of time): for as fast as it begins,
        or as the body may turn.
        """
        context, scene = m.scene.context, m.scene
        fastest = context.maximum(
            [norm(context, self.at_start(scene)), *largest_rates(scene, m.scaling.drive)]
        )
        return exponent(context, fastest) + m.scaling.time

    def rates(self, m: Kinematics) -> list[Symbolic]:
        """Its angular velocity, body axes, in units of 1/time."""
        unit = m.scene.context.ldexp(m.scene.context.one, self.unit(m))
        return in_common_unit(list(hy.make_vars(*STATES)), [unit] * 3, m.number)

    def _relative_rate(self, m: Kinematics) -> list[Symbolic]:
        """w - v."""
        return [w - v for w, v in zip(m.rates, self.rates(m), strict=True)]

    def _along(self, m: Kinematics, vector: list[Symbolic]) -> Symbolic:
        return hy.sum([m.number(p) * x for p, x in zip(self.axis, vector, strict=True) if p != 0])

    def extra_states(self, m: Kinematics) -> StateBlock:
        context, f, unit = m.scene.context, self.flattening, self.unit(m)
        rates, relative_rate = self.rates(m), self._relative_rate(m)
        across = cross(rates, relative_rate)
        if self.friction != 0:
            drag = m.scaled(self.friction / (self.polar * (1 - f)), m.scaling.time)
            across = [x + drag * d for x, d in zip(across, relative_rate, strict=True)]
        slopes = [[x] for x in across]
        if f != 0:
            along, spin = self._along(m, across), self._along(m, rates)
            for row, p, turned in zip(
                slopes, self.axis, cross(m.fixed(self.axis), relative_rate), strict=True
            ):
                row += [m.number(-f * p) * along] if p != 0 else []
                row.append(m.number(f / (1 - f)) * (spin * turned))
        own = m.scaled(1, -unit)
        derivatives = [hy.sum(row) if unit == 0 else own * hy.sum(row) for row in slopes]
        start = [context.ldexp(x, m.scaling.time - unit) for x in self.at_start(m.scene)]
        exponents = [unit - m.scaling.time] * 3
        return StateBlock(STATES, derivatives, start, exponents=exponents, why="rate of the fluid core")

    # --- its momentum ---------------------------------------------------------------------------------------

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        context, tensor = m.scene.context, self.tensor
        inner = [[context.ldexp(x, -m.scaling.inertia) for x in row] for row in tensor]
        return list(zip(inner, self.rates(m), strict=True))  # symmetric: rows are columns

    def carried_energy(self, m: Kinematics) -> Symbolic:
        rates, terms = self.rates(m), []
        for vector, rate in self.carried_momentum(m):
            terms += [m.number(x / 2) * (v * rate) for x, v in zip(vector, rates, strict=True) if x != 0]
        return hy.sum(terms)

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        context, rates, found = m.scene.context, self.rates(m), []
        if self.flattening != 0:
            size = context.ldexp(self.polar * self.flattening, -m.scaling.inertia)
            spin = self._along(m, rates)
            for axis, rate in zip(unit_vectors(context), rates, strict=True):
                found.append(([size * x for x in cross(self.axis, axis)], spin * rate))
        if self.friction != 0:
            drag = context.ldexp(self.friction, -m.scaling.momentum)
            for axis, relative_rate in zip(unit_vectors(context), self._relative_rate(m), strict=True):
                found.append(([-drag * x for x in axis], relative_rate))
        return found

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        if self.friction == 0:
            return None
        drag = m.scaled(self.friction, -m.scaling.momentum)
        return -(drag * hy.sum([d * d for d in self._relative_rate(m)]))

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        rate = self.at_start(scene)
        momentum = apply(self.tensor, rate)
        return momentum, dot(rate, momentum) / 2

    def amplitude(self, scene: Scene) -> Any:
        """Half its energy: all of the sum of both, which friction can only lessen, may become the body's, and
        bounds add four times this to w . I_m w.
        """
        return self.carried_at_start(scene)[1] / 2

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        if self.friction == 0 or not self.acts():
            return
        rates = [*scene.angular_velocity, *self.at_start(scene)]
        fastest = max(abs(plain(x)) for x in rates)
        damping = plain(self.friction / (self.polar * (1 - self.flattening)))
        if fastest > 0 and damping > _STIFF * fastest:
            time, times = value_text(1 / damping, "s"), f"{float(damping / fastest):.2g}"
            yield Caution(
                WarningCode.FRICTION_STIFF,
                f"[body] core.friction: it brings the core to the mantle's rate in {time}, {times} times "
                "as fast as anything turns, and steps are as short; without a core the motion is nearly "
                "the same",
            )

    # --- what readers see --------------------------------------------------------------------------------

    def pictured(self) -> dict[str, Any]:
        return {
            "what": "core",
            "axis": [float(plain(x)) for x in self.axis],
            "moment": float(plain(self.polar)),
            "flattening": float(plain(self.flattening)),
        }


def _refuse_odd_mantle(core: FluidCore, body: RigidBody, context: Any) -> None:
    """Refuse a core whose rest, the mantle, is no body."""
    moments = []
    for moment, axis in zip(body.principal_moments, body.principal_axes, strict=True):
        moments.append(moment - dot(axis, apply(core.tensor, axis)))
    slack = -context.maximum(body.principal_moments) * _ROUNDING_OF_INPUT
    total = sum(moments, context.zero)
    if all(x > 0 and total - 2 * x >= slack for x in moments):
        return
    listed = ", ".join(context.nstr(plain(x), 8) for x in moments)
    raise ConfigError(
        Problem(
            "[body] core",
            f"given a moment of {context.nstr(plain(core.polar), 8)} kg m^2, which leaves the mantle "
            f"moments that no body has, {listed} kg m^2 (all must be positive, and none more than the sum of "
            "the others); make the core smaller, or change its flattening",
        )
    )


def _refuse_stiff(core: FluidCore, friction: Any, around: Setting) -> None:
    """Refuse a friction whose steps no run ends with."""
    damping = core.friction / (core.polar * (1 - core.flattening))
    if damping * abs(around.end - around.start) > _MOST_DAMPED:
        time = value_text(1 / plain(damping), "s")
        raise _fault(
            "friction",
            f"given {_text(friction)} s^-1, which takes this core to the mantle's rate in {time}, and "
            "steps are as short: a smaller rate, or no core (moment = 0), is",
        )


def _text(number: Any) -> str:
    return f"{float(plain(number)):.6g}"


def _fault(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[body] core.{key}", f"{text} allowed"))


def core_of(scene: Scene) -> FluidCore | None:
    """The fluid core of a scene; None for a rigid body."""
    return next((load for load in scene.loads if isinstance(load, FluidCore)), None)
