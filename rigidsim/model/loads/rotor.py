"""Rotors in the body: free, driven by a motor, or at a fixed rate, any number of them.

With the tensor I of the body, which includes each rotor as if it were locked, a rotor's moment J about its
unit axis a and its rate s relative to the body,

    L = I w + sum of J s a,    T = w . I w / 2 + sum of (J s a . w + J s^2 / 2).

On a bearing its momentum about the axis h = J (s + a . w) changes by its motor's torque alone, h' = torque,
and is a constant of a free rotor. In terms of h and I_b = I - sum of J a a^T over the rotors on bearings,

    L = I_b w + sum of h a,    T = w . I_b w / 2 + sum of h^2 / 2 J,
    I_b w' = (I_b w) x w + sum of (h a x w - torque a) + N

(Hughes, Spacecraft Attitude Dynamics, 1986, sections 3.3 and 3.4). Of a motor's work the part h^2 / 2 J is
the rotor's, and only the rest, -torque a . w, has to be integrated. One that keeps a rate does the work
J s a . (w - w0): what stays then is w . I w / 2 of the body with that rotor locked.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.names import in_si, written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import exponent
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector, apply, dot, norm
from rigidsim.scene.expressions.names import NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import Expression, states_read
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.rotors import Bearing, RotorTable
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing import plain


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
        if min(body.principal_moments) == 0:
            raise around.fault(
                "",
                "given in a body without a moment about one of its axes, which a rotor can't turn; "
                "remove the rotor, or give the body all three moments",
            )
        if moment == 0 and not fields.fixed:
            raise around.fault("moment", "given 0; a positive moment is allowed")
        if fields.fixed and fields.torque is not None:
            raise around.fault(
                "torque",
                "given with fixed = true, which keeps the rate by whatever torque that takes; remove one",
            )
        own = dot(axis, apply(body.inertia, axis)) / dot(axis, axis)
        if moment > own:
            raise around.fault(
                "moment",
                f"given {context.nstr(moment, 8)} kg m^2, more than the body's own about this axis, "
                f"{context.nstr(own, 8)} kg m^2, which includes the rotor as if it were locked; make it "
                "smaller, or add the rotor's tensor to [body]'s",
            )
        motor = None if fields.torque is None else around.expression("torque", fields.torque, "N m")
        size = norm(context, axis)
        axis = [x / size if x != 0 else context.zero for x in axis]
        numbers = moment, fields.rate.at(context)
        return cls(fields.name, axis, *numbers, motor, fields.fixed)

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"rotor {self.name}"

    @property
    def bearing(self) -> Bearing | None:  # type: ignore[override]
        return None if self.fixed else (self.moment, self.axis)

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
        """Momentum about its axis at the start, kg m^2/s: of a fixed one only what it has beside the body."""
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
        factor = m.number(context.ldexp(context.one, m.scaling.time - unit))
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
        context, scaling = m.scene.context, m.scaling
        if self.fixed:
            return hy.expression(m.number(context.ldexp(self.rate, scaling.time)))
        constant, expression = self._momentum(m)
        own = m.number(context.ldexp(constant / self.moment, scaling.time)) * expression
        return own - self._about_axis(m)

    def _about_axis(self, m: Kinematics) -> Symbolic:
        """The body's rate a . w about the axis, in units of 1/time."""
        return hy.sum([m.number(x) * w for x, w in zip(self.axis, m.rates, strict=True) if x != 0])

    # --- energy and torque ----------------------------------------------------------------------------------

    def lends(self, m: Kinematics) -> bool:
        """See ``carriers.Lending``: J s a . w of a fixed rate, h^2 / 2 J of a driven one."""
        return self.fixed or self.motor is not None

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        context, scaling = m.scene.context, m.scaling
        if self.fixed:
            own = m.number(context.ldexp(self.moment * self.rate**2 / 2, -scaling.energy))
            size = m.number(context.ldexp(self.moment * self.rate, scaling.time - scaling.inertia))
            return own + size * self._about_axis(m)
        constant, expression = self._momentum(m)
        size = m.number(context.ldexp(constant**2 / (2 * self.moment), -scaling.energy))
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
        size = m.number(m.scene.context.ldexp(m.scene.context.one, -m.scaling.energy))
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
