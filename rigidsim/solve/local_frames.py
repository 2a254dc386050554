"""Starts against the local frame of an orbit: attitude and rates relative to axes that turn with it.

All frames are made of the place p of the source as seen from the body and a normal n, as
``rigidsim.model.frames`` chooses them for what is recorded: x forward, y against n, z along p. With v = p'
the frame turns, about its own axes, at

    (-v.y / |p|,  v.x / |p|,  n'.x / |n|),

on a Kepler orbit by the rate of the true anomaly about the normal, with the node and with the periapsis. The
normal of a flight, n = r x v, turns by what pushes the body out of its plane: n' = r x a, with the
acceleration a of all loads at the start. NED takes n = Z x p, so that x points north along the pole Z.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, ensure, required
from rigidsim.model.formulations.formulation import Requirements
from rigidsim.model.frames import first_source, plane_of
from rigidsim.model.load import Load, force_terms, loads_of
from rigidsim.model.load_estimate import probe, start_of, sums_of
from rigidsim.model.loads.gravity import UniformGravity
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, negligible, norm, plus, transpose
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC
from rigidsim.scene.starts import STARTS, InitialRotation, refusal
from rigidsim.scene.swept import SweptContext, Untraceable
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.precision import Precision

_ROUNDS = 40
"""Times that the frame's rate is found anew, where a force depends on the body's rates."""
_OUTWARD = ("rsw", "rtn", "ric")


def _refused(scene: Scene, why: str) -> ConfigError:
    return refusal("relative_to", f'given "{scene.config.initial.relative_to}", but {why}')


def _dot(a: Vector, b: Vector) -> Any:
    return attitude.total([x * y for x, y in zip(a, b, strict=True)])


def _source(scene: Scene) -> Load:
    """The load whose source the body goes round."""
    load = first_source(loads_of(scene))
    what = "no load has a source that the body goes round; give a gravity_gradient with satellite_orbit or "
    what += "orbit, or position and velocity with a central_gravity, or remove relative_to"
    if load is None or (load.placement.rests and not load.placement.flies):
        raise _refused(scene, what)
    known = load.placement.flies or load.placement.table is not None or not load.placement.untracked
    what = f"how its source moves isn't known ({load.placement.untracked}); give its orbit by elements, or "
    ensure(known, _refused(scene, f"of {load.title} {what}remove relative_to"))
    return load


def _normal(scene: Scene, place: Vector) -> Vector:
    """A normal of any length (mpf, space axes)."""
    if scene.config.initial.relative_to == "ned":
        what = "space Z is the pole of the ecliptic, and north is the equator's; set [frame] axes to "
        ensure(scene.axes != ECLIPTIC, _refused(scene, what + '"EME2000", or take "lvlh"'))
        return [-place[1], place[0], 0 * place[2]]
    plane = plane_of(_source(scene))
    if plane is not None and plane.called:
        return plane.at_start(scene)
    pole = [scene.context.zero, scene.context.zero, scene.context.one]
    return [_dot(place, place) * z - place[2] * x for z, x in zip(pole, place, strict=True)]


def _normal_rate(scene: Scene, place: Vector, moving: Vector) -> Vector:
    """Its rate of change."""
    if scene.config.initial.relative_to == "ned":
        return [-moving[1], moving[0], 0 * moving[2]]
    plane = plane_of(_source(scene))
    if plane is not None and plane.called:
        return required(plane.turning)(scene, partial(_acceleration, scene))
    pole = [scene.context.zero, scene.context.zero, 2 * _dot(place, moving)]
    rows = zip(pole, place, moving, strict=True)
    return [z - moving[2] * x - place[2] * v for z, x, v in rows]


def _axes(scene: Scene) -> tuple[Matrix, Vector, Vector]:
    """Forward, against the normal and to the source (mpf, space axes); place and velocity of the source."""
    place, moving = _source(scene).placement.turning_at_start(scene)
    normal, distance = _normal(scene, place), norm(scene.context, place)
    down, size = [x / distance for x in place], norm(scene.context, normal)
    what = "the source is along the line to it; start with another position or velocity"
    ensure(size > negligible(scene.context) * distance, _refused(scene, f"the normal of the orbit {what}"))
    right = [-x / size for x in normal]
    return [cross(right, down), right, down], place, moving


def _named(scene: Scene, lvlh: Any) -> list[Any]:
    """Axes, or components along them, of the frame that is asked for."""
    if scene.config.initial.relative_to not in _OUTWARD:
        return list(lvlh)
    forward, right, down = lvlh
    negative = [[-x for x in v] if isinstance(v, list) else -v for v in (down, right)]
    return [negative[0], forward, negative[1]]


def _to_space(scene: Scene) -> Vector:
    """Quaternion of the frame's axes."""
    return attitude.quaternion_from_matrix(scene.context, transpose(_named(scene, _axes(scene)[0])))


def _acceleration(scene: Scene) -> Vector:
    """Of a body in flight at the start, by all loads (mpf, m/s^2, space axes)."""
    context = scene.context
    if isinstance(context, SweptContext):
        raise Untraceable("the acceleration of a flight")
    wide = Precision(f"{context.prec} bits", context.prec, hy.real, cheap=False, compact=True)
    loads = [*UniformGravity.of(scene), *loads_of(scene)]
    m = probe(scene, Requirements(True, False, True, None, {}), loads, wide.number)
    values = start_of(m, loads)
    sums = sums_of((term for load in loads for term in force_terms(load, m)), wide.number)
    variables = list(hy.make_vars(*values))
    function = compiled_function(sums, variables, compact_mode=True, **wide.options)
    time = wide.number(context.ldexp(scene.start, -m.scaling.time))
    found = function(wide.array(list(values.values())), time=time)
    exponent = m.scaling.speed - m.scaling.time
    return [context.ldexp(context.make_mpf(wide.exact(x)._mpf_), exponent) for x in found]


def _attitude(scene: Scene) -> InitialRotation:
    """In space, of one that is relative."""
    quaternion = attitude.product(_to_space(scene), scene.quaternion)
    return InitialRotation(attitude.unit_quaternion(scene.context, quaternion))


def _rates(scene: Scene) -> InitialRotation:
    """In space, of those that are relative."""
    (axes, place, moving), given = _axes(scene), scene.angular_velocity
    distance = norm(scene.context, place)
    w, x, y, z = _to_space(scene)
    inside = transpose(attitude.rotation_matrix(attitude.product([w, -x, -y, -z], scene.quaternion)))
    about = [-_dot(moving, axes[1]) / distance, _dot(moving, axes[0]) / distance]
    size = norm(scene.context, _normal(scene, place))
    found: Vector = []
    for _ in range(_ROUNDS):
        before, turning = found, _normal_rate(scene, place, moving)
        found = plus(given, apply(inside, _named(scene, [*about, _dot(turning, axes[0]) / size])))
        least = negligible(scene.context) * norm(scene.context, found)
        if before and all(abs(x - y) <= least for x, y in zip(found, before, strict=True)):
            return InitialRotation(scene.quaternion, found)
        scene = scene.started(InitialRotation(scene.quaternion, found))
    what = "forces that depend on the body's rates turn the orbit faster than the body; give angular_velocity"
    raise _refused(scene, f"{what} in space, without relative_to")


STARTS["relative attitude"], STARTS["relative rates"] = _attitude, _rates
