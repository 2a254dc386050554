"""A scene's closed-form solution, and the states that it gives at any time.

The cost of a state doesn't depend on its time, and nor does its accuracy: frequencies are known to three
times the scene's digits and turns are counted exactly, so that a run is right to rounding at any horizon.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import mpmath
import numpy as np

from rigidsim.model.scaling import Scaling, choose_scaling
from rigidsim.model.system import System
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, negligible, norm
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form.arithmetic import Arithmetic, Digits, Doubles, Motion, NoClosedForm, two_sum
from rigidsim.solve.closed_form.free import free_motion, spinning
from rigidsim.solve.closed_form.heavy import heavy_motion, perpendicular_axes
from rigidsim.solve.precision import Precision, Scalar


def choose_motion(context: mpmath.MPContext, scene: Scene, scaling: Scaling) -> Motion:
    """Closed-form rotation of a scene without loads, or with uniform gravity alone, in the units of a
    scaling; the context has at least twice the scene's digits.

    Raises:
        NoClosedForm: no closed form is known for the motion.
    """

    def wide(vector: Vector, exponent: int = 0) -> Vector:
        return [context.ldexp(context.mpf(x), exponent) for x in vector]

    body = scene.body
    moments = wide(body.principal_moments, -scaling.inertia)
    axes = [wide(axis) for axis in body.principal_axes]
    rates = wide(scene.angular_velocity, scaling.time)
    # residue of a zero after the scene's own rounding
    tiny = context.mpf(negligible(scene.context))
    if scene.torque_arm is None:
        return free_motion(context, moments, axes, rates, tiny)
    assert scene.gravity is not None
    arm, gravity = wide(scene.torque_arm), wide(scene.gravity)
    strength = norm(context, gravity)
    pull = context.ldexp(norm(context, arm) * strength, -scaling.energy)
    frame = _top_frame(context, moments, axes, arm, tiny)
    if frame is None:
        raise NoClosedForm(
            "a heavy top without two equal moments, or with its centre of mass off its symmetry axis, has no "
            "closed form here",
        )
    frame_axes, across, along = frame
    matrix = attitude.rotation_matrix(attitude.unit_quaternion(context, wide(scene.quaternion)))
    vertical = [-dot([row[i] for row in matrix], gravity) / strength for i in range(3)]
    components = [dot(axis, rates) for axis in frame_axes]
    level = [dot(axis, vertical) for axis in frame_axes[:2]]
    fastest = max(context.sqrt(pull / across), norm(context, rates))
    if norm(context, level) <= tiny and norm(context, components[:2]) <= tiny * fastest:
        return spinning(context, frame_axes, components[2])
    return heavy_motion(context, frame_axes, (across, along), pull, rates, vertical)


def _top_frame(
    context: mpmath.MPContext, moments: Vector, axes: Matrix, arm: Vector, tiny: mpmath.mpf
) -> tuple[Matrix, mpmath.mpf, mpmath.mpf] | None:
    """Axes with the third along the arm, and moments across and along; None for no such symmetry."""
    length = norm(context, arm)
    third = [x / length for x in arm]
    largest = max(moments)
    alike = [abs(moments[(i + 1) % 3] - moments[(i + 2) % 3]) <= tiny * largest for i in range(3)]
    along = [i for i in range(3) if alike[i] and norm(context, cross(third, axes[i])) <= tiny]
    if along:
        k = along[0]
        i, j = (k + 1) % 3, (k + 2) % 3
        across = (moments[i] + moments[j]) / 2
        if dot(axes[k], third) > 0:
            return [axes[i], axes[j], axes[k]], across, moments[k]
        return [axes[j], axes[i], [-x for x in axes[k]]], across, moments[k]
    if all(alike):
        return perpendicular_axes(context, third), moments[0], moments[0]
    return None


_GUARD_BITS = 40  # guard bits of an evaluation beyond double, for its own rounding


@dataclass(frozen=True)
class ClosedForm:
    """Closed-form solution of a scene, forwards or backwards from its start."""

    method: ClassVar[str] = "closed_form"
    scene: Scene
    motion: Motion  # rotation of the body about its reference point, internal units of time
    scaling: Scaling
    before: Vector  # quaternions from the motion's fixed frame to space, and body axes to its own
    after: Vector

    @property
    def title(self) -> str:
        """Name of the solution, for plans and summaries."""
        return self.motion.title + ("; parabola of the centre of mass" if self.scene.free_flight else "")

    def states(self, system: System, precision: Precision, times: np.ndarray, start: Scalar) -> np.ndarray:
        """States (n, states) at times (n,) in the precision, internal units, of a system of this scene in the
        formulation "quaternion" or "rates". Double and single are evaluated in arrays of doubles, other
        precisions number by number in mpmath.

        Raises:
            ValueError: the system has states that no closed form gives.
        """
        if precision.narrow:
            # the difference of two doubles is a pair, exactly
            way = float(self.scaling.direction)
            elapsed = two_sum(way * np.asarray(times, dtype=np.float64), -way * float(start))
            columns = self._columns(Doubles(), elapsed, system)
            return np.stack(columns, axis=1).astype(precision.scalar)
        begin = precision.exact(start)
        known: dict[int, Digits] = {}
        result = np.empty((len(times), len(system.states)), dtype=precision.scalar)
        for n, time in enumerate(times):
            # by the sample's own time, so that no bit depends on which samples are evaluated together
            exact = precision.exact(time)
            late = _phase_bits(exact - begin)
            if late not in known:
                known[late] = Digits(self._context(precision.bits, late))
            arithmetic = known[late]
            elapsed = self.scaling.direction * (arithmetic.number(exact) - arithmetic.number(begin))
            row = self._columns(arithmetic, elapsed, system)
            result[n] = [precision.number(x) for x in row]
        return result

    def rates_and_quaternions(self, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity (n, 3), body axes, rad/s, and quaternion (n, 4), body to space, as doubles."""
        high = np.ldexp(np.asarray(seconds, dtype=np.float64), -self.scaling.time)
        rates, quaternion = self._turned(Doubles(), (high, np.zeros_like(high)))
        return np.ldexp(np.stack(rates, axis=1), -self.scaling.time), np.stack(quaternion, axis=1)

    def exactly(self, seconds: mpmath.mpf, digits: int) -> tuple[Vector, Vector]:
        """Angular velocity and quaternion in mpmath, correct in so many digits of the largest rate."""
        elapsed = mpmath.ldexp(seconds, -self.scaling.time)
        arithmetic = Digits(self._context(math.ceil(digits * math.log2(10)), _phase_bits(elapsed)))
        rates, quaternion = self._turned(arithmetic, arithmetic.number(seconds) * 2**-self.scaling.time)
        return [mpmath.ldexp(w, -self.scaling.time) for w in rates], quaternion

    def _context(self, bits: int, late: int) -> mpmath.MPContext:
        """Context with enough bits, the bits of a phase included."""
        context = mpmath.MPContext()
        context.prec = bits + _GUARD_BITS + late
        return context

    def _turned(self, arithmetic: Arithmetic, time: Any) -> tuple[Vector, Vector]:
        """Rates in body axes, and the quaternion from body axes to space, from the motion's own frame."""
        number = arithmetic.number
        own, relative = self.motion.at(arithmetic, time)
        columns = zip(*self.motion.axes, strict=True)
        rates = [
            dot(
                [number(x) for x in column if x != 0], [w for x, w in zip(column, own, strict=True) if x != 0]
            )
            for column in columns
        ]
        before, after = ([number(x) for x in q] for q in (self.before, self.after))
        return rates, attitude.product(attitude.product(before, relative), after)

    def _columns(self, arithmetic: Arithmetic, time: Any, system: System) -> list[Any]:
        scene, number = self.scene, arithmetic.number
        context = scene.context
        rates, quaternion = self._turned(arithmetic, time)
        units = [number(context.ldexp(context.one, -e)) for e in system.scaling.rates]
        values = {name: w * unit for name, w, unit in zip(("wx", "wy", "wz"), rates, units, strict=True)}
        values |= dict(zip(("qw", "qx", "qy", "qz"), quaternion, strict=True))
        if "gx" in system.states:
            assert scene.gravity is not None
            up = [number(-g / norm(context, scene.gravity)) for g in scene.gravity]
            matrix = attitude.rotation_matrix(quaternion)
            values |= {f"g{n}": dot([row[i] for row in matrix], up) for i, n in enumerate("xyz")}
        if "x" in system.states:
            values |= self._flight(arithmetic, arithmetic.elapsed(time))
        unknown = [name for name in system.states if name not in values]
        if unknown:
            raise ValueError(
                f"given a system with the states {', '.join(unknown)}; a closed form gives rates, "
                'quaternion, position and velocity: build the system with formulation = "quaternion"'
            )
        return [values[name] for name in system.states]

    def _flight(self, arithmetic: Arithmetic, time: Any) -> dict[str, Any]:
        """Free fall in a uniform field, or straight motion; internal units of length and speed."""
        scene, scaling, number = self.scene, self.scaling, arithmetic.number
        assert scene.position is not None
        assert scene.velocity is not None
        context = scene.context
        ratio = number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
        values = {}
        for i, name in enumerate("xyz"):
            field = scene.gravity[i] if scene.gravity is not None else context.zero
            pull = number(context.ldexp(field, scaling.time - scaling.speed))
            x = number(context.ldexp(scene.position[i], -scaling.length))
            v = number(context.ldexp(scene.velocity[i], -scaling.speed))
            values[name] = x + ratio * ((v + pull * time / 2) * time)
            values[f"v{name}"] = v + pull * time
        return values


def _phase_bits(elapsed: mpmath.mpf) -> int:
    """Bits of a phase, which in internal units is about the time itself."""
    return max(0, math.ceil(mpmath.log(1 + abs(elapsed), 2)))


def closed_form_of(scene: Scene, *, driven: bool = False) -> ClosedForm:
    """The closed form of a scene; raises NoClosedForm if it has none."""
    if driven:
        raise NoClosedForm("a load given from Python has no closed form")
    for event in scene.impulses:
        raise NoClosedForm(f"the impulse {event.name} has no closed form")
    for load in scene.loads:
        raise NoClosedForm(f"{load.title} has no closed form here")
    for state in scene.states:
        raise NoClosedForm(f"the state {state.name} of [[states]] has no closed form")
    context = mpmath.MPContext()
    # double roots (regular precession) keep half the digits
    context.prec = 3 * scene.context.prec
    scaling = choose_scaling(scene)
    motion = choose_motion(context, scene, scaling)
    start = attitude.unit_quaternion(context, [context.mpf(x) for x in scene.quaternion])
    after = attitude.quaternion_from_matrix(context, motion.axes)
    _, relative = motion.at(Digits(context), context.zero)
    w, x, y, z = attitude.product(relative, after)
    before = attitude.product(start, [w, -x, -y, -z])
    return ClosedForm(scene, motion, scaling, before, after)


def find_closed_form(scene: Scene, *, driven: bool = False) -> ClosedForm | None:
    """Like ``closed_form_of``, but None if there is none."""
    try:
        return closed_form_of(scene, driven=driven)
    except NoClosedForm:
        return None
