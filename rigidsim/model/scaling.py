"""Scaling by powers of two that brings every quantity of a scene to O(1) without rounding.

heyoka's step control is absolute below 1 and relative to the largest component above: a spin of 1e-6 rad/s
or a component dwarfed by another loses digits. Inside the equations time, inertia, length and each state
are therefore measured in separate units; results are multiplied back, exactly, when they are stored.
Every coefficient is worked out in the scene's arithmetic (mpmath with guard bits) and rounded once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, norm
from rigidsim.scene.scene import Scene

Rounder = Callable[[Any], Any]
"""Rounds an mpf once to the working precision's scalar."""


@dataclass(frozen=True)
class EstimatedEffect:
    """Estimated effect of loads of unknown size (see ``rigidsim.model.load_estimate``), mpf."""

    energy: Any  # added energy of rotation, J
    speed: Any  # added speed of the centre of mass, m/s


@dataclass(frozen=True)
class Scaling:
    """Binary exponents of the internal units, in SI: one internal unit of time is ``2**time`` seconds.

    The model is written in the time of the scene; ``System`` hands its equations on in internal time.
    """

    time: int
    inertia: int
    rates: tuple[int, int, int]  # relative to 1 / (unit of time)
    length: int = 0
    speed: int = 0
    drive: EstimatedEffect | None = None  # the estimate used for loads of unknown size
    own: Mapping[str, int] = field(default_factory=dict)  # of user-defined states
    direction: int = 1  # of internal time: -1 in a run that goes backwards

    def internal(self, seconds: Any, context: Any) -> Any:
        """A time of the scene (mpf, s) as internal time, which grows along every run."""
        return context.ldexp(self.direction * seconds, -self.time)

    def seconds(self, internal: Any) -> Any:
        """The time of the scene, s, of an internal time (float64 or an array)."""
        return self.direction * np.ldexp(internal, self.time)

    @property
    def momentum(self) -> int:
        """Exponent of the internal unit of angular momentum, kg m^2/s."""
        return self.inertia - self.time

    @property
    def energy(self) -> int:
        """Exponent of the internal unit of energy, J."""
        return self.inertia - 2 * self.time


# A component is given a separate unit only where it stays this far below the fastest one: within this
# factor step control sees it well enough, and the equations stay the simplest.
_WORTH_A_UNIT = 4  # bits


def exponent(context: Any, value: Any) -> int:
    """The smallest e with abs(value) <= 2**e; zero for zero."""
    if value == 0:
        return 0
    return 1 - context.frexp(1 / value)[1]


def largest_rates(scene: Scene, drive: EstimatedEffect | None = None) -> list[Any]:
    """Upper bounds of the absolute body rates over the whole motion from energy and momentum (mpf, rad/s).

    For a free body in principal axes both 2 E I_max - L^2 and L^2 - 2 E I_min are sums of squares with
    positive weights, so each bounds two rates and the smaller bound is sharp (Landau & Lifshitz, section 37).
    Otherwise |w_i| <= sqrt(2 E_kin,max (I^-1)_ii).
    """
    context, w = scene.context, scene.angular_velocity
    inertia, inverse = scene.turning_inertia, scene.inverse_inertia
    zero = context.zero
    weighted = [dot(row, w) for row in inertia]
    twice_energy = dot(w, weighted)
    swing = 4 * potential_amplitude(scene)
    if scene.loads or drive is not None:  # an orbit feeds energy in: bound carried along with it
        carried = source_rate(scene)
        fed = context.sqrt(context.maximum([twice_energy, zero]) + swing + 4 * loads_amplitude(scene))
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
                bounds[i] = context.minimum([bounds[i], bound])
    return bounds


def symmetry_axis(scene: Scene) -> int | None:
    """Body axis of symmetry of a diagonal tensor on which the centre of mass lies; None without one."""
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


def loads_amplitude(scene: Scene) -> Any:
    """Largest change of the energy of rotation, J, by all loads of known size except uniform gravity."""
    known = [load.amplitude(scene) for load in scene.loads]
    return sum((size for size in known if size is not None), scene.context.zero)


def source_rate(scene: Scene) -> Any:
    """Fastest angular rate of any source seen from the body, rad/s; zero without one."""
    rates = [load.fastest_rate(scene) for load in scene.loads]
    return scene.context.maximum([scene.context.zero, *rates])


def gyroscopic_rate(scene: Scene) -> Any:
    """Upper bound of the rate at which the momenta that the body carries make it nutate, rad/s.

    For a single one I w' = h x w: the other two eigenvalues of I^-1 [h]x are +-i sqrt(h . I h / det I).
    """
    context, inertia = scene.context, scene.turning_inertia
    total = context.zero
    for load in scene.loads:
        if (h := load.gyroscopic_momentum(scene)) is not None:
            volume = dot(inertia[0], cross(inertia[1], inertia[2]))
            total += context.sqrt(dot(h, [dot(row, h) for row in inertia]) / volume)
    return total


def _flight_scales(scene: Scene, drive: EstimatedEffect | None) -> tuple[Any, Any]:
    """Expected largest distance from the origin (m) and speed (m/s)."""
    context = scene.context
    assert scene.position is not None
    assert scene.velocity is not None
    fed = context.zero if drive is None else drive.speed
    bounds = [found for load in scene.loads if (found := load.flight_bounds(scene, fed)) is not None]
    if len(bounds) == 1 and scene.gravity is None:
        return bounds[0]
    horizon = scene.duration
    pull = norm(context, scene.gravity) if scene.gravity is not None else context.zero
    swiftest = norm(context, scene.velocity) + pull * horizon + fed
    return norm(context, scene.position) + swiftest * horizon, swiftest


def _point_mass_scales(scene: Scene) -> tuple[Any, Any]:
    """Largest distance from the origin (m) and speed (m/s) of point masses and body at the start."""
    context, masses = scene.context, scene.bodies
    assert masses is not None
    places, speeds = list(masses.positions), list(masses.velocities)
    if scene.position is not None and scene.velocity is not None:
        places.append(scene.position)
        speeds.append(scene.velocity)
    farthest, swiftest = ([norm(context, x) for x in vectors] for vectors in (places, speeds))
    return context.maximum(farthest), context.maximum(swiftest)


def choose_scaling(scene: Scene, drive: EstimatedEffect | None = None) -> Scaling:
    """The units of a scene; a pure function of it, so that the same config gives the same bits."""
    context, body = scene.context, scene.body
    bounds = largest_rates(scene, drive)
    fastest = context.maximum(bounds)
    potential = potential_amplitude(scene)
    if potential != 0:
        smallest = context.minimum(m for m in body.principal_moments if m != 0)
        axial = symmetry_axis(scene)
        swing_moment = smallest
        if axial is not None and all(body.inertia[i][j] == 0 for i in range(3) for j in range(3) if i != j):
            swing_moment = body.inertia[(axial + 1) % 3][(axial + 1) % 3]
        fastest = context.maximum([fastest, context.sqrt(potential / swing_moment)])
    masses, count = scene.bodies, range(0 if scene.bodies is None else len(scene.bodies.names))
    met = [masses.encounter(context, i, j)[1] for i in count for j in count if i < j] if masses else []
    fastest = context.maximum([fastest, source_rate(scene), gyroscopic_rate(scene), *met])
    time = -exponent(context, fastest)
    if fastest == 0:  # at rest for good: any unit will do, the horizon is the natural one
        time = exponent(context, scene.duration)
    rates = []
    for bound in bounds:
        relative = exponent(context, bound) + time if bound != 0 else 0
        rates.append(relative if abs(relative) >= _WORTH_A_UNIT else 0)
    flight: tuple[Any, Any] = 0, 0
    if scene.bodies is not None:
        flight = _point_mass_scales(scene)
    elif scene.position is not None and scene.velocity is not None:
        flight = _flight_scales(scene, drive)
    length, speed = (exponent(context, size) for size in flight)
    inertia = exponent(context, max(body.principal_moments))
    direction = scene.samples.direction
    return Scaling(time, inertia, (rates[0], rates[1], rates[2]), length, speed, drive, direction=direction)


# --- the scene's constants ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class ScaledNumbers:
    """The scene's constants in internal units (see ``Scaling``), as mpf."""

    inertia: Matrix  # of the mass distribution
    turning_inertia: Matrix  # of what turns with the body, see ``Scene``
    inverse_inertia: Matrix  # of that
    rate_units: Vector
    arm: Vector | None  # M com |g|, body axes: potential energy is arm . vertical; None without a torque
    up: Vector | None  # unit vector against gravity, space axes; None without gravity

    def vertical_of(self, matrix: SymbolicMatrix, number: Rounder) -> list[Symbolic]:
        """Unit vector against gravity in body axes, R^T up."""
        assert self.up is not None
        terms = [[number(u) * matrix[i][k] for i, u in enumerate(self.up) if u != 0] for k in range(3)]
        return [hy.sum(column) for column in terms]


def scaled_numbers(scene: Scene, scaling: Scaling) -> ScaledNumbers:
    """Bring the scene's constants to internal units; powers of two only, so nothing is rounded."""
    context, up, arm = scene.context, None, None
    strength = context.zero if scene.gravity is None else norm(context, scene.gravity)
    if scene.gravity is not None and any(g != 0 for g in scene.gravity):
        up = [-g / strength for g in scene.gravity]
    if scene.torque_arm is not None:
        arm = [context.ldexp(a * strength, -scaling.energy) for a in scene.torque_arm]
    return ScaledNumbers(
        [[context.ldexp(x, -scaling.inertia) for x in row] for row in scene.body.inertia],
        [[context.ldexp(x, -scaling.inertia) for x in row] for row in scene.turning_inertia],
        [[context.ldexp(x, scaling.inertia) for x in row] for row in scene.inverse_inertia],
        [context.ldexp(context.one, e) for e in scaling.rates],
        arm,
        up,
    )
