"""Turns of angles between sparse samples, counted along the motion and not guessed from the samples.

Angles that are functions of the state (Euler angles where a quaternion is carried, longitudes of axes) are
known up to full turns. Where the body may turn far between two samples, the motion from the one to the other
is integrated once more, in double precision from the recorded state on, and its angles are followed in small
parts. Whole turns are all that is taken from it, so that it needn't be exact: it has to arrive near the
second sample, which is checked. The run itself, its steps and what it records of the state know nothing of
it.

Counting along the run's own steps would save nothing: of a driven asymmetric body states at each part add 1.2
us a step in double precision and 3.5 us with 80 bits, or more with events; the motion once more costs 0.4 us.

Near a pole of the angles two of them swing by up to half a turn at once; there the path is followed in ever
smaller parts. A pass nearer than that resolves has no direction of its own, and the nearest one is taken.

Euler angles and their momenta have singularities, near which a run changes its chart. Following the motion
needs neither: a twin in quaternions carries the same motion, and its states are functions of the run's.
"""

import math
import time as clock_time
from collections.abc import Callable, Sequence
from dataclasses import replace

import heyoka as hy
import numpy as np

from rigidsim.model.formulations.quaternion import Quaternion
from rigidsim.model.frames import plane_drift
from rigidsim.model.outputs import Recorded
from rigidsim.model.scaling import source_rate
from rigidsim.model.state_blocks import BODY
from rigidsim.model.system import System
from rigidsim.scene.rotations import is_proper
from rigidsim.scene.scene import SampleTimes
from rigidsim.solve.compiled import CompiledFunction, compiled_engine, compiled_function, interruptible
from rigidsim.solve.precision import precision_of
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper
from rigidsim.solve.turns.steps import AngleSteps, Place

DENSE = 1.0
"""Largest angle (rad) by which a body turns between samples whose angles are joined to the nearest."""

_PART = 0.5  # rad, that the body turns from one point to the next
_CHUNK = 4096  # points, always as many, so that turns don't depend on timing
_SWITCHING_CHUNK = 256  # where each step is taken by itself
_STEPS = 50  # per point, at most; a motion that takes more isn't followed
_DOUBTFUL = 2.0  # rad: a jump by more is looked at in parts; one that is missed by a turn is larger than 4
_FINER = 16  # parts of a part
_DEPTH = 4
_POLE = 1e-6  # rad, within which dense samples aren't looked at in parts
_OFTEN = 0.05  # of the parts; if more are doubtful, the motion rests in a pole, and no path tells more
_FAR = 0.05  # difference of an attitude state from which the motion followed is no longer the run's
_TOLERANCE = 1e-11
_SPARE = 1.25  # over the fastest rate of a chunk, for the next
_SLOWER = 64.0  # than its bound, at most: the next chunk is not to be an age
_WORTH_BUILDING = 2e5  # rad: code that builds in a tenth of the time runs half as fast
MOST_OF_A_CLOSED_FORM = 1e6
"""Angle between samples of a closed form up to which turns are counted: about a second's work."""


def radians_between(samples: SampleTimes, rate: float) -> float:
    """Largest angle (rad) between neighbouring samples for rates of at most this per component (rad/s)."""
    return math.sqrt(3) * rate * samples.largest_spacing


def angles_to_join(system: System) -> list[Recorded]:
    """The recorded angles that are functions of the state."""
    return [r for r in system.recorded if r.continuity == "unwrap"]


def angle_rate(system: System, angles: Sequence[Recorded]) -> float:
    """Bound (rad/s) of each rate against the frame of the angles, which may turn with an orbit."""
    moving = any(r.name != "euler_angles" for r in angles)
    if not system.formulation.resolves_rotation:
        # the plane may move, but nothing is told of the place on an orbit
        drift = plane_drift(system.scene, system.plan.loads)
        if drift is not None:
            return float(system.rate_bound + drift)
    return float(system.rate_bound) + (float(source_rate(system.scene)) if moving else 0.0)


def is_sparse(system: System) -> bool:
    """Whether samples are too far apart to tell turns."""
    return radians_between(system.scene.samples, angle_rate(system, angles_to_join(system))) > DENSE


def doubtful_rows(jumps: np.ndarray, angles: np.ndarray, sequence: str) -> np.ndarray:
    """Rows where dense samples' angles (n + 1, 3) jump by nearly half a turn, near their pole."""
    middle = angles[:, 1]
    factor = np.abs(np.sin(middle) if is_proper(sequence) else np.cos(middle)) > _POLE
    return np.flatnonzero((np.abs(jumps).max(axis=1) > _DOUBTFUL) & factor[:-1] & factor[1:])


Follower = Callable[[np.ndarray, np.ndarray], np.ndarray | None]
"""Function from ascending times (n,) and the state at the first to the states; None if the motion doesn't get
there.
"""


def _by_grids(system: System, *, compact: bool) -> Follower:
    """Follows a motion with the engine's own grids."""
    start = np.zeros(len(system.states))
    engine = compiled_engine(system.equations, start, tol=_TOLERANCE, compact_mode=compact)

    def states(times: np.ndarray, state: np.ndarray) -> np.ndarray | None:
        engine.time = times[0]
        engine.state[:] = state
        outcome, *_, found = engine.propagate_grid(times, max_steps=_STEPS * len(times))
        return np.asarray(found) if outcome == hy.taylor_outcome.time_limit else None

    return states


def _by_steps(stepper: TaylorStepper) -> Follower:
    """Follows a motion with switching surfaces or tabulated orbits step by step."""

    def states(times: np.ndarray, state: np.ndarray) -> np.ndarray | None:
        found = [state]
        stepper.back_to(replace(stepper.mark(), time=(float(times[0]), 0.0), state=state))
        stepper.settle()
        for _ in range(_STEPS * len(times)):
            if not stepper.step():
                return None
            while len(found) < len(times) and times[len(found)] <= stepper.time:
                found.append(stepper.dense(times[len(found)]))
            if len(found) == len(times):
                return np.array(found)
        return None

    return states


class TurnCounter:
    """Follows angles from sample to sample."""

    def __init__(self, system: System, angles: Sequence[Recorded]) -> None:
        self._exact, self._angles, self._steps = system, angles, AngleSteps(angles)
        self._place: Place | None = None
        self._built = False

    def begin(self, place: Place) -> None:
        """Count from a sample on, unless the counter is there already."""
        if self._place is not None and self._place.time == place.time:
            return
        self._place = place
        self._time, self._state = place.time, place.state
        self._followed = place.angles.copy()
        self._lost = False
        self._rate = self._bound

    def follow(self, time: float, seconds: float = 0.2) -> None:
        """Continue towards the next sample as far as the run itself has come, for at most ``seconds``."""
        started = clock_time.perf_counter()
        while (
            self._place is not None
            and not self._lost
            and self._time + self._chunk * self._part <= time
            and clock_time.perf_counter() - started < seconds
        ):
            self._advance(time)

    def turns(self, place: Place) -> np.ndarray | None:
        """Full turns (angles,) from the beginning to a sample; None if the motion doesn't lead there."""
        while self._time < place.time and not self._lost:
            self._advance(place.time)
        watched = self._watched
        off = np.abs(self._state[watched] - place.state[watched]).max()
        if self._two_signs:
            off = min(off, np.abs(self._state[watched] + place.state[watched]).max())
        if self._lost or not off < _FAR:
            return None
        return self._steps.turns(self._followed, place.angles)

    # --- the motion once more ---------------------------------------------------------------------------

    @property
    def _bound(self) -> float:
        """Bound of the angular velocity, internal units."""
        if not self._built:
            interruptible(self._build)
        return self._largest

    @property
    def _part(self) -> float:
        return _PART / self._rate

    def _build(self) -> None:
        double = precision_of("double")
        system = self._exact.rounded(double.number)
        m = system.mechanics
        self._chunk = _CHUNK if not system.stepwise else _SWITCHING_CHUNK
        names = [r.name for r in self._angles]
        found = [r for name in names for r in system.recorded if r.name == name]
        outputs = [system.outputs[r.first + i] for r in found for i in range(r.count)]
        ends = np.cumsum([r.count for r in self._angles]).tolist()
        self._groups = [slice(end - r.count, end) for r, end in zip(self._angles, ends, strict=True)]
        squared = hy.sum([w * w for w in m.rates])
        names = system.states[:3] if m.attitude is None else m.attitude.names
        self._two_signs = m.attitude is not None and m.attitude.quaternion_sign == "state"
        self._watched = [system.states.index(name) for name in names]
        self._function: CompiledFunction = compiled_function(
            [*outputs, squared], system.variables, compact_mode=True
        )
        bound = angle_rate(system, self._angles)
        self._source = math.ldexp(bound - float(system.rate_bound), system.scaling.time)
        rate = math.sqrt(3) * bound
        radians = rate * float(system.scene.duration)
        start = float(system.start)
        if system.stepwise:
            self._states = _by_steps(stepper_of(system, double, _TOLERANCE, start))
        else:
            self._states = _by_grids(system, compact=system.wide or radians < _WORTH_BUILDING)
        self._largest = math.ldexp(rate, system.scaling.time)
        self._built = True

    def _path(self, time: float, state: np.ndarray, end: float, parts: int) -> tuple[np.ndarray, ...] | None:
        """Times (n + 1,), states, angles (n + 1, angles) and largest rate between two times."""
        times = np.linspace(time, end, parts + 1)
        times[0], times[-1] = time, end
        states = self._states(times, state)
        if states is None or not np.isfinite(states).all():
            return None
        values = np.asarray(self._function(np.ascontiguousarray(states.T), time=times))
        return times, states, np.nan_to_num(values[:-1].T), np.sqrt(values[-1].max()) + self._source

    def _advance(self, limit: float) -> None:
        """Follow a chunk of points, or as many as there are up to a time."""
        parts = min(self._chunk, max(1, math.ceil((limit - self._time) / self._part)))
        end = limit if parts < self._chunk else min(limit, self._time + self._chunk * self._part)
        found = self._path(self._time, self._state, end, parts)
        if found is None or not end > self._time:
            self._lost = True
            return
        times, states, angles, fastest = found
        if fastest * (end - self._time) / parts > 2 * _PART:  # faster than it was, or than an estimated bound
            self._rate = 2 * float(fastest)
            return
        self._rate = max(_SPARE * float(fastest), self._bound / _SLOWER)
        jumps = self._steps.jumps(angles)
        doubtful: set[int] = set()
        for group in self._groups:
            rows = np.flatnonzero(np.abs(jumps[:, group]).max(axis=1) > _DOUBTFUL)
            doubtful |= set(rows.tolist()) if len(rows) <= max(4, _OFTEN * parts) else set()
        for i in sorted(doubtful):
            jumps[i] = self._looked_at(times[i], states[i], times[i + 1], jumps[i], _DEPTH)
        self._followed += jumps.sum(axis=0)
        self._time, self._state = end, states[-1]

    def _looked_at(
        self, time: float, state: np.ndarray, end: float, jump: np.ndarray, depth: int
    ) -> np.ndarray:
        """Change of the angles within a part whose ends don't tell it."""
        found = self._path(time, state, end, _FINER) if depth else None
        if found is None:
            return jump
        times, states, angles, _ = found
        jumps = self._steps.jumps(angles)
        for i in np.flatnonzero(np.abs(jumps).max(axis=1) > _DOUBTFUL):
            jumps[i] = self._looked_at(times[i], states[i], times[i + 1], jumps[i], depth - 1)
        return jumps.sum(axis=0)


class FollowedSystem:
    """The system that is followed in place of a given one."""

    def __init__(self, system: System) -> None:
        self._own = system
        self._charts: list[CompiledFunction] = []
        self.system: System | None = system
        plan = system.plan
        if not plan.formulation.variables.regular:
            twin = System(replace(plan, formulation=Quaternion()), system.number)
            self.system = None if system.switches else twin

    def states(self, block: SampleBlock) -> np.ndarray:
        """States of the followed system, float64, at the samples of a block, (n, states)."""
        states = block.states.astype(np.float64)
        if self.system is None or self.system is self._own:
            return states
        if not self._charts:
            twin = self.system
            self._charts = interruptible(lambda: self._compiled(twin))
        charts = [np.asarray(chart(np.ascontiguousarray(states.T))).T for chart in self._charts]
        return np.where(block.chart[:, None] == 0, charts[0], charts[-1])

    def _compiled(self, twin: System) -> list[CompiledFunction]:
        own = self._own.rounded(precision_of("double").number)
        return [
            hy.cfunc(_twin_states(twin, chart), chart.variables, compact_mode=True)
            for chart in (own, own.partner)
            if chart is not None
        ]


def _twin_states(twin: System, chart: System) -> list[hy.expression]:
    """States of the twin as expressions of the states of a chart."""
    m = chart.mechanics
    attitude = m.carried(m.attitude)
    known = dict(zip(BODY.rates, m.rate_states, strict=True))
    known |= dict(zip(chart.states, chart.variables, strict=True))
    known |= dict(zip(m.carried(twin.mechanics.attitude).names, attitude.quaternion, strict=True))
    return [known[name] for name in twin.states]
