"""Simulated effect of a run's rounding errors: neighbours of the motion that are pushed at random all along.

A neighbour follows the motion at a small distance and gets, again and again, a push as a step's rounding
gives one, but many times as large. Its distance over that factor is an error as the run's own is: made
anywhere, in any state, and carried by the motion from there to the end, whatever it passes on the way. No law
of growth is assumed.

Distances stay small (or are drawn in), so that they grow as infinitely small ones do. The neighbours are
lanes of one batch, beside the motion itself in the first; a loose tolerance is good enough, since what is cut
off from the series is a smooth function of the state and nearly the same in all lanes.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigidsim.model.heyoka_expressions import TANGENT
from rigidsim.model.system import System
from rigidsim.solve.neighbours.chords import attitude_chords
from rigidsim.solve.neighbours.lanes import NEIGHBOURS, Lanes, SeriesErrors
from rigidsim.solve.neighbours.spread import Spread

_HOPELESS_STEPS = 32_768
"""Steps beyond the expected number after which the motion is given up, say on its way to a collision."""
_LARGEST = 2.0**-24
"""Distance from which neighbours are drawn in. A chord that is drawn in leaves the surfaces on which the
motion's invariants are constant by half its square, which must stay below what the pushes did.
"""
_DRAWN_IN = 2.0**-2
_SATURATED = 2.0**-14
"""Distance that is no longer small: the stretch is repeated in two parts, or from nearer."""
_FIRST_PUSHES = 2.0**-40
"""Initial distance that stands for one epsilon."""
_STEPS_AT_ONCE = 192.0
_FEWEST_STRETCHES, _MOST_STRETCHES, _FEWEST_OF_WINDOW = 32, 512, 12
"""Between pushes where growth is slow: so many steps, or so many stretches of the whole. They are counted
in steps, among which those of a close passage are many, not in time, of which they take little.
"""
_FEWEST_STEPS, _FEWEST_OF_ALL = 6.0, 12
"""In a stretch, whose last one is cut short, of the shortest motions; but so many stretches at any rate."""
_MOST_STEPS_AT_ONCE = 4096
_LONGER = 1.5
"""Ratio by which a stretch may exceed the mean if the motion takes few steps in it."""
_CALM, _WILD = 4.0, 16.0
"""Growth over a stretch below which stretches may become longer, and above which they become shorter."""
_MOST_CLOSER = 40
_APART = ("pace", "work", "stride")
"""States that nothing depends on."""
_GROUPS: dict[str, tuple[str, ...]] = {
    "rates": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
}


@dataclass(frozen=True)
class Pushes:
    """Errors that a step adds to each state, in epsilons.

    Attributes:
        own: random error relative to the state's own size.
        shared: random error relative to the largest state's size.
        series: truncation error of the series, over its value in these states.
        first: error at the start relative to the state's own size.
        clock: error of the time, for loads that depend on it.
        ahead: internal time by which the time in which such a load counts is ahead of the scene's.
        together: most steps with the same error of the time. Over a load's period it would average out, which
            those of single steps don't.
    """

    own: float = 0.4
    shared: float = 0.0
    series: float = 1.0
    first: float = 0.5
    clock: float = 0.3
    ahead: float = 0.0
    together: float = math.inf


def _length(vector: np.ndarray) -> float:
    return math.sqrt(float(vector @ vector))


class Neighbours:
    """A motion with neighbours that are pushed along the way.

    Args:
        system: built for double precision, without a partner chart.
        lanes: integrators that carry it.
        start, end: times between which to follow the motion, internal units.
        steps: steps that the motion is expected to take, which decide the spacing of pushes.
        epsilon: unit of the pushes.
        rounded: (states,) bool, which of the initial values were rounded.
        series: truncation errors, for a tolerance far above epsilon.
    """

    def __init__(
        self,
        system: System,
        lanes: Lanes,
        start: float,
        end: float,
        steps: float,
        pushes: Pushes,
        epsilon: float,
        rounded: np.ndarray,
        series: SeriesErrors | None = None,
    ) -> None:
        self._system, self._lanes, self._pushes = system, lanes, pushes
        self._epsilon, self._series = epsilon, series
        names, attitude = system.states, system.mechanics.attitude
        groups: dict[str, tuple[str, ...]] = dict(_GROUPS)
        self._chords = attitude_chords(system)
        if attitude is not None:
            groups["attitude"] = tuple(attitude.names)
        self._places = {
            group: [names.index(n) for n in members if n in names] for group, members in groups.items()
        }
        grouped = {i for places in self._places.values() for i in places}
        apart = {n for n in names if n in _APART or n.startswith(TANGENT)}
        alone = [[i] for i, n in enumerate(names) if i not in grouped and n not in apart]
        groups_of_places = [*filter(None, self._places.values()), *alone]
        self._members = np.zeros((len(groups_of_places), len(names)))
        for row, places in enumerate(groups_of_places):
            self._members[row, places] = 1.0
        self._felt = np.array([n not in apart for n in names])
        exponents = system.state_exponents
        self._units = np.ldexp(1.0, np.array([exponents[i] for i in self._places["rates"][:3]], np.int32))
        self._angles = list(system.angle_states)
        self._turn = math.ldexp(2 * math.pi, -system.angle_unit)
        initial = np.array([float(x) for x in system.initial])
        self._begin(initial, start, end, steps, _FEWEST_STRETCHES)
        self._push(pushes.first, np.abs(initial), rounded)

    def _begin(self, initial: np.ndarray, start: float, end: float, steps: float, fewest: int) -> None:
        self._states = np.repeat(initial[:, None], NEIGHBOURS + 1, axis=1)
        self._random = np.random.default_rng(0)  # the same pushes each time
        self._factor = _FIRST_PUSHES  # distance for one epsilon
        self._largest = np.abs(initial)
        self._weigh()
        self._time, self.steps = start, 0
        self._pace(end, steps, fewest)
        self._stretch = self._longest
        self._apart: np.ndarray = np.zeros(NEIGHBOURS)
        self._cut = 0.0
        self.spread = Spread()

    def _pace(self, end: float, steps: float, fewest: float) -> None:
        """Set the spacing of pushes up to a time reached in so many steps."""
        fewest = max(_FEWEST_OF_ALL, min(fewest, steps / _FEWEST_STEPS))
        stretches = min(max(fewest, steps / _STEPS_AT_ONCE), _MOST_STRETCHES)
        stretches = max(stretches, steps / min(_MOST_STEPS_AT_ONCE, self._pushes.together))
        self._longest = _LONGER * (end - self._time) / stretches
        self._steps_at_once = round(max(steps / stretches, min(_FEWEST_STEPS, self._pushes.together)))
        self._most_steps = self.steps + 4 * steps + _HOPELESS_STEPS

    def elsewhere(self, state: np.ndarray, start: float, end: float, steps: float) -> Neighbours:
        """Neighbours for a part of the motion that begins in another state (states,), in the same lanes.

        Args:
            steps: steps that the part is expected to take.
        """
        other = copy.copy(self)
        other._begin(state, start, end, steps, _FEWEST_OF_WINDOW)
        other._push(self._pushes.first, np.abs(state), state != 0)
        return other

    @property
    def time(self) -> float:
        """Time that the neighbours have reached, internal units."""
        return self._time

    def away_from(self, state: np.ndarray) -> float:
        """Distance of the motion from another state (states,) at this time, relative to its size."""
        pair = np.stack([self._states[:, 0], state], axis=1)
        if angles := self._angles:
            pair[angles, 1] -= self._turn * np.rint((pair[angles, 1] - pair[angles, 0]) / self._turn)
        return float(self._distances(pair)[0])

    @property
    def lanes(self) -> Lanes:
        """The lanes that carry the neighbours now."""
        return self._lanes

    @property
    def tolerance(self) -> float:
        """Tolerance of the lanes' steps."""
        return self._lanes.tolerance

    def prepare_for(self, steps: float, end: float) -> None:
        """Prepare for further steps beyond those expected, to another end."""
        self._lanes = self._lanes.again(steps)
        self._pace(end, steps, _FEWEST_STRETCHES)

    def follow(self, until: float, go_on: Callable[[], bool], lost: float = math.inf) -> Spread:
        """Follow the motion to a time, unless all is lost before.

        Args:
            until: time, internal units.
            go_on: called between stretches; False ends the work.
            lost: spread of the attitude (or the rates) past which nothing more can be learnt.
        """
        spread = self.spread
        while spread.whole and self._time < until and go_on() and not self.all_lost(lost):
            spread.whole = self._go(until)
        return spread

    def all_lost(self, lost: float) -> bool:
        """Whether neither the attitude (or the rates) nor the position can be predicted any more."""
        spread = self.spread
        if not spread.times:
            return False
        if (spread.rates if self._chords is None else spread.attitude)[-1] < lost:
            return False
        return not self._places["position"] or spread.position[-1] * self._epsilon > spread.extent

    def _go(self, until: float) -> bool:
        """Follow one stretch, as long as growth allows; False if the motion can't be followed."""
        before, distances = self._states.copy(), self._apart
        for _ in range(_MOST_CLOSER):
            time = min(self._time + self._stretch, until)
            if until - time < 0.01 * self._stretch:
                time = until
            found = self._advance(before, time, self._steps_at_once)
            if found is None:
                return False
            taken, time = found
            grown = self._distances(self._states)
            if grown.max() < _SATURATED:
                break
            if taken > 4:
                self._stretch = (time - self._time) / 2
            else:
                before = self._drawn_in(before, 2.0**-8)
                distances = self._distances(before)
        else:
            return False
        growth = float((grown / np.maximum(distances, 1e-300)).max())
        if growth > _WILD:
            self._stretch = max(self._stretch / 2, (time - self._time) / max(taken, 1))
        elif growth < _CALM:
            self._stretch = min(2 * self._stretch, self._longest)
        self.steps += taken
        self._time = time
        largest = np.maximum(np.abs(before[:, 0]), np.abs(self._states[:, 0]))
        if (largest > self._largest).any():
            self._largest = np.maximum(self._largest, largest)
            self._weigh()
        moved = before[:, 0] != self._states[:, 0]  # what stands still isn't rounded
        if angles := self._angles:  # which grow, and step control with them
            self._states[angles] -= self._turn * np.rint(self._states[angles, :1] / self._turn)
        self._push(self._pushes.own * math.sqrt(taken), largest, moved, taken)
        far = float(self._apart.max())
        if far > _LARGEST:
            self._states = self._drawn_in(self._states, _DRAWN_IN * _LARGEST / far)
            self._apart = _DRAWN_IN * _LARGEST / far * self._apart
        self._note()
        return True

    def _advance(self, states: np.ndarray, time: float, most: int) -> tuple[int, float] | None:
        """Take at most ``most`` steps: their number and the time reached, or None if not finite."""
        # a rounded time is another time, for loads that depend on it: another one at each step, whereas the
        # neighbours' lasts for the stretch
        steps = min(most, self._steps_at_once * _LONGER * (time - self._time) / self._longest)
        late = abs(self._time + self._pushes.ahead)
        wrong = self._pushes.clock * late * self._factor / math.sqrt(max(steps, 1.0))
        shifts = np.concatenate([[0.0], wrong * self._random.standard_normal(NEIGHBOURS)])
        found = self._lanes.advance(states, self._time + shifts, time + shifts, most)
        if found is None or not np.isfinite(found[0]).all() or self.steps > self._most_steps:
            return None
        self._states, taken, reached = found
        return max(taken, 1), reached

    def _push(self, own: float, sizes: np.ndarray, moved: np.ndarray, taken: int = 0) -> None:
        """Add errors: ``own`` relative to each size, and the truncation of ``taken`` steps."""
        normal = self._random.standard_normal((len(sizes), NEIGHBOURS))
        pushed = own * sizes[:, None] * normal
        pushed[~moved] = 0.0
        if taken and self._pushes.shared:
            alike = self._random.standard_normal((len(sizes), NEIGHBOURS)) * (self._largest > 0)[:, None]
            pushed += own / self._pushes.own * self._pushes.shared * float(sizes[self._felt].max()) * alike
        if taken and self._series is not None:
            wrong = self._pushes.series * self._series.of_step(self._states[:, 0], self._time) / self._epsilon
            # one step stands for all of the stretch: they add up, or walk where their errors change sign
            times = taken + math.sqrt(taken) * self._random.standard_normal(NEIGHBOURS)
            pushed += wrong[:, None] * times
            self._cut += taken * math.sqrt(float((self._weights @ (wrong * self._felt) ** 2).max()))
        pushed[~self._felt] = 0.0
        self._states[:, 1:] += self._factor * pushed
        self._apart = self._distances(self._states)

    def _drawn_in(self, states: np.ndarray, factor: float) -> np.ndarray:
        """Neighbours moved nearer by a factor, in the same directions."""
        self._factor *= factor
        nearer = states.copy()
        nearer[:, 1:] = states[:, :1] + factor * (states[:, 1:] - states[:, :1])
        return nearer

    def _distances(self, states: np.ndarray) -> np.ndarray:
        """Distance of each neighbour (neighbours,), relative to the size of the respective states."""
        apart = states[:, 1:] - states[:, :1]
        found: np.ndarray = np.sqrt((self._weights @ (apart * apart)).max(axis=0))
        return found

    def _weigh(self) -> None:
        """Update the weights of squared differences; states that never moved get none."""
        sizes = (self._members * self._largest).max(axis=1, keepdims=True)
        self._weights = np.where(sizes > 0, self._members / np.maximum(sizes, 1e-150) ** 2, 0.0)

    def _note(self) -> None:
        spread, motion = self.spread, self._states[:, 0]
        apart = (self._states[:, 1:] - motion[:, None]) / self._factor
        wrong = np.sqrt(np.add.reduce(apart * apart, axis=1) / NEIGHBOURS)
        places, units = self._places, self._units
        rates = places["rates"][:3]
        size = _length(units * motion[rates])
        spread.times.append(self._time)
        spread.steps.append(self.steps)
        spread.cut.append(self._cut)
        spread.rates.append(_length(units * wrong[rates]) / size if size > 0 else 0.0)
        turned = 0.0 if self._chords is None else self._chords.between(self._states)
        spread.attitude.append(turned / self._factor)
        if not places["position"]:
            spread.position.append(0.0)
            spread.velocity.append(0.0)
        else:
            spread.position.append(_length(wrong[places["position"]]))
            spread.velocity.append(_length(wrong[places["velocity"]]))
            spread.extent = max(spread.extent, _length(motion[places["position"]]))
            spread.fastest = max(spread.fastest, _length(motion[places["velocity"]]))
