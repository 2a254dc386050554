"""What one session works with: the compiled parts, what records them, and where they stand."""

from __future__ import annotations

import os
from dataclasses import dataclass

from rigidsim.session.attributes import root_attributes
from rigidsim.session.checkpoints import Checkpoints
from rigidsim.session.guards import Guards, Interruption
from rigidsim.session.recorder import Recorder
from rigidsim.session.session import Session
from rigidsim.session.statistics import SampleStatistics
from rigidsim.session.summary import cost_so_far
from rigidsim.session.timings import RunCost
from rigidsim.session.variables import dataset_variables
from rigidsim.solve.assembly import Assembly, assemble, sampler
from rigidsim.solve.checkpoint import Position
from rigidsim.solve.driver import Driver
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress
from rigidsim.solve.trail import SampleTrail
from rigidsim.store.attributes import RootAttributes
from rigidsim.store.folder import RunFolder
from rigidsim.store.memory import MemoryWriter
from rigidsim.store.segments import Chain, SegmentWriter
from rigidsim.store.summary_parts import Cost
from rigidsim.store.variables import Variable


@dataclass(frozen=True)
class ActiveRun:
    """A run under way in one session.

    Attributes:
        folder: the run's folder; None in memory.
        attributes: root attributes of its segments, and of its dataset as far as they are known beforehand.
        variables: what the dataset holds along time.
    """

    prepared: InitialValueProblem
    folder: RunFolder | None
    run_id: str
    parts: Assembly
    attributes: RootAttributes
    variables: list[Variable]
    writer: SegmentWriter | MemoryWriter
    recorder: Recorder
    checkpoints: Checkpoints
    driver: Driver
    interruption: Interruption

    @classmethod
    def begun(
        cls, session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None
    ) -> ActiveRun:
        """Compile what the run needs, and go to where it begins."""
        parts = assemble(prepared)
        system, progress = prepared.system, Progress(prepared.clock.count)
        statistics = SampleStatistics([i.name for i in system.invariants], [r.name for r in system.recorded])
        cost = RunCost(session.effort, progress)
        trail = SampleTrail(prepared.precision)
        checkpoints = Checkpoints(parts, statistics=statistics, cost=cost, trail=trail)
        start = None if chain is None else checkpoints.restore(chain)
        run_id = os.urandom(8).hex() if chain is None else chain.run
        attributes = root_attributes(prepared, parts, run_id, session.mixed)
        variables = dataset_variables(prepared)
        writer: SegmentWriter | MemoryWriter = MemoryWriter()
        if folder is not None:
            limits = session.tuning.segments
            writer = SegmentWriter(folder.segments, variables, attributes.as_dict(), chain, limits)
        recorder = Recorder(prepared, parts.evaluator, writer, statistics, trail, checkpoints, start)
        interruption = Interruption()
        session.phases.next("build")
        session.observer.started(prepared, None if folder is None else folder.path)
        session.observer.phase("integrate")
        guards = Guards(prepared, statistics, interruption, session.observer)
        pacing, most = session.tuning.pacing, _most_steps(prepared, start)
        driver = sampler(prepared, parts, recorder, guards, start, pacing, most, progress)
        if start is not None:
            session.observer.resumed(progress)
        return cls(
            prepared,
            folder,
            run_id,
            parts,
            attributes,
            variables,
            writer,
            recorder,
            checkpoints,
            driver,
            interruption,
        )

    @property
    def progress(self) -> Progress:
        """How far it is, and how it ended."""
        return self.driver.progress

    @property
    def last_time(self) -> float:
        """Time of the last sample, internal units."""
        return float(self.prepared.clock.at(self.prepared.clock.count - 1))

    def cost(self, session: Session) -> Cost:
        """Cost of the run so far, all of its sessions together."""
        return cost_so_far(self.prepared, self.progress, session.phases, session.effort)

    def save(self) -> None:
        """Save where it stands, to go on from there."""
        self.recorder.save(self.driver.position())

    def wanted(self) -> bool:
        """Whether nobody has asked for its end."""
        return not self.interruption.requested


def _most_steps(prepared: InitialValueProblem, start: Position | None) -> int | None:
    """The limit of natural steps, counted from the run's beginning; it starts anew in each session."""
    most = prepared.scene.config.limits.max_steps
    if most is None or start is None:
        return most
    return most + start.boundary.mark.steps
