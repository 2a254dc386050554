"""A fluid core: it turns at a rate of its own, by friction and by the pressure of a flattened boundary.

Its axis p is the body's axis of largest moment, its tensor I_c = A_c + (C_c - A_c) p p^T stays in body axes,
and with its rate v and the body's w, both in body axes,

    N_c = K (v - w) + (C_c - A_c) (p . v) p x v,
    d(I_m w)/dt + w x I_m w = N + N_c,    d(I_c v)/dt + w x I_c v = -N_c,    I_m = I - I_c

(Poincare's model to first order in the flattening, as in Williams, Boggs, Yoder, Ratcliff & Dickey 2001, JGR
106, 27933). The angular momentum I_m w + I_c v is kept, and of the energy w . I_m w / 2 + v . I_c v / 2
friction takes K |v - w|^2. With d = w - v, f = (C_c - A_c) / C_c and M = 1 - f p p^T the core's equation is

    v' = M (v x d + K / A_c d) + f / (1 - f) (p . v) p x d,

in which everything is small where the core follows the body. Other torques act on the whole tensor I.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics, in_common_unit
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import value_text
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import exponent, largest_rates
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, dot, norm, unit_vectors
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.frame import unique_axis
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain

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
        context, body, table = around.context, around.body, fields.body.core
        assert table is not None
        assert body is not None
        moment, flattening, friction = (
            x.at(context) for x in (table.moment, table.flattening, table.friction)
        )
        if any(x != 0 for x in body.center_of_mass):
            what = (
                "given for a body that turns about another point than its centre of mass, about which a core "
            )
            raise ConfigError(Problem("[body] core", what + "would turn; remove reference or center_of_mass"))
        if fields.initial.angular_momentum is not None and table.angular_velocity is not None:
            what = "given with angular_velocity of [body] core, from which the body's own would follow; give "
            raise ConfigError(Problem("[initial] angular_momentum", what + "angular_velocity here, too"))
        if fields.initial.equilibrium is not None:
            what = "given for a body with a fluid core, and equilibria are found for rigid bodies; give the "
            raise ConfigError(Problem("[initial] equilibrium", what + "attitude and rates themselves"))
        largest = context.maximum(body.principal_moments)
        axis = unique_axis(body, context, largest=True)
        if axis is None and flattening != 0 and moment != 0:
            what = (
                f"given {_text(flattening)}, but the body's two largest moments are equal, so that no axis "
                "of largest moment is the core's; 0 is"
            )
            raise _fault("flattening", what)
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
            drag = m.number(context.ldexp(self.friction / (self.polar * (1 - f)), m.scaling.time))
            across = [x + drag * d for x, d in zip(across, relative_rate, strict=True)]
        slopes = [[x] for x in across]
        if f != 0:
            along, spin = self._along(m, across), self._along(m, rates)
            for row, p, turned in zip(
                slopes, self.axis, cross(m.fixed(self.axis), relative_rate), strict=True
            ):
                row += [m.number(-f * p) * along] if p != 0 else []
                row.append(m.number(f / (1 - f)) * (spin * turned))
        own = m.number(context.ldexp(context.one, -unit))
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
        drag = m.number(m.scene.context.ldexp(self.friction, -m.scaling.momentum))
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
            text = (
                f"[body] core.friction: it takes the core to the mantle's rate in {time}, {times} times as "
            )
            text += "fast as anything turns, and steps are as short as that; without a core the motion is "
            yield Caution(WarningCode.FRICTION_STIFF, text + "nearly the same")

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
    what = (
        f"given a moment of {context.nstr(plain(core.polar), 8)} kg m^2, which leaves the mantle the moments "
        f"{listed} kg m^2, and no body has these (all are positive, and none is more than the sum of the "
        "others); make the core smaller, or flatten it otherwise"
    )
    raise ConfigError(Problem("[body] core", what))


def _refuse_stiff(core: FluidCore, friction: Any, around: Setting) -> None:
    """Refuse a friction whose steps no run ends with."""
    damping = core.friction / (core.polar * (1 - core.flattening))
    if damping * abs(around.end - around.start) > _MOST_DAMPED:
        time = value_text(1 / plain(damping), "s")
        what = (
            f"given {_text(friction)} s^-1, which takes this core to the mantle's rate in {time}, and steps "
        )
        raise _fault("friction", what + "are as short: a smaller rate, or no core (moment = 0), is")


def _text(number: Any) -> str:
    return f"{float(plain(number)):.6g}"


def _fault(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[body] core.{key}", f"{text} allowed"))


def core_of(scene: Scene) -> FluidCore | None:
    """The fluid core of a scene; None for a rigid body."""
    return next((load for load in scene.loads if isinstance(load, FluidCore)), None)
