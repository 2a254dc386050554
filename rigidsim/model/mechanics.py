"""What the loads of a scene do: torque, force, energy and power as expressions of its states.

**Carriers** add angular momentum and kinetic energy to the body's: rotors, a fluid core. With the body's I
w and the momentum h_k of each carrier, all in body axes,

    L = I w + sum of h_k,    T = w . I w / 2 + sum of T_k,

and Euler's equations L' + w x L = torque become

    I w' = (I w) x w + torque + sum of (h_k x w + g_k),

where g_k = -h_k' is the torque that a carrier exerts on the body, a motor's or friction's (Hughes, Spacecraft
Attitude Dynamics, 1986, section 3.4). The body's tensor I then contains what turns with it: of a rotor on a
bearing it includes the mass, but not the moment about the bearing's axis.

A carrier is a load: it brings its states by ``extra_states``, and is registered, configured and reported in
the same way. Motions and formulations that know the body alone ask ``carried_beside``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term, force_terms, loads_of, torque_terms
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling, exponent
from rigidsim.model.state_blocks import BODY, AttitudeStates
from rigidsim.scene.arithmetic import Vector, across, cross, parallel, unit_vectors
from rigidsim.scene.arithmetic import apply as multiply
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces


@runtime_checkable
class Carrier(Protocol):
    """A load that carries angular momentum relative to the body, or stores energy: by default, neither."""

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        """Its momentum h, body axes, in internal units of momentum."""
        return []

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        """Its kinetic energy, internal units; None for none."""
        return None

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        """The torque -h' that it exerts on the body, body axes, in internal units of energy."""
        return []

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """The power that its drive feeds in, less what its friction takes, in internal units of energy over
        time; None if it keeps the energy.
        """
        return None

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        """Its momentum (mpf, kg m^2/s, body axes) and kinetic energy (mpf, J) at the start."""
        return [scene.context.zero] * 3, scene.context.zero


def carried_beside(loads: Iterable[Load]) -> str:
    """Why more turns than a body of constant moments, for what can't do with that; empty if it doesn't."""
    found = next((load for load in loads if isinstance(load, Carrier)), None)
    if found is None:
        return ""
    return found.changes or f"{found.title} carries angular momentum"


def momentum_terms(carriers: Iterable[Any], m: Kinematics) -> list[Term]:
    """Momentum of all carriers without the body; what is zero for good is left out."""
    terms = (term for carrier in carriers for term in carrier.carried_momentum(m))
    return [(vector, hy.expression(part)) for vector, part in terms if any(x != 0 for x in vector)]


@dataclass(frozen=True)
class Mechanics(Kinematics):
    """Kinematics together with all acting loads: the quantities observables and invariants are written in."""

    loads: list[Load] = field(default_factory=list)
    average: Any = (
        None  # that replaces the full motion (``rigidsim.model.averaged.average.Average``), or None
    )

    @classmethod
    def built(
        cls,
        scene: Scene,
        scaling: Scaling,
        numbers: ScaledNumbers,
        rates: list[Symbolic],
        attitude: AttitudeStates | None,
        number: Rounder,
        *,
        vertical: bool,
        flies: bool,
        **more: Any,
    ) -> Mechanics:
        """Mechanics of given rates and attitude, from which the vertical follows unless it has states."""
        up = list(hy.make_vars(*BODY.vertical)) if vertical else None
        if attitude is not None and numbers.arm is not None:
            up = numbers.vertical_of(attitude.matrix, number)
        position = list(hy.make_vars(*BODY.position)) if flies else None
        velocity = list(hy.make_vars(*BODY.velocity)) if flies else None
        made = cls(scene, scaling, numbers, rates, attitude, up, position, velocity, number, **more)
        return made._shaped()

    def _shaped(self) -> Mechanics:
        reshaping = [load for load in loads_of(self.scene) if load.changes]
        if not reshaping:
            return self
        made = replace(self, shape=reshaping[0].shape(self))
        if made.rate_correction is None:
            return made
        states = zip(made.carried_rates, made.rate_correction, self.numbers.rate_units, strict=True)
        turning = [w + (x if u == 1 else self.number(1 / u) * x) for w, x, u in states]
        return replace(made, rate_states=turning)

    @cached_property
    def observed(self) -> Mechanics:
        """The same for what is recorded and watched, whose parameters are no sides of surfaces: moments with
        kinks decide these by the state.
        """
        if self.shape is None or not self.surfaces.found:
            return self
        return replace(self, surfaces=Surfaces())._shaped()

    @property
    def commensurable_angle(self) -> tuple[Symbolic, Symbolic] | None:
        """Sine and cosine, times a common size, of the angle that an averaged resonance keeps; else None."""
        return None

    @property
    def figure_space(self) -> list[Symbolic]:
        """Vector along the figure axis, space axes; not normalized."""
        return apply(self.matrix, self.fixed(self.scene.figure.pole))

    @property
    def spin_space(self) -> list[Symbolic]:
        """Vector along the angular velocity, space axes; not normalized."""
        return apply(self.matrix, self.rates)

    # --- sums over what carries momentum and energy ------------------------------------------------------

    @cached_property
    def carriers(self) -> list[Any]:
        """Loads that carry angular momentum."""
        return [load for load in self.loads if isinstance(load, Carrier)]

    @cached_property
    def momentum_body(self) -> list[Symbolic]:
        """Angular momentum of the body and all carriers, body axes."""
        rows = [[own] for own in self.own_momentum]
        for vector, expression in momentum_terms(self.carriers, self):
            for row, x in zip(rows, vector, strict=True):
                row += [self.number(x) * expression] if x != 0 else []
        return [row[0] if len(row) == 1 else hy.sum(row) for row in rows]

    @cached_property
    def momentum_space(self) -> list[Symbolic]:
        """The same in space axes."""
        return apply(self.matrix, self.momentum_body)

    @cached_property
    def rotational_energy(self) -> Symbolic:
        """Kinetic energy of rotation of the body, w . I w / 2, and of all carriers."""
        return self.rotational()

    def rotational(self, *, kept: bool = False) -> Symbolic:
        """The same; if ``kept``, without carriers whose energy changes by what their drives do alone."""
        own = self.inertia.energy(self.undistorted_rates, self.own_momentum)
        carriers = (x for x in self.carriers if not (kept and x.lends(self)))
        others = [found for x in carriers if (found := x.carried_energy(self)) is not None]
        return hy.sum([own, *others]) if others else own

    @cached_property
    def energy_stored_by_drives(self) -> Symbolic | None:
        """Energy of those carriers; None without any."""
        found = [x.carried_energy(self) for x in self.carriers if x.lends(self)]
        if found and self._rigid is not None and self.potential_energy is not None:
            found.append(self.potential_energy - self.carried(self._rigid.potential_energy))
        return hy.sum([x for x in found if x is not None]) if found else None

    @cached_property
    def _rigid(self) -> Mechanics | None:
        """The same with the constant tensor, where a lending carrier changes it: the energy in fields that
        the change brings counts as lent.
        """
        lending = any(x.lends(self) for x in self.carriers)
        return replace(self, shape=None) if lending and self.rate_correction is not None else None

    @cached_property
    def starting_momentum(self) -> Vector:
        """Angular momentum of the body and all carriers at the start (mpf, SI), body axes."""
        total = multiply(self.scene.turning_inertia, self.scene.angular_velocity)
        for carrier in self.carriers:
            momentum, _ = carrier.carried_at_start(self.scene)
            total = [x + y for x, y in zip(total, momentum, strict=True)]
        return total

    @property
    def starting_rates(self) -> Vector:
        """What the states of the rates are at the start (mpf, rad/s)."""
        if self.rate_correction is None:
            return self.scene.angular_velocity
        momentum = multiply(self.scene.turning_inertia, self.scene.angular_velocity)
        for carrier in self.carriers:
            if carrier.changes:  # which has none
                own, _ = carrier.carried_at_start(self.scene)
                momentum = [x + y for x, y in zip(momentum, own, strict=True)]
        return multiply(self.scene.inverse_inertia, momentum)

    @cached_property
    def inner_torque(self) -> list[Term]:
        """Terms of h x w and of the torques that carriers exert on the body, which no total feels, as
        ``torque``.
        """
        found: list[Term] = []
        for vector, expression in momentum_terms((x for x in self.carriers if not x.loose), self):
            for axis, unit, rate in zip(
                unit_vectors(self.scene.context), self.numbers.rate_units, self.rate_states, strict=True
            ):
                found.append(([x * unit for x in cross(vector, axis)], expression * rate))
        exerted = (term for carrier in self.carriers for term in carrier.exerted_torque(self))
        return found + [(vector, hy.expression(part)) for vector, part in exerted]

    # --- what the loads do -------------------------------------------------------------------------------

    @cached_property
    def _torques(self) -> list[list[Term]]:
        return [torque_terms(load, self) for load in self.loads]

    @cached_property
    def torque(self) -> list[Term]:
        """Terms of the total torque, body axes, internal units of energy."""
        return [term for terms in self._torques for term in terms]

    @cached_property
    def turning(self) -> list[Load]:
        """The loads that exert a torque."""
        return [load for load, terms in zip(self.loads, self._torques, strict=True) if terms]

    @property
    def acting(self) -> list[Load]:
        """The loads but for those that only carry momentum."""
        turning = self.turning
        return [x for x in self.loads if not isinstance(x, Carrier) or x in turning or x.force(self)]

    @cached_property
    def accelerations(self) -> list[Symbolic]:
        """Derivatives of the states of the rates, each in its own unit."""
        torque = [*self.torque, *self.inner_torque]
        if self.rate_correction is not None:  # M x w is the states' part and this
            turned = cross(self.own_momentum, self.rate_correction)
            torque += zip(unit_vectors(self.scene.context), turned, strict=True)
        return self.inertia.accelerations(self.carried_rates, self.numbers.rate_units, torque)

    @cached_property
    def force(self) -> list[Term]:
        """Terms of the centre of mass's total acceleration, space axes."""
        return [term for load in self.loads for term in force_terms(load, self)]

    @cached_property
    def potential_energy(self) -> Symbolic | None:
        """Potential energy of all conservative loads, internal units; None if there are none."""
        parts = [load.potential(self) for load in self.loads if load.conservative]
        found = [part for part in parts if part is not None]
        return hy.sum(found) if found else None

    @cached_property
    def work_unit(self) -> int:
        """Binary exponent of the unit that work is carried in, J: large enough that it stays of order 1.

        Step control is relative to the largest state, whether anything depends on it or not. Work done on the
        flight is of the size of its kinetic energy, and would be by far the largest in units of rotation's.
        """
        context, scaling = self.scene.context, self.scaling
        working = [load for load in self.loads if not load.conservative]
        if self.velocity is None or not any(load.force(self) for load in working):
            return scaling.energy
        flight = context.ldexp(self.scene.body.mass, 2 * scaling.speed)
        return exponent(context, context.maximum([flight, context.ldexp(context.one, scaling.energy)]))

    @cached_property
    def power(self) -> Symbolic | None:
        """Power of the loads without a potential, units of work over time; None without such loads."""
        context, scaling, terms = self.scene.context, self.scaling, []
        for load in self.loads:
            if load.conservative:
                continue
            for vector, expression in load.torque(self):
                turning = [context.ldexp(x, scaling.energy - self.work_unit) for x in vector]
                pairs = zip(turning, self.rates, strict=True)
                terms.append(expression * hy.sum([self.number(x) * w for x, w in pairs if x != 0]))
            if self.velocity is not None and self.scene.body.mass is not None:
                # force per mass times mass times speed
                scale = context.ldexp(self.scene.body.mass, 2 * scaling.speed - self.work_unit)
                for vector, expression in load.force(self):
                    pairs = zip(vector, self.velocity, strict=True)
                    along = hy.sum([self.number(scale * x) * v for x, v in pairs if x != 0])
                    terms.append(expression * along)
        supplied = [found for x in self.carriers if (found := x.supplied_power(self)) is not None]
        unit = self.scaled(1, scaling.energy - self.work_unit)
        terms += [unit * power for power in supplied]
        return hy.sum(terms) if terms else None

    @property
    def driven_within(self) -> bool:
        """Whether a carrier's drive or friction changes the energy."""
        return any(carrier.supplied_power(self) is not None for carrier in self.carriers)

    @property
    def drives_work(self) -> bool:
        """The same, drives that keep a rate included."""
        return self.driven_within or self.energy_stored_by_drives is not None

    @property
    def conserves_energy(self) -> bool:
        """Whether every acting load has a time-independent potential, and no carrier is driven: then the
        energy stays, but for what drives lend that keep a rate.
        """
        acting = (x for x in self.loads if not x.conservative)
        kept = self.average is None and not any(x.torque(self) or x.force(self) for x in acting)
        return kept and not self.driven_within

    @cached_property
    def energy(self) -> Symbolic:
        """Kinetic energy (rotation, and translation if the centre of mass moves) plus potential energy."""
        return self.total_energy()

    def total_energy(self, *, kept: bool = False) -> Symbolic:
        """The same, perhaps as ``rotational`` is kept."""
        terms = [self.rotational(kept=True) if kept else self.rotational_energy]
        mass, scaling = self.scene.body.mass, self.scaling
        if self.velocity is not None and mass is not None:
            half_mass = self.scaled(mass / 2, 2 * scaling.speed - scaling.energy)
            terms.append(half_mass * hy.sum([v * v for v in self.velocity]))
        rigid = self._rigid if kept else None
        potential = self.potential_energy if rigid is None else rigid.potential_energy
        return hy.sum([*terms, *([] if potential is None else [potential])])

    @property
    def preferred_axis(self) -> Vector | None:
        """To the centre of mass of a heavy body, or along the dipole of any other."""
        pulled = [load.linear_potential(self.scene) for load in self.loads]
        return self.numbers.arm or next((found[0] for found in pulled if found is not None), None)

    @property
    def keeps_axial(self) -> bool:
        """Whether the angular momentum along the symmetry axis is conserved; what is carried is along it."""
        axis, context = self.symmetry_direction, self.scene.context
        carried = momentum_terms(self.carriers, self)
        if axis is None or not all(parallel(context, vector, axis) for vector, _ in carried):
            return False
        turning = [(load, terms) for load, terms in zip(self.loads, self._torques, strict=True) if terms]
        kept = ((load.keeps_axial(self, axis), terms) for load, terms in turning)
        return all(self._spares(terms, axis) if found is None else found for found, terms in kept)

    def _spares(self, torque: list[Term], axis: Vector) -> bool:
        """Whether the vectors of a torque have no part along an axis of the body."""
        context = self.scene.context
        # zeros of two types aren't equal
        none = (hy.expression(0.0), hy.expression(self.number(context.zero)))
        return all(across(context, vector, axis) for vector, expression in torque if expression not in none)
