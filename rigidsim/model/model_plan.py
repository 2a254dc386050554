"""Decisions about a scene's equations made before any number is rounded: loads, states, units, orbits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.capabilities import is_wide, orbit_of, table_of
from rigidsim.model.frames.orbital import corotating_orbit
from rigidsim.model.frames.reference_plane import refuse_without_plane
from rigidsim.model.load import Load, loads_of
from rigidsim.model.load_estimate import estimate_drive
from rigidsim.model.loads.uniform_gravity import UniformGravity
from rigidsim.model.numbers import ScaledNumbers, scaled_numbers
from rigidsim.model.orbits.table_states import Carried, TablePlace, places_of
from rigidsim.model.planar import PlaneOfMotion, asked_plane, gradient_plane
from rigidsim.model.refusals import refuse_odd_loads, refuse_second_orbits
from rigidsim.model.scaling import Scaling, amplitude_of, choose_scaling
from rigidsim.model.state_selection import PLANAR, Requirements, choose_requirements
from rigidsim.scene.moments import happens_at_a_moment
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces, surfaces_of

if TYPE_CHECKING:
    from rigidsim.model.averaged.average import Average


@dataclass(frozen=True)
class ModelPlan:
    """The modelling decisions from which a system of equations follows in any precision.

    Attributes:
        scene: the scene, including loads given from Python.
        loads: all that act, with the uniform fields combined into one.
        orbit_tags: for each prescribed orbit, the tag that makes its state names unique.
        frame_orbit: orbit in whose frame the attitude is carried; None if it is carried in space axes.
        surfaces: switching surfaces on which the equations change.
        plane: plane that the motion stays in, if the formulation is planar.
        tables: positions of the states and parameters of tabulated orbits.
        clocked: whether expressions of the time need it in two numbers (``rigidsim.model.two_part_time``).
        average: the average that replaces the motion, if rotations are averaged over.
    """

    scene: Scene
    loads: Sequence[Load]
    requirements: Requirements
    scaling: Scaling
    numbers: ScaledNumbers
    orbit_tags: Mapping[KeplerOrbit, str]
    frame_orbit: KeplerOrbit | None
    surfaces: Surfaces
    plane: PlaneOfMotion | None = None
    tables: Mapping[TabulatedOrbit, TablePlace] = field(default_factory=dict)
    clocked: bool = False
    average: Average | None = None

    @property
    def wide(self) -> bool:
        """Whether the equations are too long to be compiled unrolled."""
        average = self.average
        if average is not None and average.resonance is not None:
            return True
        summed = average is not None and average.driven is not None and average.driven.course.nodes
        return bool(summed) or any(map(is_wide, self.loads))


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
    if scene.config.model.reduced:
        return _averaged(scene, loads, along)
    requirements = choose_requirements(scene, loads)
    requirements, plane = _planar(scene, loads, requirements)
    if scaling is None and like is not None:
        scaling = choose_scaling(scene, like.scaling.drive)
    elif scaling is None:
        unknown = [load for load in loads if amplitude_of(load, scene) is None]
        refuse_odd_loads(scene, requirements, unknown)
        scaling = choose_scaling(scene, estimate_drive(scene, unknown, requirements))
    if requirements.canonical or plane is not None:
        scaling = replace(scaling, rates=(0, 0, 0))
    tags = _orbit_tags(scene)
    surfaces, tables = surfaces_of(scene), _tables(scene)
    if tables and surfaces.found:
        what = (
            f'given beside {surfaces.found[0].where}, whose "{surfaces.found[0].text}" has a kink or jump: '
            "steps can't end at both; make the change smooth with tanh, or give the orbit by elements"
        )
        raise ConfigError(Problem("[[loads]] orbit.table", what))
    numbers = scaled_numbers(scene, scaling)
    orbit = corotating_orbit(scene, loads, requirements.formulation)
    return ModelPlan(
        scene,
        loads,
        requirements,
        scaling,
        numbers,
        tags,
        orbit,
        surfaces,
        plane,
        tables,
        not tables and happens_at_a_moment(scene),
    )


def _tables(scene: Scene, longitude: Carried = Carried.ECCENTRIC) -> dict[TabulatedOrbit, TablePlace]:
    tables = [(str(number), table_of(load)) for number, load in enumerate(loads_of(scene), start=1)]
    return places_of([(tag, table) for tag, table in tables if table is not None], longitude)


def _orbit_tags(scene: Scene) -> dict[KeplerOrbit, str]:
    tags: dict[KeplerOrbit, str] = {}
    for number, load in enumerate(loads_of(scene), start=1):
        if (orbit := orbit_of(load)) is not None:
            tags.setdefault(orbit, str(number))
    return tags


def _averaged(scene: Scene, loads: Sequence[Load], along: Average | None) -> ModelPlan:
    """Plan a motion averaged over its rotation, and possibly over its sources' orbits."""
    from rigidsim.model.averaged.average import average_of
    from rigidsim.model.averaged.states import WHY, WHY_DRIVEN, refuse_untold

    scaling = replace(choose_scaling(scene), rates=(0, 0, 0))
    average = average_of(scene, loads, scaling, along)
    record = scene.config.output.record
    refuse_untold(average, record)
    refuse_without_plane(scene, loads)
    left_out = [("attitude", f'[model] level = "{average.level}" averages over the rotation')]
    if average.over_orbits:
        left_out.append(("anomalies", "the torques are averaged over the orbits"))
    why = WHY[average.level]
    if average.resonance is not None:
        why = (
            f"the body keeps pace with its source, {average.resonance.name}: the commensurable angle is kept"
        )
    elif average.driven is not None:
        why = WHY_DRIVEN
    requirements = Requirements(average.level, False, False, record, {"attitude": why}, left_out)
    return ModelPlan(
        scene,
        loads,
        requirements,
        scaling,
        scaled_numbers(scene, scaling),
        _orbit_tags(scene),
        None,
        surfaces_of(scene),
        tables=_tables(scene, average.longitude),
        average=average,
    )


def _planar(
    scene: Scene, loads: Sequence[Load], requirements: Requirements
) -> tuple[Requirements, PlaneOfMotion | None]:
    """Reduce to two states if gravity gradients keep the body in a plane, or if the config asks for it."""
    if requirements.formulation == PLANAR:
        return requirements, asked_plane(scene, loads)
    if scene.config.integrator.formulation != "auto" or requirements.formulation != "quaternion":
        return requirements, None
    plane = gradient_plane(scene, loads)
    if plane is None:
        return requirements, None
    return requirements.in_plane(), plane
