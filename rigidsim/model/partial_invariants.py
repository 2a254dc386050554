"""Invariants of scenes whose loads leave an axis or a direction free of torque, recorded where they hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import heyoka as hy

from rigidsim.model import fixed_axes
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import (
    linear_momentum,
    linear_momentum_scale,
    mass_exponent,
    momentum_scale,
    total_momentum,
    total_momentum_scale,
)
from rigidsim.model.observables.observable import (
    MOMENTUM,
    SPACE,
    Observable,
    only_when_named,
    register_all,
    same_unit,
)
from rigidsim.model.rotations import Symbolic
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, norm


def _total_momentum_along(m: Mechanics) -> list[Symbolic]:
    pairs = zip(m.carried(fixed_axes.attracting_line(m)), total_momentum(m), strict=True)
    return [hy.sum([m.number(n) * x for n, x in pairs if n != 0])]


def _along(name: str) -> Callable[[Mechanics], list[Symbolic]]:
    return lambda m: [fixed_axes.along(m, fixed_axes.kept_axes(m)[name])]


def _across_its_beginning(m: Mechanics) -> list[Symbolic]:
    """Component of L perpendicular to its initial direction d, L - (L . d) d."""
    scene, context = m.scene, m.scene.context
    begun = apply(
        attitude.rotation_matrix(scene.quaternion), apply(scene.body.inertia, scene.angular_velocity)
    )
    unit = [m.number(x / norm(context, begun)) for x in begun]
    along = hy.sum([u * x for u, x in zip(unit, m.momentum_space, strict=True)])
    return [x - u * along for u, x in zip(unit, m.momentum_space, strict=True)]


def _across_gravity(m: Mechanics) -> list[Symbolic]:
    momentum, up = linear_momentum(m), [m.number(x) for x in m.carried(m.numbers.up)]
    along = hy.sum([u * p for u, p in zip(up, momentum, strict=True)])
    return [p - u * along for u, p in zip(up, momentum, strict=True)]


def _brun_scale(m: Mechanics) -> tuple[Any, str]:
    value = fixed_axes.largest_brun(m, momentum_scale(m)[0])
    return value, "squared angular momentum plus 3 G M / R^3 times the largest product of two moments"


def _bogoyavlensky_scale(m: Mechanics) -> tuple[Any, str]:
    value = fixed_axes.source_trace(m) * fixed_axes.largest_brun(m, momentum_scale(m)[0])
    return value, "sum of 3 G M / R^3 times the scale of Brun's constant"


BUILT_IN: tuple[Observable, ...] = (
    Observable(
        "angular_momentum_source", (), "kg m2 s-1", "angular momentum along the axis of the fixed sources",
        _along("source"), same_unit(MOMENTUM, 1), "space axes", ("source_axis",),
        lambda m: "no load has a torque about the direction of a fixed source", momentum_scale,
    ),
    Observable(
        "angular_momentum_field", (), "kg m2 s-1", "angular momentum along the uniform field",
        _along("field"), same_unit(MOMENTUM, 1), "space axes", ("field_axis",),
        lambda m: "no load has a torque about the direction of the field", momentum_scale,
    ),
    *(
        Observable(
            f"angular_momentum_{'xyz'[i]}", (), "kg m2 s-1",
            f"angular momentum along the space axis {'XYZ'[i]}",
            _along("xyz"[i]), same_unit(MOMENTUM, 1), "space axes",
            (f"{'xyz'[i]}_axis",), lambda m: "no load has a torque about this axis", momentum_scale,
        )
        for i in range(3)
    ),
    Observable(
        "angular_momentum_across", SPACE, "kg m2 s-1", "angular momentum across its initial direction",
        _across_its_beginning, same_unit(MOMENTUM, 3), "space axes", ("isotropic_damping",),
        lambda m: "the damping is in proportion to the inertia tensor", momentum_scale,
        by_default=only_when_named,  # zeros
    ),
    Observable(
        "brun_constant", (), "kg2 m4 s-2", "Brun's constant",
        lambda m: [fixed_axes.brun_constant(m)], same_unit(lambda m: 2 * m.scaling.momentum, 1), "",
        ("sources",), lambda m: "all torques are gravity gradients of fixed sources (Brun)", _brun_scale,
    ),
    Observable(
        "bogoyavlensky_constant", (), "kg2 m4 s-4", "Bogoyavlensky's constant",
        lambda m: [fixed_axes.bogoyavlensky_constant(m)],
        same_unit(lambda m: 2 * (m.scaling.momentum - m.scaling.time), 1), "", ("several_sources",),
        lambda m: "all torques are gravity gradients of fixed sources (Bogoyavlensky)", _bogoyavlensky_scale,
    ),
    Observable(
        "total_angular_momentum_axial", (), "kg m2 s-1",
        "angular momentum along the line of the attracting points, orbital plus spin",
        _total_momentum_along, same_unit(MOMENTUM, 1), "space axes", ("attracting_line",),
        lambda m: "no load turns the motion about the line of the attracting points", total_momentum_scale,
    ),
    Observable(
        "linear_momentum_horizontal", SPACE, "kg m s-1", "linear momentum across gravity", _across_gravity,
        same_unit(lambda m: m.scaling.speed + mass_exponent(m), 3), "space axes", ("free_fall",),
        lambda m: "the only force is uniform gravity", linear_momentum_scale,
    ),
)  # fmt: skip

register_all(*BUILT_IN)
