"""Stage of a body on a free orbit about an attracting point: body, direction to its planet, and the orbit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import surroundings
from rigidsim.look.stages.bodies import Subject, vectors_of
from rigidsim.look.stages.orbits import ORBIT_BODY, orbit_stage
from rigidsim.look.stages.parts import SOURCE, Arrow, Picture

if TYPE_CHECKING:
    from rigidsim.look.rows import Table


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Picture of a body with a position and one attracting point; None for others."""
    listed = surroundings.told(dataset, "attractor")
    if len(listed) != 1 or subject.position is None:
        return None
    position = subject.position - np.asarray(listed[0]["position"], dtype=float)
    planet = surroundings.globe_of(listed[0])
    arrows, trails, notes = vectors_of(dataset, subject, paths=False)
    close = subject.stage(arrows, trails, "Body, seen in space axes")
    name = surroundings.called(planet, "attracting point")
    down = -position / np.linalg.norm(position, axis=1, keepdims=True)
    close.arrows.append(Arrow("nadir", f"to {name}", SOURCE, 1.35 * down, False, f"direction of {name}"))
    stage = orbit_stage(subject, subject.quaternion, position, planet)
    notes.append(
        f"in the view of the orbit 1 unit = {stage.unit:.6g} m; the body is drawn "
        f"{ORBIT_BODY * stage.unit / subject.reach:.3g} times too large"
    )
    first = replace(stage, title=stage.title)
    return Picture(
        "orbit about an attracting point", [close, first], [], ("libration", "angular_velocity"), notes
    )
