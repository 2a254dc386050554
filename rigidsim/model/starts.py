"""Starts against the plane of ``[frame] reference``, which may be that of a source's orbit."""

from __future__ import annotations

from rigidsim.model.frames import initial_normal, plane_axes
from rigidsim.model.load import loads_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, negligible, norm, transpose
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import (
    ATTITUDES,
    InitialRotation,
    StartForm,
    angle_out_of_range,
    attitude_from_pole,
    from_equator,
    meridian,
    register_start,
)


def _from_obliquity(scene: Scene) -> InitialRotation:
    """The attitude of the node on the reference plane and of the obliquity, as the observables."""
    table, context = scene.config.initial, scene.context
    assert table.obliquity is not None
    assert table.node_longitude is not None
    tilt, node = table.obliquity.at(context), table.node_longitude.at(context)
    if not 0 <= tilt <= context.pi * (1 + negligible(context)):
        raise angle_out_of_range("obliquity", "", context, tilt, "0 to 180 deg")
    normal = initial_normal(scene, loads_of(scene))
    length = norm(context, normal)
    columns = transpose(plane_axes(context, [x / length for x in normal]))
    to_space = attitude.quaternion_from_matrix(context, columns)
    quaternion = attitude.product(to_space, attitude_from_pole(scene, node, tilt, context.zero))
    if table.prime_meridian is not None:
        w, x, y, z = equator = from_equator(scene, "prime_meridian")
        inside = attitude.rotation_matrix(attitude.product([w, -x, -y, -z], quaternion))
        east, north, up = apply(inside, scene.figure.pole)
        node, tilt = context.atan2(east, -north), context.atan2(context.hypot(east, north), up)
        quaternion = attitude.product(equator, attitude_from_pole(scene, node, tilt, meridian(scene)))
    return InitialRotation(attitude.unit_quaternion(context, quaternion))


register_start(ATTITUDES, StartForm("obliquity", _from_obliquity, ("node_longitude",), ("prime_meridian",)))
