"""The picture of a scene by its kind: tops, bodies that fly, free ones, and any other.

The tip of a free body's angular velocity keeps to the ellipsoid of energy, sum I_i w_i^2 = 2 T of the body's
axes, which touches the plane w . L = 2 T without slipping (Poinsot 1834): it leaves the polhode on the one
and the herpolhode on the other.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import body_of, called, color_of, scene_of
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Mesh, ball, body_meshes, globe, graticule, rotation_matrix, spinning_top
from rigidsim.look.sources import kepler_path, orbit_normal
from rigidsim.look.stages import bodies, parts, planet
from rigidsim.look.stages.bodies import (
    FIELD,
    Subject,
    direction_of,
    plane_view,
    source_arrows,
    suited_camera,
    vectors_of,
    with_track,
)  # fmt: skip
from rigidsim.look.stages.parts import (
    BODY,
    CENTRE,
    Array,
    Camera,
    Part,
    Picture,
    Stage,
    around,
    arrow,
    fixed_arrow,
    lines,
    spot,
    trail,
)  # fmt: skip
from rigidsim.look.stages.uncertainty import add_cone
from rigidsim.look.stages.wheels import add_wheels
from rigidsim.scene.bodies.presets import KnownBody
from rigidsim.scene.rotations import multiplied, of_euler, quaternion_of

_Planet = KnownBody | None
ENERGY: parts.Color = (120, 150, 200)
NORMAL: parts.Color = (190, 150, 255)
FORWARD: parts.Color = (150, 205, 110)
PARTNER = "partner"
"""Frame of a second body."""
IN_BODY_AXES = "no attitude was recorded: the body is shown in its own axes and doesn't turn"
TRACE = 1.0  # where on a top's axis the traced point is, in reaches
_SYMMETRIC = 1e-9  # of the moments
ORBIT_BODY = 0.11  # reach of the enlarged body, in units of the orbit's largest distance
_ALMOST = 0.93  # of the least distance: a larger planet would swallow the enlarged body
_LARGE = 1e5  # m: a larger body is a planet, and what pulls it is far away
_HORIZON, _BELOW = 9.0, 2.2  # radius of the planet drawn near the body, and its distance
_FAR = 30.0  # radii of a planet, beyond which it is no horizon
_DOT = 0.05  # radius of a planet in the view of an orbit, at least


def top(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a body on a fixed point off its centre of mass under uniform gravity."""
    arm, attitude = need(signals.lever(dataset)), need(subject.attitude)
    up = scene_of(dataset).vertical
    axis = _figure(dataset, arm)
    symbol = _symbol(dataset, subject, arm, axis)
    if symbol is not None:
        mesh, reach = symbol
        subject = replace(subject, meshes=[mesh.scaled(1 / reach)], points=np.zeros((0, 3)), reach=reach)
    shown, notes = vectors_of(dataset, subject, paths=False, longer=(1.25, 1.1))
    if symbol is not None:
        notes.append(
            "the config gives moments and no shape: the body is drawn as a top with its axis, its centre of "
            "mass and the radius of a disk of its mass and axial moment"
        )
    tip = TRACE * attitude @ axis
    lowest = min(float(np.nanmin(tip @ up)), float((subject.meshes[0].vertices @ axis).min()))
    # A top that dips below its pivot stands on a post, not on a floor that it would pass through.
    post = not (lowest > -0.02 and float(np.nanmin(tip @ up)) > 0.25)
    ground, center = (-1.35 if post else 0.0) * up, np.zeros(3)
    across = _across(up)
    rim, upright = parts.circle(1.6, up, ground), np.stack([ground, 1.5 * up])
    place, words = 1.25 * across[0] + 0.9 * up, "gravity"
    # on a post the label is below, where it is clear of the body's own
    pivot, size = (0.55 * ground, 0.0) if post else (center, 5.0)
    shown += [
        *fixed_arrow(words, words, parts.PULL, place, -0.55 * up, words, radius=0.02),
        *trail("tip", parts.FIGURE, tip, "trace of the axis", head=True),
        lines("ground/rim", parts.FAINT, [rim], strength=0.8),
        parts.grid("ground", ground, *across, 1.6, 4, 0.4, round_=True),
        lines("vertical", parts.FAINT, [upright], "vertical", width=1.0),
        spot("pivot", "pivot", parts.PALE, pivot, size=size),
    ]
    if post:
        shown.append(lines("ground/post", parts.PALE, [np.stack([ground, center])], width=4.0))
    if symbol is None:
        com = arm / subject.reach
        shown.append(lines("arm", parts.PALE, [np.stack([center, com])], place=BODY, width=2.5))
        shown.append(spot("center_of_mass", "centre of mass", parts.PULL, com, BODY, 6.0))
    elevation = np.deg2rad(20.0)
    direction = np.cos(elevation) * (0.55 * across[0] - 0.83 * across[1]) + np.sin(elevation) * up
    target, radius = (-0.1 if post else 0.55) * up, 2.05 if post else 1.62
    camera = Camera(target + radius / np.sin(FIELD / 2) * direction, target, up)
    return Picture("top on a fixed point", [subject.stage(shown, "Top on its pivot", camera=camera)], notes)


def _figure(dataset: xarray.Dataset, arm: Array) -> Array:
    """The axis whose trace is shown: of symmetry if the centre of mass lies on it, else through that."""
    scene = scene_of(dataset)
    if scene.moments is not None:
        axis = scene.axes[scene.symmetry]
        along = float(axis @ arm) / float(np.linalg.norm(arm))
        if abs(along) > 1 - _SYMMETRIC:
            return np.asarray(np.sign(along) * axis)
    return np.asarray(arm / np.linalg.norm(arm))


@optional
def _symbol(dataset: xarray.Dataset, subject: Subject, arm: Array, axis: Array) -> tuple[Mesh, float]:
    """A toy top (in metres) and its reach, if only the moments of a symmetric body are known."""
    scene = scene_of(dataset)
    need(len(subject.solids) == 1 and bool(subject.solids[0].get("equivalent")))
    moments, mass, k = need(scene.moments), need(scene.mass), scene.symmetry
    a, b = np.delete(moments, k)
    along = abs(float(scene.axes[k] @ arm)) / float(np.linalg.norm(arm))
    need(abs(a - b) <= _SYMMETRIC * max(a, b) and along >= 1 - _SYMMETRIC)
    length = float(np.linalg.norm(arm))
    # of a disk, C = m r^2/2; kept to what still looks like a top
    radius = float(np.clip(np.sqrt(2 * moments[k] / mass), 0.35 * length, 1.3 * length))
    mesh = spinning_top(radius, length, 1.75 * length)
    other = _across(axis)
    return mesh.moved(np.stack([*other, axis], axis=1), np.zeros(3)), 1.75 * length


def _across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors that complete an axis to a right-handed frame; X and Y for Z."""
    second, first = signals.across(axis)
    return first, -second


def free_orbit(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a body with a position and one attracting point."""
    listed = scene_of(dataset).attractors
    need(len(listed) == 1)
    position = need(subject.position) - np.asarray(listed[0]["position"], dtype=float)
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


def pair(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of two rigid bodies at true sizes and distance, the first at the origin."""
    listed = scene_of(dataset).partners
    need(len(listed) == 1 and "rigid_body_position" in dataset)
    other, name = dataset.isel(rigid_body=0), listed[0]["name"]
    place, q = (
        need(signals.values(other, f"rigid_body_{x}", n)) for x, n in (("position", 3), ("quaternion", 4))
    )
    unit = float(np.nanmax(np.linalg.norm(place, axis=1)))
    meshes = body_meshes(listed[0]["drawing"])
    size = max(mesh.reach() for mesh in meshes) / unit
    shown = [
        *parts.frame(PARTNER, quaternion=q, translation=place / unit),
        *(parts.solid(around(PARTNER, str(k)), mesh.scaled(1 / unit)) for k, mesh in enumerate(meshes)),
        spot("label", name, parts.PALE, np.array([0.0, 0.0, 1.4 * size]), place=PARTNER),
    ]
    elevation, azimuth = plane_view(place)
    up = np.array([0.0, 0.0, 1.0])
    camera = Camera(1.25 / np.sin(FIELD / 2) * direction_of(elevation, azimuth), np.zeros(3), up)
    true, words = subject.reach / unit, f"track of {name}"
    shown += trail("partner_track", parts.TRACK, place / unit, words)
    stage = subject.stage(
        shown, "Both bodies, to scale", size=true, unit=unit, axes=1.3 * true, camera=camera
    )
    near, notes = vectors_of(dataset, subject, paths=False)
    notes.insert(0, f"both bodies have true sizes and distances: 1 unit = {unit:.6g} m, the largest distance")
    close = subject.stage(near, "First body, seen in space axes", root="close")
    return Picture("two rigid bodies", [stage, close], notes)


def satellite(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a small body with a single source on an orbit, its attitude known in space or in the local
    frame.
    """
    listed = [one for one in scene_of(dataset).sources if "orbit" in one]
    unsized = subject.solids and subject.solids[0].get("equivalent")  # known by its moments alone
    large = subject.reach > _LARGE and not unsized
    need(len(listed) == 1 and subject.position is None and not large)
    orbit = listed[0]["orbit"]
    source = kepler_path(orbit, signals.seconds(dataset))
    # The normal of the satellite's orbit: as seen from the planet it goes about it in the same sense.
    local = local_frame(-source, orbit_normal(orbit))
    quaternion = subject.quaternion
    if quaternion is None:
        angles = need(signals.values(dataset, "roll_pitch_yaw", 3))
        need(np.isfinite(angles).all())
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
    relative = np.einsum("tji,tjk->tik", local, need(subject.attitude))
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
        *parts.frame("local", quaternion=quaternion_of(local)),
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


def flight(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a body with a position under a uniform gravity and without attractor."""
    need(scene_of(dataset).gravity is not None and not scene_of(dataset).attractors)
    need(subject.position)
    shown, notes = vectors_of(dataset, subject, paths=False)
    *others, path = bodies.with_track(subject, shown, notes)
    up = scene_of(dataset).vertical
    points = signals.finite_rows(need(path.track))
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
            parts.spot("start", "start", parts.PALE, signals.from_start(dataset, points)[0], size=4.0),
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


def free(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a body whose energy and momentum are constant."""
    need(subject.position is None)
    moments, twice, _ = need(signals.energy_and_momentum(dataset))
    rates = need(signals.values(dataset, "angular_velocity", 3))
    axes = scene_of(dataset).axes
    radii = np.sqrt(twice / moments)  # of the ellipsoid of energy, rad/s, along the principal axes
    shown, notes = vectors_of(dataset, subject, paths=subject.attitude is None)
    if subject.attitude is None:
        shown += _ellipsoid(axes, 1.6 * radii / float(np.linalg.norm(rates, axis=1).max()))
        return Picture("free rotation", [subject.stage(shown)], [*notes, IN_BODY_AXES])
    # the principal axis nearest to the first angular velocity
    along = axes @ rates[0]
    k = int(np.abs(along).argmax())
    followed = axes[k] * (1 if along[k] >= 0 else -1)
    tip = np.einsum("tij,j->ti", subject.attitude, 1.15 * followed)
    if signals.joined(tip, parts.NEAR):  # of samples too far apart it would be a cloud
        words = f"trace of the body's {_axis_name(followed)} axis"
        shown += trail("axis_trace", parts.FIGURE, tip, words, place=CENTRE)
    stages = [subject.stage(shown)]
    momentum = signals.steady_momentum(dataset)
    if momentum is not None:
        stages.append(_poinsot(subject, axes, momentum, radii, rates))
        notes.append(
            "Poinsot's construction: the ellipsoid of energy (blue), which turns with the body, rolls on the "
            "invariable plane; the point of contact is the tip of ω"
        )
    return Picture("free rotation", stages, notes)


def _ellipsoid(axes: Array, radii: Array) -> list[Part]:
    """The ellipsoid of energy, translucent, along principal axes (rows), its meridians and parallels."""
    mesh = ball(*radii).moved(axes.T, np.zeros(3))
    rings = [ring @ axes for ring in graticule(radii, lift=1.0)]
    around = parts.lines("energy/0", ENERGY, rings, place=BODY, width=1.0, strength=0.5)
    return [parts.solid(parts.around(BODY, "energy_ellipsoid"), mesh, clear=ENERGY), around]


def _axis_name(axis: Array) -> str:
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) < 1 - 1e-9:
        return "principal"
    return ("" if axis[k] > 0 else "−") + "xyz"[k]


def _poinsot(subject: Subject, axes: Array, along: Array, radii: Array, rates: Array) -> Stage:
    """The ellipsoid with these semi-axes on the plane across the momentum's direction."""
    scale = 1.0 / float(radii.max())
    tip = np.einsum("tij,tj->ti", need(subject.attitude), rates * scale)
    heights = tip @ along
    reach = float(np.sqrt(max(np.nanmax((tip**2).sum(axis=1) - heights**2), 0.0)))
    size = 1.2 * max(reach, 0.8)
    floor = float(np.nanmean(heights)) * along
    first, second = signals.across(along)
    # With L downwards, as books show it: the plane is the floor that the ellipsoid rolls on.
    eye = -along * 0.55 + first * 1.35 + second * 0.9
    eye = eye / np.linalg.norm(eye) * 2.2 * max(size, 1.0) * 1.2
    center = 0.35 * floor
    on_ellipsoid, on_plane = "polhode, on the ellipsoid of energy", "herpolhode, on the invariable plane"
    momentum, velocity = "angular momentum L", "angular velocity ω"
    rim, label = parts.circle(size, along, floor), floor - 0.98 * size * second
    shown = [
        arrow("angular_velocity", "", parts.VELOCITY, tip, velocity, radius=0.014),
        *fixed_arrow("momentum", "L", parts.MOMENTUM, np.zeros(3), 1.2 * floor, momentum, radius=0.012),
        *trail("polhode", parts.POLHODE, rates * scale, on_ellipsoid, place=BODY),
        *trail("herpolhode", (90, 225, 160), tip, on_plane),
        parts.lines("plane/rim", parts.FAINT, [rim], width=1.6),
        parts.grid("plane", floor, first, second, size, 4, 0.45, round_=True),
        parts.spot("plane/label", "invariable plane", parts.PALE, label),
        *_ellipsoid(axes, radii * scale),
    ]
    bare = replace(subject, meshes=[], points=np.empty((0, 3)))
    camera, title = Camera(center + eye, center, -along), "Poinsot's construction"
    return bare.stage(shown, title, root="poinsot", unit=1.0, axes=0.0, camera=camera)


def _any(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Any scene: the body with its momentum and angular velocity, and its track if it moves far."""
    shown, notes = vectors_of(dataset, subject, paths=not scene_of(dataset).carries_within)
    if subject.attitude is None:
        notes.append(IN_BODY_AXES)
    else:
        shown += source_arrows(dataset, 0.95 * parts.ARROW_REACH)
    return Picture("motion of a rigid body", with_track(subject, shown, notes), notes)


KINDS = (pair, top, free_orbit, flight, satellite, planet.picture, free, _any)
"""Functions that make the picture of a scene of their kind; the first that finds what it needs does."""


def build_picture(dataset: xarray.Dataset) -> tuple[Picture, Subject]:
    """Picture of a thinned dataset in memory, and its body; ``ValueError`` for an unreadable ``drawing``."""
    subject = Subject.of(dataset)
    pictures = (optional(kind)(dataset, subject) for kind in KINDS)
    found = next(picture for picture in pictures if picture is not None)
    add_wheels(dataset, subject, found)
    add_cone(dataset, subject, found)
    found.notes.insert(0, f"lengths are in units of the body's reach: 1 unit = {subject.reach:.6g} m")
    stages = [replace(one, camera=one.camera or suited_camera(one, subject)) for one in found.stages]
    return replace(found, stages=stages), subject
