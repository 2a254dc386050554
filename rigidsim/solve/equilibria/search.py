"""What is sought for a Cassini state: which body, in step or not, on which orbit, and when it comes back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from rigidsim.model.capabilities import Beside, gradient_source_of
from rigidsim.model.load import Load, loads_of
from rigidsim.scene.arithmetic import Matrix, cross, dot, negligible
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import refusal, spin_rate

_MOST_REVOLUTIONS = 600
_MOST_APSIDAL_TURNS = 12


@dataclass(frozen=True)
class SoughtReturn:
    """What is sought: a pose that comes back.

    Attributes:
        axes: rows a, b, c in body axes: least, middle and largest moment.
        turns: p turns to a revolution, or None for a body with A = B that turns at any rate.
        rate: spin about c in the node's frame, rad/s (mpf); of the whole angular velocity for A = B.
        orbit: on which the pose comes back.
        revolutions: of the source from one return to the next.
        scene: on that orbit.
        how: it is found, and to what order it is the state.
        slow: the same with apsides at rest, whose map tells faster librations, too; None if nothing differs.
    """

    scene: Scene
    orbit: KeplerOrbit
    axes: Matrix
    turns: Any | None
    rate: Any
    revolutions: int
    how: str
    slow: SoughtReturn | None = None

    @property
    def period(self) -> Any:
        """T, s."""
        return self.revolutions * 2 * self.scene.context.pi / self.orbit.mean_motion


def _source(scene: Scene, given: str) -> tuple[Load, KeplerOrbit, Any]:
    loads = loads_of(scene)
    sources = [(load, source) for load in loads if (source := gradient_source_of(load)) is not None]
    if scene.free_flight or len(loads) != 1 or len(sources) != 1 or sources[0][1].orbit is None:
        what = "it is for a body under the gravity_gradient of one source with elements of its orbit, and "
        if any(isinstance(load, Beside) for load in loads):
            what = f"it is found by the gradient alone: leave degree and figure out; {what}"
        raise refusal(
            "equilibrium", f"{given}{what}nothing else; remove other loads, or give attitude and rates"
        )
    load, source = sources[0]
    orbit = source.orbit
    assert orbit is not None
    context = scene.context
    if abs(context.sin(orbit.inclination)) <= negligible(context):
        what = "the orbit isn't inclined to the plane that its node moves in; give orbit.inclination"
        raise refusal("equilibrium", given + what)
    if orbit.node_rate == 0:
        other = ', or choose "relative"' if orbit.circular else ""
        raise refusal("equilibrium", f"{given}the orbit's node is at rest; give orbit.node_rate{other}")
    if scene.gravity is not None and scene.torque_arm is not None:
        raise refusal("equilibrium", f"{given}uniform_gravity has a torque; remove it")
    return load, orbit, source.gravitational_parameter / orbit.semi_major_axis**3


def search_for(scene: Scene, name: str) -> SoughtReturn:
    """What is sought in a scene for the state of a name; ``ConfigError`` if it can't have any."""
    given, context, body = f'given "{name}", but ', scene.context, scene.body
    load, orbit, strength = _source(scene, given)
    order = sorted(range(3), key=lambda k: body.principal_moments[k])
    least, middle, most = (body.principal_moments[k] for k in order)
    tiny = most * negligible(context)
    if most - middle <= tiny:
        raise refusal(
            "equilibrium", f"{given}no axis has the largest moment alone, about which the body would turn"
        )
    symmetric = middle - least <= tiny
    axes = _axes(scene, order, symmetric=symmetric)
    spin = None
    if scene.config.initial.spin_period is not None:
        spin = spin_rate(scene)
        if spin < 0:
            what = (
                "given a negative time beside a Cassini state, whose spin is about the figure axis; states "
            )
            raise refusal(
                "spin_period", what + "at more than 90 deg from the normal are retrograde: cassini_3"
            )
    if symmetric:
        if spin is None:
            what = f'missing; "{name}" of a body with two equal moments can turn at any rate: give it'
            raise refusal("spin_period", what)
        return _on(scene, load, orbit, axes, None, spin)
    if spin is None:
        return _on(scene, load, orbit, axes, context.one, None)
    turns = context.nint(2 * spin / orbit.mean_motion) / 2
    width = context.sqrt(3 * strength * (middle - least) / most)
    away = abs(spin - turns * orbit.mean_motion - orbit.periapsis_rate - orbit.node_rate)
    if turns > 0 and away <= width:
        return _on(scene, load, orbit, axes, turns, None)
    mean = (least + middle) / 2
    round_body = _with_moments(scene, [most if k == order[2] else mean for k in range(3)])
    axes = _axes(round_body, order, symmetric=True)
    found = _on(round_body, load, orbit, axes, None, spin)
    part = context.nstr((middle - least) / most, 2)
    how = f"{found.how}, of a body with the mean of both smaller moments, since its rotation isn't in step "
    how += f"with the orbit (within {context.nstr(width / spin, 2)} of the rate): to order {part}"
    return replace(found, how=how)


def _with_moments(scene: Scene, moments: list[Any]) -> Scene:
    """The scene with other moments about the body's principal axes."""
    axes = scene.body.principal_axes
    tensors = (
        [[sum(m * a[i] * a[j] for m, a in zip(given, axes, strict=True)) for j in range(3)] for i in range(3)]
        for given in (moments, [1 / m for m in moments])
    )
    inertia, inverse = tensors
    body = replace(scene.body, inertia=inertia, principal_moments=moments)
    return replace(scene, body=body, turning_inertia=inertia, inverse_inertia=inverse)


def _axes(scene: Scene, order: list[int], *, symmetric: bool) -> Matrix:
    """Principal axes a, b, c; c on the side of the figure axis, a the figure's first axis for A = B."""
    principal, figure = scene.body.principal_axes, scene.figure
    c = list(principal[order[2]])
    if dot(c, figure.pole) < 0:
        c = [-x for x in c]
    a = list(principal[order[0]])
    if symmetric and abs(dot(c, figure.pole)) > 1 - 1e-12:
        a = list(figure.first)
    return [a, cross(c, a), c]


def _on(
    scene: Scene, load: Load, orbit: KeplerOrbit, axes: Matrix, turns: Any | None, spin: Any
) -> SoughtReturn:
    """The search on the scene's orbit, or on the nearest one on which something comes back."""
    context, rest = scene.context, orbit.mean_motion + orbit.periapsis_rate
    once = 1 if turns is None or turns == int(turns) else 2
    full = "by Newton's method on the full equations: it comes back after "
    how = full + ("a revolution" if once == 1 else "two revolutions")

    def on(other: KeplerOrbit, revolutions: int, how: str, slow: SoughtReturn | None = None) -> SoughtReturn:
        rate = spin if turns is None else turns * other.mean_motion + other.periapsis_rate
        moved = scene if other is orbit else _with_orbit(scene, load, other)
        return SoughtReturn(moved, other, axes, turns, rate, revolutions, how, slow)

    if orbit.periapsis_rate == 0:
        return on(orbit, once, how)
    motion = orbit.mean_motion + (0 if turns is None else orbit.periapsis_rate / turns)
    how += " with the slow apsides at rest; free librations are of the order of what their turning forces"
    slow = on(_paced(orbit, motion, context.zero, scene.start), once, how)
    whole, apsidal = _recurrence(orbit, once)
    if not whole:
        return slow
    motion = rest / (1 + context.mpf(apsidal) / whole)
    changed = context.nstr(abs((rest - motion) / orbit.periapsis_rate - 1), 2)
    how = f"{full}{whole} revolutions, while the apsides turn {abs(apsidal)} times, at a rate changed by "
    how += f"{changed} of itself: free librations are about that part of what the apsides force (exponents: "
    how += "apsides at rest)"
    return on(_paced(orbit, motion, rest - motion, scene.start), whole, how, slow)


def _paced(orbit: KeplerOrbit, motion: Any, apsidal: Any, start: Any) -> KeplerOrbit:
    """The orbit with other rates of mean anomaly and periapsis, and the same place at the start."""
    return replace(
        orbit,
        mean_motion=motion,
        mean_anomaly=orbit.mean_anomaly + (orbit.mean_motion - motion) * start,
        periapsis=orbit.periapsis + (orbit.periapsis_rate - apsidal) * start,
        periapsis_rate=apsidal,
    )


def _recurrence(orbit: KeplerOrbit, halves: int) -> tuple[int, int]:
    """Revolutions and turns of the apsides after which both come back nearly; zeros if that takes long."""
    once = float(orbit.mean_motion / orbit.periapsis_rate)  # revolutions to a turn
    best = (1.0, 0, 0)
    for turns in range(1, _MOST_APSIDAL_TURNS + 1):
        count = round(once * turns / halves) * halves
        if 0 < abs(count) <= _MOST_REVOLUTIONS:
            best = min(best, (abs(count / turns / once - 1), abs(count), turns if once > 0 else -turns))
    return best[1:]


def _with_orbit(scene: Scene, load: Any, orbit: KeplerOrbit) -> Scene:
    """The scene with its source on another orbit that has the same place at the start."""
    moved = replace(load, placement=replace(load.placement, orbit=orbit))
    return replace(scene, loads=tuple(moved if x is load else x for x in scene.loads))
