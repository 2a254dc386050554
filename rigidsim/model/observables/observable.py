"""Observables: one entry from a name to its expressions, how its samples are joined, and what it needs.

A new observable is one ``Observable`` in a list of this package. A new invariant is an observable whose
``conserved`` says when and why it holds. Angles that may turn around are ``continuous_angles``. Each then
shows up in the dataset, the summary, the plots and the timeline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.frames import (
    first_source,
    flies_about_source,
    flies_in_plane,
    reference_plane,
    rotating_orbit,
)
from rigidsim.model.kinematics import Poles
from rigidsim.model.load import loads_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.si import values_in_si
from rigidsim.scene.choices import variables_named
from rigidsim.scene.registry import register_observable
from rigidsim.scene.scene import Scene


def unless(possible: Callable[[Scene], object], why: str) -> Callable[[Scene, str], str | None]:
    """``Need.missing`` of what only some scenes have, and why others don't."""
    return lambda scene, _: None if possible(scene) else why


def _flight_of_a_free_body(scene: Scene) -> str | None:
    return "flight" if scene.free_flight else None


@dataclass(frozen=True)
class Need:
    """One thing that observables may need: whether it is met, the states that must be carried for it
    ("attitude", "flight" or None), and why a scene in a formulation can't have it, if that is seen at once.
    """

    met: Callable[[Mechanics], bool]
    states: Callable[[Scene], str | None] = lambda _: None
    missing: Callable[[Scene, str], str | None] = lambda scene, formulation: None


BALANCE = ("work", "energy_balance")
"""Observables that take the work of the loads, a state that nothing else reads."""


def carries_work(m: Mechanics) -> bool:
    """Whether the loads' power is integrated: if one asks for what takes it, guards all drifts, or if the
    attitude has no norm that is monitored in its place.
    """
    config, attitude = m.scene.config, m.attitude
    asked = config.output.record is None or not set(BALANCE).isdisjoint(config.output.record)
    alone = attitude is None or attitude.defect is None
    return (asked or alone or config.limits.max_drift is not None) and has_balance(m)


def has_balance(m: Mechanics) -> bool:
    """Whether the energy balances the work of the loads: neither it nor a Jacobi constant is conserved."""
    acting = [load for load in m.loads if m.driven_within or not load.changes]
    has_jacobi = m.attitude is not None and len(acting) == 1 and acting[0].corotating_orbit is not None
    return _has_energy(m) and not m.conserves_energy and not has_jacobi and m.power is not None


def _has_energy(m: Mechanics) -> bool:
    return m.velocity is not None or not m.scene.free_flight


def _no_attitude(scene: Scene, formulation: str) -> str | None:
    if variables_named(formulation).keeps_attitude:
        return None
    return f'needs the attitude; choose another formulation than "{formulation}", such as "auto"'


_NO_POSITION = unless(
    lambda scene: scene.free_flight,
    "the scene has no position; give [initial] position or velocity, or leave it out",
)
_NO_POTENTIAL = unless(
    lambda scene: scene.loads or scene.torque_arm is not None or (scene.free_flight and scene.gravity),
    "no load of the scene has a potential that varies; leave it out",
)
_NO_VERTICAL = unless(
    lambda scene: scene.torque_arm is not None,
    "the scene has no load that marks a vertical; record angular_momentum instead",
)
_NO_POINT_MASSES = unless(
    lambda scene: scene.bodies is not None, "there are no [[bodies]]; add them, or leave it out"
)
_NO_ROTORS = unless(
    lambda scene: scene.tabled.get("rotors"), "there are no [[rotors]]; add them, or leave it out"
)
_NO_KERNEL = unless(
    lambda scene: any(load.sights for load in scene.loads),
    'no load has a source = "..." in an [ephemeris] kernel; give one, or leave it out',
)
_NO_SOURCE = unless(
    lambda scene: first_source(loads_of(scene)) is not None,
    "no load has a source whose direction it would count from (gravity_gradient, central_gravity, or "
    "magnetic_dipole with an orbit); leave it out",
)


def _sourced(m: Mechanics) -> bool:
    load = first_source(m.loads) if m.attitude is not None else None
    return load is not None and (load.attracting_point is None or m.velocity is not None)


NEEDS: dict[str, Need] = {
    "attitude": Need(lambda m: m.attitude is not None, lambda _: "attitude", _no_attitude),
    "flight": Need(lambda m: m.velocity is not None, lambda _: "flight", _NO_POSITION),
    "vertical": Need(lambda m: m.vertical is not None and m.numbers.arm is not None, missing=_NO_VERTICAL),
    "potential": Need(lambda m: m.potential_energy is not None, _flight_of_a_free_body, _NO_POTENTIAL),
    "energy": Need(_has_energy, _flight_of_a_free_body),
    "symmetry": Need(lambda m: m.symmetry_direction is not None),
    "work": Need(carries_work),
    "jacobi": Need(lambda m: m.attitude is not None and rotating_orbit(m) is not None),
    "plane": Need(
        lambda m: not flies_in_plane(m.scene, m.loads) or m.velocity is not None,
        lambda scene: "flight" if flies_in_plane(scene, loads_of(scene)) else None,
    ),
    "source": Need(_sourced, lambda scene: "flight" if flies_about_source(scene) else None, _NO_SOURCE),
    "place": Need(lambda m: not m.scene.free_flight or m.velocity is not None, _flight_of_a_free_body),
    "rotors": Need(lambda m: bool(m.scene.tabled.get("rotors")), missing=_NO_ROTORS),
    "fixed_rotors": Need(
        lambda m: m.energy_stored_by_drives is not None and not m.driven_within, missing=_NO_ROTORS
    ),
    "point_masses": Need(lambda m: m.scene.bodies is not None, missing=_NO_POINT_MASSES),
    "kernel": Need(lambda m: m.sky is not None, missing=_NO_KERNEL),
    "attractor": Need(lambda m: m.velocity is not None and any(x.attracting_point for x in m.loads)),
}
"""All needs, by the names that ``Observable.needs`` uses."""


Dims = tuple[str, ...]
BODY: Dims = ("body_axis",)
SPACE: Dims = ("space_axis",)


def _without(_: Mechanics) -> None:
    return None


def lacking(
    holds: Callable[[Mechanics], object], why: str = "this scene has none"
) -> Callable[[Mechanics], str | None]:
    """``Observable.absent`` of what a scene can't have, and why, where something doesn't hold."""
    return lambda m: None if holds(m) else why


def always(_: Mechanics) -> bool:
    """Record wherever a scene has the quantity, unless the config names what to record."""
    return True


def only_when_named(_: Mechanics) -> bool:
    """Record only if ``[output] record`` names the quantity."""
    return False


@dataclass(frozen=True)
class Angle:
    """atan2(across, along), an angle that may turn around: sine and cosine times a common size, of order 1.

    Where that is below ``rigidsim.model.kinematics.UNDEFINED`` rounding errors, NaN is recorded.
    """

    across: Symbolic
    along: Symbolic

    @property
    def value(self) -> Symbolic:
        """The angle within half a turn, rad."""
        return hy.atan2(self.across, self.along)

    @property
    def squared_size(self) -> Symbolic:
        """Squared common size, which vanishes where the angle is undefined."""
        return self.across * self.across + self.along * self.along


@dataclass(frozen=True)
class Observable:
    """One recordable quantity; register your own with ``rigidsim.scene.registry.register_observable``.

    Attributes:
        name: name of the dataset's variable.
        dims: dimensions besides time; keys of ``rigidsim.store.variables.LABELS``.
        units: SI.
        long_name: description for readers.
        frame: "body axes", "space axes" or "".
        expressions: components as expressions of the state: in SI (``rigidsim.model.si.InSI``) for units of a
            dimension without ``exponents``, otherwise in internal units (``Kinematics``).
        exponents: binary exponents of the components' internal units; None where they are in SI or have none.
        needs: what the scene must have; names in ``rigidsim.model.observables.observable.NEEDS``.
        conserved: why it is an invariant of this scene, or None where it isn't.
        drift_scale: scale of its drift in SI (mpf), and the name of that scale.
        by_default: whether it is recorded if the config names nothing.
        continuity: how samples are joined, see ``rigidsim.model.system.Recorded``.
        angles: the angles whose full turns are counted (``continuous_angles``), if it consists of such.
        poles: for Euler angles that are functions of the state, where only one of the outer ones is defined.
        attributes: further attributes of the variable: convention, reference plane, ...
        absent: why this scene can't have the observable although it meets all needs; None if it can.
    """

    name: str
    dims: Dims
    units: str
    long_name: str
    expressions: Callable[[Mechanics], list[Symbolic]]
    exponents: Callable[[Mechanics], list[int]] | None = None
    frame: str = ""
    needs: tuple[str, ...] = ()
    conserved: Callable[[Mechanics], str | None] = _without
    drift_scale: Callable[[Mechanics], tuple[Any, str]] | None = None
    by_default: Callable[[Mechanics], bool] = always
    continuity: Callable[[Mechanics], str] = lambda _: ""
    angles: Callable[[Mechanics], list[Angle]] | None = None
    poles: Callable[[Mechanics], Poles | None] = _without
    attributes: Callable[[Mechanics], Mapping[str, str]] = lambda _: {}
    absent: Callable[[Mechanics], str | None] = _without

    def __post_init__(self) -> None:
        """Let an observable with a dimension, but without exponents, take the state in SI."""
        if self.exponents is None and self.units not in ("", "1", "rad"):
            object.__setattr__(self, "expressions", values_in_si(self.expressions))

    def available(self, m: Mechanics) -> bool:
        """Whether the scene meets all needs and nothing else makes the quantity absent."""
        carried = m.average is None or m.average.provides(self.name)
        return carried and self.needed(m) and self.absent(m) is None

    def needed(self, m: Mechanics) -> bool:
        """Whether the scene has what ``needs`` names."""
        return all(NEEDS[need].met(m) for need in self.needs)

    def unit_exponents(self, m: Mechanics, count: int) -> list[int]:
        """Binary exponents of the units of ``count`` components."""
        return [0] * count if self.exponents is None else self.exponents(m)


def continuous_angles(
    name: str,
    dims: Dims,
    long_name: str,
    angles: Callable[[Mechanics], list[Angle]],
    *,
    by_default: Callable[[Mechanics], bool] = only_when_named,
    **more: Any,
) -> Observable:
    """An observable of angles (one per component), in rad, whose full turns are counted along the motion,
    however far apart the samples are; ``more`` as for ``Observable``.
    """
    values = lambda m: [angle.value for angle in angles(m)]  # noqa: E731
    return Observable(
        name, dims, "rad", long_name, values, continuity=lambda m: "unwrap", angles=angles,
        by_default=by_default, **more,
    )  # fmt: skip


def register_all(*observables: Observable) -> None:
    """Register observables in the order of the dataset."""
    for observable in observables:
        register_observable(observable)


def same_unit(exponent: Callable[[Mechanics], int], count: int) -> Callable[[Mechanics], list[int]]:
    """``Observable.exponents`` for components that share one unit."""
    return lambda m: [exponent(m)] * count


MOMENTUM = lambda m: m.scaling.momentum  # noqa: E731
ENERGY = lambda m: m.scaling.energy  # noqa: E731


def described_by(
    convention: str | Callable[[Mechanics], str], *, figure: bool = False, plane: bool = False
) -> Callable[[Mechanics], Mapping[str, str]]:
    """Attributes that give a convention, and the figure axis and reference plane if it uses them."""

    def attributes(m: Mechanics) -> dict[str, str]:
        found = {"convention": convention if isinstance(convention, str) else convention(m)}
        if figure:
            pole = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.pole)
            found["figure_axis"] = f"{m.scene.figure.described}: [{pole}] in body axes"
        if plane:
            found["reference_plane"] = reference_plane(m).described
        return found

    return attributes
