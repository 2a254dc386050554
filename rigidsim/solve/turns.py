"""Full turns of recorded angles that are functions of the state: Euler angles where a quaternion is carried,
longitudes of axes.

Such an angle is known up to full turns. From one row to the next it takes the nearest way, since the body
turns by at most ``DENSE`` there: distant samples have rows between them, found within the run's steps
like samples but not recorded, and like samples they change no bit of the motion.

Near a pole both outer Euler angles swing by up to half a turn at once, in opposite senses, while a + s c
(``rigidsim.model.kinematics``) advances no faster than the body turns. So its change gives the turns of c
once those of a are chosen; chosen one by one, they may add up to a turn that nobody made. Where an angle
jumps by nearly half a turn all the same, the motion between the two rows is integrated once more, in double
precision, and looked at in ever smaller parts. Of a pass nearer than that resolves the nearest way is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import heyoka as hy
import numpy as np

from rigidsim.model.frames import plane_drift
from rigidsim.model.kinematics import UNDEFINED
from rigidsim.model.scaling import source_rate
from rigidsim.model.system import Recorded, System
from rigidsim.scene.rotations import AXES, is_proper, parity
from rigidsim.solve.checkpoint import Arrays
from rigidsim.solve.compiled import CompiledFunction, evaluate_rows, interruptible
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampling import Rows, SampleClock
from rigidsim.solve.stepper import SamplesWithin
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

DENSE = 1.0
"""Largest angle (rad) by which a body turns between rows whose angles are joined to the nearest."""
MOST_OF_A_CLOSED_FORM = 1e6
"""Angle between samples of a closed form up to which turns are counted: about a second's work."""

_NEAR = 0.5  # singular factor: the body turns by less than half a turn between points below it, on one side
_LOOKED_AT = 2.0**-16  # singular factor, in double precision, below which it is worked out in the run's own
DOUBTFUL = 2.0
"""Jump (rad) from which on it is looked at in parts; one that is missed by a turn is larger than 4."""
_POLE = 1e-6  # size of an angle's sine and cosine below which jumps aren't looked at
_PARTS, _DEPTH = 16, 4  # parts of a part, and how often
_STEPS = 1000  # between two rows, at most
_TOLERANCE = 1e-11
_TURN = 2 * np.pi


def angles_to_join(system: System) -> list[Recorded]:
    """The recorded angles that are functions of the state."""
    return [r for r in system.recorded if r.continuity == "unwrap"]


def radians_between_samples(system: System) -> float:
    """Largest angle (rad) by which the body turns between samples against the frame of recorded
    angles, which may turn with an orbit.
    """
    scene, rate = system.scene, float(system.rate_bound)
    if not system.formulation.resolves_rotation:
        # the plane may move, but no place on an orbit is recorded
        rate += float(plane_drift(scene, system.plan.loads) or 0)
    elif any(r.name != "euler_angles" for r in angles_to_join(system)):
        rate += float(source_rate(scene))
    return math.sqrt(3) * rate * scene.samples.largest_spacing


def nearest(jumps: np.ndarray) -> np.ndarray:
    """Changes of angles reduced to half a turn."""
    return jumps - _TURN * np.rint(jumps / _TURN)


def at_poles(sequence: str, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the outer angles' sum (1) or difference (-1) is regular at the nearer pole, and its factor."""
    sine, cosine = np.sin(middle), np.cos(middle)
    if is_proper(sequence):
        return np.copysign(1.0, cosine), np.abs(sine)
    return parity(*map(AXES.index, sequence[:2])) * np.copysign(1.0, sine), np.abs(cosine)


@dataclass(frozen=True)
class Continuity:
    """What joins the angles of a block to the angles of the block before.

    Attributes:
        turns: full turns of the angles, (angles,).
        angles: of the latest row, float64, without these turns; None before the first.
        time, state, chart: of the latest row, float64, internal units.
    """

    turns: np.ndarray | int = 0
    angles: np.ndarray | None = None
    time: float = math.nan
    state: np.ndarray | None = None
    chart: int = 0

    def pack(self) -> Arrays:
        """It as arrays of a checkpoint."""
        if self.angles is None or self.state is None:
            return {}
        place = np.array([self.time, self.chart])
        return {
            "joined_turns": np.asarray(self.turns),
            "joined_angles": self.angles,
            "joined_state": self.state,
            "joined_place": place,
        }

    @classmethod
    def unpacked(cls, arrays: Mapping[str, np.ndarray]) -> Continuity:
        """Restored from them."""
        if "joined_angles" not in arrays:
            return cls()
        if "joined_place" not in arrays:
            raise ValueError("an earlier version followed its angles; resume it with that one")
        time, chart = arrays["joined_place"].tolist()
        return cls(arrays["joined_turns"], arrays["joined_angles"], time, arrays["joined_state"], int(chart))


class JoinedAngles:
    """The angles of a system that are joined from row to row.

    An undefined angle is NaN; only of Euler angles in their pole the first keeps the value it had, and the
    last is what it leaves of the turn that both share.

    Attributes:
        columns: their places among the system's outputs.
        known: what the next rows are joined to.
        lost: whether samples of a closed form are too far apart to count turns.
    """

    def __init__(
        self,
        system: System,
        compiled: Callable[[list[hy.expression]], CompiledFunction],
        precision: Precision,
        *,
        has_steps: bool,
    ) -> None:
        self.variables = angles_to_join(system)
        self.columns = [r.first + i for r in self.variables for i in range(r.count)]
        ends = np.cumsum([r.count for r in self.variables]).tolist()
        firsts = [end - r.count for r, end in zip(self.variables, ends, strict=True)]
        self._parts = {r.name: slice(i, i + r.count) for i, r in zip(firsts, self.variables, strict=True)}
        self._split = [(i, r.poles.sequence) for i, r in zip(firsts, self.variables, strict=True) if r.poles]
        self._system, self._compiled, self._precision = system, compiled, precision
        self._radians = radians_between_samples(system) if self.variables else 0.0
        self.lost = not has_steps and self._radians > MOST_OF_A_CLOSED_FORM
        self._least = (UNDEFINED * float(precision.epsilon)) ** 2
        self.known = Continuity()

    def __bool__(self) -> bool:
        return bool(self.variables)

    def rows(self, clock: SampleClock) -> Rows:
        """The samples, and as many rows between them as turns need."""
        radians = 0.0 if self.lost else self._radians
        return Rows(clock, math.ceil(radians / DENSE))

    def part(self, variable: Recorded) -> slice | None:
        """Where a variable's angles are among the joined ones; None if they aren't joined."""
        return self._parts.get(variable.name)

    def apart(self, block: SampleBlock) -> SampleBlock:
        """A block of states that follow no others, whose angles are within one turn."""
        if not self:
            return block
        angles, lost, _, _ = self._evaluated(block.states, block.times, block.chart)
        return replace(block, joined=np.where(lost, np.nan, angles))

    def joined(self, block: SampleBlock) -> SampleBlock:
        """A block whose rows follow those before, with their angles."""
        if self.lost or not self or not len(block):
            return self.apart(block)
        known, times, states = self.known, block.times.astype(np.float64), block.states.astype(np.float64)
        angles, lost, sizes, rates = self._evaluated(block.states, block.times, block.chart)
        for first, sequence, rows in self._in_poles(angles, block):
            begun = angles[0, first] if known.angles is None else known.angles[first]
            side, _ = at_poles(sequence, angles[:, first + 1])
            for row in rows.tolist():
                kept = angles[row - 1, first] if row else begun
                angles[row, first + 2] -= side[row] * (kept - angles[row, first])
                angles[row, first] = kept
        before = angles[0] if known.angles is None else known.angles
        all_angles = np.vstack([before, angles])
        jumps = self.jumps(all_angles)
        begins = [known.time, *times[:-1]]
        fast = np.flatnonzero(rates * (times - begins) > DOUBTFUL)  # where the rates' bound is an estimate
        for row in {*self._doubtful(jumps, all_angles, sizes).tolist(), *fast.tolist()}:
            state, chart = (states[row - 1], int(block.chart[row - 1])) if row else (known.state, known.chart)
            if state is not None:
                jumps[row] = self._looked_at(begins[row], state, chart, times[row], jumps[row])
        made = np.rint((jumps - np.diff(all_angles, axis=0)) / _TURN).astype(np.int64)
        turns = known.turns + np.cumsum(made, axis=0)
        self.known = Continuity(turns[-1], angles[-1], times[-1], states[-1], int(block.chart[-1]))
        return replace(block, joined=np.where(lost, np.nan, angles + _TURN * turns))

    def recorded(self, angles: np.ndarray, block: SampleBlock) -> tuple[np.ndarray, np.ndarray]:
        """Angles (n, angles) as evaluated, with what they have in a pole, and their full turns."""
        found, plain = angles.copy(), angles.astype(np.float64)
        lost = np.isnan(block.joined)
        found[lost] = self._precision.of_double(math.nan)
        off = np.where(lost, 0.0, block.joined - plain)
        for first, sequence in self._split:
            kept = np.abs(nearest(off[:, first])) > 1e-6 + 2.0**-50 * np.abs(block.joined[:, first])
            side, _ = at_poles(sequence, plain[:, first + 1])
            for row in np.flatnonzero(kept):
                value = self._precision.of_double(float(plain[row, first] + nearest(off[row, first])))
                moved = value - found[row, first]
                found[row, first] = value
                found[row, first + 2] = found[row, first + 2] - side[row] * moved
        return found, np.rint(np.where(lost, 0.0, (block.joined - found.astype(np.float64)) / _TURN))

    def jumps(self, angles: np.ndarray) -> np.ndarray:
        """Changes (n, angles) from each of n + 1 points to the next, to the nearest."""
        steps = np.diff(angles, axis=0)
        found = nearest(steps)
        for i, sequence in self._split:
            side, factor = at_poles(sequence, angles[:, i + 1])
            near = (np.maximum(factor[:-1], factor[1:]) < _NEAR) & (side[:-1] == side[1:])
            shared = nearest(steps[:, i] + side[1:] * steps[:, i + 2])
            off = side[1:] * (shared - found[:, i]) - found[:, i + 2]
            found[near, i + 2] += _TURN * np.rint(off[near] / _TURN)
        return found

    # --- evaluation -----------------------------------------------------------------------------------------

    def _evaluated(
        self, states: np.ndarray, times: np.ndarray, chart: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Angles (n, angles) within one turn, where they are undefined, the sizes of their sines and cosines,
        and the body's rate (n,), rad per internal unit: float64.
        """
        count = len(self.columns)
        values = evaluate_rows(self._functions[0], states, times=times)
        there = chart != 0
        if there.any():
            values[:, there] = evaluate_rows(self._functions[1], states[there], times=times[there])
        plain = values.astype(np.float64)
        angles, squared = plain[:count].T, plain[count:-1].T
        lost = ~((squared >= self._least) & np.isfinite(squared))
        return np.where(lost, 0.0, angles), lost, np.sqrt(squared), np.sqrt(plain[-1])

    @cached_property
    def _functions(self) -> list[CompiledFunction]:
        return interruptible(lambda: [self._compiled(self._of(chart)) for chart in self._charts])

    @property
    def _charts(self) -> list[System]:
        return [chart for chart in (self._system, self._system.partner) if chart is not None]

    def _of(self, chart: System) -> list[hy.expression]:
        names = {r.name for r in self.variables}
        found = [r for r in chart.recorded if r.name in names]
        angles = [chart.outputs[r.first + i] for r in found for i in range(r.count)]
        sizes = [x for r in found for x in r.squared_sizes or [hy.expression(1.0)] * r.count]
        return [*angles, *sizes, hy.sum([w * w for w in chart.mechanics.rates])]

    @cached_property
    def _squared_factors(self) -> CompiledFunction:
        """Squared factors that vanish in the poles, compiled once a row comes near one."""
        squares = [r.poles.squared_factor for r in self.variables if r.poles is not None]
        return interruptible(lambda: self._compiled(squares))

    def _in_poles(self, angles: np.ndarray, block: SampleBlock) -> list[tuple[int, str, np.ndarray]]:
        """Of each variable with poles the place of its first angle, its sequence, and the rows in a pole."""
        found = []
        for number, (first, sequence) in enumerate(self._split):
            _, factor = at_poles(sequence, angles[:, first + 1])
            if (factor < _LOOKED_AT).any():
                squares = evaluate_rows(self._squared_factors, block.states, times=block.times)
                rows = np.flatnonzero(squares[number].astype(np.float64) < self._least)
                found.append((first, sequence, rows))
        return found

    def _doubtful(self, jumps: np.ndarray, angles: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Rows whose turns the row before doesn't determine because an angle is near its pole."""
        found = np.zeros(len(jumps), dtype=bool)
        large = np.abs(jumps) > DOUBTFUL
        for variable in self.variables:
            part = self._parts[variable.name]
            if variable.poles is None:
                found |= large[:, part].any(axis=1) & (sizes[:, part] > _POLE).all(axis=1)
            else:
                _, factor = at_poles(variable.poles.sequence, angles[:, part][:, 1])
                found |= large[:, part].any(axis=1) & (np.minimum(factor[:-1], factor[1:]) > _POLE)
        return np.flatnonzero(found)

    # --- the motion once more -------------------------------------------------------------------------------

    @cached_property
    def _stepper(self) -> TaylorStepper:
        double, start = precision_of("double"), float(self._system.start)
        system = self._system
        return interruptible(lambda: stepper_of(system.rounded(double.number), double, _TOLERANCE, start))

    def _looked_at(
        self, begin: float, state: np.ndarray, chart: int, end: float, jump: np.ndarray, depth: int = _DEPTH
    ) -> np.ndarray:
        """Change of the angles (angles,) between two moments, where their values don't determine it."""
        times = np.linspace(begin, end, _PARTS + 1)
        states = self._path(times, state, chart)
        if states is None:
            return jump
        scalars = self._precision.of_doubles(states.ravel()).reshape(states.shape)
        angles, *_ = self._evaluated(scalars, self._precision.of_doubles(times), np.full(len(times), chart))
        jumps = self.jumps(angles)
        for i in np.flatnonzero(np.abs(jumps).max(axis=1) > DOUBTFUL) if depth > 1 else ():
            jumps[i] = self._looked_at(times[i], states[i], chart, times[i + 1], jumps[i], depth - 1)
        return np.asarray(jumps.sum(axis=0))

    def _path(self, times: np.ndarray, state: np.ndarray, chart: int) -> np.ndarray | None:
        """States (n, states) at ascending times from the state at the first on; None if the motion doesn't
        get there, or depends on turns that this state doesn't determine.
        """
        if self._system.turning or not times[-1] > times[0]:
            return None
        stepper, samples = self._stepper, SamplesWithin(times)
        stepper.use(chart)
        stepper.back_to(replace(stepper.begun, time=(float(times[0]), 0.0), state=state))
        stepper.settle()
        going = stepper.take(_STEPS, samples)
        found = np.asarray(samples.states)
        return found if going and len(found) == len(times) and np.isfinite(found).all() else None
