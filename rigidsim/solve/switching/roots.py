"""Roots of the arguments of surfaces within a step: the first that leads away from the motion's side."""

from __future__ import annotations

import numpy as np

from rigidsim.solve.precision import Scalar
from rigidsim.solve.switching.engines import Root, SwitchedEngines
from rigidsim.solve.switching.moments import later
from rigidsim.solve.switching.sides import HELD, SLIDES

_NEAR = 2.0**-12  # of a step: within it Newton's method improves a root
_BISECTIONS = 4  # bisections of a step per bit of the precision


class SurfaceRoots(SwitchedEngines):
    """Engines of a motion with surfaces that find where a step has to end."""

    def moment(self, root: Root) -> tuple[tuple[Scalar, Scalar], bool]:
        """Time of a root in two numbers, and whether it is known from the surface's expression."""
        known = self._probe.moments[root[1]].near(root[0], self._modes)
        return known or (root[0], root[0] * 0), known is not None

    def _first_root(self, begun: tuple[Scalar, Scalar], before: np.ndarray) -> Root | None:
        """The first root where the step just taken leaves its side, from where it begun; None if none is."""
        engine = self._integrator
        end, after = engine.time, np.array(engine.state)
        states = [before, after]
        hidden = self._hidden(begun[0], end)
        # those of known moments may differ by less than one number tells
        roots = sorted([*self._roots, *hidden], key=lambda root: self.moment(root)[0])
        for n, (time, j, side) in enumerate(roots):
            if self._modes[j] == SLIDES or roots[n] in hidden:
                return roots[n]
            if side != -self._modes[j]:
                continue
            following = next((t for t, i, _ in roots[n + 1 :] if i == j), end)
            middle = time + (following - time) / 2
            look = self._look(engine.update_d_output(middle), middle)
            if float(look.u[j]) * side > self._probe.noise(look, j, states):
                return roots[n]
        values = self._values(after, end, self._low)
        for j, mode in enumerate(self._modes):
            if abs(mode) >= HELD or mode * float(values[j]) >= 0:
                continue
            look = self._look(after, end, self._low)
            if -mode * float(look.u[j]) <= self._probe.noise(look, j, states):
                continue
            inside = self._seen(j, begun, before)
            if inside is None:
                return begun[0], j, -mode
            return self._bisected(j, inside, end), j, -mode
        return None

    def _hidden(self, begin: Scalar, end: Scalar) -> list[Root]:
        """Roots within the step that its polynomials may have missed."""
        middles = [moments.hidden(begin, end, self._modes) for moments in self._probe.moments]
        return [(middle, j, -self._modes[j]) for j, middle in enumerate(middles) if middle is not None]

    def _again(
        self,
        root: Root,
        time: tuple[Scalar, Scalar],
        before: np.ndarray,
        size: Scalar,
        moment: tuple[Scalar, Scalar] | None,
    ) -> Scalar:
        """Repeat the step up to a root, to its last digits, or to its known moment; returns the step's size.

        Args:
            size: of the step to the root as the engine found it, within the step just taken.
        """
        engine = self._integrator
        if moment is None and root[1] not in self._along:  # by that step's own polynomials
            high, low = later(time, size)
            look = self._look(np.array(engine.update_d_output(high)), high, low)
            rate = look.rate(root[1])
            correction = look.u[root[1]] / rate if rate != 0 else rate
            if 0 < abs(float(correction)) < _NEAR * float(size):
                size = size - correction
        muted, self.log.muted = self.log.muted, True
        try:
            engine.dtime = time
            engine.state[:] = before
            engine.step(size, write_tc=True)
            if moment is not None:
                engine.dtime = moment
        finally:
            self.log.muted = muted
        return size

    def _seen(self, j: int, begun: tuple[Scalar, Scalar], before: np.ndarray) -> Scalar | None:
        """A time within the latest step at which an argument has the sign of its side, or None."""
        begin, end, mode = begun[0], self._integrator.time, self._modes[j]
        look = self._look(before, *begun)
        known = self._probe.noise(look, j, [before])
        beside = mode * float(look.u[j]) > known  # of the surface, as the step began
        some = self.precision.bits // 2
        for power in range(1, _BISECTIONS * self.precision.bits):
            then = begin + (end - begin) * self.precision.of_double(2.0**-power)
            value = mode * float(self._values(self._integrator.update_d_output(then), then)[j])
            if value > 0:
                return then
            if power >= some and (beside or abs(value) <= known):  # nearer than that it is on the surface
                break
        return begin if beside else None

    def _bisected(self, j: int, begin: Scalar, end: Scalar) -> Scalar:
        """A root that the engine missed, by bisection."""
        for _ in range(_BISECTIONS * self.precision.bits):
            middle = begin + (end - begin) / 2
            if not begin < middle < end:
                break
            value = self._values(self._integrator.update_d_output(middle), middle)[j]
            if self._modes[j] * float(value) > 0:
                begin = middle
            else:
                end = middle
        return end
