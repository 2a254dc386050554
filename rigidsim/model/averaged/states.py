"""States of an averaged motion, and which observables it can provide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import told_of_resonances
from rigidsim.model.averaged.average import DIRECTION, TOLD, Average
from rigidsim.model.averaged.driven_mechanics import AMPLITUDES, DrivenMechanics
from rigidsim.model.averaged.mechanics import AveragedMechanics
from rigidsim.model.averaged.resonant_mechanics import RESONANT_ANGLE, SLOW, ResonantMechanics
from rigidsim.model.load import Load
from rigidsim.model.orbits.table_states import TablePlace
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_OF_FIGURE = ("figure_axis",)
_WHY = {
    "spin_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation: its size and the energy stay as they are",
    "orbit_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation and over the sources' orbits: its size and the energy stay as they are",
}

_WHY_TURNED = "the direction of the angular momentum, under gravity gradients averaged over the free rotation"
_WHY_AT_REST = "the direction of the angular momentum, which torques of the body alone don't turn on average"


def _resonant_states(
    scene: Scene,
    average: Average,
    loads: Sequence[Load],
    scaling: Scaling,
    numbers: ScaledNumbers,
    orbit_tags: Mapping[KeplerOrbit, str],
    number: Rounder,
) -> tuple[AveragedMechanics, list[StateBlock]]:
    """States of a body in spin-orbit resonance."""
    resonance, initial = average.resonance, average.initial(scaling.momentum)
    assert resonance is not None
    q = list(hy.make_vars(*SLOW[:4]))
    attitude = AttitudeStates(
        SLOW[:4], [], initial[:4], [], q, "state",
        defect=("quaternion_norm", "norm of the slow quaternion", hy.sqrt(hy.sum([x * x for x in q]))),
    )  # fmt: skip
    m = ResonantMechanics(
        scene, scaling, numbers, q[:3], attitude, None, None, None, number, orbit_tags,
        loads=list(loads), average=average,
    )  # fmt: skip
    why = f"the body keeps pace with [[loads]] number {resonance.source.number}, {resonance.name}: its axes "
    why += (
        "turned back by so many turns to a revolution, and the momentum beyond that, under torques averaged "
    )
    why += "over rotation and orbits"
    exponents = [0] * 4 + [scaling.momentum] * 3
    slow = StateBlock(SLOW, m.slow_derivatives, initial, exponents=exponents, why=why)
    return m, [slow, *_point_masses(m)]


def _amplitudes(m: DrivenMechanics, scaling: Scaling) -> StateBlock:
    """P and Q of a driven motion."""
    why = f"size of the momentum and energy of rotation, under {' and '.join(m.driven.titles)}: its largest "
    why += "components along the axis that it circles and across it"
    exponents = [scaling.momentum] * 2
    initial = m.driven.states(scaling.momentum)
    return StateBlock(AMPLITUDES, m.amplitude_rates, initial, exponents=exponents, why=why)


def refuse_untold(average: Average, record: Sequence[str] | None) -> None:
    """Refuse observables that an averaged motion can't provide.

    Raises:
        ConfigError: names a recorded variable that needs every rotation resolved.
    """
    for name in record or ():
        if name in _OF_FIGURE and not average.figure:
            why = "the body tumbles, so that its figure axis points nowhere on average; record momentum_axis "
            why += "instead"
        elif name == RESONANT_ANGLE and average.resonance is not None:
            continue
        elif name not in TOLD:
            why = f'needs every rotation, which [model] level = "{average.level}" averages over'
        else:
            continue
        what = f'given "{name}": {why}; choose level = "full" to have it'
        raise ConfigError(Problem("[output] record", what))


def averaged_states(
    scene: Scene,
    average: Average,
    loads: Sequence[Load],
    scaling: Scaling,
    numbers: ScaledNumbers,
    orbit_tags: Mapping[KeplerOrbit, str],
    tables: Mapping[TabulatedOrbit, TablePlace],
    number: Rounder,
) -> tuple[AveragedMechanics, list[StateBlock]]:
    """The mechanical quantities of an averaged motion, and its states."""
    if average.resonance is not None:
        return _resonant_states(scene, average, loads, scaling, numbers, orbit_tags, number)
    s = list(hy.make_vars(*DIRECTION))
    attitude = AttitudeStates(
        DIRECTION,
        [],
        list(average.start),
        [],
        [],
        "state",
        defect=(
            "momentum_axis_norm",
            "norm of the momentum's direction",
            hy.sqrt(hy.sum([x * x for x in s])),
        ),
        chord=1.0,
    )
    kind = AveragedMechanics if average.driven is None else DrivenMechanics
    m = kind(
        scene, scaling, numbers, s, attitude, None, None, None, number, orbit_tags, tables=tables,
        loads=list(loads), average=average,
    )  # fmt: skip
    why = _WHY[average.level]
    if average.driven is not None:
        why = _WHY_TURNED if average.sources else _WHY_AT_REST
    why += told_of_resonances(average.sources)
    blocks = [StateBlock(DIRECTION, m.derivatives, average.start, why=why)]
    if isinstance(m, DrivenMechanics):
        blocks.append(_amplitudes(m, scaling))
    for orbit in tables:
        what = "elements of" if average.over_orbits else "where"
        which = "the source's orbit" if average.over_orbits else "the source is"
        block = m.table_block(orbit)
        blocks.append(replace(block, why=f'gravity_gradient: {what} {which}, by "{orbit.name}"'))
    return m, blocks + _point_masses(m)


def _point_masses(m: AveragedMechanics) -> list[StateBlock]:
    states = m.point_masses
    return [] if states is None else [states.block()]
