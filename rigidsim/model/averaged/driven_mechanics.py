"""Mechanics of an averaged motion under torques of the body alone, which change its energy and momentum.

Besides the momentum's direction the amplitudes P and Q of ``free_motion`` are states. Gradients turn the
direction as before, with the mean tensor of the present polhode.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.driven import Driven
from rigidsim.model.averaged.mechanics import AveragedMechanics
from rigidsim.model.averaged.sources import Source
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import cross

AMPLITUDES = ["axial", "transverse"]
"""States: the largest components P and Q of the momentum along the circled axis and the intermediate one."""


@dataclass(frozen=True)
class DrivenMechanics(AveragedMechanics):
    """Mechanics of an average under torques that do work."""

    @property
    def driven(self) -> Driven:
        """What drives the motion."""
        return self.carried(self.of.driven)

    @cached_property
    def amplitudes(self) -> tuple[Symbolic, Symbolic]:
        """P and Q, internal units."""
        axial, transverse = hy.make_vars(*AMPLITUDES)
        return axial, transverse

    @cached_property
    def mean_square(self) -> Symbolic:
        """<sin^2 f> over the polhode."""
        largest, epsilon = self.driven.parameter, self.driven.epsilon
        return self.driven.torques.mean_square(*self.amplitudes, self.number, largest, epsilon)

    @cached_property
    def amplitude_rates(self) -> list[Symbolic]:
        """Derivatives of P and Q, per internal unit of time."""
        nodes = self.driven.nodes
        return self.driven.torques.rates(*self.amplitudes, self.number, nodes, self.mean_square)

    @cached_property
    def momentum_size(self) -> Symbolic:
        axial, transverse = self.amplitudes
        ratio = as_factor(self.number(self.driven.polhodes.ratio))
        return hy.sqrt(axial * axial + ratio * (transverse * transverse))

    @cached_property
    def derivatives(self) -> list[Symbolic]:
        if not self.of.sources:
            return [hy.expression(0.0)] * 3
        s = self.direction
        return cross(self._pull(s), s)

    @cached_property
    def _excess(self) -> Symbolic:
        """(3 <m . I m> - tr I) / 2 over the size of the momentum, internal units of time."""
        context, polhodes = self.scene.context, self.driven.polhodes
        first, second, third = (context.ldexp(x, -self.scaling.inertia) for x in polhodes.moments)
        axial, transverse = self.amplitudes
        p, q = axial * axial, transverse * transverse
        ratio = polhodes.ratio
        # I1 r (1 - S) + I2 S - I3 (1 - r) S along Q^2
        steady = as_factor(self.number(first * ratio * 3 / 2))
        varying = as_factor(self.number((second - ratio * first - (1 - ratio) * third) * 3 / 2))
        squares = hy.sum(
            [as_factor(self.number(third * 3 / 2)) * p, (steady + varying * self.mean_square) * q]
        )
        trace = self.number((first + second + third) / 2)
        size = self.momentum_size
        return (squares / (size * size) - trace) / size

    def _strength(self, source: Source) -> Symbolic:
        """Precession constant over the mean tensor's present excess over L."""
        context = self.scene.context
        # strength in 1/s^2, times inertia over momentum, per internal unit of time
        strength = context.ldexp(source.strength, 2 * self.scaling.time)
        return as_factor(self.number(strength)) * self._excess

    @cached_property
    def rotational_energy(self) -> Symbolic:
        context, polhodes = self.scene.context, self.driven.polhodes
        first, _, third = (context.ldexp(x, -self.scaling.inertia) for x in polhodes.moments)
        axial, transverse = self.amplitudes
        along: Any = as_factor(self.number(1 / (2 * third)))
        across: Any = as_factor(self.number(polhodes.ratio / (2 * first)))
        return hy.sum([along * (axial * axial), across * (transverse * transverse)])
