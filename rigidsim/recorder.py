"""What becomes of a run's samples: evaluated, watched, and written to segments together with checkpoints."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rigidsim.prepare import Prepared
from rigidsim.solve.advance import Progress
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.solve.harvest import Checkpoint
from rigidsim.solve.hold import put_back_by_invariant
from rigidsim.solve.packing import pack_checkpoint, pack_events
from rigidsim.store.segments import SegmentWriter
from rigidsim.summary import Watch

Arrays = dict[str, np.ndarray]


@dataclass
class Effort:
    """What a run has cost over all its sessions.

    Attributes:
        sessions: this one included.
        wall_seconds, cpu_seconds: of the sessions before this one.
    """

    sessions: int = 1
    wall_seconds: float = 0.0
    cpu_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    cpu_started: float = field(default_factory=time.process_time)

    @property
    def wall(self) -> float:
        """Of all sessions, seconds."""
        return self.wall_seconds + time.perf_counter() - self.started

    @property
    def cpu(self) -> float:
        """Of all sessions, seconds."""
        return self.cpu_seconds + time.process_time() - self.cpu_started


class Recorder:
    """The keeper of a run's samples.

    Attributes:
        watch: what the summary says of all samples.
        progress: of the run; set when it begins.
    """

    progress: Progress

    def __init__(
        self,
        prepared: Prepared,
        evaluator: Evaluator,
        writer: SegmentWriter,
        log: EventLog,
        effort: Effort,
    ) -> None:
        self._prepared = prepared
        self._evaluator = evaluator
        self._writer = writer
        self._log = log
        self._effort = effort
        self._events_saved = len(log.found)
        self.watch = Watch()

    def take(
        self, first: int, times: np.ndarray, states: np.ndarray, turns: np.ndarray, put_back: np.ndarray
    ) -> None:
        """Evaluate and collect samples."""
        recorded: dict[str, list[np.ndarray]] = self._evaluator.evaluate(states, turns)
        exponent = self._prepared.clock.exponent
        recorded["time"] = [np.ldexp(part, exponent) for part in self._prepared.precision.parts(times)]
        for invariant in self._prepared.system.invariants:
            self.watch.see(invariant.name, recorded[f"{invariant.name}_drift"][0][:, 0])
        for name, values in put_back_by_invariant(self._prepared.held_scalars, put_back).items():
            recorded[f"{name}_put_back"] = [values[:, None]]
            self.watch.put_back[name] = float(values[-1])
        factors = self._evaluator.singular_factors(states, turns)
        if factors is not None:
            self.watch.see_singular(factors, recorded["time"][0])
        self._writer.add(recorded)

    def due(self) -> bool:
        """Whether what is collected is much, or the last segment old."""
        return self._writer.due

    def save(self, checkpoint: Checkpoint) -> None:
        """Write a segment; on return all samples taken, and the way on from there, are saved."""
        events = pack_events(self._log.found[self._events_saved :], self._prepared.precision)
        self._writer.flush(self.packed(checkpoint), events)
        self._events_saved = len(self._log.found)

    def packed(self, checkpoint: Checkpoint) -> Arrays:
        """A checkpoint as arrays, with what the summary will say of the samples so far."""
        arrays = pack_checkpoint(checkpoint, self._evaluator.memory, self._prepared.precision)
        names = [invariant.name for invariant in self._prepared.system.invariants]
        watch, progress = self.watch, self.progress
        arrays["watched"] = np.array(
            [[watched.get(name, math.nan) for name in names] for watched in (watch.largest, watch.final)]
        )
        arrays["put_back"] = np.array([watch.put_back.get(name, math.nan) for name in names])
        arrays["singularity"] = np.array([watch.nearest_singularity, watch.singularity_time])
        arrays["steps_seen"] = np.array([progress.smallest_step, progress.largest_step])
        arrays["effort"] = np.array([self._effort.wall, self._effort.cpu, progress.integration_seconds])
        arrays["sessions"] = np.array([self._effort.sessions, progress.redone_steps], dtype=np.int64)
        return arrays

    def all_events(self) -> Arrays:
        """Every crossing so far."""
        return pack_events(self._log.found, self._prepared.precision)

    def restore(self, arrays: Mapping[str, np.ndarray], progress: Progress) -> None:
        """Go on from a checkpoint's arrays.

        Raises:
            KeyError, ValueError: they are another run's.
        """
        names = [invariant.name for invariant in self._prepared.system.invariants]
        largest, final = arrays["watched"].reshape(2, len(names)) if names else ([], [])
        for name, most, last in zip(names, largest, final, strict=True):
            if not math.isnan(last):
                self.watch.largest[name], self.watch.final[name] = float(most), float(last)
        for name, value in zip(names, arrays.get("put_back", ()), strict=False):  # of held runs alone
            if not math.isnan(value):
                self.watch.put_back[name] = float(value)
        nearest, when = arrays["singularity"]
        self.watch.nearest_singularity, self.watch.singularity_time = float(nearest), float(when)
        progress.smallest_step, progress.largest_step = (float(x) for x in arrays["steps_seen"])
        wall, cpu, engine = (float(x) for x in arrays["effort"])
        sessions, redone = (int(x) for x in arrays["sessions"])
        self._effort.wall_seconds, self._effort.cpu_seconds = wall, cpu
        self._effort.sessions = sessions + 1
        progress.integration_seconds, progress.redone_steps = engine, redone
