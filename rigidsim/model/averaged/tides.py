"""Tides on a precessing body: slow changes of its rotation and of its satellite's distance.

With s the spin axis, n the orbit's normal, x = n . s, w the rotation's rate over its initial rate, and r the
distance of a source over its initial distance, precession by this source goes with w r^-3: the flattening
goes with w^2, the momentum with w (``rigidsim.model.averaged.sources``). In a time t from the start:

- ``linear``: w = 1 + D a t, r^-3 = 1 + 2 D b t, with the rate b = n'/n of the Moon's mean motion (Quinn,
  Tremaine & Duncan 1991) and the rate a of the Earth's rotation that goes with it (Lambeck 1980), as in snvec
  (Zeebe & Lourens 2022); the axis moves by D E (n - x s) / sqrt(1 - x^2), if asked for.
- ``constant_lag`` (Mignard 1979, Hut 1981, Neron de Surgy & Laskar 1997): with

      k = 3 D G m^2 R^5 k2 dt / (C a^6),     n_orbit^2 a^3 = G (M + m),
      w' = -sum k (w (1 + x^2) / 2 - x n_orbit / w0),
      a' = 2 C k (w0 w x - n_orbit) / (mu n_orbit a),    mu = m M / (m + M),
      s' = -sum k (x / 2 - n_orbit / (w0 w)) (n - x s),  if asked for.

D is ``dissipation``. Orbits are taken as circles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.model.averaged.sources import Source
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.exact import parse_number
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import TidesTable
from rigidsim.scene.validation_messages import nearest

LINEAR = "linear"
SPIN = "tidal_spin"
_SPIN_RATE, _MOTION_RATE = "-2.705994e-10", "-1.4516496e-10"  # a and b, per year
_OBLIQUITY_RATE = "-4.17e-19"  # E, rad/s
_RADIUS, _LOVE_LAG = "6378136.3", "194.895"  # of the Earth: m, and 0.305 times 639 s (Laskar et al. 2004)
_EARTH_RATE, _EARTH_WITHIN = 7.292115e-5, 0.05  # rad/s, of which these numbers are
_STEPS = 512  # of the other model's history


@dataclass(frozen=True)
class Raising:
    """A source that raises tides; numbers are mpf, SI.

    Attributes:
        rate: k at the start, 1/s.
        motion: n_orbit at the start, rad/s.
        recession: 2 C k w0 / (mu n_orbit a^2) at the start, 1/s.
    """

    source: Source
    rate: Any
    motion: Any
    recession: Any

    @property
    def state(self) -> str:
        """Name of the state r."""
        return f"tidal_distance{self.source.number}"


@dataclass(frozen=True)
class Tides:
    """The tides of an averaged motion.

    Attributes:
        spin: rate of rotation at the start, rad/s (mpf).
        start: s.
    """

    table: TidesTable
    spin: Any
    raising: Sequence[Raising]
    start: Any
    context: Any

    @property
    def linear(self) -> bool:
        """Whether all that changes is linear in time."""
        return self.table.model == LINEAR

    @property
    def slopes(self) -> tuple[Any, Any, Any]:
        """Rates of w and of r^-3 (1/s), and of the obliquity (rad/s), of the linear model (mpf)."""
        context, dissipation = self.context, self.table.dissipation.at(self.context)
        year = parse_number("1 yr").at(context)
        spin, motion = (dissipation * context.mpf(x) / year for x in (_SPIN_RATE, _MOTION_RATE))
        return spin, 2 * motion, dissipation * context.mpf(_OBLIQUITY_RATE)

    # --- in equations, of averaged mechanics m --------------------------------------------------------------

    def _line(self, m: Any, slope: Any) -> Symbolic:
        return m.moving(1 - slope * self.start, slope)

    def spin_ratio(self, m: Any) -> Symbolic:
        """w."""
        return self._line(m, self.slopes[0]) if self.linear else hy.make_vars(SPIN)

    def distance_ratio(self, m: Any, one: Raising) -> Symbolic:
        """r."""
        return self._line(m, self.slopes[1]) ** (-1.0 / 3) if self.linear else hy.make_vars(one.state)

    def growth(self, m: Any, source: Source) -> Symbolic:
        """Factor w r^-3 of the precession by a source."""
        spin = self.spin_ratio(m)
        one = next((one for one in self.raising if one.source.number == source.number), None)
        if one is None:
            return spin
        return spin * (self._line(m, self.slopes[1]) if self.linear else hy.make_vars(one.state) ** -3.0)

    def block(self, m: Any, s: list[Symbolic]) -> StateBlock | None:
        """The states w and r of each source, per internal unit of time; None if they are known."""
        if self.linear:
            return None
        w, names, changes, slowed = hy.make_vars(SPIN), [SPIN], [], []
        for one in self.raising:
            r, x = hy.make_vars(one.state), dot(m.normal(one.source), s)
            sizes = one.rate * m.unit, one.recession * m.unit, one.motion / self.spin
            k, away, orbit = (as_factor(m.number(size)) for size in sizes)
            n = orbit * r**-1.5
            slowed.append(-(k * r**-6.0) * (0.5 * w * (1.0 + x * x) - n * x))
            changes.append((away * r**-5.5) * (w * x - n))
            names.append(one.state)
        why = "tides slow the rotation and move what raises them away, relative to the start"
        return StateBlock(names, [hy.sum(slowed), *changes], [self.context.one] * len(names), why=why)

    def turned(self, m: Any, s: list[Symbolic]) -> list[list[Symbolic]]:
        """Changes of the direction s by tides, if asked for, per internal unit of time."""
        found = []
        for one in self.raising if self.table.obliquity else ():
            normal = m.normal(one.source)
            x = dot(normal, s)
            if self.linear:
                factor = as_factor(m.number(self.slopes[2] * m.unit)) / hy.sqrt(1.0 - x * x)
            else:
                r, orbit = hy.make_vars(one.state), as_factor(m.number(one.motion / self.spin))
                lag = 0.5 * x - orbit * r**-1.5 / hy.make_vars(SPIN)
                factor = -(as_factor(m.number(one.rate * m.unit)) * r**-6.0) * lag
            found.append([factor * (n - x * c) for n, c in zip(normal, s, strict=True)])
        return found


def tides_of(scene: Scene, sources: Sequence[Source], momentum: Any) -> Tides | None:
    """The tides that a config asks for, of a body with so much momentum (mpf); None without."""
    table, context, body = scene.config.tides, scene.context, scene.body
    if table is None:
        return None

    def fault(key: str, what: str) -> ConfigError:
        return ConfigError(Problem(f"[tides] {key}".rstrip(), what))

    named = {str(load.name): n for n, load in enumerate(scene.config.loads, 1) if getattr(load, "name", None)}
    known = {source.number: source for source in sources if source.motion > 0}
    moment, found = max(body.principal_moments), []
    spin = momentum / moment
    earth = abs(float(spin) / _EARTH_RATE - 1) < _EARTH_WITHIN
    what = f'given "linear", whose rates are the Earth\'s, for a body that turns at {float(spin):.4g} rad/s; '
    ensure(earth or table.model != LINEAR, fault("model", what + 'choose "constant_lag"'))
    what = f'given {len(table.raised_by)} names, where "linear" has the rates of the Moon alone; name one'
    ensure(table.model != LINEAR or len(table.raised_by) == 1, fault("raised_by", what))
    given = earth or (table.radius is not None and table.love_lag is not None)
    ensure(given, fault("", 'model = "constant_lag" needs radius and love_lag (k2 times the lag); give both'))
    ensure(body.mass is not None, fault("", "tides need the body's mass; give [body] mass"))
    newton = context.mpf(GRAVITATIONAL_CONSTANT)
    radius = context.mpf(_RADIUS) if table.radius is None else table.radius.at(context)
    lag = context.mpf(_LOVE_LAG) if table.love_lag is None else table.love_lag.at(context)
    for name in table.raised_by:
        allowed = ", ".join(x for x, n in named.items() if n in known) or "none; give one on an orbit a name"
        what = f'given "{name}"{nearest(name, named)}; loads with a source on an orbit are allowed: {allowed}'
        ensure(named.get(name) in known, fault("raised_by", what))
        source = known[named[name]]
        axis, strength = source.of.placement.distance(context), source.of.gravitational_parameter
        mass, motion = strength / newton, context.sqrt((strength + newton * body.mass) / axis**3)
        rate = 3 * strength * mass * radius**5 * lag * table.dissipation.at(context) / (moment * axis**6)
        reduced = mass * body.mass / (mass + body.mass)
        found.append(Raising(source, rate, motion, 2 * moment * rate * spin / (reduced * motion * axis**2)))
    return Tides(table, spin, found, scene.start, context)


def described(tides: Tides, rates: Mapping[int, float], cosine: float, seconds: float) -> str:
    """The tidal model, and what the other one would change of the precession until the end, for a summary.

    Args:
        rates: of precession by each source at the start, by number of its load, rad/s.
        cosine: x at the start, taken as constant.
        seconds: from start to end, with its sign.
    """
    times = np.linspace(0.0, seconds, _STEPS)
    growths = []
    for linear in (tides.linear, not tides.linear):
        spin, *distances = _histories(tides, cosine, times, linear=linear)
        far = {one.source.number: r for one, r in zip(tides.raising, distances, strict=True)}
        growths.append(sum(rate * spin * far.get(n, spin * 0 + 1) ** -3 for n, rate in rates.items()))
    shift = float(np.trapezoid(growths[1] - growths[0], times)) * cosine
    names = (LINEAR, "constant_lag") if tides.linear else ("constant_lag", LINEAR)
    turned = f"{abs(np.degrees(shift)):.3g} deg at the end"
    return f"model {names[0]}; {names[1]} would change the precession by about {turned}"


def _histories(tides: Tides, cosine: float, seconds: np.ndarray, *, linear: bool) -> np.ndarray:
    """w, and r of each raising source, (1 + sources, n), by either model at even times from the start in s,
    for a constant x, in double precision by the classical Runge-Kutta method.
    """
    if linear:
        spin, cubed, _ = map(float, tides.slopes)
        moon = max(tides.raising, key=lambda one: float(one.rate))
        shares = [cubed if one is moon else 0.0 for one in tides.raising]
        return np.array([1 + spin * seconds, *((1 + share * seconds) ** (-1 / 3) for share in shares)])
    sizes = [(one.rate, one.motion / tides.spin, one.recession) for one in tides.raising]
    k, orbit, away = np.array(sizes, dtype=float).T

    def slope(y: np.ndarray) -> np.ndarray:
        w, r = y[0], y[1:]
        n = orbit * r**-1.5
        slowed = -(k * r**-6 * (w * (1 + cosine**2) / 2 - n * cosine)).sum()
        return np.concatenate([[slowed], away * r**-5.5 * (w * cosine - n)])

    found, step = [np.ones(1 + len(tides.raising))], float(seconds[1] - seconds[0])
    for _ in seconds[1:]:
        y = found[-1]
        a = slope(y)
        b = slope(y + step / 2 * a)
        c = slope(y + step / 2 * b)
        found.append(y + step / 6 * (a + 2 * b + 2 * c + slope(y + step * c)))
    return np.array(found).T
