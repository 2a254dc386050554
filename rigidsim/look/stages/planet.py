"""Stages of a planet: its globe and axes, ecliptic and equator, the circle of its precession, its source; and
its disc as its source sees it.

If no attitude is known but an axis is (in an averaged model, which has no rotation), a body is drawn that
points there and doesn't turn; a body of which nothing else is known has a separate stage. The frame of the
disc turns with the direction to the source, and the mean figure axis is up. It is stretched along the line of
sight, so that the eye sees all that is seen from far away, to the limb: librations are its wobble.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals, sources
from rigidsim.look.curves import loop_rows
from rigidsim.look.fits import secular, turn_text
from rigidsim.look.record import called, color_of, named_body, scene_of
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Array, Mesh, globe, graticule, pictured_globe
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import FIELD, Subject, direction_of, eye_at, source_arrows
from rigidsim.look.stages.parts import BODY, Camera, Color, Part, Picture, Stage, arrow, lines, trail
from rigidsim.scene.bodies.presets import KNOWN
from rigidsim.scene.readable import DAY, YEAR
from rigidsim.scene.rotations import quaternion_of

_LARGE = 1e5  # m: a smaller body is no globe
_ROUND = 0.9  # of the smallest over the largest semi-axis
_ALIKE = 1e-3  # of a radius, for a body to be taken for one that is known
_UNKNOWN: Color = (128, 148, 170)
EQUATOR: Color = (150, 205, 110)
_X_AXIS_WEST = {"earth_rigid": 14.93}  # deg from Greenwich, of presets whose x axis has the least moment
ECLIPTIC: Color = (226, 196, 90)
PRECESSION: Color = (190, 150, 255)
POLE_REACH = 1.45  # length of a pole's arrow, in units of the body's reach
SOURCE_REACH = 1.75  # length of an arrow to a source
PLANE = "plane"  # frame of the plane of reference, where that isn't XY of space
_MONTH = 27.3 * DAY
_ALMOST_WHOLE = 0.98  # of a revolution, from which it counts as one: the last sample may be short of it
_APART = 0.02  # rad, from which two arrows are seen as two
_UPRIGHT = 1e-9  # sine of the tilt, below which a pole has no node
_SPARSE = 1.0  # rad of an orbit from one row to the next, from which a source can't be followed
EYE = "eye"
_STRETCH = 25.0  # of a frame along the line of sight: perspective is a 25th of what it was
_LIFT = 1.012  # of the point under the source, in radii
_MARK = 0.03  # radius of the ring about longitude and latitude zero


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Picture of a large, nearly round body that spins nearly about its figure axis, and of any body without
    attitude and rates whose figure axis or momentum is known.
    """
    figure, turns = scene_of(dataset).figure, subject.attitude is not None
    still = not turns and "angular_velocity" not in dataset
    sizes = _semi_axes(dataset, subject)
    need(subject.position is None and (still or sizes is not None))
    axes, beside = _known_axes(dataset) if still else ({}, False)
    if subject.attitude is not None:
        axes = {"figure": subject.attitude @ figure}
    need(bool(axes) or sizes is not None)
    if still and "figure" in axes:
        subject = _pointed(subject, figure, axes["figure"])
    notes: list[str] = []
    faces, shown, what = list[Stage](), list[Part](), "body"
    kind, title = "axes in space", "Axes in space"
    if sizes is not None:
        what, west = "globe", _X_AXIS_WEST.get(str(subject.solids[0].get("name", "")), 0.0)
        name, mesh = _globe(subject, sizes)
        subject = replace(subject, meshes=[mesh.moved(_turn(west), np.zeros(3))], reach=float(sizes.max()))
        marks = _marks(sizes / sizes.max(), figure, west, prime=turns or subject.attitude is None)
        if name == "earth":
            zero = f"{west:.4g}° west of Greenwich" if west else "at longitude zero"
            notes.append(f"continents: Natural Earth; the body's x axis is {zero}")
        face = facing(dataset, subject, figure, marks)
        if face is not None:
            faces, notes = [face[0]], [*notes, face[1]]
        title = name.capitalize() or "Planet"
        article = {"": "a planet", "earth": "the Earth", "moon": "the Moon"}.get(name, title)
        kind, shown = f"rotation of {article} in space", marks
        if subject.attitude is None:
            shown = [*_in_its_own_axes(dataset, figure, notes), *marks]
            stage = subject.stage(shown, title, axes=0.0, camera=_eye(0.3, 1.75))
            return Picture(f"rotation of {article}", [*faces, stage], notes)
    leading = next(iter(axes))
    if leading == "momentum":
        subject = replace(subject, meshes=[], points=np.empty((0, 3)))
        rings = graticule(np.full(3, 0.6), lift=1.0)
        shown = [lines("directions/0", parts.FAINT, rings, width=0.7, strength=0.4)]
        notes.append("the body isn't drawn: of its attitude only the momentum's direction is known")
    arrows = []
    for name, axis in axes.items():
        color = parts.FIGURE if name == "figure" else parts.MOMENTUM
        tip, words = POLE_REACH * axis, f"{name} axis"
        arrows.append(arrow(f"{name}_axis", words, color, tip, words))
        # of samples too far apart it would be a cloud; on the circle of precession it wouldn't be seen
        if still and signals.joined(tip, parts.NEAR) and np.ptp(axis[:, 2]) > _APART:
            arrows += trail(f"{name}_path", color, tip, f"path of the {words}")
    if turns:
        arrows += source_arrows(dataset, SOURCE_REACH, balls=True)
    elif not beside:
        arrows += _followed_sources(dataset, notes)
    plane, place = reference_plane(dataset)
    circle = circle_of_precession(dataset, axes[leading], leading, place, notes)
    if beside:
        notes.append(f"the plane of reference moves in space: the {what} is drawn as seen from it")
    if still and leading == "figure":
        averaged = signals.is_averaged(dataset.attrs)
        why = "every rotation is averaged over" if averaged else "no attitude was recorded"
        notes.append(f"{why}: the {what} points where its figure axis does, and doesn't turn about it")
    elif turns and signals.aliased(dataset):
        notes.append("samples are half a turn apart or more: the globe's turning isn't seen")
    shown = [*arrows, *shown, *plane, *circle]
    stage = subject.stage(shown, title, axes=0.0, camera=_eye(), looked_from=place)
    return Picture(kind, [*faces, stage], notes)


def _globe(subject: Subject, sizes: Array) -> tuple[str, Mesh]:
    """Name, if it is known or given, of a planet with these semi-axes (3,), m, and its mesh in radii."""
    name, radius = str(subject.solids[0].get("name", "")).partition("_")[0], float(sizes.max())
    known = named_body(name)
    if not name:
        near = min(KNOWN, key=lambda one: abs(one.radius - radius))
        known = near if abs(near.radius / radius - 1) < _ALIKE else None
        name = "" if known is None else known.name.lower()
    if name in ("earth", "moon"):
        return name, pictured_globe(sizes / radius, name)
    return name, globe(sizes / radius, color_of(known, _UNKNOWN))


def _marks(half: Array, figure: Array, west: float, *, prime: bool) -> list[Part]:
    """Meridians and parallels, the equator, and the prime meridian, which makes the rotation seen."""
    turn = _turn(west).T
    rings = [line @ turn for line in graticule(half)]
    found = [lines("graticule/0", (20, 24, 30), rings, place=BODY, width=0.8, strength=0.55)]
    if prime:
        first = graticule(half, 180.0, 1.006)[0] @ turn
        found.append(lines("prime_meridian", parts.PALE, [first], "prime meridian", place=BODY, width=1.6))
    return [*found, lines("equator", EQUATOR, [parts.circle(1.01, figure)], "equator", place=BODY, width=1.8)]


def _turn(degrees: float) -> Array:
    """Rotation (3, 3) about z."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _semi_axes(dataset: xarray.Dataset, subject: Subject) -> Array | None:
    """Semi-axes (3,), m, of a globe whose poles have a meaning."""
    poles = signals.near_axis(dataset, exactly=True) or "obliquity" in dataset or "polar_motion" in dataset
    if len(subject.solids) != 1 or subject.solids[0].get("solid") not in ("ellipsoid", "sphere") or not poles:
        return None
    given = subject.solids[0].get("dimensions", {})
    sizes = np.asarray(given.get("semi_axes", given.get("radius", 0.0)), dtype=float)
    axes = np.broadcast_to(sizes, 3)
    return axes if axes.min() > max(_LARGE, _ROUND * axes.max()) else None


def _in_its_own_axes(dataset: xarray.Dataset, figure: Array, notes: list[str]) -> list[Part]:
    """Figure axis and spin axis, their angle enlarged until it is visible."""
    notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    words = "figure axis"
    fixed = parts.fixed_arrow(
        "figure_axis", words, parts.FIGURE, figure, 0.55 * figure, words, place=BODY, radius=0.014
    )
    rates = signals.values(dataset, "angular_velocity", 3)
    if rates is None:
        return fixed
    spin = rates / np.linalg.norm(rates, axis=1, keepdims=True)
    spin = spin * np.sign(spin @ figure)[:, None]
    apart = spin - np.outer(spin @ figure, figure)
    size = float(np.nanmax(np.linalg.norm(apart, axis=1)))
    if not size > 0:
        return fixed
    factor = max(float(f"{0.32 / size:.0e}"), 1.0)
    shown = 1.4 * figure + 1.4 * factor * apart
    times = f"{factor:,.0f} times"
    words = "spin axis" if factor == 1.0 else f"spin axis, {times} farther from the figure axis"
    notes.append(f"the angle between spin axis and figure axis is drawn {times} too large")
    return [
        arrow("spin_axis", "spin axis", parts.VELOCITY, shown, words, place=BODY),
        *fixed,
        *trail("polar_motion", parts.POLHODE, shown, "path of the spin axis", place=BODY),
    ]


def _eye(height: float = 0.05, radius: float = 1.95) -> Camera:
    """The eye before a globe or axes, at which it looks at some height."""
    view = float(np.deg2rad(22.0)), float(np.deg2rad(-52.0))
    return eye_at(*view, radius, np.array([0.0, 0.0, height]))


def _known_axes(dataset: xarray.Dataset) -> tuple[dict[str, Array], bool]:
    """Unit vectors (rows, 3) of the axes named figure and momentum, the latter if it is another, as far as
    all are known: as recorded, or from obliquity and node longitude; and whether they are given along a plane
    of reference that moves in space, or along space axes.
    """
    found, plane, beside = dict[str, Array](), signals.reference_axes(dataset), False
    for name in ("figure", "momentum"):
        axis = signals.pole(dataset, name)
        if axis is None:
            axis = _against_plane(dataset, name)
            beside = beside or (axis is not None and plane is None)
            axis = axis if axis is None or plane is None else axis @ plane[0]
        if axis is not None and np.isfinite(axis).all():
            found[name] = axis
    if len(found) == 2 and np.linalg.norm(found["figure"] - found["momentum"], axis=1).max() < _APART:
        del found["momentum"]
    return found, beside


@optional
def _against_plane(dataset: xarray.Dataset, axis: str) -> Array:
    """Unit vectors (rows, 3) along the plane's X', Y' and normal, from obliquity and node longitude."""
    need("obliquity" in dataset and "node_longitude" in dataset)
    tilt, node = need(signals.orientation(dataset, axis))
    return np.stack([np.sin(tilt) * np.sin(node), -np.sin(tilt) * np.cos(node), np.cos(tilt)], axis=1)


def _pointed(subject: Subject, figure: Array, pole: Array) -> Subject:
    """The subject with an attitude whose figure axis (3,), body axes, is the pole (rows, 3), without rotation
    about it.
    """
    node = np.stack([-pole[:, 1], pole[:, 0], np.zeros(len(pole))], axis=1)
    node[np.hypot(pole[:, 0], pole[:, 1]) < _UPRIGHT] = (1.0, 0.0, 0.0)
    node -= np.sum(node * pole, axis=1, keepdims=True) * pole
    node /= np.linalg.norm(node, axis=1, keepdims=True)
    in_body = np.stack([*signals.across(figure), figure], axis=1)
    in_space = np.stack([node, np.cross(pole, node), pole], axis=2)
    attitude = in_space @ in_body.T
    return replace(subject, attitude=attitude, quaternion=quaternion_of(attitude))


def _followed_sources(dataset: xarray.Dataset, notes: list[str]) -> list[Part]:
    """Directions of sources that advance little enough from row to row for the eye to follow."""
    seconds = signals.seconds(dataset)
    step = float(np.abs(np.diff(seconds)).mean()) if len(seconds) > 1 else 0.0
    orbits = [one.get("orbit", {}) for one in scene_of(dataset).sources]
    rates = {f"source{k}": float(orbit.get("mean_motion", 0.0)) for k, orbit in enumerate(orbits)}
    kept = []
    for shown in source_arrows(dataset, SOURCE_REACH):
        if abs(rates.get(shown.path.rpartition("/")[2], 0.0)) * step > _SPARSE:
            notes.append(f"the {shown.words} isn't shown: samples are too far apart to follow it")
        else:
            kept.append(shown)
    return kept


def reference_plane(dataset: xarray.Dataset) -> tuple[list[Part], str]:
    """The plane of reference and its normal, and the frame that they are in, from which it is looked at."""
    axes, words = signals.reference_axes(dataset) or (np.eye(3), "plane of reference")
    place, turning = "", []
    if not np.array_equal(axes, np.eye(3)):
        place, turn = PLANE, quaternion_of(axes.T[None])
        turning = parts.frame(PLANE, quaternion=np.repeat(turn, dataset.sizes["time"], axis=0))
    up, upright = np.array([0.0, 0.0, 1.0]), np.array([[0, 0, -1.5], [0, 0, 1.75]])
    spokes = [np.outer([-1.75, 1.75], direction_of(0.0, np.pi * k / 6)) for k in range(6)]
    rim, inner = parts.circle(1.75, up), parts.circle(1.3, up)
    return [
        *turning,
        lines("ecliptic/rim", ECLIPTIC, [rim], words, place=place, width=1.8, strength=0.9),
        lines("ecliptic/inner", ECLIPTIC, [inner], place=place, width=0.8, strength=0.35),
        lines("ecliptic/spoke0", ECLIPTIC, spokes, place=place, width=0.7, strength=0.22),
        lines("normal", parts.FAINT, [upright], place=place, width=1.0),
        parts.spot("normal/label", "normal", parts.FAINT, 1.78 * up, place),
    ], place


def circle_of_precession(
    dataset: xarray.Dataset, pole: Array, axis: str, place: str, notes: list[str]
) -> list[Part]:
    """The circle, with its period, that a pole (rows, 3), space axes, of the axis named figure or momentum
    describes about the normal of the plane of reference, if it does, in the frame of this plane.
    """
    frame = signals.reference_axes(dataset)
    if place == PLANE and frame is not None:
        pole = pole @ frame[0].T
    tilt = float(np.nanmean(np.arctan2(np.hypot(pole[:, 0], pole[:, 1]), pole[:, 2])))
    if not 1e-3 < tilt < np.pi - 1e-3:
        return []
    up, high = np.array([0.0, 0.0, 1.0]), np.array([0, 0, POLE_REACH * np.cos(tilt)])
    ring = parts.circle(POLE_REACH * np.sin(tilt), up, high)
    words = "precession of the pole" if axis == "figure" else f"precession of the {axis}"
    found = signals.orientation(dataset, axis)
    seconds = signals.seconds(dataset)
    if found is not None and len(seconds) > 8:
        mean, span = secular(seconds, found[1]), abs(float(seconds[-1] - seconds[0]))
        advance = abs(mean.rate) * span
        if float(np.abs(found[1] - mean.at(seconds)).max()) > max(advance, 1e-6):
            return []  # it strays as far as it advances: it goes about another pole
        if advance > 1e-9 and _whole_revolution(dataset, span):
            words += f": once in {turn_text(mean, dataset.attrs)}"
            which = "pole" if axis == "figure" else axis
            notes.append(f"the {which}'s longitude moves by {mean.about}{mean.rate:.6g} rad/s on the mean")
    return [lines("precession", PRECESSION, [ring], words, place=place, width=2.0)]


def _whole_revolution(dataset: xarray.Dataset, span: float) -> bool:
    """Whether a run is as long as a revolution of each source: of less, what a line fits is nutation too."""
    known, listed = {"sun": YEAR, "moon": _MONTH}, scene_of(dataset).sources
    rates = [abs((one.get("orbit") or {}).get("mean_motion") or 0.0) for one in listed]
    named = [known.get(str(one.get("ephemeris", "")).lower(), 0.0) for one in listed]
    periods = [2 * np.pi / rate if rate else by_name for rate, by_name in zip(rates, named, strict=True)]
    return span >= _ALMOST_WHOLE * max(periods, default=0.0)


@optional
def facing(dataset: xarray.Dataset, subject: Subject, figure: Array, marks: list[Part]) -> tuple[Stage, str]:
    """Stage and note of a globe that faces its strongest source at the end of the run; None for others."""
    found = need(sources.seen(dataset))
    need(np.isfinite(found.directions).all() and found.stays(found.last))
    source, attitude, directions = called(found.body, found.name), subject.attitude, found.directions
    toward = directions if attitude is None else np.einsum("tij,tj->ti", attitude, directions)
    up = figure if attitude is None else np.nanmean(attitude @ figure, axis=0)
    north = up - (toward @ up)[:, None] * toward
    north /= np.linalg.norm(north, axis=1, keepdims=True)
    turned = quaternion_of(np.stack([toward, np.cross(north, toward), north], axis=2))
    stretched = np.tile([_STRETCH, 1.0, 1.0], (len(toward), 1))
    point = f"sub-{found.body.name if found.body else 'source'} point"
    lasting = loop_rows(found.coordinates(figure)[:, 1])
    above, zero = _LIFT * directions, np.eye(3)[(int(np.abs(figure).argmax()) + 1) % 3]
    x, _, z = np.eye(3)
    words = "longitude and latitude zero"
    shown = [
        *parts.frame(EYE, quaternion=turned, scale=stretched),
        *trail("sub_source", parts.SOURCE, above, point, place=BODY, head=True, lasting=lasting),
        *marks,
        lines("limb", parts.FAINT, [parts.circle(1.0, x)], place=EYE, width=1.4, strength=0.8),
        lines("upright", parts.FAINT, [np.outer([1.03, 1.13], z)], place=EYE, width=2.0),
        lines("zero", parts.PALE, [parts.circle(_MARK, zero, _LIFT * zero)], words, place=BODY, width=2.0),
        parts.spot("north", "mean north", parts.FAINT, 1.22 * z, EYE),
    ]
    camera, title = Camera(1.3 / np.tan(FIELD / 2) * x, np.zeros(3), z), f"Seen from {source}"
    stage = subject.stage(shown, title, root="face", axes=0.0, camera=camera, looked_from=EYE, flat=True)
    seen_as = f"seen from the direction of {source}, from far away, the mean figure axis upwards"
    note = f"{title}: {seen_as}; nothing is exaggerated"
    if attitude is None:
        note += "; no attitude was recorded, so that the figure axis stays upright"
    return stage, note
