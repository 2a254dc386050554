"""Stages of bodies that fly: in a uniform gravity, on free orbits and on prescribed ones."""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import body_of, called, color_of, scene_of
from rigidsim.look.solids import globe, graticule, rotation_matrix
from rigidsim.look.sources import kepler_path, orbit_normal
from rigidsim.look.stages import bodies, parts
from rigidsim.look.stages.bodies import FIELD, Subject, direction_of, plane_view, vectors_of
from rigidsim.look.stages.parts import (
    BODY,
    Array,
    Camera,
    Picture,
    Stage,
    around,
    arrow,
    fixed_arrow,
    lines,
    trail,
)
from rigidsim.scene.bodies.presets import KnownBody
from rigidsim.scene.rotations import quaternion_of
from rigidsim.scene.row_rotations import multiplied, of_euler

_Planet = KnownBody | None
ORBIT_BODY = 0.11  # reach of the enlarged body, in units of the orbit's largest distance
NORMAL: tuple[int, int, int] = (190, 150, 255)
FORWARD: tuple[int, int, int] = (150, 205, 110)
_ALMOST = 0.93  # of the least distance: a larger planet would swallow the enlarged body
_LARGE = 1e5  # m: a larger body is a planet, and what pulls it is far away
_HORIZON, _BELOW = 9.0, 2.2  # radius of the planet drawn near the body, and its distance
_FAR = 30.0  # radii of a planet, beyond which it is no horizon
_DOT = 0.05  # radius of a planet in the view of an orbit, at least


def free_orbit(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body with a position and one attracting point; None for others."""
    listed = scene_of(dataset).attractors
    if len(listed) != 1 or subject.position is None:
        return None
    position = subject.position - np.asarray(listed[0]["position"], dtype=float)
    planet = body_of(listed[0])
    shown, notes = vectors_of(dataset, subject, paths=False)
    name = called(planet, "attracting point")
    down = -position / np.linalg.norm(position, axis=1, keepdims=True)
    shown.append(arrow("nadir", f"to {name}", parts.SOURCE, 1.6 * down, f"direction of {name}"))
    air = signals.values(dataset, "air_velocity", 3)
    if air is not None:
        oncoming = 1.6 * air / signals.norms(air)[:, None]
        shown.append(arrow("air", "air", FORWARD, oncoming, "where the air comes from", place=BODY))
    close = subject.stage(shown, "Body, seen in space axes")
    stages = [close, _orbit(subject, position, planet, notes)]
    return Picture("orbit about an attracting point", stages, notes)


def satellite(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a small body with a single source on an orbit, its attitude known in space or in the local
    frame; None for others.
    """
    listed = [one for one in scene_of(dataset).sources if "orbit" in one]
    unsized = subject.solids and subject.solids[0].get("equivalent")  # known by its moments alone
    large = subject.reach > _LARGE and not unsized
    if len(listed) != 1 or subject.position is not None or large:
        return None
    orbit = listed[0]["orbit"]
    source = kepler_path(orbit, signals.seconds(dataset))
    # The normal of the satellite's orbit: as seen from the planet it goes about it in the same sense.
    local = local_frame(-source, orbit_normal(orbit))
    quaternion = subject.quaternion
    if quaternion is None:
        angles = signals.values(dataset, "roll_pitch_yaw", 3)
        if angles is None or not np.isfinite(angles).all():
            return None
        quaternion = multiplied(quaternion_of(local), of_euler("zyx", angles[:, ::-1]))
    planet = body_of(listed[0])
    known = replace(subject, quaternion=quaternion, attitude=rotation_matrix(quaternion))
    # so far away that it is no horizon below the body
    far = planet is not None and float(np.nanmin(signals.norms(source))) > _FAR * planet.radius
    near = "in the local frame the planet's surface is drawn near the body, and not to scale"
    notes = [] if far else [near]
    whole = -kepler_path(orbit, np.linspace(0.0, 2 * np.pi / orbit["mean_motion"], 361))
    stages = [
        _in_local_frame(dataset, known, local, planet, far=far),
        _orbit(known, -source, planet, notes, whole),
    ]
    return Picture("satellite on its orbit", stages, notes)


def local_frame(position: Array, normal: Array) -> Array:
    """Rotations (rows, 3, 3) from the local frame to space: x forward, y against the orbit's normal, which
    need not be exactly across the position, z to the attracting body, from which positions (rows, 3) are.
    """
    down = -position / np.linalg.norm(position, axis=1, keepdims=True)
    forward = np.cross(np.broadcast_to(normal, position.shape), -down)
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    return np.stack([forward, np.cross(down, forward), down], axis=2)


def _orbit(
    subject: Subject, position: Array, planet: _Planet, notes: list[str], whole: Array | None = None
) -> Stage:
    """The orbit (rows, 3), m, from the planet, and the planet, both to one scale, with the body enlarged; of
    a run that covers a part of a revolution alone, faintly the ``whole`` of it (points, 3), too.
    """
    distance = np.linalg.norm(position if whole is None else whole, axis=1)
    unit = float(np.nanmax(distance))
    places = position / unit
    nearest = float(np.nanmin(distance)) / unit
    true = 0.0 if planet is None else planet.radius / unit
    radius = max(min(true, _ALMOST * nearest), _DOT)
    if planet is not None and true < _DOT:
        notes.append(f"in the view of the orbit {planet.called} is drawn {_DOT / true:.2g} times too large")
    elevation, azimuth = plane_view(places if whole is None else whole)
    direction = direction_of(max(elevation, float(np.deg2rad(28.0))), azimuth)
    notes.append(
        f"in the view of the orbit 1 unit = {unit:.6g} m; the body is drawn "
        f"{ORBIT_BODY * unit / subject.reach:.3g} times too large"
    )
    name = planet.name if planet is not None else "attracting point"
    title = f"Orbit about {called(planet, 'attracting point')}"
    rings = graticule(np.full(3, radius)) if radius > 0.1 else []
    up = np.array([0.0, 0.0, 1.0])
    shown = [parts.solid(around("", "planet"), globe(np.full(3, radius), color_of(planet)))]
    shown.append(parts.spot("planet/label", name, parts.PALE, (radius + 0.14) * up))
    if rings:
        shown.append(lines("graticule/0", (20, 24, 30), rings, width=0.7, strength=0.5))
    if whole is not None:
        shown.append(lines("revolution", parts.FAINT, [whole / unit], strength=0.7))
    camera = Camera(1.3 / np.sin(FIELD / 2) * direction, np.zeros(3), up)
    more = {"unit": unit, "track": places, "axes": 0.0, "camera": camera}
    return subject.enlarged(shown, title, ORBIT_BODY, "orbit", **more)


def _in_local_frame(
    dataset: xarray.Dataset, subject: Subject, local: Array, planet: _Planet, *, far: bool
) -> Stage:
    """The body above its planet, whose surface is drawn near it unless it is far, not to scale, z down."""
    attitude = subject.attitude
    assert attitude is not None
    relative = np.einsum("tji,tjk->tik", local, attitude)
    # the principal axis that points to the planet on average, or nearest to that
    along = scene_of(dataset).axes @ np.nanmean(relative[:, 2, :], axis=0)
    k = int(np.abs(along).argmax())
    axis = scene_of(dataset).axes[k] * (1.0 if along[k] >= 0 else -1.0)
    # in space, as all moving parts are; the view looks from the local frame
    tip = 1.3 * np.einsum("tij,tj->ti", relative, np.broadcast_to(axis, (len(relative), 3)))
    name = f"to {called(planet, 'source')}"
    words = f"trace of the body axis that points {name if far else 'down'}"
    start = np.zeros(3)
    shown = [
        *parts.frame("local", quaternion=parts.viewer_quaternion(quaternion_of(local))),
        *fixed_arrow("nadir", name, parts.SOURCE, start, [0, 0, 1.75], f"nadir: {name}", place="local"),
        *fixed_arrow("forward", "forward", FORWARD, start, [1.75, 0, 0], "along the orbit", place="local"),
        *fixed_arrow("normal", "normal", NORMAL, start, [0, -1.6, 0], "the orbit's normal", place="local"),
        *trail("axis_trace", parts.FIGURE, tip, words, place="local", head=True),
    ]
    if not far:
        center, sizes = np.array([0.0, 0.0, _BELOW + _HORIZON]), np.full(3, _HORIZON)
        surface = globe(sizes, color_of(planet)).moved(np.eye(3), center)
        rings = [ring + center for ring in graticule(sizes, 15.0)]
        shown.append(parts.solid(around("local", "horizon"), surface))
        shown.append(lines("horizon/0", parts.FAINT, rings, place="local", width=0.6, strength=0.35))
    eye = np.array([2.0, -4.3, -1.35])
    eye = eye / np.linalg.norm(eye) * 2.15 / np.sin(FIELD / 2)
    target = np.array([0.0, 0.0, 0.35])
    camera = Camera(target + eye, target, np.array([0.0, 0.0, -1.0]))
    return subject.stage(shown, "Body in the local frame", looked_from="local", camera=camera)


def flight(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body with a position under a uniform gravity and without attractor; None for others."""
    pull, position = scene_of(dataset).gravity, subject.position
    if pull is None or position is None or scene_of(dataset).attractors:
        return None
    shown, notes = vectors_of(dataset, subject, paths=False)
    *others, path = bodies.with_track(subject, shown, notes)
    assert path.track is not None
    up = scene_of(dataset).vertical
    points = signals.finite_rows(path.track)
    kept = [part for part in path.parts if not part.path.startswith(f"{BODY}/axes")]
    origin = around("", bodies.ORIGIN)
    marked = any(part.path == origin for part in kept)
    heights = points @ up
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    extent = max(float(np.linalg.norm(np.ptp(points, axis=0))), 0.3)
    # The ground is where heights count from, where that is near the path, or else just under it.
    above = marked and -0.05 * extent <= heights.min() <= extent
    level = 0.0 if above else heights.min() - 0.15 * extent
    floor = middle - (middle @ up) * up + level * up
    first, second = _level_axes(points, up)
    size = 0.75 * extent
    high = max(float(heights.max()) - level, 0.3 * extent)
    place = floor - 0.85 * size * first + 0.9 * high * up
    center = floor + 0.5 * high * up
    direction = -second * 0.93 + 0.2 * first + 0.32 * up
    direction /= np.linalg.norm(direction)
    along, radius, words = -0.45 * high * up, 0.012 * extent, "gravity"
    stage = replace(
        path,
        title="Flight" if others else path.title,
        parts=[
            *(part for part in kept if level == 0.0 or part.path != origin),
            *fixed_arrow(words, words, parts.PULL, place, along, words, radius=radius),
            parts.grid("ground", floor, first, second, size, 5, 0.5),
            parts.spot("start", "start", parts.PALE, points[0], size=4.0),
        ],
        camera=Camera(center + 0.82 * extent / np.sin(FIELD / 2) * direction, center, up),
    )
    return Picture("flight in a uniform gravity", [stage, *others], notes)


def _level_axes(points: Array, up: Array) -> tuple[Array, Array]:
    """Two level unit vectors, the first along the path's longest level extent."""
    flat = points - np.outer(points @ up, up)
    _, spread, axes = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    first = axes[0] if spread[0] > 1e-9 else signals.across(up)[0]
    first = first if (points[-1] - points[0]) @ first >= 0 else -first
    return first, np.cross(up, first)
