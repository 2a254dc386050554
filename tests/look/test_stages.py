"""Each kind of scene gets its stage, and what stands on it is where the dataset says."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
import xarray

from rigidsim.look import surroundings
from rigidsim.look.drawing import SCENE_ROWS, still_stride, trail_stride
from rigidsim.look.page import legible
from rigidsim.look.plots import plan_plots
from rigidsim.look.solids import rotation_matrix, solid_mesh
from rigidsim.look.stages.bodies import FIELD, camera
from rigidsim.look.stages.orbits import local_frame
from rigidsim.look.stages.parts import Picture, Stage, quaternion_of, trail
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.states import charts_of, sections_of, states_of
from rigidsim.look.symbols import globe, sharp_edges, spinning_top

Build = Callable[..., xarray.Dataset]

EARTH = 3.986004418e14
CIRCLE = {
    "semi_major_axis": 6.9e6, "eccentricity": 0.0, "inclination": 0.9, "ascending_node": 0.4,
    "periapsis": 0.0, "mean_anomaly": 0.2, "node_rate": 0.0, "periapsis_rate": 0.0, "mean_motion": 1.1e-3,
}  # fmt: skip


def around(dataset: xarray.Dataset, *things: dict[str, object]) -> xarray.Dataset:
    return dataset.assign_attrs(surroundings=json.dumps(things))


def picture(dataset: xarray.Dataset) -> Picture:
    return build_picture(dataset)[0]


def heavy(dataset: xarray.Dataset) -> xarray.Dataset:
    gravity = {"what": "gravity", "acceleration": [0, 0, -9.8]}
    return around(dataset, gravity).assign_attrs(center_of_mass="[0, 0, 0.04]", mass=0.1)


def satellite(dataset: xarray.Dataset) -> xarray.Dataset:
    source = {"what": "source", "gravitational_parameter": EARTH, "orbit": CIRCLE}
    return around(dataset, source)


def orbiting(dataset: xarray.Dataset) -> xarray.Dataset:
    angle = dataset["time"].values / 3
    place = 7e6 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    attractor = {"what": "attractor", "gravitational_parameter": EARTH, "position": [0, 0, 0]}
    return around(dataset.assign(position=(("time", "space_axis"), place)), attractor)


def flying(dataset: xarray.Dataset) -> xarray.Dataset:
    t = dataset["time"].values / 10
    place = np.stack([30 * t, 0 * t, 40 * t - 20 * t**2], axis=1)
    moving = dataset.assign(position=(("time", "space_axis"), place))
    return around(moving, {"what": "gravity", "acceleration": [0, 0, -9.8]})


def earth(dataset: xarray.Dataset) -> xarray.Dataset:
    drawing = [
        {
            "solid": "ellipsoid",
            "dimensions": {"semi_axes": [6.378e6, 6.378e6, 6.357e6]},
            "position": [0, 0, 0],
            "name": "earth",
        }
    ]
    rates = dataset["angular_velocity"] * [1e-6, 1e-6, 1.0]
    return dataset.assign(angular_velocity=rates).assign_attrs(drawing=json.dumps(drawing))


KINDS = {
    "top on a fixed point": heavy,
    "satellite on its orbit": satellite,
    "orbit about an attracting point": orbiting,
    "flight in a uniform gravity": flying,
    "rotation of the Earth in space": earth,
    "free rotation": lambda dataset: dataset,
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_stage_is_that_of_the_scene(symmetric_top: Build, kind: str) -> None:
    assert picture(KINDS[kind](symmetric_top(count=101))).kind == kind


def test_a_motion_under_an_unknown_torque_gets_the_generic_stage(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    dataset["angular_velocity"] = dataset["angular_velocity"] * np.linspace(1, 2, 101)[:, None]
    assert picture(dataset).kind == "motion of a rigid body"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [1e-10, 1.0])
def test_the_eye_has_body_and_path_in_its_field(symmetric_top: Build, kind: str, size: float) -> None:
    found, subject = build_picture(KINDS[kind](symmetric_top(count=101, size=size)))
    for stage in found.stages:
        eye = camera(stage, subject=subject)
        forward = eye.target - eye.position
        forward = forward / np.linalg.norm(forward)
        points = np.concatenate([places(stage), *(a.vectors for a in stage.arrows if not stage.looked_from)])
        away = points - eye.position
        depth = away @ forward
        assert (depth > 0).all()
        across = np.linalg.norm(away - np.outer(depth, forward), axis=1)
        # within the cone that the pyramid of the view holds, but for a tenth for the ends of arrows
        assert (across / depth).max() < 1.1 * np.tan(FIELD / 2)


def places(stage: Stage) -> np.ndarray:
    """Corners of the body where it begins and where it ends, and the path, as they are looked at."""
    moved = np.zeros((2, 3)) if stage.translation is None else stage.translation[[0, -1]]
    reach = max((mesh.reach() for mesh in stage.meshes), default=0.0)
    corners = [place + reach * way for place in moved for way in np.vstack([np.eye(3), -np.eye(3)])]
    return np.array(corners)


def test_an_orbit_goes_about_a_planet_of_its_size(symmetric_top: Build) -> None:
    stage = picture(orbiting(symmetric_top(count=101))).stages[1]
    assert stage.title == "Orbit about the Earth"
    assert stage.unit == pytest.approx(7e6)
    planet = next(solid for solid in stage.solids if solid.name == "planet")
    assert planet.mesh.reach() == pytest.approx(6.3781e6 / 7e6, rel=1e-6)


def test_a_kepler_path_keeps_to_the_laws_of_kepler() -> None:
    orbit = {**CIRCLE, "eccentricity": 0.6, "periapsis": 1.1}
    seconds = np.linspace(0, 2 * np.pi / orbit["mean_motion"], 2001)
    path = surroundings.kepler_path(orbit, seconds)
    distance = np.linalg.norm(path, axis=1)
    assert distance.min() == pytest.approx(0.4 * 6.9e6, rel=1e-5)
    assert distance.max() == pytest.approx(1.6 * 6.9e6, rel=1e-5)
    np.testing.assert_allclose(path[0], path[-1], rtol=0, atol=1e-6 * 6.9e6)
    np.testing.assert_allclose(path @ surroundings.orbit_normal(orbit), 0, atol=1e-14 * 1e8)
    # equal areas in equal times: of the triangles, a chord's square below the sectors
    areas = np.linalg.norm(np.cross(path[:-1], path[1:]), axis=1) / 2
    assert np.ptp(areas) / areas.mean() < (2 * np.pi / 2000 * 6) ** 2


def averaged(dataset: xarray.Dataset, axis: str, drawn: xarray.Dataset) -> xarray.Dataset:
    """A pole that goes backwards about Z, 0.4 rad from it, and nothing else; the Sun goes round fast."""
    node = 1.0 - 0.05 * dataset["time"].values
    pole = np.stack([np.sin(0.4) * np.sin(node), -np.sin(0.4) * np.cos(node), np.cos(0.4) + 0 * node], axis=1)
    bare = dataset.drop_vars(["quaternion", "angular_velocity", "angular_momentum", "energy"])
    known = {
        f"{axis}_axis": (("time", "space_axis"), pole),
        "obliquity": (("time", "axis"), np.full((len(node), 1), 0.4), {"units": "rad"}),
        "node_longitude": (("time", "axis"), node[:, None], {"units": "rad"}),
    }
    bare = bare.assign(known).assign_coords(axis=[axis]).assign_attrs(formulation="orbit_averaged")
    sun = {
        "what": "source",
        "gravitational_parameter": 1.32712440018e20,
        "orbit": {**CIRCLE, "mean_motion": 60},
    }
    return around(bare.assign_attrs(drawing=drawn.attrs["drawing"]), sun)


def test_a_globe_without_rotation_points_where_its_axis_does(symmetric_top: Build) -> None:
    top = symmetric_top(count=101)
    dataset = averaged(top, "figure", earth(top))
    for known in (dataset, dataset.drop_vars("figure_axis")):  # by itself, and from its angles
        found = picture(known)
        assert found.kind == "rotation of the Earth in space"
        (stage,) = found.stages
        assert stage.quaternion is not None
        turn = rotation_matrix(stage.quaternion[:, [3, 0, 1, 2]])
        np.testing.assert_allclose(turn[:, :, 2], dataset["figure_axis"].values, rtol=0, atol=1e-6)  # float32
        # about its axis it keeps to the node: the first of its axes across stays level
        assert np.abs(turn[:, 2, :2]).min(axis=1).max() < 1e-6
        assert [arrow.name for arrow in stage.arrows] == ["figure_axis"]  # the Sun would jump about
        assert "prime_meridian" not in [line.name for line in stage.lines]
        (ring,) = [line for line in stage.lines if line.name == "precession"]
        assert ring.words == "precession of the pole: once in 2.09 min"  # 2 pi / 0.05 s
        np.testing.assert_allclose(ring.points[:, 2], 1.45 * np.cos(0.4), rtol=1e-12)
        assert any("averaged over" in note for note in found.notes)
        assert any("direction of the Sun isn't shown" in note for note in found.notes)


def test_where_a_longitude_strays_as_far_as_it_advances_no_circle_of_precession_is_drawn(
    symmetric_top: Build,
) -> None:
    top = symmetric_top(count=101)
    dataset = averaged(top, "momentum", top)
    node = dataset["node_longitude"]
    swings = 2.0 * np.ptp(node.values) * np.cos(np.linspace(0.0, 2 * np.pi, node.size))[:, None]
    found = picture(dataset.assign(node_longitude=node + swings))
    assert "precession" not in {line.name for line in found.stages[0].lines}
    assert "precession" in {line.name for line in picture(dataset).stages[0].lines}


def test_against_a_moving_plane_a_globe_is_seen_from_that_plane(symmetric_top: Build) -> None:
    top = symmetric_top(count=101)
    dataset = averaged(top, "figure", earth(top))
    pole = dataset["figure_axis"].values  # of its angles against the plane, whichever way that lies
    config = dataset.attrs["config"] + '\n[frame]\nreference = "orbit"\n'
    dataset = dataset.drop_vars("figure_axis").assign_attrs(config=config)
    found, _ = build_picture(dataset)
    (stage,) = found.stages
    assert stage.quaternion is not None
    turn = rotation_matrix(stage.quaternion[:, [3, 0, 1, 2]])
    np.testing.assert_allclose(turn[:, :, 2], pole, rtol=0, atol=1e-6)  # float32
    assert [arrow.name for arrow in stage.arrows] == ["figure_axis"]  # nothing says where the Sun is
    assert any("as seen from it" in note for note in found.notes)


def test_of_a_tumbling_body_without_attitude_the_momentum_is_shown_alone(symmetric_top: Build) -> None:
    top = symmetric_top(count=101)
    dataset = averaged(top, "momentum", top)
    found, subject = build_picture(dataset)
    assert found.kind == "axes in space"
    (stage,) = found.stages
    assert stage.meshes == []
    assert stage.quaternion is None
    (arrow,) = stage.arrows
    np.testing.assert_allclose(arrow.vectors, 1.45 * dataset["momentum_axis"].values, rtol=1e-12)
    assert {"plane of reference", "precession of the momentum: once in 2.09 min"} <= {
        line.words for line in stage.lines
    }
    assert any("isn't drawn" in note for note in found.notes)
    with_axis = averaged(top, "figure", top)  # a disk whose axis is known is drawn, along it
    found, _ = build_picture(with_axis)
    assert found.kind == "axes in space"
    assert len(found.stages[0].meshes) == len(subject.meshes) > 0
    turn = rotation_matrix(found.stages[0].quaternion[:, [3, 0, 1, 2]])
    np.testing.assert_allclose(turn[:, :, 2], with_axis["figure_axis"].values, rtol=0, atol=1e-6)


def test_the_local_frame_points_forward_and_down() -> None:
    seconds = np.linspace(0, 3000, 50)
    source = surroundings.kepler_path(CIRCLE, seconds)
    frame = local_frame(-source, surroundings.orbit_normal(CIRCLE))
    np.testing.assert_allclose(
        frame[:, :, 2], source / np.linalg.norm(source, axis=1, keepdims=True), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(frame), 1, atol=1e-13)
    velocity = -(surroundings.kepler_path(CIRCLE, seconds + 1) - source)
    velocity /= np.linalg.norm(velocity, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", frame[:, :, 0], velocity) > 0.999).all()


def test_a_satellite_without_attitude_in_space_is_turned_by_roll_pitch_and_yaw(symmetric_top: Build) -> None:
    dataset = satellite(symmetric_top(count=101)).drop_vars(["quaternion", "angular_momentum"])
    angles = np.deg2rad(np.tile([10.0, 20.0, 30.0], (101, 1)))
    dataset["roll_pitch_yaw"] = (("time", "angle"), angles)
    stage = picture(dataset).stages[0]
    assert stage.quaternion is not None
    shown = rotation_matrix(stage.quaternion[:, [3, 0, 1, 2]].astype(float))
    source = surroundings.kepler_path(CIRCLE, dataset["time"].values)
    local = local_frame(-source, surroundings.orbit_normal(CIRCLE))
    relative = np.einsum("tji,tjk->tik", local, shown)
    # 3-2-1: pitch, yaw and roll from the matrix (Diebel 2006, eq. 290)
    np.testing.assert_allclose(-np.arcsin(relative[:, 2, 0]), np.deg2rad(20), atol=1e-6)
    np.testing.assert_allclose(np.arctan2(relative[:, 1, 0], relative[:, 0, 0]), np.deg2rad(30), atol=1e-6)
    np.testing.assert_allclose(np.arctan2(relative[:, 2, 1], relative[:, 2, 2]), np.deg2rad(10), atol=1e-6)


def test_the_ellipsoid_of_energy_touches_the_invariable_plane_at_the_tip(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    rolling = picture(dataset).stages[1]
    (shell,) = rolling.shells
    polhode, herpolhode = (t.points for t in rolling.trails)
    np.testing.assert_allclose(((polhode / shell.half_sizes) ** 2).sum(axis=1), 1, rtol=1e-9)
    heights = herpolhode[:, 2]  # L is along Z
    np.testing.assert_allclose(heights, heights[0], rtol=1e-9)
    rim = next(line for line in rolling.lines if line.name == "plane/rim")
    np.testing.assert_allclose(rim.points[:, 2], heights[0], rtol=1e-9)


def test_a_top_of_known_moments_is_drawn_as_one_that_stands_on_its_pivot(symmetric_top: Build) -> None:
    cuboid = [
        {"solid": "cuboid", "dimensions": {"size": [1, 1, 1]}, "position": [0, 0, 0.04], "equivalent": True}
    ]
    dataset = heavy(symmetric_top(count=101)).assign_attrs(
        drawing=json.dumps(cuboid), principal_moments="[2e-4, 2e-4, 1e-4]"
    )
    (mesh,) = picture(dataset).stages[0].meshes
    assert mesh.vertices[:, 2].min() == pytest.approx(0, abs=1e-12)
    # the disk's radius is sqrt(2 C / m), in units of the stem's 7 cm
    radius = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).max()
    assert radius == pytest.approx(np.sqrt(2e-4 / 0.1) / 0.07, rel=1e-9)
    shaped = dataset.assign_attrs(drawing=json.dumps([{**cuboid[0], "equivalent": False}]))
    (mesh,) = picture(shaped).stages[0].meshes
    assert len(mesh.triangles) == 12  # a shape that is known is drawn


def test_a_plate_is_never_seen_edge_on_at_the_start(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=401)
    for turn in ([1, 0, 0, 0], [np.sqrt(0.5), np.sqrt(0.5), 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0]):
        fixed = dataset.assign(quaternion=(("time", "quaternion_component"), np.tile(turn, (401, 1))))
        found, subject = build_picture(fixed.drop_vars("angular_momentum"))
        eye = camera(found.stages[0], subject=subject)
        way = (eye.position - eye.target) / np.linalg.norm(eye.position - eye.target)
        normal = rotation_matrix(turn) @ [0, 0, 1]
        assert abs(way @ normal) > 0.4


def test_quaternions_of_matrices_give_them_back() -> None:
    random = np.random.default_rng(3).normal(size=(500, 4))
    matrices = rotation_matrix(random)
    found = quaternion_of(matrices)
    np.testing.assert_allclose(rotation_matrix(found), matrices, atol=1e-14)
    assert (np.einsum("ij,ij->i", found[1:], found[:-1]) >= 0).all()


def test_sharp_edges_are_those_of_the_solid() -> None:
    assert len(sharp_edges(solid_mesh("cuboid", {"size": [1, 2, 3]}))) == 12
    assert len(sharp_edges(globe(np.ones(3), (1, 2, 3)))) == 0
    top = spinning_top(0.5, 1.0, 1.7)
    assert top.volume() > 0
    assert len(sharp_edges(top)) % 64 == 0


def test_long_trails_and_arrows_are_thinned_only_where_nothing_is_lost() -> None:
    turns = np.linspace(0, 2 * np.pi, 5 * SCENE_ROWS)
    slow = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    fast = np.stack([np.cos(3000 * turns), np.sin(3000 * turns), 0 * turns], axis=1)
    assert still_stride(slow) == 64
    assert still_stride(fast) == 1
    assert still_stride(slow[:SCENE_ROWS]) == 1
    assert trail_stride(trail("t", (1, 2, 3), slow)) == 16
    assert trail_stride(trail("t", (1, 2, 3), fast)) == 1  # 33 points a turn


def test_what_the_scene_is_about_is_plotted_first_and_in_readable_units(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    dataset["tilt"] = ("time", np.linspace(0.1, 0.5, 1001), {"units": "rad"})
    plots = plan_plots(dataset, ("tilt", "precession_angle"))
    assert [plot.title for plot in plots if plot.place == "leading"] == ["Tilt [°]"]
    np.testing.assert_allclose(plots[0].series[0].values[:, 0], np.rad2deg(dataset["tilt"]), rtol=1e-15)
    assert plots[0].series[0].error is None
    banded = plan_plots(dataset.assign_attrs(attitude_error=0.02), ("tilt",))[0].series[0].error
    assert banded is not None
    assert banded[[0, -1]] == pytest.approx([0.0, np.rad2deg(0.02)])
    assert banded[500] == pytest.approx(np.rad2deg(0.02) * 0.5**1.5)
    assert plan_plots(dataset)[0].title == "Angular velocity [rad/s]"


def test_events_have_a_lane_and_a_section(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    times = np.arange(1.0, 13.0)
    label = {"event": "flip"}
    dataset["flip_time"] = ("flip", times, {**label, "units": "s"})
    dataset["flip_angular_velocity"] = (
        ("flip", "body_axis"),
        np.stack([np.cos(times), np.sin(times), 0 * times], axis=1),
        {**label, "units": "1"},
    )
    (lane,) = states_of(dataset, 0.0, 20.0)
    assert lane.values[:3] == ["before flip", "flip 1", "flip 2"]
    np.testing.assert_array_equal(lane.seconds, np.append(0.0, times))
    (plane,) = sections_of(dataset)
    low, high = np.cos(times).min(), np.cos(times).max()
    assert plane.names[0] == f"x (axes cross at {(low + high) / 2:.4g})"
    assert plane.points[:, 0].min() == pytest.approx((low - high) / 2)
    assert not plane.moves
    assert len(plane.points) == 12
    stopped = states_of(dataset.assign_attrs(status="max_drift"), 0.0, 20.0)[-1]
    assert (stopped.values, stopped.seconds.tolist()) == (["running", "max drift"], [0.0, 20.0])


def test_a_run_in_euler_angles_has_a_lane_of_its_charts(symmetric_top: Build) -> None:
    """The asked sequence is left where its middle angle nears 0 or half a turn, and found again later."""
    dataset = symmetric_top(count=721)
    turn = np.linspace(0.0, 2 * np.pi, 721)  # about X: sin of the middle angle of zxz is that of the turn
    zero = np.zeros(721)
    dataset["quaternion"] = (
        ("time", "quaternion_component"),
        np.stack([np.cos(turn / 2), np.sin(turn / 2), zero, zero], axis=1),
    )
    assert charts_of(dataset) == []
    named = dataset.assign_attrs(
        formulation="euler_angles", euler_sequence="zxz", euler_partner_sequence="zxy"
    )
    (lane,) = charts_of(named)
    # it begins in the singularity; the partner's factor, abs(cos), falls below a half at 60 degrees
    assert (lane.name, lane.values) == ("chart", ["zxy", "zxz", "zxy", "zxz", "zxy"])
    degrees = 360 * lane.seconds[1:] / dataset["time"].values[-1]
    np.testing.assert_allclose(degrees, [60, 150, 240, 330], atol=0.51)
    assert charts_of(named.drop_vars("quaternion")) == []


def test_the_announced_error_is_a_level_beside_the_drifts(symmetric_top: Build) -> None:
    def levels(dataset: xarray.Dataset) -> list[tuple[str, float]]:
        return [(level.label, level.value) for plot in plan_plots(dataset) for level in plot.levels]

    dataset = symmetric_top(count=11)
    assert levels(dataset) == []
    assert levels(dataset.assign_attrs(attitude_error=1e-8)) == [
        ("error of the attitude at the end, rad", -8.0)
    ]
    averaged = dataset.assign_attrs(attitude_error=1e-6, formulation="orbit_averaged")
    assert levels(averaged) == [("error of the axis at the end, rad", pytest.approx(-6.0))]


def test_a_constant_curve_is_not_magnified(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    dataset["tilt"] = ("time", 0.5 + 1e-15 * np.arange(101), {"units": "rad"})
    tilt, *_ = plan_plots(dataset, ("tilt",))
    assert tilt.range == pytest.approx(np.rad2deg([0.475, 0.525]))
    dataset["tilt"] = ("time", 0.5 + 1e-7 * np.arange(101), {"units": "rad"})
    assert plan_plots(dataset, ("tilt",))[0].range is None
    # unless all that it does is less than what is known of it
    uncertain = dataset.assign_attrs(attitude_error=1e-5)
    assert plan_plots(uncertain, ("tilt",))[0].range is not None


def test_rates_have_prefixes_and_axes_that_lie_together_one_curve(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101, scale=1e-13)
    dataset["obliquity"] = (
        ("time", "axis"),
        np.stack([np.linspace(0.4, 0.5, 101)] * 2 + [np.linspace(0.5, 0.4, 101)], axis=1),
        {"units": "rad"},
    )
    dataset = dataset.assign_coords(axis=["figure", "spin", "momentum"])
    plots = {plot.key: plot for plot in plan_plots(dataset, ("obliquity",))}
    assert plots["angular_velocity"].title == "Angular velocity [Trad/s]"
    assert np.abs(plots["angular_velocity"].series[0].values).max() < 10
    assert plots["obliquity"].series[0].labels == ["figure, spin", "momentum"]
    assert plots["obliquity"].series[0].values.shape == (101, 2)


def test_point_masses_beside_the_body_are_pointed_to(symmetric_top: Build) -> None:
    """From the one that the body is, not from the origin."""
    dataset = earth(symmetric_top(count=11))
    place = np.zeros((11, 3, 3))
    place[:, 0] = [-1.5e11, 0, 0]  # the Sun
    place[:, 1] = [0, 1e9, 0]  # the Earth, where the body is
    place[:, 2] = [0, 1e9, 4e8]
    dataset["point_mass_position"] = (("time", "point_mass", "space_axis"), place, {"units": "m"})
    dataset = dataset.assign_coords(point_mass=["sun", "earth", "moon"])
    dataset = dataset.assign_attrs(config='[body]\nhost = "earth"\n')
    arrows = {arrow.label: arrow for arrow in picture(dataset).stages[0].arrows}
    assert {"to the Sun", "to the Moon"} <= set(arrows)
    moon, sun = (arrows[name].vectors[0] for name in ("to the Moon", "to the Sun"))
    np.testing.assert_allclose(moon / np.linalg.norm(moon), [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(sun / np.linalg.norm(sun), [-1, 0, 0], atol=0.01)


def test_a_page_has_only_letters_that_the_viewer_can_draw() -> None:
    assert legible("ω = 2π/T, naïve Größe, 10⁻³ kg m²/s ≤ ½") == "ω = 2π/T, naïve Größe, 10⁻³ kg m²/s ≤ ½"
    assert legible("a 🪐 of 質量 1") == "a ? of ?? 1"
