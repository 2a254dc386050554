"""Powers of two that bring every quantity of a scene to O(1), so that scaling never rounds anything.

heyoka's step control is absolute below 1 and relative to the largest component above: a spin of 1e-6 rad/s
or a component dwarfed by another loses digits. Inside the equations time, inertia, length and each state
are therefore measured in a unit of their own; results are multiplied back, exactly, when they are stored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.model.ephemeris import MEAN_DISTANCE
from rigidsim.scene.context import cross, dot, norm
from rigidsim.scene.loads import CentralGravity, GravityGradient
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class Drive:
    """What loads of unknown size are estimated to add to the motion (see ``rigidsim.model.drive``), mpf.

    Attributes:
        energy: of rotation, J.
        speed: of the centre of mass, m/s.
    """

    energy: Any
    speed: Any


@dataclass(frozen=True)
class Scaling:
    """Binary exponents of the internal units, in SI: one internal unit of time is ``2**time`` seconds.

    Attributes:
        time, inertia, length, speed: exponents.
        rates: exponents of the three body rates relative to ``1 / (unit of time)``.
        drive: what went into them for loads of unknown size, or None.
    """

    time: int
    inertia: int
    rates: tuple[int, int, int]
    length: int = 0
    speed: int = 0
    drive: Drive | None = None

    @property
    def momentum(self) -> int:
        """Exponent of the internal unit of angular momentum, kg m^2/s."""
        return self.inertia - self.time

    @property
    def energy(self) -> int:
        """Exponent of the internal unit of energy, J."""
        return self.inertia - 2 * self.time


# A component is given a unit of its own only where it stays this far below the fastest one: within this
# factor step control sees it well enough, and the equations stay the simplest.
_WORTH_A_UNIT = 4  # bits


def exponent(context: Any, value: Any) -> int:
    """The smallest e with abs(value) <= 2**e; zero for zero."""
    if value == 0:
        return 0
    mantissa, power = context.frexp(abs(value))
    return int(power) - 1 if mantissa == 0.5 else int(power)


def largest_rates(scene: Scene, drive: Drive | None = None) -> list[Any]:
    """Upper bounds of the absolute body rates over the whole motion, from energy and momentum, rad/s.

    For a free body in principal axes both 2 E I_max - L^2 and L^2 - 2 E I_min are sums of squares with
    positive weights, so each bounds two rates and the smaller bound is sharp (Landau & Lifshitz, section 37).
    Otherwise |w_i| <= sqrt(2 E_kin,max (I^-1)_ii).

    Args:
        drive: of loads whose size the scene doesn't know.
    """
    context, body, w = scene.context, scene.body, scene.angular_velocity
    inertia, inverse = body.inertia, scene.inverse_inertia
    zero = context.zero
    weighted = [dot(row, w) for row in inertia]
    twice_energy = dot(w, weighted)
    swing = 4 * potential_amplitude(scene)
    if scene.loads or drive is not None:  # an orbit feeds it: a bound for the body carried along with it
        carried = orbital_rate(scene)
        fed = context.sqrt(max(twice_energy, zero) + swing + 4 * tidal_amplitude(scene))
        if drive is not None:
            fed += context.sqrt(2 * drive.energy)
        return [fed * context.sqrt(inverse[i][i]) + carried for i in range(3)]
    diagonal = all(inertia[i][j] == 0 for i in range(3) for j in range(3) if i != j)
    axis = symmetry_axis(scene) if diagonal else None
    if swing != 0 and axis is not None:
        # the spin about the symmetry axis is constant and its energy can't feed the other two
        transverse = sum((inertia[i][i] * w[i] ** 2 for i in range(3) if i != axis), zero) + swing
        return [abs(w[i]) if i == axis else context.sqrt(transverse * inverse[i][i]) for i in range(3)]
    bounds = [context.sqrt((twice_energy + swing) * inverse[i][i]) for i in range(3)]
    if swing != 0 or not diagonal:
        return bounds
    moments = [inertia[i][i] for i in range(3)]
    for extreme in (max(moments), min(moments)):
        invariant = sum((m * abs(extreme - m) * x**2 for m, x in zip(moments, w, strict=True)), zero)
        for i, moment in enumerate(moments):
            if moment != extreme and moment != 0:
                bound = context.sqrt(invariant / (moment * abs(extreme - moment)))
                bounds[i] = min(bounds[i], bound)
    return bounds


def symmetry_axis(scene: Scene) -> int | None:
    """The body axis about which a diagonal tensor is symmetric and on which the centre of mass lies."""
    inertia, center = scene.body.inertia, scene.body.center_of_mass
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        if inertia[j][j] == inertia[k][k] and center[j] == 0 and center[k] == 0:
            return axis
    return None


def potential_amplitude(scene: Scene) -> Any:
    """M g l: half the range of the potential energy about a fixed point, J; zero without a torque."""
    arm = scene.torque_arm
    if arm is None:
        return scene.context.zero
    assert scene.gravity is not None
    return norm(scene.context, arm) * norm(scene.context, scene.gravity)


def tidal_amplitude(scene: Scene) -> Any:
    """(3/2) (G M / R^3) (I_max - I_min) summed over the attracting bodies at their nearest, J."""
    context, moments = scene.context, scene.body.principal_moments
    spread = max(moments) - min(moments)
    total = context.zero
    for load in scene.loads:
        if isinstance(load, GravityGradient):
            if load.ephemeris is not None:
                distance = context.mpf(MEAN_DISTANCE[load.ephemeris])
            elif load.orbit is None:
                distance = norm(context, load.position or [])
            else:
                distance = load.orbit.semi_major_axis * (1 - load.orbit.eccentricity)
        elif isinstance(load, CentralGravity):
            distance = nearest_approach(scene, load)
        else:
            continue
        total += 3 * load.gravitational_parameter / distance**3 * spread / 2
    return total


def orbital_rate(scene: Scene) -> Any:
    """Fastest angular rate of any attracting body seen from the body, rad/s; zero without one."""
    context = scene.context
    fastest = context.zero
    for load in scene.loads:
        if isinstance(load, GravityGradient) and load.orbit is not None:
            e = load.orbit.eccentricity
            fastest = max(fastest, abs(load.orbit.mean_motion) * context.sqrt(1 - e * e) / (1 - e) ** 2)
        elif isinstance(load, CentralGravity):
            nearest = nearest_approach(scene, load)
            offset, _speed = _relative(scene, load)
            momentum = norm(context, cross(offset, scene.velocity)) if scene.velocity else context.zero
            fastest = max(fastest, momentum / nearest**2)
    return fastest


def _relative(scene: Scene, load: CentralGravity) -> tuple[list[Any], Any]:
    assert scene.position is not None
    assert scene.velocity is not None
    offset = [x - a for x, a in zip(scene.position, load.position, strict=True)]
    return offset, norm(scene.context, scene.velocity)


def nearest_approach(scene: Scene, load: CentralGravity) -> Any:
    """Pericentre distance of the Kepler orbit through the initial state, m (at least a thousandth of the
    initial distance, since a scale must not vanish for a plunging orbit).
    """
    context = scene.context
    offset, speed = _relative(scene, load)
    distance = norm(context, offset)
    momentum = norm(context, cross(offset, scene.velocity or offset))
    energy = speed**2 / 2 - load.gravitational_parameter / distance
    strength = load.gravitational_parameter
    e = context.sqrt(max(1 + 2 * energy * momentum**2 / strength**2, context.zero))
    pericentre = momentum**2 / strength / (1 + e)
    return max(min(pericentre, distance), distance / 1000)


def _flight_scales(scene: Scene, drive: Drive | None) -> tuple[Any, Any]:
    """Largest distance from the origin (m) and speed (m/s) to be expected."""
    context = scene.context
    assert scene.position is not None
    assert scene.velocity is not None
    horizon = scene.end - scene.start
    fed = context.zero if drive is None else drive.speed
    central = [load for load in scene.loads if isinstance(load, CentralGravity)]
    if len(central) == 1 and scene.gravity is None:
        load = central[0]
        offset, speed = _relative(scene, load)
        distance = norm(context, offset)
        energy = speed**2 / 2 - load.gravitational_parameter / distance
        nearest = nearest_approach(scene, load)
        swiftest = context.sqrt(2 * abs(energy + load.gravitational_parameter / nearest))
        if energy < 0:
            farthest = load.gravitational_parameter / -energy  # twice the semi-major axis
            reach = min(farthest, distance + swiftest * horizon) + fed * horizon
            return norm(context, load.position) + reach, swiftest + fed
        return norm(context, scene.position) + (swiftest + fed) * horizon, swiftest + fed
    pull = norm(context, scene.gravity) if scene.gravity is not None else context.zero
    swiftest = norm(context, scene.velocity) + pull * horizon + fed
    return norm(context, scene.position) + swiftest * horizon, swiftest


def choose_scaling(scene: Scene, drive: Drive | None = None) -> Scaling:
    """The units of a scene; a pure function of it, so that the same config gives the same bits."""
    context, body = scene.context, scene.body
    bounds = largest_rates(scene, drive)
    fastest = max(bounds)
    potential = potential_amplitude(scene)
    if potential != 0:
        smallest = min(m for m in body.principal_moments if m != 0)
        axial = symmetry_axis(scene)
        swing_moment = smallest
        if axial is not None and all(body.inertia[i][j] == 0 for i in range(3) for j in range(3) if i != j):
            swing_moment = body.inertia[(axial + 1) % 3][(axial + 1) % 3]
        fastest = max(fastest, context.sqrt(potential / swing_moment))
    fastest = max(fastest, orbital_rate(scene))
    time = -exponent(context, fastest)
    if fastest == 0:  # at rest for good: any unit will do, the horizon is the natural one
        time = exponent(context, scene.end - scene.start)
    rates = []
    for bound in bounds:
        relative = exponent(context, bound) + time if bound != 0 else 0
        rates.append(relative if abs(relative) >= _WORTH_A_UNIT else 0)
    length = speed = 0
    if scene.position is not None and scene.velocity is not None:
        farthest, swiftest = _flight_scales(scene, drive)
        length, speed = exponent(context, farthest), exponent(context, swiftest)
    return Scaling(
        time=time,
        inertia=exponent(context, max(body.principal_moments)),
        rates=(rates[0], rates[1], rates[2]),
        length=length,
        speed=speed,
        drive=drive,
    )
