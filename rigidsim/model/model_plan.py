"""Decisions about a scene's equations made before any number is rounded: loads, states, units, orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.average import Average
from rigidsim.model.capabilities import orbit_of, table_of
from rigidsim.model.formulations.formulation import ModelPlan
from rigidsim.model.load import Load, loads_of
from rigidsim.model.load_estimate import estimate_drive
from rigidsim.model.loads.uniform_gravity import UniformGravity
from rigidsim.model.numbers import scaled_numbers
from rigidsim.model.orbits.table_states import Carried, TablePlace, places_of
from rigidsim.model.refusals import refuse_odd_loads, refuse_second_orbits
from rigidsim.model.scaling import Scaling, amplitude_of, choose_scaling
from rigidsim.model.state_selection import choose_formulation
from rigidsim.scene.moments import happens_at_a_moment
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import surfaces_of


def plan_model(
    scene: Scene,
    extra_loads: Sequence[Load] = (),
    scaling: Scaling | None = None,
    *,
    like: ModelPlan | None = None,
    along: Average | None = None,
) -> ModelPlan:
    """Decide on the least system that a scene needs.

    Args:
        extra_loads: loads given from Python, besides those of the config.
        scaling: if already known from another formulation of the same motion, whose loads were checked.
        like: plan of the same scene in plain numbers, whose estimates and checks hold here too.
        along: the average, already chosen, of a motion that this scene is a part of.

    Raises:
        ConfigError: a record that the scene or the formulation can't give, or a load that depends on the
            quaternion's sign.
    """
    if extra_loads:
        scene = replace(scene, loads=(*scene.loads, *extra_loads))
    loads: list[Load] = [*UniformGravity.of(scene), *loads_of(scene)]
    if like is None:
        refuse_second_orbits(scene, loads)
    formulation, requirements = choose_formulation(scene, loads, along)
    if scaling is None and like is not None:
        scaling = choose_scaling(scene, like.scaling.drive)
    elif scaling is None:
        unknown = [x for x in loads if formulation.resolves_rotation and amplitude_of(x, scene) is None]
        refuse_odd_loads(scene, requirements, unknown)
        scaling = choose_scaling(scene, estimate_drive(scene, unknown, requirements))
    if not formulation.carries_rates:
        scaling = replace(scaling, rates=(0, 0, 0))
    surfaces, tables = surfaces_of(scene), _tables(scene, formulation.longitude)
    if tables and surfaces.found and formulation.resolves_rotation:
        what = (
            f'given beside {surfaces.found[0].where}, whose "{surfaces.found[0].text}" has a kink or jump: '
            "steps can't end at both; make the change smooth with tanh, or give the orbit by elements"
        )
        raise ConfigError(Problem("[[loads]] orbit.table", what))
    return ModelPlan(
        scene,
        loads,
        formulation,
        requirements,
        scaling,
        scaled_numbers(scene, scaling),
        _orbit_tags(scene),
        surfaces,
        tables,
        formulation.resolves_rotation and not tables and happens_at_a_moment(scene),
    )


def _tables(scene: Scene, longitude: Carried) -> dict[TabulatedOrbit, TablePlace]:
    tables = [(str(number), table_of(load)) for number, load in enumerate(loads_of(scene), start=1)]
    return places_of([(tag, table) for tag, table in tables if table is not None], longitude)


def _orbit_tags(scene: Scene) -> dict[KeplerOrbit, str]:
    tags: dict[KeplerOrbit, str] = {}
    for number, load in enumerate(loads_of(scene), start=1):
        if (orbit := orbit_of(load)) is not None:
            tags.setdefault(orbit, str(number))
    return tags
