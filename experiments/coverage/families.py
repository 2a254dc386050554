"""Random scenes by family: those in which an error estimate is most likely to be wrong, in all formulations.

The same seed and number always give the same scene; families take turns.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.coverage import carried, deep_time, fields, known, pairs, real_bodies, satellites
from experiments.coverage.hyperbolic import HYPERBOLIC, hyperbolic_average
from experiments.coverage.moments import put_late, spike, switch
from experiments.random_scenes import KINDS, Draw, orbit

SAMPLES = 9
DEEP_TIME = "deep time"
_FORMULATIONS = ("quaternion", "quaternion", "rotation_matrix", "euler_angles", "canonical")


@dataclass(frozen=True)
class Family:
    """What a scene is made of.

    Attributes:
        draw: writes body, start and loads.
        radians: powers of ten between which the horizon is drawn.
        averaged: whether it is an averaged model, which has its own states and settings.
        finish: writes what depends on the end of the run, s.
        epochs: years between which the run's is drawn; None without one.
        canonical: whether canonical variables take part.
    """

    draw: Callable[[Draw], None]
    radians: tuple[float, float] = (1.0, 3.3)
    averaged: bool = False
    finish: Callable[[Draw, float], None] | None = None
    epochs: tuple[int, int] | None = None
    canonical: bool = True


@dataclass(frozen=True)
class CoverageScene:
    """One scene; ``radians`` is about how far the body turns, or the slowest motion's units of time."""

    number: int
    family: str
    text: str
    radians: float


def _slow_body(draw: Draw) -> None:
    """The orbit is quick, the body hardly turns."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.decades(-5, -1))
    motion, axis = 1 / draw.time, 1e3 * draw.length
    strength, turn = motion**2 * axis**3 * draw.decades(-4, 0), 2 * math.pi / motion
    way = orbit(axis, eccentricity=draw.between(0, 0.6), inclination=draw.between(0, 3), period=turn)
    draw.load("gravity_gradient", f"gravitational_parameter = {strength!r}", way)


def _eccentric(draw: Draw) -> None:
    """As in the issue: chaotic, weakly so or regular, nothing says at first which."""
    draw.body(np.array([1, 1 + draw.decades(-2, -0.5), 1 + draw.decades(-2, -0.4)]))
    draw.start(draw.direction() * draw.between(0.5, 3))
    axis, motion = 1e3 * draw.length, 1 / draw.time
    e = draw.between(0.01, 0.7)
    draw.source(axis, motion, e, inclination=draw.between(0, 3), mean_anomaly=draw.between(0, 6))


def _late_instability(draw: Draw) -> None:
    """Spin about the middle axis, left slowly, beside a weak load that leaves no closed form."""
    middle, spread = 1.0, draw.decades(-3, -0.5)
    draw.body([middle - spread * draw.between(0.1, 1), middle, middle + spread * draw.between(0.1, 1)])
    draw.start([draw.decades(-10, -3), draw.between(0.5, 2), draw.decades(-10, -3)])
    if draw.sometimes(0.5):
        size = draw.mass * draw.length**2 / draw.time * draw.decades(-8, -5)
        draw.load("viscous_torque", f"coefficients = {[size, size, size]}")


def _several(draw: Draw) -> None:
    """Two or three loads at once on a body about a fixed point."""
    draw.body(draw.moments(), draw.direction() * draw.between(0.2, 1))
    draw.start(draw.direction() * draw.between(0.5, 3))
    size = draw.mass * draw.length**2 / draw.time**2
    draw.gravity(draw.decades(-2, 0))
    if draw.sometimes(0.7):
        unit = size * draw.time * draw.decades(-4, -1)
        draw.load("viscous_torque", f"coefficients = {[unit * draw.between(0.3, 1) for _ in range(3)]}")
    if draw.sometimes(0.7):
        draw.parameters += [
            f"k = {size * draw.decades(-3, -0.5)!r}",
            f"n = {draw.between(0.1, 2) / draw.time!r}",
        ]
        frame = "body" if draw.sometimes(0.5) else "space"
        draw.load("torque", 'components = ["k*sin(n*t)", "0.5*k", "-k*cos(n*t)^2"]', f'frame = "{frame}"')


def _close_pass(draw: Draw) -> None:
    """Six degrees of freedom past a close pericentre."""
    draw.body(draw.moments(), turned=draw.sometimes(0.5))
    eccentricity = 1 - draw.decades(-2, -0.5)
    far = draw.between(3, 30) * 2 / (1 - eccentricity)  # from 3 lengths on at the pericentre
    speed = math.sqrt((1 - eccentricity) / far)
    tilt = draw.between(0, 3)
    draw.fly(draw.direction() * draw.between(0.02, 1) * far**-1.5, far, speed, tilt, 1.0)
    draw.time_scale = far**1.5


def _attractors(draw: Draw) -> None:
    """Six degrees of freedom between two or three attractors."""
    draw.body(draw.moments())
    count = 2 + draw.sometimes(0.5)
    far = 30.0
    angle = draw.between(0, 6)
    speed = math.sqrt(count / far) * draw.between(0.8, 1.1)
    draw.start(
        draw.direction() * 0.05,
        position=[far * math.cos(angle), far * math.sin(angle), draw.between(-3, 3)],
        velocity=[-speed * math.sin(angle), speed * math.cos(angle), 0.0],
    )
    draw.time_scale = far**1.5
    for n in range(count):
        place = [4 * math.cos(2 * math.pi * n / count), 4 * math.sin(2 * math.pi * n / count), 0.0]
        draw.load(
            "central_gravity",
            f"gravitational_parameter = {draw.length**3 / draw.time**2!r}",
            f"position = {[float(x * draw.length) for x in place]}",
        )


def _pushed_flight(draw: Draw) -> None:
    """Six degrees of freedom under gravity and a force that depends on the motion."""
    draw.body(draw.moments())
    draw.start(draw.direction(), position=draw.direction(), velocity=draw.direction())
    draw.gravity(draw.decades(-2, 0))
    drag = draw.mass / draw.time * draw.decades(-3, -1)
    draw.parameters += [f"c = {drag!r}"]
    draw.load("force", 'components = ["-c*vx", "-c*vy", "-c*vz"]', 'frame = "space"')


def _long_regular(draw: Draw) -> None:
    """Spin near an outer axis, damped or driven a little or not at all: nothing amplifies but time."""
    moments = np.sort(draw.moments())
    draw.body(moments)
    draw.start([draw.decades(-4, -1), draw.decades(-4, -1), 1.0])
    if draw.sometimes(0.5):
        size = draw.mass * draw.length**2 / draw.time * draw.decades(-9, -7)
        draw.load("viscous_torque", f"coefficients = {[size * m for m in (1.0, 2.0, 1.5)]}")


def _kink(draw: Draw) -> None:
    """One axis, a torque with a kink in time or in the rate, written as a root; exact solutions exist."""
    moment = 1.0
    draw.body([moment, moment, moment])
    size = draw.mass * draw.length**2
    rate = draw.between(0.5, 2)
    if draw.sometimes(0.5):
        late = draw.between(1, 8) * draw.time
        draw.start([0, 0, rate])
        draw.parameters += [f"k = {size / draw.time**3 * draw.decades(-2, 0)!r}", f"late = {late!r}"]
        draw.load("torque", 'components = ["0", "0", "k*sqrt((t-late)^2)"]')
    else:
        draw.start([rate, 0, 0])
        draw.parameters += [f"k = {size / draw.time**2 * draw.decades(-2, -0.5)!r}", f"n = {1 / draw.time!r}"]
        draw.load("torque", 'components = ["-k*sqrt((wx-0.3*n)^2)/n", "0", "0"]')


def _switching(draw: Draw) -> None:
    """Kinks and jumps that a tumbling body comes to again and again."""
    draw.body(draw.moments())
    draw.start(draw.direction())
    size = draw.mass * draw.length**2 / draw.time**2
    draw.parameters += [f"k = {size * draw.decades(-3, -1)!r}", f"n = {1 / draw.time!r}"]
    torques = [
        '["-k*abs(wx)*wx/n^2", "-k*abs(wy)*wy/n^2", "-k*abs(wz)*wz/n^2"]',
        '["-k*sign(wx)", "0", "-0.5*k*sign(wz)"]',
        '["k*max(qx*qw, 0)", "k*min(wy/n, 0.2)", "0"]',
        '["0", "k*abs(sin(n*t))", "k*sqrt((wx-0.1*n)^2)/n"]',
    ]
    draw.load("torque", f"components = {draw.random.choice(torques)}")


def _signed(draw: Draw) -> None:
    """Loads that would be odd in the quaternion, but for a sign or a product."""
    draw.body(draw.moments())
    draw.start(draw.direction())
    draw.parameters += [f"k = {draw.mass * draw.length**2 / draw.time**2 * draw.decades(-2, -0.3)!r}"]
    torques = [
        '["k*qx*qw", "0", "0.4*k*qw^2"]',
        '["k*sign(qw)*qx", "0", "0.4*k*abs(qw)"]',
        '["k*qx", "0", "0.4*k*qw"]',
    ]
    draw.load("torque", f"components = {draw.random.choice(torques)}")


def _ephemeris(draw: Draw) -> None:
    """The Sun, the Moon or both by their series, over years, at any epoch: a time of 1e9 s is rounded."""
    draw.time = 86400 * draw.decades(0.3, 1)
    draw.body(draw.moments())
    draw.start(draw.direction() * draw.between(0.5, 1.5))
    distances = {"sun": 149597870700, "moon": 384400000}
    chosen = draw.random.choice(["sun", "moon", "both"])
    for body in distances if chosen == "both" else (str(chosen),):
        strength = (draw.decades(-1.5, -0.3) / draw.time) ** 2 * distances[body] ** 3
        draw.load(
            "gravity_gradient", f'ephemeris = "{body}"', f"gravitational_parameter = {float(strength)!r}"
        )


FAMILIES: dict[str, Family] = {
    "central gravity": Family(KINDS["central gravity"], (1.0, 3.0)),
    "eccentric orbit": Family(_eccentric, (1.3, 3.5)),
    "slow body, quick orbit": Family(_slow_body, (1.5, 4.0)),
    "late instability": Family(_late_instability, (1.5, 3.7)),
    "several loads": Family(_several, (1.0, 2.7)),
    "close pass": Family(_close_pass, (0.3, 1.7)),
    "several attractors": Family(_attractors, (0.3, 1.7)),
    "pushed flight": Family(_pushed_flight, (1.0, 3.0)),
    "long, regular": Family(_long_regular, (3.0, 5.0), canonical=False),
    "free body": Family(KINDS["asymmetric"], (1.0, 4.3)),
    "free, near separatrix": Family(KINDS["near separatrix"], (1.0, 3.5)),
    "heavy symmetric top": Family(KINDS["heavy symmetric top"], (1.0, 3.7)),
    "heavy asymmetric top": Family(KINDS["heavy asymmetric top"], (1.0, 2.7)),
    "circular orbit": Family(KINDS["circular orbit"], (1.0, 3.3)),
    "torque in time": Family(KINDS["torque, space axes"], (1.0, 3.3)),
    "late pulse": Family(KINDS["late pulse"], (1.0, 3.3)),
    "kink": Family(_kink, (1.0, 1.5)),
    "switching": Family(_switching, (1.0, 2.3)),
    "odd load": Family(_signed, (1.0, 2.3)),
    HYPERBOLIC: Family(hyperbolic_average, (0.18, 0.9), averaged=True),
    "late switch": Family(switch, (2.0, 4.0), finish=put_late),
    "late spike": Family(spike, (2.0, 4.0), finish=put_late),
    "gyrostat": Family(carried.gyrostat, (1.0, 3.0), canonical=False),
    "states and laws": Family(carried.laws, (1.0, 3.0), canonical=False),
    "long ephemeris": Family(_ephemeris, (1.5, 2.7), epochs=(1950, 2100)),
    "heavy gyrostat": Family(carried.heavy_gyrostat, (1.0, 2.7), canonical=False),
    "gyrostat in flight": Family(carried.gyrostat_in_flight, (1.0, 2.7), canonical=False),
    "controller": Family(carried.controller, (1.0, 2.5), canonical=False),
    "filter": Family(carried.lagging, (1.0, 3.0), canonical=False),
    "slosh": Family(carried.slosh, (1.0, 3.0), canonical=False),
    "moving mass": Family(carried.moving_mass, (1.0, 2.3), canonical=False),
    "B-dot": Family(carried.magnetic, (1.0, 2.5), canonical=False),
    "shadow": Family(known.shadow, (1.0, 2.3), canonical=False),
    "air": Family(known.air, (1.0, 2.5), canonical=False),
    "names on a table": Family(known.table, (1.0, 2.5), finish=known.write_table, canonical=False),
    "names of point masses": Family(known.moving_bodies, (1.0, 2.5), canonical=False),
    "jet damping": Family(known.jet, (1.0, 2.3), canonical=False),
    "fluid core": Family(carried.fluid_core, (1.0, 3.0), canonical=False),
    "gravity field": Family(fields.gravity_field, (1.0, 3.0)),
    "gravity field in flight": Family(fields.gravity_field_in_flight, (0.3, 2.0)),
    "bodies of a kernel": Family(real_bodies.kernel, (1.0, 2.0), epochs=(1950, 2100), canonical=False),
    "elastic body": Family(real_bodies.elastic, (1.0, 3.0), canonical=False),
    "light on plates": Family(satellites.light, (1.0, 2.5), canonical=False),
    "plates in air": Family(satellites.plates_in_air, (0.3, 1.7), canonical=False),
    "eddy currents": Family(satellites.eddy_currents, (1.0, 3.0), canonical=False),
    "field of the attractor": Family(satellites.attractor, (0.3, 2.0), canonical=False),
    "pairs": Family(pairs.pair, (1.0, 2.7), canonical=False),
    DEEP_TIME: Family(deep_time.precession, (3.0, 5.0), finish=deep_time.write_orbit),
}
"""By the name under which the table shows them."""


def coverage_scene(number: int, seed: int = 1, name: str = "") -> CoverageScene:
    """Scene ``number`` of a seed, of a family by ``name`` or of the one whose turn it is."""
    name = name or list(FAMILIES)[number % len(FAMILIES)]
    family = FAMILIES[name]
    draw = Draw(np.random.default_rng([7, seed, number]))
    family.draw(draw)
    radians = draw.decades(*family.radians)
    end = radians * draw.time * draw.time_scale
    if name == "late pulse":
        draw.parameters.append(f"late = {end * draw.between(0.5, 0.95)!r}")
    if family.finish is not None:
        family.finish(draw, end)
    span = [f"end = {end!r}", f"samples = {SAMPLES}"]
    if family.epochs is not None:
        span.append(f'epoch = "{draw.random.integers(*family.epochs)}-01-01T12:00:00 TDB"')
    formulation = str(draw.random.choice(_FORMULATIONS))
    if formulation == "canonical" and not family.canonical:
        formulation = "quaternion"
    integrator = [f'formulation = "{formulation}"']
    kind = draw.random.random()
    if kind < 0.1:
        integrator.append('precision = "single"')
    elif kind < 0.18 and radians < 300:
        integrator.append('precision = "extended"')
    elif kind < 0.35:
        integrator.append(f"tolerance = {draw.decades(-13, -7):.3g}")
    elif kind < 0.43:
        integrator.append("hold_invariants = true")
    if name == DEEP_TIME:  # which brings its states, and holds none
        integrator = [x for x in integrator[1:] if "hold" not in x] or ['precision = "double"']
    if family.averaged:
        integrator = []
    text = draw.text(f"coverage{number}", span, integrator)
    return CoverageScene(number, name, text, radians)
