"""Steps that end on switching surfaces: no step passes over a kink or a jump.

The engine finds where a step's own polynomials take an argument through zero. A step that leaves its side is
taken again up to there, and the next one begins on the other side, or goes along the surface. A root counts
only where it leads away from the side that the motion is on: the zero at which a step begins doesn't, so
that no cooldown is needed and a checkpoint holds all there is. All steps are single ones.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import Stepper, bound_of_sparse_series
from rigidsim.solve.switching.engines import Root
from rigidsim.solve.switching.moments import between
from rigidsim.solve.switching.roots import SurfaceRoots
from rigidsim.solve.switching.sides import HELD, SLIDES, Continuation, Fields, Look, crossings
from rigidsim.solve.switching.sliding import MOST_AT_ONCE
from rigidsim.solve.switching.turned import MOST
from rigidsim.solve.taylor_stepper import TaylorStepper

_ATTEMPTS = 32  # attempts at one step
_MOST_SWITCHES = 256
"""Switches at intervals shorter than ``_SHORTEST`` that count as an accumulation, or as swings kept up by
rounding, whose period is the square root of its size.
"""
_SHORTEST = 2.0**-8  # internal units of time; with more digits less, see ``_window``
_ROUNDINGS = 2.0**15  # in the square of an interval
_MOST_LEFT_OUT = 8.0  # roundings of the state, by a moment in two numbers
_NOT_RESOLVED = "choose a higher precision, or count time from an epoch shortly before"
_WIDTH = 2.0**8  # roundings of a time between two findings of the same crossing


class SwitchingStepper(SurfaceRoots):
    """Stepper of a system with surfaces, or with angles whose turns matter; it begins where motion leads."""

    # --- steps ----------------------------------------------------------------------------------------------

    def step(self) -> bool:
        """Take one step, not past a surface; False if lost, or if it can't go on (``failure`` says why)."""
        return self._step(self._longest)

    def skip(self, count: int) -> bool:
        return Stepper.skip(self, count)  # step by step

    def to(self, time: float) -> bool:
        for _ in range(100_000):
            high, low = self._integrator.dtime
            left = (time - high) - low
            if left <= abs(time) * self._epsilon:
                return True
            if not self._step(min(left, self._longest)):
                break
        return False

    def dense(self, time: Scalar) -> np.ndarray:
        return np.array(self._dense.update_d_output(time))

    def settle(self) -> None:
        """Must be called after the state was set from outside: takes the sides on which it lies."""
        self._roots.clear()
        # the state lies beside surfaces that it kept to
        self._modes = [mode if abs(mode) == 1 else 1 for mode in self._modes]
        self._agree()
        self._enter()

    def _step(self, longest: Scalar) -> bool:
        if self._unsettled:
            self.failure = self._unsettled
            return False
        longest = min(longest, self._begin_piece())
        self._watched()
        self._quieten()
        log, events = self.log, len(self.log.found)
        for _ in range(_ATTEMPTS):
            begun = self._integrator
            self._set(begun)
            time, before = begun.dtime, np.array(begun.state)
            self._roots.clear()
            outcome, size = begun.step(longest, write_tc=True)
            bound = bound_of_sparse_series(begun.tc) if self._fresh or not self.steps else np.inf
            bound = min(bound, self._bound_of_turn(before, time[0], size))
            if bound < abs(float(size)):
                log.back_to(events)
                self._roots.clear()
                begun.dtime = time
                begun.state[:] = before
                outcome, size = begun.step(self.precision.of_double(bound), write_tc=True)
            if outcome == hy.taylor_outcome.err_nf_state:
                return False
            natural = abs(float(size))
            root = self._first_root(time, before)
            if root is None:
                break
            log.drop_after(events, root[0] + self._width(root[0]))
            moment, known = self.moment(root)
            left = between(time, moment)
            if left > 0:
                size = self._again(root, time, before, left, moment if known else None)
                break
            # the step begins on the surface and leaves its side at once
            log.back_to(events)
            begun.dtime = time
            begun.state[:] = before
            if not self._arrive(root, [before], self._fresh):
                return False
        else:
            assert root is not None
            return self._fail(root[1], "it turns back to it again and again")
        self._dense = begun
        self.smallest, self.largest = abs(float(size)), natural
        self.steps += 1
        self._judge(time[0], 1)
        self.ended = self.watcher is not None and not self.watcher(begun)
        self._follow()
        again, self._fresh = self._fresh, False
        if root is not None and not self._arrive(root, [before, np.array(self.state)], again):
            return False
        if self._along:
            self._keep_to_surfaces()
        return True

    def _bound_of_turn(self, before: np.ndarray, time: Scalar, size: Scalar) -> float:
        """Bound of a step just taken within which turns can be continued: series of many terms go far."""
        if not self._probe.unturned:
            return math.inf
        pars = self._pars(self._probe.unturned)  # those of the engine are fewer where it slides
        after = np.array(self.state), self.time
        rates = [self._probe.rate(*there, pars) for there in ((before, time), after)]
        return MOST / max(sum(rates) / 2, 1e-300)

    def _width(self, time: Scalar) -> Scalar:
        size = _WIDTH * self._epsilon * max(abs(float(time)), 1.0)
        return self.precision.of_double(size)

    def _quieten(self) -> None:
        """Suppress events at the surface where the latest step ended, which found them."""
        time = self.time
        self.log.quiet_until = time + self._width(time) if self._fresh else None

    # --- surfaces -------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Find the sides at the start."""
        look = self._agree()
        on = self._lying_on(look, [self.state])
        if on:
            choice = self._at_rest(on, look) or self._chosen(on)
            if choice.modes is None:
                self._fail(on[0], f"the motion starts there, and {choice.why}")
                self._unsettled = self.failure
            else:
                self._take(choice)

    def _lying_on(self, look: Look, states: list[np.ndarray]) -> list[int]:
        """Surfaces whose arguments are zero but for rounding of these states."""
        near = np.abs(look.u.astype(np.float64)) <= self._probe.noises(look, states)
        return [int(j) for j in np.flatnonzero(near)]

    @property
    def _window(self) -> float:
        """Time (internal units) within which ``_MOST_SWITCHES`` count as an accumulation."""
        return _MOST_SWITCHES * min(_SHORTEST, (_ROUNDINGS * self._epsilon) ** 0.5)

    def _arrive(self, root: Root, states: list[np.ndarray], again: bool) -> bool:
        """Continue from a surface (``again``: as the step began); False if that is impossible."""
        _, j, side = root
        self._fresh = True
        now = float(self.time)
        if now - self._since > self._window:
            self._since, self._count = now, 0
        self._count += 1
        if self._count > _MOST_SWITCHES:
            return self._fail(j, f"its sides changed more than {_MOST_SWITCHES} times in almost no time")
        if self._modes[j] == SLIDES:
            self._modes[j] = side
            for i, (by, sign) in self._held.items():
                if by == j:
                    self._modes[i] = sign * side
            self._enter()
            return True
        look = self._look(self.state, self.time, self._low)
        on = [j, *self._along, *self._held]
        on += [i for i in self._lying_on(look, states) if i not in on]
        moments = [i for i in on if self._probe.moments[i].of_time]
        alone = len(moments) == 1
        if (again or not alone) and any(self._unresolved(i, alone) for i in moments):
            why = (
                f"something so strong changes that two numbers of {self.precision.name} precision don't tell "
                "its impulse"
            )
            return self._fail(j, why, _NOT_RESOLVED)
        choice = self._at_rest(on, look) or self._chosen(on, hint=(j, side))
        if choice.modes is None:
            return self._fail(j, choice.why)
        self._take(choice)
        return True

    def _unresolved(self, j: int, alone: bool) -> bool:
        """Whether the change of the field on a surface matters even for what two numbers leave out of its
        moment. Where something ends alone the state tells its impulse, by which the rest is judged; where it
        begins, nothing is known yet.
        """
        before, after = (
            self._probe.look(self.state, self.time, self._parameters({j: side * self._modes[j]})).field
            for side in (1, -1)
        )
        if alone and float(np.abs(after).max()) > float(np.abs(before).max()):
            return False
        change = max(abs(float(x)) for x in after - before)
        size = max(1.0, *(abs(float(x)) for x in self.state))
        allowed, time = _MOST_LEFT_OUT * self._epsilon * size, self._integrator.dtime
        if change * self._epsilon**2 * abs(float(time[0])) <= allowed:
            return False
        return change * self._probe.moments[j].left_out(time, self._modes) > allowed

    def _agree(self, known: Collection[int] = ()) -> Look:
        """Put all surfaces except the known ones on the sides where the state lies, since an argument that
        reads another surface's side jumps with it; returns the last look.
        """
        for _ in range(len(self._modes) + 1):
            look, changed = self._look(self.state, self.time, self._low), False
            noises = self._probe.noises(look, [self.state])
            for j, mode in enumerate(self._modes):
                u = float(look.u[j])
                beyond = mode * u < 0 and abs(u) > noises[j]
                if beyond and j not in known and abs(mode) < HELD:
                    self._modes[j], changed = -mode, True
            if not changed:
                break
        return look

    def _take(self, choice: Continuation) -> None:
        assert choice.modes is not None
        for j, mode in choice.modes.items():
            self._modes[j] = mode
        self._agree(choice.modes)
        self._enter()
        if self._along:
            self._keep_to_surfaces()

    def _chosen(self, on: list[int], hint: tuple[int, int] | None = None) -> Continuation:
        """How to continue from the surfaces on which the state lies."""

        def at(sides: dict[int, int]) -> Look:
            return self._probe.look(self.state, self.time, self._parameters(sides))

        moving = [j for j in on if hint is not None and j == hint[0]]
        for j in on:
            if j not in moving and j not in Fields(at, self._probe, [j]).idle():
                moving.append(j)
        idle = {j: self._modes[j] or 1 for j in on if j not in moving}
        if not moving:
            return self._by_trial(idle)
        crossed = (
            crossings(at, self._probe, {j: self._modes[j] or 1 for j in moving})
            if len(moving) > MOST_AT_ONCE
            else {}
        )
        moving = [j for j in moving if j not in crossed]
        if len(moving) > MOST_AT_ONCE:
            return Continuation(None, f"more than {MOST_AT_ONCE} surfaces meet there")
        if not moving:
            return Continuation({**idle, **crossed})
        choice = Fields(lambda sides: at({**crossed, **sides}), self._probe, moving).choose()
        if choice.modes is not None:
            return Continuation({**idle, **crossed, **choice.modes})
        if not choice.tangential or hint is None or hint[0] in crossed:
            return choice
        # touched: rounding hides the rates, but the step was seen to reach the other side
        return Continuation({**idle, **crossed, **{j: self._modes[j] for j in moving}, hint[0]: hint[1]})

    def _by_trial(self, idle: dict[int, int]) -> Continuation:
        """At rest on a surface, find by trial the side on which a step stays on its own."""
        modes = dict(idle)
        for j in idle:
            kept = []
            for side in (1, -1):
                self._modes[j] = side
                moved = self._moved(j)
                if moved == 0 or moved == side:
                    kept.append(side if moved else 0)
            self._modes[j] = idle[j]
            if kept == [1, -1]:
                return Continuation(None, "it could leave it to either side")
            if not kept:
                return Continuation(None, "both sides lead back to it with growing speed")
            modes[j] = kept[0] or idle[j]
        return Continuation(modes)

    def _moved(self, j: int) -> int:
        """The side of a surface to which a trial step leads (it is taken back); 0 for none."""
        engine = self._integrator
        time, before = engine.dtime, np.array(engine.state)
        self._set(engine)
        muted, self.log.muted = self.log.muted, True
        engine.step(self._longest if self._requirement is None else self._within_piece(), write_tc=True)
        end, after = engine.time, np.array(engine.state)
        found = 0
        for part in (1 / 16, 1 / 2, 1.0):
            then = time[0] + self.precision.of_double(part) * (end - time[0])
            look = self._look(engine.update_d_output(then), then)
            if abs(float(look.u[j])) > self._probe.noise(look, j, [before, after]):
                found = 1 if look.u[j] > 0 else -1
                break
        self.log.muted = muted
        self._roots.clear()
        engine.dtime = time
        engine.state[:] = before
        return found

    def _fail(self, j: int, why: str, what_to_do: str = "") -> bool:
        surface = self.system.plan.surfaces.found[j]
        what_to_do = what_to_do or surface.remedy
        self.failure = f'at the kink or jump of "{surface.text}" ({surface.where}) {why}; {what_to_do}'
        return False


def stepper_of(
    system: System,
    precision: Precision,
    tolerance: Scalar | None,
    start: Scalar,
    log: EventLog | None = None,
) -> TaylorStepper:
    """The stepper of a system: a plain one, unless the system switches sides; tolerance None stands for the
    precision's epsilon, and without a log no events are looked for.
    """
    kind = SwitchingStepper if system.switches else TaylorStepper
    return kind(system, precision, tolerance, start, log)
