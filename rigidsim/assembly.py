"""What integrates a prepared scene, put together: stepper, corrections, evaluation."""

from __future__ import annotations

from dataclasses import dataclass

from rigidsim.prepare import Prepared
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.solve.hold import Holder, steps_between
from rigidsim.solve.rhythm import Rhythm
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.winding import Winding


@dataclass(frozen=True)
class Assembly:
    """The parts of an integration.

    Attributes:
        holder: puts invariants back; None where that isn't asked for.
    """

    winding: Winding
    log: EventLog
    stepper: Stepper
    holder: Holder | None
    rhythm: Rhythm
    evaluator: Evaluator


def assemble(prepared: Prepared) -> Assembly:
    """Compile everything that a prepared scene needs to go from its start.

    Raises:
        ConfigError: invariants are to be held where there are none.
    """
    system, precision, start = prepared.system, prepared.precision, prepared.clock.start
    winding = Winding(system.angle_states, precision, prepared.scene.context)
    log = EventLog([c.stop for c in system.crossings], winding.turns)
    stepper = Stepper(system, precision, prepared.tolerance, start, log)
    holder = None
    if prepared.holds_invariants:
        holder = Holder(system, precision, start, prepared.python_loads)
    rhythm = Rhythm(stepper, winding, holder, held_every=steps_between(precision))
    return Assembly(winding, log, stepper, holder, rhythm, Evaluator(system, precision, winding))
