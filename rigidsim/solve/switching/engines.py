"""Engines of a motion with switching surfaces, and the memory that its state doesn't contain.

Sides are parameters of the equations, and so are the turns of angles and the sign of the quaternion where an
expression depends on them: both are continued from step to step. Along surfaces the motion has
equations of its own, which are compiled when they are first needed.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine, interruptible
from rigidsim.solve.events import BESIDE, EventLog, engine_events, of_order_one
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.requirements import SetAtKnots
from rigidsim.solve.stepper import Mark
from rigidsim.solve.switching.sides import HELD, SLIDES, Continuation, Look, Probe
from rigidsim.solve.switching.sliding import Meeting, sliding
from rigidsim.solve.switching.turned import Turned
from rigidsim.solve.taylor_stepper import TaylorStepper

Root = tuple[Any, int, int]
"""Time, number of a surface, and the side to which it leads."""


class SwitchedEngines(TaylorStepper):
    """A stepper with surfaces apart from its steps: an engine for each combination of sides, and a memory."""

    single_steps = True

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        self._roots: list[Root] = []
        self._probes: dict[int, Probe] = {}
        self._slid: dict[tuple[int, tuple[int, ...], tuple[int, ...]], TaylorEngine] = {}
        self._chart = 0
        surfaces = system.plan.surfaces
        self._modes = [1] * len(surfaces.found)
        self._fresh, self._count, self._since = False, 0, 0.0
        self._piece: np.ndarray | None = None  # parameters of the piece in which the latest step was
        super().__init__(system, precision, tolerance, start, log)
        # in the partner chart, where a run may begin, angles are plain already
        self._turned = Turned.begun(system, *self._plain(self.state, self.time))
        self._dense = self._integrator
        self._unsettled = ""
        self._begin()
        self.begun = self.mark()

    def _begin(self) -> None:
        """Find the sides at the start."""
        raise NotImplementedError

    # --- memory ---------------------------------------------------------------------------------------------

    @property
    def _along(self) -> tuple[int, ...]:
        return tuple(j for j, mode in enumerate(self._modes) if mode == SLIDES)

    @property
    def _held(self) -> dict[int, tuple[int, int]]:
        """For surfaces kept to at rest: the surface whose side each has (1) or the opposite (-1)."""
        return {
            j: (abs(mode) - HELD, 1 if mode > 0 else -1)
            for j, mode in enumerate(self._modes)
            if abs(mode) >= HELD
        }

    @property
    def _probe(self) -> Probe:
        if self._chart not in self._probes:
            system = self._system_of(self._chart)
            self._probes[self._chart] = interruptible(lambda: Probe(system, self.precision))
        return self._probes[self._chart]

    def mark(self) -> Mark:
        mark = super().mark()
        sides = (
            *map(float, self._modes),
            *self._turned.angles,
            *self._turned.quaternion,
            float(self._fresh),
            float(self._count),
            self._since,
        )
        return replace(mark, memory=(mark.memory, sides))

    def back_to(self, mark: Mark) -> None:
        tiny, sides = mark.memory
        s, a = len(self._modes), len(self._turned.angles)
        self._modes = [int(x) for x in sides[:s]]
        self._turned = Turned(list(sides[s : s + a]), list(sides[s + a : -3]))
        fresh, count, self._since = sides[-3:]
        self._fresh, self._count = bool(fresh), int(count)
        self.failure = ""
        self._enter()
        self._piece = None
        super().back_to(replace(mark, memory=tiny))

    def pack(self, memory: Any) -> dict[str, np.ndarray]:
        tiny, sides = memory
        return super().pack(tiny) | {"rhythm_switching": np.array(sides)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        _, known = self.begun.memory
        sides = np.asarray(arrays.get("rhythm_switching", np.zeros(0)), dtype=np.float64)
        if sides.shape != (len(known),):
            raise ValueError(f"the checkpoint remembers {sides.shape} numbers of switching surfaces")
        return super().unpack(arrays), tuple(sides.tolist())

    def use(self, chart: int) -> None:
        self._chart = chart
        self._enter()
        self._longest = self._bounds[chart]

    def _enter(self) -> None:
        """Continue with the equations of this chart along the current surfaces."""
        key = self._chart, self._along, tuple(self._modes[j] for j in self._held)
        if key not in self._slid:
            system, along, held = self._system_of(self._chart), self._along, self._held
            interruptible(lambda: self._compiled(system, along, held))
        entered = self._slid[key]
        if entered is not self._integrator:
            entered.dtime = self._integrator.dtime
            entered.state[:] = self._integrator.state
            self._integrator = entered

    def _compiled(
        self, system: System, along: tuple[int, ...] = (), held: Mapping[int, tuple[int, int]] | None = None
    ) -> TaylorEngine:
        held = held or {}
        options = dict(self.precision.options)
        equations, kind = system.equations, self.precision.scalar
        shifted = [u + hy.par[system.parameters + j] for j, u in enumerate(system.surfaces)]
        events = [
            hy.nt_event(u, self._noting(j), fp_type=kind)
            for j, u in enumerate(of_order_one(system, shifted, system.surfaces))
            if j not in along and j not in held
        ]
        if along:
            found = sliding(system, along, held)
            equations = found.equations
            for j, side in zip(along, found.sides, strict=True):
                for end, way in ((1, hy.event_direction.positive), (-1, hy.event_direction.negative)):
                    leaves = self._noting(j, end)
                    events.append(hy.nt_event(side - float(end), leaves, direction=way, fp_type=kind))
        if self.has_events:
            offsets = system.parameters + len(system.surfaces)
            events += engine_events(system, self.precision, self.log, offsets=offsets)
        if self._tolerance is not None:
            options["tol"] = self._tolerance
        integrator = hy.taylor_adaptive(
            equations,
            self.precision.array(system.initial),
            time=self._start,
            nt_events=events,
            compact_mode=self.precision.compact or system.wide or len(along) > 1,
            **options,
        )
        self._slid[(self._chart, along, tuple(self._modes[j] for j in held))] = integrator
        return integrator

    def _noting(self, j: int, end: int = 0) -> Callable[[TaylorEngine, Scalar, int], None]:
        def called(_: TaylorEngine, time: Scalar, way: int) -> None:
            self._roots.append((time, j, end or way))

        return called

    # --- parameters -----------------------------------------------------------------------------------------

    def _pars(
        self, turns: list[float], over: dict[int, int] | None = None, low: Scalar | None = None
    ) -> np.ndarray:
        """Parameters of the equations; turns of angles, and the sign of the quaternion, are given."""
        modes = self._modes if over is None else [over.get(j, mode) for j, mode in enumerate(self._modes)]
        sides = [-1.0 if mode < 0 else 1.0 for mode in modes]
        numbers = [*sides, *turns]
        if (pieces := self.system.pieces) is not None:
            if self._piece is None:  # of those that meet at a boundary, the one that ends there
                self._piece = self._piece_of(bisect_left(pieces.knots, self.time))
            numbers += [0.0] * (self.system.first_of_pieces - len(numbers))
            return np.concatenate([self._array(numbers), self._piece])
        pars = self._array(numbers)
        if not self._probe.clocked:
            return pars
        rest = self._array([0.0])
        if low is not None:
            rest[0] = low
        return np.concatenate([pars, rest])

    def _piece_of(self, number: int) -> np.ndarray:
        assert self.system.pieces is not None
        return self.system.pieces.parameters(number)

    def _begin_piece(self) -> Scalar:
        """Continue with the piece of the equations that begins here, if one does; see ``_within_piece``."""
        if isinstance(self._requirement, SetAtKnots):
            self._piece = self._piece_of(self._requirement.enter(self._integrator))
        return self._within_piece()

    def _meet(self) -> Scalar | None:
        self._begin_piece()
        return self.end

    def _within_piece(self) -> Scalar:
        """How far a step may go that begins here."""
        if (end := self.end) is None:
            return self._longest
        high, low = self._integrator.dtime
        return min(self._longest, (end - high) - low)

    @property
    def _low(self) -> Scalar:
        """Second number of the time."""
        return self._integrator.dtime[1]

    def _array(self, numbers: list[float]) -> np.ndarray:
        if issubclass(self.precision.scalar, float | np.floating):
            return np.array(numbers, dtype=self.precision.scalar) + 0
        return np.array([self.precision.of_double(x) for x in numbers], dtype=self.precision.scalar)

    def _parameters(self, over: dict[int, int] | None = None) -> np.ndarray:
        """Parameters at this boundary; turns and sign continue from the latest step."""
        return self._pars(self._joined(self.state, self.time), over, self._low)

    def _look(self, state: np.ndarray, time: Scalar, low: Scalar | None = None) -> Look:
        """Look at the surfaces in a state of the latest step, at a time in one number or two."""
        return self._probe.look(state, time, self._pars(self._joined(state, time), low=low))

    def _values(self, state: np.ndarray, time: Scalar, low: Scalar | None = None) -> np.ndarray:
        """Arguments of the surfaces in a state of the latest step, likewise."""
        return self._probe.values(state, time, self._pars(self._joined(state, time), low=low))[0]

    def _plain(self, state: np.ndarray, time: Scalar) -> tuple[list[float], list[float]]:
        """Angles within one turn, and the quaternion without its sign, that expressions read."""
        return self._probe.values(state, time, self._pars(self._probe.unturned))[1:]

    def _joined(self, state: np.ndarray, time: Scalar) -> list[float]:
        """Turns and sign, continued from the latest step on to a state."""
        return self._turned.parameters(*self._plain(state, time)) if self._probe.unturned else []

    def _follow(self) -> None:
        """Continue angles and quaternion to the end of the step just taken."""
        if self._probe.unturned:
            self._turned = self._turned.followed(*self._plain(self.state, self.time))

    def _set(self, engine: TaylorEngine) -> None:
        """Set an engine's parameters at this boundary.

        The engine finds a zero at a step's very beginning again and again, in place of those that follow. So
        an argument that is zero there but for rounding is watched for the zero of its sum with a rounding, on
        the side that the motion is on; and an event that lies there, and was found on the way to it, for the
        zero of its sum with next to nothing.
        """
        pars = self._parameters()
        look = self._probe.look(self.state, self.time, pars)
        # what a unit of time makes of the state tells its size
        noises = self._probe.noises(look, [self.state, look.field])
        near = np.abs(look.u.astype(np.float64)) <= noises
        moved = [
            float(mode * noise) if beside and abs(mode) < HELD else 0.0
            for mode, noise, beside in zip(self._modes, noises, near, strict=True)
        ]
        if self.has_events:
            moved += [self._beside(*found) for found in self._probe.crossings(self.state, self.time, pars)]
        offsets = self._array(moved)
        everything = np.concatenate([pars, offsets])
        engine.pars[:] = everything[: len(engine.pars)]  # along a surface the last ones have no meaning

    def _beside(self, value: float, noise: float) -> float:
        """Offset to add to an event's expression."""
        if self._along and abs(value) <= noise:  # it is zero all along the surface and crosses nothing
            return 2 * noise
        return 2.0 ** (-self.precision.bits - BESIDE) if self._fresh and value == 0 else 0.0

    def _at_rest(self, on: list[int], look: Look) -> Continuation | None:
        """How to continue if swings about two surfaces have decayed to rounding; None otherwise."""
        resting = np.abs(look.u.astype(np.float64)) <= self._probe.swing_noises(look, self.state)
        small = [i for i, mode in enumerate(self._modes) if i in on or abs(mode) >= HELD or resting[i]]
        if len(small) < 2:
            return None

        def at(sides: Mapping[int, int], state: np.ndarray, time: Scalar) -> Look:
            return self._probe.look(state, time, self._parameters(dict(sides)))

        meeting = Meeting(at, self._probe, np.array(self.state), self.time, self._epsilon)
        kept = {j: self._modes[j] for j in (*self._along, *self._held)}
        return meeting.rest(sorted({*small, *kept}), kept)

    def _keep_to_surfaces(self) -> None:
        """Remove the rounding that moved the state off the surfaces along which it slides."""
        state = self._integrator.state
        look = self._look(state, self.time, self._low)
        for j in (*self._along, *self._held):
            gradient = look.gradients[j]
            square = sum((g * g for g in gradient), gradient[0] * 0)
            if square != 0:
                state[:] = state - (look.u[j] / square) * gradient
