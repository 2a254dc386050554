"""Tangents that are kicked as a step's errors are: the simulated effect of rounding on motions.

Beside each motion go a few tangents (``rigidsim.solve.tangents``), to which the errors of some steps at a
time are added at random. Each is an error as the motion's own is: made anywhere, in any state, and carried
from there to the end, whatever is passed on the way. No law of growth is assumed.

Errors come between stretches of several steps: half of those that a stretch stands for before it, half after,
so that few stretches suffice for errors that grow as time makes them; where they grow faster, stretches
become shorter. The motion begins anew at each known state of the run, so that a loose tolerance is good
enough.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.names import TANGENT
from rigidsim.model.observables.mechanical import WORK
from rigidsim.model.state_blocks import BODY
from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.lanes import BatchEngine
from rigidsim.solve.requirements import SetAtKnots, requirement_of
from rigidsim.solve.stepper import Mark
from rigidsim.solve.tangents import parameters_of
from rigidsim.solve.taylor_stepper import TaylorStepper

TANGENTS = 3
"""Of two, the true errors of 1.2 % of the motions would be beyond three times what is announced, instead of
0.3 % (Student's t at 9, where one direction leads); of 60 planar spins one was 11 times as wrong as
announced.
"""
SHORTEST, _LONGEST = 4.0, 4096.0
"""Steps of a stretch. They are counted in steps, among which those of a close passage are many, not in time,
of which they take little.
"""
_PART_OF_STEP = 2.0**-4
"""Shortest stretch of a stepper: a step in 200 digits, of order 230, spans some 11 e-folds of an instability.
"""
_CALM, _WILD = 8.0, 64.0
"""Growth over a stretch below which stretches may become longer, and above which they are repeated, shorter.
"""
_NOTHING = 2.0**-96
"""Initial value, in internal units, that is zero but for the arithmetic of the scene, and no size: a state
that is measured alone would be lost after its first step.
"""
_TO_SAME = 64  # steps at most from where a neighbour is to where the motion is
_HOPELESS = 32_768
"""Steps beyond four times the expected number after which a motion is given up, as before a collision."""
_ALIKE = 1e-4
"""Ratio of singular values of the gradients of invariants below which a direction isn't taken back. Runs
leave those alone whose gradients are apart by less than 2^-9 rad; near a middle axis errors in these are
what grows.
"""
_APART = 2.0**-30  # of a state's size, at which neighbours of a motion that switches show its tangents


# --- what carries motions and tangents ---------------------------------------------------------------------


def timed(rights: Sequence[Any], first: int) -> list[Any]:
    """Right-hand sides with an error of the time as the parameter ``first``."""
    return hy.subs([hy.expression(x) for x in rights], {hy.time: hy.time + hy.par[first]})


def beside(tangents: np.ndarray, late: np.ndarray) -> np.ndarray:
    """Factors (motions, tangents) that bring neighbours so near that their distances are tangents."""
    sizes = np.maximum(np.abs(tangents).max(axis=0, initial=0.0), np.abs(late))
    return np.asarray(_APART / np.maximum(sizes, 1e-300))


class LaneCarrier:
    """Motions and their neighbours in lanes of a batch: their distances are the tangents. Exact ones take
    three times as long, and ten times as long to compile.

    Args:
        engine: of the equations with an error of the time as their last parameter.
        read: the other parameters, (parameters, motions).
        starts: of the motions, whose series bound their steps.
        knots: of pieces that are followed. first: index of their first parameter.
    """

    shortest = SHORTEST

    def __init__(
        self,
        engine: BatchEngine,
        read: np.ndarray,
        starts: Starts | None,
        knots: SetAtKnots | None = None,
        first: int = 0,
    ) -> None:
        self._engine, self._longest = engine, np.full(1, math.inf)
        self._read = np.concatenate([read, np.zeros((1, read.shape[1]))])
        self._knots, self._first = knots, first
        if starts is not None:
            for place, time in enumerate(starts.begin.tolist()):
                self._enter(starts.states, self._read, slice(place, place + 1), time)
            self._longest = engine.longest(starts.states, self._read, starts.begin)

    @classmethod
    def of(cls, system: System, tolerance: float, *, compact: bool) -> LaneCarrier:
        """Of a single motion of a system."""
        first = parameters_of(system)
        idle = [name == WORK or name.startswith(TANGENT) for name in system.states]
        zero = hy.expression(0.0)  # for what nothing depends on: it would only cost time to compile
        rights = [zero if rests else right for (_, right), rests in zip(system.equations, idle, strict=True)]
        engine = BatchEngine(
            list(zip(system.variables, timed(rights, first), strict=True)),
            1 + TANGENTS,
            tolerance=tolerance,
            compact=compact or system.wide,
            optimised=False,
            requirement=requirement_of(system) if system.pieces is None else None,
        )
        knots = None if system.pieces is None else SetAtKnots(system)
        return cls(engine, np.zeros((first, 1)), None, knots, system.first_of_pieces)

    def advance(
        self,
        which: np.ndarray,
        states: np.ndarray,
        tangents: np.ndarray,
        late: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        steps: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Go on by about so many steps (motions,) at most, and no further than to given times (motions,);
        all stretches of as many steps go together.

        Args:
            which: numbers of the motions.
            states, tangents: (states, motions), (states, motions, tangents).
            late: error of the time that loads depend on, (motions, tangents).

        Returns:
            States and tangents, not finite if they can't be followed, the steps taken and the times reached.
        """
        factors, lanes = beside(tangents, late), 1 + TANGENTS
        every = np.repeat(states[:, :, None], lanes, axis=2)
        every[:, :, 1:] += factors * tangents
        read = np.repeat(self._read[:, which][:, :, None], lanes, axis=2)
        read[-1, :, 1:] = factors * late
        times, taken = np.empty(every.shape[1:]), np.empty(every.shape[1:])
        for stride in np.unique(steps).tolist():
            alike = np.flatnonzero(steps == stride)
            first, last, bounds = (np.repeat(x[alike], lanes) for x in (begin, end, self._longest[which]))
            there, flat = (x[:, alike].reshape(len(x), -1) for x in (every, read))
            there, then, gone = self._onward(int(stride), there, flat, first, last, bounds)
            # neighbours took steps of almost the same lengths
            reached = np.repeat(then.reshape(-1, lanes)[:, 0], lanes)
            there, *_ = self._engine.onward(_TO_SAME, there, flat, then, reached, bounds)
            every[:, alike] = there.reshape(len(every), -1, lanes)
            times[alike], taken[alike] = then.reshape(-1, lanes), gone.reshape(-1, lanes)
        moved = (every[:, :, 1:] - every[:, :, :1]) / factors
        return every[:, :, 0], moved, np.maximum(taken[:, 0], 1), times[:, 0]

    def _onward(
        self, most: int, there: np.ndarray, read: np.ndarray, now: np.ndarray, ends: np.ndarray, *more: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Go on, through pieces of the equations, each motion with its neighbours in one."""
        if self._knots is None:
            return self._engine.onward(most, there, read, now, ends, *more)
        lanes, taken = 1 + TANGENTS, np.zeros(len(now))
        going = np.arange(0, len(now), lanes)
        while len(going):
            edges = np.array([self._enter(there, read, slice(k, k + lanes), float(now[k])) for k in going])
            some = (going[:, None] + np.arange(lanes)).ravel()
            left, until = most - int(taken[going].min()), np.minimum(ends[some], np.repeat(edges, lanes))
            given = there[:, some], read[:, some], now[some], until, *(x[some] for x in more)
            there[:, some], now[some], gone = self._engine.onward(left, *given)
            taken[some] += gone
            late = (now[some].reshape(-1, lanes) < edges[:, None]).any(axis=1)
            going = going[~(late | (edges >= ends[going]) | (taken[going] >= most))]
        return there, now, taken

    def _enter(self, states: np.ndarray, read: np.ndarray, lanes: slice, time: float) -> float:
        """Set what begins at a time, or contains it, in some lanes; returns where it ends."""
        if (knots := self._knots) is None:
            return math.inf
        number = knots.pieces.number_at(time)
        if number and knots.pieces.knots[number - 1] == time:
            for series, values in knots.pieces.changes(number):
                states[knots.places[series], lanes] = values[:, None]
        read[self._first : self._first + knots.parameters, lanes] = knots.pieces.parameters(number)[:, None]
        return float(knots.pieces.knots[number]) if number < len(knots.pieces.knots) else math.inf


class SteppedCarrier:
    """A single motion by a stepper that ends its steps on switching surfaces, and its tangents by neighbours
    in double precision, which are on the same sides as it is.

    The motion itself goes on in the run's arithmetic: in fewer bits it would leave an unstable rest early,
    and tangents would belong to another motion.
    """

    shortest = _PART_OF_STEP

    def __init__(self, own: TaylorStepper, near: TaylorStepper, start: float, end: float, steps: int) -> None:
        self._near, self._pace = near, steps / (end - start)
        self._steppers = [near] if own is near else [near, own]
        # of the motion, which may slide, by times: a stretch may be followed again from where it began
        self._marks = {start: [stepper.begun for stepper in self._steppers]}

    def advance(
        self,
        which: np.ndarray,
        states: np.ndarray,
        tangents: np.ndarray,
        late: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        steps: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """See ``LaneCarrier``."""
        first, until = float(begin[0]), min(float(end[0]), float(begin[0]) + float(steps[0]) / self._pace)
        taken, time, moved = np.array([(until - first) * self._pace]), np.array([until]), tangents.copy()
        marks: list[Mark] = []
        for stepper, known in zip(self._steppers, self._marks[first], strict=True):
            if stepper is not self._near or (known.state == states[:, 0]).all():
                stepper.back_to(known)
            else:
                self._set(first, first, states[:, 0])
            there, zero = (stepper.precision.of_double(x) for x in (until, 0.0))
            if not stepper.to(there):
                return states * np.nan, moved, taken, time
            marks.append(replace(stepper.mark(), time=(there, zero)))
        base, *_, own = [np.array([float(x) for x in mark.state]) for mark in (marks[0], *marks)]
        for j, factor in enumerate(beside(tangents, late)[0].tolist()):
            shift = factor * float(late[0, j])
            self._set(first, first + shift, states[:, 0] + factor * tangents[:, 0, j])
            if not self._near.to(until + shift):
                return states * np.nan, moved, taken, time
            moved[:, 0, j] = (np.array(self._near.mark().state, dtype=float) - base) / factor
        # what moves in the run's arithmetic alone is rounded, too: a last bit shows that it does
        still = np.array([x == y for x, y in zip(marks[-1].state, known.state, strict=True)])
        own = np.where((own == states[:, 0]) & ~still, np.nextafter(own, np.inf), own)
        self._marks[until] = marks
        return own[:, None], moved, taken, time

    def _set(self, first: float, begin: float, state: np.ndarray) -> None:
        """Set the neighbours' stepper on a state at a time that is ``first`` but for a small error."""
        near, pieces, known = self._near, self._near.system.pieces, self._marks[first][0]
        # none is past an edge that the motion isn't, where it would go on with what holds before
        edges = [] if pieces is None else pieces.knots[bisect_left(pieces.knots, first) :][:1]
        near.back_to(replace(known, time=(min([begin, *map(float, edges)]), 0.0), state=state.copy()))
        near.settle()


# --- kicks ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Perturbations:
    """Errors that a step adds to each state, in epsilons.

    Attributes:
        together: most steps with the same error of the time. Over a load's period it would average out,
            which those of single steps don't.
    """

    own: float = 0.4  # random error relative to the state's own size
    first: float = 0.5  # error at the start relative to the state's own size
    clock: float = 0.3  # error of the time, for loads that depend on it
    ahead: float = 0.0  # internal time by which the time in which such a load counts is ahead of the scene's
    together: float = math.inf


@dataclass(frozen=True)
class Held:
    """Invariants that a single run projects.

    Attributes:
        gradients: of the invariants (invariants, states), in a state, for states of order one.
        since: time from which on it does.
        between: steps from an error of a step to where it is taken back, for what it does to the phase.
    """

    gradients: Callable[[np.ndarray], np.ndarray]
    since: float
    between: int


class ErrorTangents:
    """Motions and the tangents of each: ``time`` is what was reached, (motions,), and ``spread``
    what was seen. The random draws are the same for all motions and each time, so that results don't depend
    on the company.

    Args:
        perturbations: errors of a step, in units of ``epsilon``.
        rounded: (states,) bool, which of the initial values were rounded; all by default.
        known: where the motions begin anew: times (places, motions), ascending, and states (places, states,
            motions).
        stretches: number of stretches at least, of motions with many steps.
    """

    def __init__(
        self,
        carrier: LaneCarrier | SteppedCarrier,
        measures: Measures,
        starts: Starts,
        perturbations: Perturbations,
        epsilon: float,
        *,
        rounded: np.ndarray | None = None,
        known: tuple[np.ndarray, np.ndarray] | None = None,
        held: Held | None = None,
        stretches: int = 12,
    ) -> None:
        self._carrier, self._measures, self._errors = carrier, measures, perturbations
        self._starts, self._held, self._epsilon = starts, held, epsilon
        none = np.zeros((0, len(starts.begin))), np.zeros((0, *starts.states.shape))
        self._known: tuple[np.ndarray, np.ndarray] = known or none
        motions, self._states = len(starts.begin), starts.states.copy()
        self.time, self.spread = starts.begin.copy(), Spread(motions)
        self._steps, self._ahead, self._extent, self._lead = np.zeros((4, motions))
        self._random = np.random.default_rng(0)
        longest = 2.0 ** np.floor(np.log2(np.maximum(math.sqrt(2) * starts.steps / stretches, 1.0)))
        self._most = np.minimum(np.clip(longest, SHORTEST, _LONGEST), perturbations.together)
        self._stride = self._most.copy()
        begun = (starts.states != 0) if rounded is None else rounded[:, None]
        sizes = np.where(begun & (np.abs(starts.states) > _NOTHING), np.abs(starts.states), 0.0)
        normal = self._random.standard_normal((len(starts.states), TANGENTS))
        first = np.full(motions, (perturbations.first / perturbations.own) ** 2)
        self._tangents = self._kicks(first, sizes, normal)
        self._sizes = np.zeros_like(sizes)  # of what moves and is rounded; not known before the first stretch

    def follow(
        self,
        until: float = math.inf,
        go_on: Callable[[], bool] = lambda: True,
        lost: float = math.inf,
    ) -> Spread:
        """Follow the motions to their ends, or until a time, while ``go_on`` says so and not all is lost."""
        ends = np.minimum(self._starts.end, until)
        with np.errstate(all="ignore"):
            while True:
                going = np.flatnonzero(self.spread.whole & (self.time < ends) & (self._lead < lost))
                if not len(going) or not go_on():
                    return self.spread
                known = self._known[0][:, going]
                ahead = np.where(known > self.time[going], known, math.inf)
                self._stretch(going, np.minimum(ahead.min(axis=0, initial=math.inf), ends[going]))

    def _stretch(self, going: np.ndarray, until: np.ndarray) -> None:
        """Follow some motions through one stretch, with the errors of half of its steps added before it, and
        the errors of the others after it. Where tangents grow too much it is repeated, shorter.
        """
        # the same number of draws in each round, for whichever motions
        clock, *normal = self._random.standard_normal((1 + 2 * len(self._states), TANGENTS))
        before, steps, sizes = self._states[:, going], self._steps[going], self._sizes[:, going]
        stride = np.where(steps > 0, self._stride[going], np.minimum(self._stride[going], SHORTEST))
        expected = np.minimum(np.maximum(self._starts.steps[going] - steps, 1), stride)
        ahead = np.where(steps > 0, np.maximum(self._ahead[going], expected / 2), 0.0)
        early = self._kicks(ahead - self._ahead[going], sizes, normal[::2])
        # a rounded time is another time, for loads that depend on it: another one at each step, whereas the
        # tangents' lasts for the stretch
        late = self._errors.clock * np.abs(self.time[going] + self._errors.ahead) / np.sqrt(expected)
        tangents = self._tangents[:, going] + early
        found, grown, taken, reached = self._carried(going, tangents, late[:, None] * clock, until, stride)
        growth = self._lengths(grown) / np.maximum(self._lengths(tangents), 1e-300)
        followed = np.isfinite(found).all(axis=0) & np.isfinite(grown).all(axis=(0, 2))
        followed &= steps <= 4 * self._starts.steps[going] + _HOPELESS
        self.spread.whole[going[~followed]] = False
        wild = (growth > _WILD) & (stride > self._carrier.shortest)
        calm = np.where(growth < _CALM, np.minimum(2 * self._stride[going], self._most[going]), stride)
        self._stride[going] = np.where(wild, np.maximum(stride / 8, self._carrier.shortest), calm)
        # what stands still isn't rounded; of errors made all along a stretch of exponential growth g a part
        # 1 / ln g grows as much (variances)
        sizes = np.where(before != found, np.maximum(np.abs(before), np.abs(found)), 0.0)
        sizes /= np.sqrt(np.clip(np.log(growth), 1.0, math.log(_WILD)))
        grown += self._kicks(np.maximum(taken - ahead, 0.0), sizes, normal[1::2])
        if angles := self._measures.angles:  # which grow, and step control with them
            found[angles] -= self._measures.turn * np.rint(found[angles] / self._measures.turn)
        places = self._known[0][:, going] == reached
        for place, motion in zip(*np.nonzero(places), strict=True):  # of the motion itself
            found[:, motion] = self._known[1][place, :, going[motion]]
        some = followed & ~wild
        going = going[some]
        self._states[:, going], self._sizes[:, going] = found[:, some], sizes[:, some]
        self._tangents[:, going], self.time[going] = grown[:, some], reached[some]
        self._steps[going] += taken[some]
        self._ahead[going] = np.maximum(ahead - taken, 0.0)[some]
        self._note(going)

    def _carried(
        self, going: np.ndarray, tangents: np.ndarray, late: np.ndarray, until: np.ndarray, stride: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Through a stretch, on whose way errors of invariants are taken back that are held."""
        begin, states, held, before = self.time[going], self._states[:, going], self._held, np.zeros(1)
        if held is not None and begin[0] >= held.since:
            first = np.minimum(float(held.between), stride)
            # what errors of the time do to the invariants is taken back as soon
            states, tangents, before, begin = self._carrier.advance(
                going, states, tangents, late * (stride / first)[:, None], begin, until, first
            )
            late, stride = 0 * late, stride - first
            if np.isfinite(states).all():
                gradients = held.gradients(states[:, 0])
                back, *_ = np.linalg.lstsq(gradients, gradients @ tangents[:, 0], rcond=_ALIKE)
                tangents[:, 0] -= back
            if not ((begin < until) & (stride > 0)).all():
                return states, tangents, before, begin
        found, grown, taken, reached = self._carrier.advance(
            going, states, tangents, late, begin, until, stride
        )
        return found, grown, before + taken, reached

    def _kicks(self, steps: np.ndarray, sizes: np.ndarray, normal: Iterable[np.ndarray]) -> np.ndarray:
        """Errors (states, motions, tangents) of steps (motions,) in states of sizes (states, motions), by
        random numbers (states, tangents), in epsilons.
        """
        kicks = self._errors.own * (np.sqrt(steps) * sizes)[:, :, None] * np.array(list(normal))[:, None]
        return np.where(self._measures.felt[:, None, None], kicks, 0.0)

    def _lengths(self, tangents: np.ndarray) -> np.ndarray:
        """Length of the longest tangent (motions,) of (states, motions, tangents), internal units."""
        felt = tangents[self._measures.felt]
        return np.asarray(np.sqrt((felt * felt).sum(axis=0)).max(axis=1))

    def _note(self, which: np.ndarray) -> None:
        states, tangents = self._states[:, which], self._tangents[:, which]
        # at which neighbours are as good as tangents
        unit = 2.0**-24 / np.maximum(self._lengths(tangents), 1e-300)
        found = self._measures.differences(states, unit[:, None] * tangents, self._starts, which, unit)
        self.spread.note(which, time=self.time[which], steps=self._steps[which], **found)
        lead = found["attitude" if self._measures.carried else "rates"]
        if "position" in found:
            self._extent[which] = np.maximum(self._extent[which], found["distance"])
            lead = np.where(found["position"] * self._epsilon > self._extent[which], lead, 0.0)
        self._lead[which] = lead


# --- what they amount to ----------------------------------------------------------------------------------

_IDLE = ("pace", "work", "stride")
"""States that nothing depends on."""


@dataclass(frozen=True)
class Starts:
    """Motions to be followed; internal units.

    Attributes:
        begin, end: times, (motions,).
    """

    states: np.ndarray  # initial states (states, motions)
    begin: np.ndarray
    end: np.ndarray
    steps: np.ndarray  # steps that each is expected to take, (motions,)
    rate_units: np.ndarray  # factors that bring the body rates to a common unit, (3, motions)
    parameters: np.ndarray  # of the equations, (parameters, motions)


class Measures:
    """Sizes of differences between a system's states.

    Attributes:
        places: indices of the states of each quantity ("rates", "attitude", "position", "velocity", and a
            second body's attitude, "partner").
        felt: mask of the states that anything depends on, (states,).
        carried: whether there is an attitude.
        angles, turn: indices of the states that are angles growing without bound, and their full turn.
    """

    def __init__(self, system: System, states: int | None = None, parameters: Sequence[Any] = ()) -> None:
        names, attitude = list(system.states[:states]), system.mechanics.attitude
        flown, groups = system.flown, {"rates": BODY.rates}
        if flown is not None:
            groups |= {"position": flown.position, "velocity": flown.velocity}
            groups |= {} if flown is BODY else {"partner": flown.quaternion}
        self.places = {group: [names.index(n) for n in of if n in names] for group, of in groups.items()}
        self.places["attitude"] = [] if attitude is None else [names.index(n) for n in attitude.names]
        self.felt = np.array([n not in _IDLE and not n.startswith(TANGENT) for n in names])
        self.carried = attitude is not None
        self.angles, self.turn = list(system.angle_states), math.ldexp(2 * math.pi, -system.angle_unit)
        self._attitude = attitude
        self._variables = [*system.variables[: len(names)], *parameters]
        self._chord = None if attitude is None else attitude.chord

    def differences(
        self,
        states: np.ndarray,
        apart: np.ndarray,
        starts: Starts,
        which: np.ndarray,
        unit: np.ndarray | float = 1.0,
    ) -> dict[str, np.ndarray]:
        """Root mean square differences (motions,) of each quantity, as ``Spread`` names them, in units
        (motions,): of states (states, motions) and others that are ``apart`` (states, motions, others), where
        ``which`` are their numbers among the starts.
        """
        places, found = self.places, {}
        wrong = np.sqrt(np.add.reduce(apart * apart, axis=2) / apart.shape[2]) / unit
        if rates := places["rates"]:
            units = starts.rate_units[:, which]
            size, off = (np.sqrt(((units * x[rates]) ** 2).sum(axis=0)) for x in (states, wrong))
            found["rates"] = np.where(size > 0, off / np.maximum(size, 1e-300), 0.0)
        if self.carried:
            angles = self._angles_between(states, apart, starts.parameters[:, which])
            found["attitude"] = np.sqrt((angles**2).mean(axis=1)) / unit
            if other := places.get("partner"):  # whose attitude may be the worse one
                angle = 2.0 * np.sqrt((wrong[other] ** 2).sum(axis=0))
                found["attitude"] = np.maximum(found["attitude"], angle)
        for name, size_name in (("position", "distance"), ("velocity", "speed")):
            if place := places.get(name):
                found[name], found[size_name] = (
                    np.sqrt((x[place] ** 2).sum(axis=0)) for x in (wrong, states)
                )
        return found

    def _angles_between(self, states: np.ndarray, apart: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Angles (motions, others), rad, between the attitudes."""
        if self._chord is not None:
            return np.asarray(self._chord * np.sqrt((apart[self.places["attitude"]] ** 2).sum(axis=0)))
        _, motions, others = apart.shape
        every = np.concatenate([states[:, :, None], states[:, :, None] + apart], axis=2)
        read = np.repeat(parameters, others + 1, axis=1)
        rows = np.concatenate([every.reshape(len(states), -1), read]).T
        found = self.attitudes(rows, fp_type=float).reshape(4, motions, -1)
        return np.asarray(2.0 * np.sqrt(((found[:, :, 1:] - found[:, :, :1]) ** 2).sum(axis=0)))

    def attitudes(self, rows: np.ndarray, **options: Any) -> np.ndarray:
        """Components (components, n) of the quaternion, or of a direction without one, of states and
        parameters (n, both), all at one time: a frame that turns with time changes no distance.
        """
        assert self._attitude is not None
        read = self._attitude.quaternion or self._attitude.variables
        function = compiled_function(read, self._variables, compact_mode=True, **options)
        return evaluate_rows(function, rows, times=np.zeros(len(rows)))


class Spread:
    """Effect of errors of one epsilon per step along some motions, as noted at times.

    Its quantities, each by name:

    - ``time``, ``steps``: internal units; steps that the motion took until then, as it was followed;
    - ``rates``, ``attitude``, ``position``, ``velocity``: root mean square over the perturbed motions, in
      epsilons of internal units; attitude as an angle, rates relative to their size; zeros if there is none;
    - ``distance``, ``speed``: of the motion from the origin.

    Attributes:
        whole: (motions,), False for motions that couldn't be followed to the requested end.
    """

    def __init__(self, motions: int) -> None:
        self.whole = np.ones(motions, dtype=bool)
        self._notes: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []

    def note(self, which: np.ndarray, **quantities: np.ndarray) -> None:
        """Note quantities of some motions."""
        self._notes.append((which, quantities))

    def along(self, name: str) -> np.ndarray:
        """Values of a quantity along a single motion, (notes,)."""
        return np.array([found.get(name, [0.0])[0] for which, found in self._notes if len(which)])

    def largest(self, name: str) -> np.ndarray:
        """Largest values so far, (motions,), zero at the start."""
        most = np.zeros(len(self.whole))
        for which, found in self._notes:
            most[which] = np.maximum(most[which], found.get(name, 0.0))
        return most
