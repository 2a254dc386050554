"""Torques of the body alone, averaged over its free motion: dampings, and functions of the rates.

Such a torque has a mean along the momentum and one that does work, which change the amplitudes P and Q of
``free_motion``; across the momentum it goes round with the precession and has no mean. A viscous torque takes
closed means, of whose matrix the products about two axes vanish:

    Q' = -Q (d1 / I1 (1 - S) + d2 / I2 S),   P' = -P (d3 / I3 (1 - k^2 S) + k^2 d2 / I2 S),   S = <sin^2 f>

with the coefficients d about the principal axes. Any other is summed over nodes of f.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import heyoka as hy
import numpy as np

from rigidsim.model.averaged.free_motion import Polhodes, mean_square_sine, means_needed, nodes_needed
from rigidsim.model.averaged.wobble import Wobble
from rigidsim.model.carriers import Carrier
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling
from rigidsim.model.state_blocks import BODY
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, dot
from rigidsim.scene.scene import Scene

RATE_STATES = BODY.rates
_CLOCK = "t_of_torque"
_MOST_NODES = 1024
_CHECKED = 1e-12
"""Relative difference between sums over n and over 2 n nodes, in double precision, at which n are taken to
resolve a torque whose smoothness isn't known.
"""
_BITS_CHECKED = 40


def reads_rates_alone(load: Load) -> bool:
    """Whether a load is a function of the body's rates, in body axes, that doesn't depend on time."""
    placed = load.orbit or load.table or load.has_source
    return not (load.reads or placed or load.reacts or isinstance(load, Carrier))


@dataclass(frozen=True)
class DrivingTorques:
    """The torques of a body alone, as functions of its rates; damping is d (mpf) about principal axes."""

    scene: Scene
    scaling: Scaling
    numbers: ScaledNumbers
    polhodes: Polhodes
    damping: Vector
    others: Sequence[Load]

    @classmethod
    def of(
        cls, scene: Scene, scaling: Scaling, numbers: ScaledNumbers, polhodes: Polhodes, loads: Sequence[Load]
    ) -> Self:
        """The torques of these loads."""
        context, others = scene.context, []
        damping = [context.zero] * 3
        for load in loads:
            coefficients = load.damping()
            if coefficients is None:
                others.append(load)
                continue
            for i, axis in enumerate(polhodes.axes):
                damping[i] += sum(c * a * a for c, a in zip(coefficients, axis, strict=True))
        return cls(scene, scaling, numbers, polhodes, damping, others)

    @cached_property
    def _moments(self) -> Vector:
        """Principal moments, internal units."""
        return [self.scene.context.ldexp(x, -self.scaling.inertia) for x in self.polhodes.moments]

    @cached_property
    def _decay(self) -> Vector:
        """d / I about the principal axes, per internal unit of time."""
        unit = self.scaling.time
        pairs = zip(self.damping, self.polhodes.moments, strict=True)
        return [self.scene.context.ldexp(d / i, unit) for d, i in pairs]

    def _along_axes(self, number: Rounder) -> list[Symbolic]:
        """Torque of the other loads along the principal axes, in ``RATE_STATES``, internal units."""
        terms = self._mechanics(number).torque
        found = []
        for axis in self.polhodes.axes:
            shares = [(dot(axis, vector), expression) for vector, expression in terms]
            parts = [as_factor(number(share)) * expression for share, expression in shares if share != 0]
            found.append(hy.sum(parts))
        return found

    def _mechanics(self, number: Rounder) -> Mechanics:
        return Mechanics(
            self.scene, self.scaling, self.numbers, list(hy.make_vars(*RATE_STATES)), None, None, None, None,
            number, loads=list(self.others),
        )  # fmt: skip

    @property
    def varies(self) -> str:
        """Why they aren't functions of the rates alone; empty if they are."""
        bare, clock = self._mechanics(float), hy.make_vars(_CLOCK)
        if any(load.extra_states(bare) is not None for load in self.others):
            return "a load has states"
        torque = (hy.subs(x, {hy.time: clock}) for x in self._along_axes(float))
        return "a torque depends on time" if any(_CLOCK in hy.get_variables(x) for x in torque) else ""

    # --- in double precision --------------------------------------------------------------------------------

    @cached_property
    def _evaluated(self) -> Any:
        found = self._along_axes(float)
        return hy.cfunc(found, list(hy.make_vars(*RATE_STATES)), compact_mode=True, opt_level=0)

    def at(self, momentum: np.ndarray) -> np.ndarray:
        """Torque (3, n) along the principal axes for a momentum (3, n) along them, internal units."""
        moments = np.array(self._moments, dtype=float)[:, None]
        torque = -np.array(self._decay, dtype=float)[:, None] * momentum
        if self.others:
            axes = np.array(self.polhodes.axes, dtype=float)
            rates = np.ascontiguousarray(axes.T @ (momentum / moments))
            torque = torque + self._evaluated(rates)
        return np.asarray(torque)

    def nodes(self, amplitudes: np.ndarray, epsilon: float) -> int:
        """Nodes for sums over f that err by less than epsilon for all these amplitudes.

        At least those that the weight needs (``nodes_needed``); doubled until sums over twice as many agree
        in double precision, which tells the smoothness of the torque itself, and in proportion to the digits
        beyond.

        Raises:
            ArithmeticError: a torque that too many nodes don't resolve.
        """
        if not self.others:
            return 0
        largest = max(map(self.parameter_at, amplitudes))
        count = nodes_needed(largest, max(epsilon, 2.0**-_BITS_CHECKED)) + 8
        # of what is averaged: a mean may vanish
        around = 2 * np.pi * (np.arange(count) + 0.5) / count
        scale = max(float(np.abs(self.change(p, q, around)).max()) for p, q in amplitudes)
        while count <= _MOST_NODES:
            pairs = [(self.mean(p, q, count), self.mean(p, q, 2 * count)) for p, q in amplitudes]
            if all(float(np.abs(x - y).max()) <= _CHECKED * scale for x, y in pairs):
                more = -np.log2(epsilon) / _BITS_CHECKED
                return int(np.ceil(count * max(1.0, more)))
            count *= 2
        raise ArithmeticError

    def wobble(self, axial: float, transverse: float, amplitude: float = 0.0) -> Wobble:
        """The rotation of these amplitudes, internal units."""
        return Wobble(self._moments, axial, transverse, amplitude)

    def parameter_at(self, amplitudes: np.ndarray) -> float:
        """k^2 at amplitudes P and Q."""
        ratio = float(self.polhodes.ratio)
        return 0.0 if ratio == 1 else float((1 - ratio) * (amplitudes[1] / amplitudes[0]) ** 2)

    def across(self, wobble: Wobble) -> np.ndarray:
        """Torque across the momentum, x + i y in the frame that precesses, (points,)."""
        turned = np.einsum("nab,bn->an", wobble.turns, self.at(wobble.momentum))
        return np.asarray(turned[0] + 1j * turned[1])

    def change(self, axial: float, transverse: float, angle: np.ndarray) -> np.ndarray:
        """P' and Q', (2, n), at amplitudes f, per internal unit of time."""
        ratio, root = float(self.polhodes.ratio), float(self.polhodes.root)
        cosine, sine = np.cos(angle), np.sin(angle)
        share = (1 - ratio) * transverse / axial if ratio != 1 else 0.0
        delta = np.sqrt(1 - share * (transverse / axial) * sine**2) if ratio != 1 else np.ones_like(sine)
        momentum = np.array([root * transverse * cosine, transverse * sine, axial * delta])
        torque = self.at(momentum)
        along = torque[2] * delta + share * torque[1] * sine
        return np.array([along, torque[0] * cosine / root + torque[1] * sine])

    def mean(self, axial: float, transverse: float, count: int) -> np.ndarray:
        """Means of P' and Q' over a polhode, (2,), by a sum over nodes."""
        angle = 2 * np.pi * (np.arange(count) + 0.5) / count
        weight = 1 / self.deltas(axial, transverse, angle)
        return np.asarray(self.change(axial, transverse, angle) @ weight / weight.sum())

    def deltas(self, axial: float, transverse: float, angle: np.ndarray) -> np.ndarray:
        """dn at amplitudes f."""
        ratio = float(self.polhodes.ratio)
        if ratio == 1:
            return np.ones_like(angle)
        return np.asarray(np.sqrt(1 - (1 - ratio) * (transverse / axial) ** 2 * np.sin(angle) ** 2))

    # --- as expressions -------------------------------------------------------------------------------------

    def rates(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, nodes: int, sines: Symbolic
    ) -> list[Symbolic]:
        """P' and Q' as expressions of P and Q, per internal unit of time."""
        first, second, third = (as_factor(number(x)) for x in self._decay)
        parameter = self.parameter(axial, transverse, number)
        p = [-(axial * (third + parameter * sines * (second - third)))] if any(self.damping) else []
        q = [-(transverse * (first + sines * (second - first)))] if any(self.damping) else []
        if self.others:
            more = self._summed(axial, transverse, number, nodes)
            p.append(more[0])
            q.append(more[1])
        return [hy.sum(p), hy.sum(q)]

    def parameter(self, axial: Symbolic, transverse: Symbolic, number: Rounder) -> Symbolic:
        """k^2."""
        if self.polhodes.symmetric:
            return hy.expression(0.0)
        tangent = transverse / axial
        return as_factor(number(1 - self.polhodes.ratio)) * (tangent * tangent)

    def mean_square(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, largest: float, epsilon: float
    ) -> Symbolic:
        """<sin^2 f>, for parameters up to the largest given."""
        if self.polhodes.symmetric:
            return hy.expression(0.5)
        means = means_needed(largest, epsilon)
        return mean_square_sine(self.parameter(axial, transverse, number), hy.sqrt, means)

    def _summed(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, nodes: int
    ) -> tuple[Symbolic, Symbolic]:
        context, polhodes = self.scene.context, self.polhodes
        torque = self._along_axes(number)
        states = list(hy.make_vars(*RATE_STATES))
        tangent = transverse / axial
        weights, along, across = [], [], []
        for j in range(nodes):
            angle = 2 * context.pi * (j + context.one / 2) / nodes
            c, s = context.cos(angle), context.sin(angle)
            delta: Any = 1.0
            if not polhodes.symmetric:
                factor = as_factor(number((1 - polhodes.ratio) * s * s))
                delta = hy.sqrt(1.0 - factor * (tangent * tangent))
            shares = [polhodes.root * c / self._moments[0], s / self._moments[1], 1 / self._moments[2]]
            sizes = [transverse, transverse, axial * delta]
            rates = {
                state: hy.sum(
                    [
                        as_factor(number(share * axis[i])) * size
                        for share, size, axis in zip(shares, sizes, polhodes.axes, strict=True)
                        if share * axis[i] != 0
                    ]
                )
                for i, state in enumerate(states)
            }
            first, second, third = hy.subs(torque, rates)
            weight: Any = 1.0 if polhodes.symmetric else 1.0 / delta
            weights.append(weight)
            if polhodes.symmetric:
                along.append(third)
            else:
                share = as_factor(number((1 - polhodes.ratio) * s)) * tangent
                along.append(third + weight * (share * second))
            turned = as_factor(number(c / polhodes.root)) * first + as_factor(number(s)) * second
            across.append(weight * turned)
        whole = float(nodes) if polhodes.symmetric else hy.sum(weights)
        return hy.sum(along) / whole, hy.sum(across) / whole
