"""A body of a kernel as a source, seen from the one that the rigid body is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.placements.placement import Circuit, Placement, SourceMotion, SourcePlace
from rigidsim.model.rotations import length
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.kernels.ephemeris import Ephemeris
from rigidsim.scene.kernels.reading import RelativeEphemeris
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene

_LUNISOLAR = frozenset({"sun", "earth", "moon", "earth_moon_barycenter"})
_BOTH, _PARTS = "earth_moon_barycenter", ("earth", "moon")
_SAMPLES = 4000  # over a run
_ROUNDS = 2  # of finer samples about the least distance
_WINDOW = 100 * 365.25 * 86400.0  # s, in which the mean motion is measured in a kernel
_TURN = 0.2  # of a block: samples by which the mean motion is followed
_LEAST_SHAPE = 0.01  # eccentricity or inclination (rad) from which apsides or nodes are reported


@dataclass(frozen=True)
class PlacedByKernel(Placement):
    """A body of the kernel, seen from the host."""

    ephemeris: Ephemeris
    sight: RelativeEphemeris
    untracked = ""
    moves: ClassVar[bool] = True
    wide = True  # unrolled, the polynomials take several times as long to compile
    without_plane = "positions of a kernel name none"

    @classmethod
    def of(cls, source: str, around: Setting) -> PlacedByKernel:
        """The body that the key ``source`` of a load names."""
        ephemeris = kernel_body(source, around)
        if not around.host:
            what = "nothing says from which body of the kernel it is seen; name that in "
            what += '[body] host, such as "moon"'
            if around.bodies is not None and around.bodies.host is not None:
                own = around.bodies.names[around.bodies.host]
                what = f'the body is "{own}", which is one of [[bodies]] and moves by itself; give orbit = '
                what += '{body = "..."} of another one, or a [body] host that is none of them'
            raise around.fault("source", f'given "{source}", but {what}')
        if source == around.host:
            raise around.fault(
                "source", f'given "{source}", which is the body itself; another one is allowed'
            )
        return cls(ephemeris, ephemeris.sight(source, around.host))

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.sight.source

    @property
    def axes(self) -> str:  # type: ignore[override]
        return self.ephemeris.axes

    @property
    def lunisolar(self) -> bool:  # type: ignore[override]
        return {self.sight.source, self.sight.host} <= _LUNISOLAR

    @property
    def without_elements(self) -> tuple[str, str]:  # type: ignore[override]
        return (
            f'the kernel gives places of "{self.name}", and no elements to average over',
            'choose "spin_averaged", or give it an orbit with a node_rate',
        )

    def distance(self, context: Any) -> Any:
        return context.ldexp(context.mpf(1000), self.sight.exponent)

    def seen(self, m: Kinematics) -> SourcePlace:
        vector = m.carried(m.sky).seen(self.sight)
        inverse = 1.0 / length(vector)
        return SourcePlace([x * inverse for x in vector], inverse, self.distance(m.scene.context))

    def motion(self, m: Kinematics) -> SourceMotion:
        """The derivatives come from the series; for what is recorded they have to be states."""
        sky = m.carried(m.sky)
        place, velocity, acceleration = (sky.seen(self.sight, order) for order in range(3))
        found = self.seen(m)
        return SourceMotion(place, velocity, acceleration, found.inverse, found.unit)

    def motion_at_start(self, scene: Scene) -> tuple[Vector, Vector, Vector]:
        found = (self.ephemeris.place(scene.context, self.sight, scene.start, order) for order in range(3))
        place, velocity, acceleration = found
        return place, velocity, acceleration

    @property
    def sights(self) -> tuple[tuple[RelativeEphemeris, int], ...]:  # type: ignore[override]
        return ((self.sight, 0),)

    def at_start(self, scene: Setting) -> Vector:
        return self.ephemeris.place(scene.context, self.sight, scene.start)

    # --- sizes, from samples in double precision ----------------------------------------------------------

    @cached_property
    def _reach(self) -> tuple[float, float, float]:
        """Least and largest distance (m) within the run, and the largest rate of the direction (rad/s)."""
        begin, end = (float(t) + float(self.ephemeris.ahead) for t in self.ephemeris.run)
        times = np.linspace(begin, end, _SAMPLES)
        far = np.linalg.norm(self.sight.sampled(times), axis=1)
        most = float(far.max())
        for _ in range(_ROUNDS):
            nearest, width = times[np.argmin(far)], times[1] - times[0]
            times = np.linspace(max(begin, nearest - width), min(end, nearest + width), _SAMPLES // 10)
            far = np.linalg.norm(self.sight.sampled(times), axis=1)
        least, when = float(far.min()), float(times[np.argmin(far)])
        step = 1e-3 * float(min(series.length for _, series in self.sight.links))
        when = min(max(when, float(self.sight.span[0]) + step), float(self.sight.span[1]) - step)
        before, after = self.sight.sampled(np.array([when - step, when + step]))
        turning = float(np.linalg.norm(np.cross(before, after))) / (2 * step * least**2)
        return 1000 * least, 1000 * most, turning

    def nearest(self, scene: Setting) -> Any:
        return scene.context.mpf(self._reach[0])

    def fastest_rate(self, scene: Setting) -> Any:
        return scene.context.mpf(self._reach[2])

    def circuit(self, context: Any) -> Circuit:
        """From the kernel's positions of up to a century about the start: apsides and nodes go round by the
        difference of the anomalistic and the draconic month to the sidereal one.
        """
        first, last = map(float, self.sight.span)
        begin = float(self.ephemeris.run[0]) + float(self.ephemeris.ahead)
        low, high = max(first, begin - _WINDOW / 2), min(last, begin + _WINDOW / 2)
        finest = float(min(series.length for _, series in self.sight.links)) * _TURN
        times = np.linspace(low, high, max(int((high - low) / finest), 2))
        places = self.sight.sampled(times)
        far = np.linalg.norm(places, axis=1)
        units = places / far[:, None]
        turned = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(units, axis=0), axis=1) / 2, 0, 1))
        e = float((far.max() - far.min()) / (far.max() + far.min()))
        motion = float(turned.sum()) / (high - low)
        normal = np.cross(units[:-1], units[1:]).sum(axis=0)
        latitude = units @ normal / np.linalg.norm(normal)
        nearer, above = np.diff(far) < 0, latitude > 0
        slow = 0.0
        if e > _LEAST_SHAPE:
            slow += abs(_rate(times[1:-1][nearer[:-1] & ~nearer[1:]], motion) - motion)
        if np.abs(latitude).max() > _LEAST_SHAPE:
            slow += abs(_rate(times[1:][above[1:] & ~above[:-1]], motion) - motion)
        return Circuit(motion, e, (2.0**self.sight.exponent / float(far.min())) ** 3, slow)

    def pictured(self) -> dict[str, Any]:
        return {"kernel": self.name}


def _rate(times: np.ndarray, otherwise: float) -> float:
    """Mean rate (rad/s) of what comes round at given times; none if they are too few."""
    return 2 * np.pi * (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 2 else otherwise


def refuse_same_sources(loads: Iterable[Any], host: str | None) -> None:
    """Refuse loads of one kind (their keys) whose sources are, or contain, the same body of a kernel."""
    seen: set[tuple[str, str]] = set()
    for number, load in enumerate(loads, 1):
        name = getattr(load, "source", None)
        if name is None:
            continue
        where = f"[[loads]] number {number} source"
        if (load.kind, name) in seen:
            raise ConfigError(
                Problem(
                    where,
                    f'given "{name}", as in another {load.kind}, by which it acts twice; remove one of them',
                )
            )
        seen.add((load.kind, name))
        parts = [x for x in _PARTS if (load.kind, x) in seen or x == host]
        if (load.kind, _BOTH) in seen and parts:
            raise ConfigError(
                Problem(
                    where,
                    f'given "{name}", but the mass of "{_BOTH}" contains "{parts[0]}", a source or the body '
                    'as well; give "earth" and "moon", or one of them',
                )
            )


def kernel_body(source: str, around: Setting) -> Ephemeris:
    """The ephemeris that has a body which a load names; refused if none has."""
    if around.ephemeris is None:
        raise around.fault("source", f'given "{source}", but there is no [ephemeris]; add one with a kernel')
    around.ephemeris.check_body(source, lambda what: around.fault("source", what))
    return around.ephemeris


def refuse_series(around: Setting) -> None:
    """Refuse analytic series beside a kernel whose axes they don't share."""
    if around.ephemeris is not None and around.axes is None:
        raise around.fault(
            "ephemeris",
            'given with [ephemeris], whose axes are ICRF unless [frame] axes = "ecliptic J2000"; set '
            "that, or give source instead",
        )
