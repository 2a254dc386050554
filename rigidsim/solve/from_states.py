"""A scene's equations from any attitude and rates at any time: where a trajectory would go from each row.

In double precision at its epsilon, with the attitude as a quaternion. States that a trajectory doesn't have
(orbits, rotors, flight) start each time where the scene's own motion has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.formulations.formulation import Quaternion
from rigidsim.model.model_plan import plan_model
from rigidsim.model.observables.mechanical import WORK
from rigidsim.model.state_blocks import BODY
from rigidsim.model.step_limiter import PACE
from rigidsim.model.system import System, drift_outputs
from rigidsim.scene.scene import Scene
from rigidsim.solve.compiled import compiled_engine, compiled_function, evaluate_rows
from rigidsim.solve.precision import Precision, precision_of

_STEPS = 100_000


class NotFromStates(Exception):
    """Why a scene can't be started from attitude and rates alone."""


class AnyStart:
    """A scene's equations in rates and quaternion, which may begin at any attitude and rates.

    Attributes:
        others: names of further states besides its own and the orbits': of rotors and of users.
        second: the same of a second body.
    """

    second: Sequence[str] = ()

    def __init__(
        self, scene: Scene, precision: Precision, *, compact: bool = False, forwards: bool = False
    ) -> None:
        self.precision = precision
        plan = replace(plan_model(scene.as_motion()), formulation=Quaternion())
        if forwards:  # whichever way the scene runs
            plan = replace(plan, scaling=replace(plan.scaling, direction=1))
        self._system = System(plan, precision.number)
        self._options = dict(precision.options, compact_mode=compact or self._system.wide)
        names = self._system.states
        self._places = [names.index(name) for name in (*BODY.quaternion, *BODY.rates)]
        flown = self._system.flown
        flight = [] if flown is None else [*flown.position, *flown.velocity]
        if flown is not None and flown is not BODY:
            flight += [*flown.quaternion, *flown.rates]
            self.second = flight
        self._flight = [names.index(name) for name in flight]
        orbits = [self._system.mechanics.orbit(tag).block.names for tag in self._system.plan.orbit_tags]
        known = {WORK, PACE, *(name for block in orbits for name in block)}
        taken = {names[place] for place in (*self._places, *self._flight)}
        self.others = [name for name in names if name not in known | taken]
        self.whole = not set(names) - taken

    @property
    def plain(self) -> bool:
        """Whether nothing happens between steps."""
        return not self._system.stepwise and not self._system.clocked

    @cached_property
    def _engine(self) -> Any:
        initial = self.precision.array(self._system.initial)
        return compiled_engine(self._system.equations, initial, time=self._start, **self._options)

    @cached_property
    def _derivatives(self) -> Any:
        expressions = [right for _, right in self._system.equations]
        return compiled_function(expressions, self._system.variables, **self._options)

    @property
    def _exact_start(self) -> Any:
        """Internal units, mpf."""
        return self._system.start

    @property
    def _start(self) -> Any:
        return self.precision.number(self._exact_start)


class FromStates(AnyStart):
    """A scene's motion from given states; times in s, attitudes w x y z, rates in rad/s, body axes."""

    def __init__(self, scene: Scene) -> None:
        if scene.config.model.level != "full":
            what = f"the config's model is {scene.config.model.level}, an average without an attitude"
            raise NotFromStates(what)
        super().__init__(scene, precision_of("double"), forwards=True)
        if not self.plain:
            raise NotFromStates("its equations change along the motion (tables, kernels or switches)")
        if self._system.mechanics.rate_correction is not None:
            raise NotFromStates("its body is distorted, so that rates alone don't determine its momentum")

    @cached_property
    def _scales(self) -> np.ndarray:
        return np.ldexp(1.0, np.array(self._system.state_exponents))

    def _internal(self, times: np.ndarray) -> np.ndarray:
        return self._system.scaling.direction * np.ldexp(times, -self._system.scaling.time)

    def motion(self, times: np.ndarray) -> np.ndarray:
        """The scene's own states (rows, states), internal units, at ascending times (s)."""
        engine, grid = self._engine, self._internal(times)
        initial = self.precision.array(self._system.initial)
        found, early = np.empty((len(grid), len(initial))), int(np.searchsorted(grid, self._start))
        for rows in (np.arange(early)[::-1], np.arange(early, len(grid))):  # backwards, then on
            engine.time, engine.state[:] = self._start, initial
            begun = np.concatenate([[self._start], grid[rows][grid[rows] != self._start]])
            result = engine.propagate_grid(begun, max_steps=10**9)
            states = np.asarray(result[5] if len(result) > 5 else result[-1])
            if result[0] != hy.taylor_outcome.time_limit or len(states) != len(begun):
                raise NotFromStates("its motion ends before the trajectory does")
            found[rows] = states[len(begun) - len(rows) :]
        return found

    def states(
        self, own: np.ndarray, quaternions: np.ndarray, rates: np.ndarray, flight: np.ndarray | None = None
    ) -> np.ndarray:
        """States (rows, states), or of a single row, internal units, of attitudes and rates, with all else as
        in ``own``.

        Args:
            flight: positions and velocities (rows, 6), SI, space axes; of a second body also its attitudes
                and rates (rows, 13).
        """
        made = own.copy()
        made[..., self._places[:4]] = quaternions
        made[..., self._places[4:]] = rates / self._scales[self._places[4:]]
        if flight is not None and flight.shape[-1] == len(self._flight):
            made[..., self._flight] = flight / self._scales[self._flight]
        return made

    def after(self, start: np.ndarray, time: float, until: np.ndarray) -> np.ndarray:
        """States (times, states) at ascending later times (s), from a state at a time; nan past an end."""
        engine = self._engine
        engine.time = float(self._internal(np.array([time]))[0])
        engine.state[:] = start
        found = np.full((len(until), len(start)), np.nan)
        for n, moment in enumerate(self._internal(until)):
            outcome, *_ = engine.propagate_until(moment, max_steps=_STEPS)
            if outcome != hy.taylor_outcome.time_limit:
                break
            found[n] = engine.state
        return found

    def slopes(self, states: np.ndarray, times: np.ndarray, added: np.ndarray | None = None) -> np.ndarray:
        """Derivatives (rows, states) by time (s) of states in internal units.

        Args:
            added: angular accelerations (rows, 3), rad/s^2, body axes, added to the equations'.
        """
        found = evaluate_rows(self._derivatives, states, times=self._internal(times)).T
        found = self._internal(found)
        if added is not None:
            found[:, self._places[4:]] += added / self._scales[self._places[4:]]
        return found

    @cached_property
    def inertia(self) -> np.ndarray:
        """Tensor (3, 3), kg m^2, body axes, of what turns with the body."""
        return np.array([[float(x) for x in row] for row in self._system.scene.turning_inertia])

    def accelerations(self, states: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Angular accelerations (rows, 3), rad/s^2, body axes."""
        return self.slopes(states, times)[:, self._places[4:]] * self._scales[self._places[4:]]

    def attitude(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (rows, 4) and angular velocities (rows, 3), rad/s, of states in internal units."""
        first, last = self._places[0], self._places[3]
        together = self._places[:4] == [*range(first, last + 1)]  # a view, which copies nothing
        rates = states[..., self._places[4:]] * self._scales[self._places[4:]]
        return states[..., slice(first, last + 1) if together else self._places[:4]], rates

    def drifts(self, states: RowStates, times: np.ndarray) -> dict[str, np.ndarray]:
        """Drift of each invariant from the first row on, relative to its scale."""
        invariants = self._system.invariants
        if not invariants:
            return {}
        components = [x for invariant in invariants for x in invariant.expressions]
        value = compiled_function(components, self._system.variables, **self._options)
        begun = evaluate_rows(value, states[slice(1)], times=self._internal(times[:1]))[:, 0]
        expressions = drift_outputs(invariants, self._system.scene.context, self.precision.number)
        function = compiled_function(expressions, self._system.variables, **self._options)
        found = evaluate_rows(function, states[slice(None)], begun, self._internal(times)).T
        return {invariant.name: found[:, n] for n, invariant in enumerate(invariants)}


@dataclass(frozen=True)
class RowStates:
    """States of a trajectory's rows, made of those that are asked for alone.

    Attributes:
        own: states (rows, states) of the scene's own motion, internal units.
        quaternions: (rows, 4), w x y z, of norm one. rates: (rows, 3), rad/s, body axes.
        flight: see ``FromStates.states``, if known.
    """

    equations: FromStates
    own: np.ndarray
    quaternions: np.ndarray
    rates: np.ndarray
    flight: np.ndarray | None

    def __getitem__(self, rows: int | slice | np.ndarray) -> np.ndarray:
        flight = None if self.flight is None else self.flight[rows]
        return self.equations.states(self.own[rows], self.quaternions[rows], self.rates[rows], flight)
