"""Where do the poles of the Moon and Mercury stand: Cassini's states found and followed by an average?

Kepler orbits whose node turns about the ecliptic's pole (the Moon) or the Laplace plane's (Mercury), bodies
in step 1:1 and 3:2. The state is the mean place of the pole in the frame of the node (Hann window), from
which the next run starts, and the full model at last.

The balance L |W| sin I = dU/dt (Colombo 1966; Peale 1969, Astronomical Journal 74, 483) is solved
numerically; the linear theory of the path about it has the Jacobian J of the torque summed over the anomaly,
and moves the pole by (i k w - J)^-1 of each harmonic. Tolerances: a tenth of what goes round, for the Moon
also the bend of the figure axis, (3 e)^2 (C - A)/C n/w of the angle; three times 3/2 (C - A)/C n/w for what
averaging leaves out.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from experiments.common import EPSILON, Answer, Check, Curve, Panel, Picture, Result, Study, covered, simulate
from rigidsim.scene.arithmetic import context_for, hansen
from rigidsim.scene.bodies.presets import PRESETS

DAY, YEAR = 86400.0, 31557600.0
CONFIG = """
name = "{name}"
body.preset = "{name}"
[initial]
angular_velocity = [0, 0, "{spin} deg/day"]
euler_angles = [{node}, {tilt}, {turn}]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {strength}
[loads.orbit]
semi_major_axis = {axis}
eccentricity = {e}
inclination = "{inclination} deg"
period = "{period} day"
node_rate = {node_rate}
periapsis_rate = {periapsis_rate}
[model]
level = "{level}"
[time]
end = "{years} yr"
samples = {samples}
[output]
record = ["momentum_axis", "angular_momentum_norm"]
estimate = {estimate}
"""


@dataclass(frozen=True)
class Case:
    """A body in step with its source.

    Attributes:
        strength, axis: G M (m^3/s^2) and semi-major axis (m).
        inclination: of the orbit to the plane about whose pole its node turns, deg.
        period: from pericentre to pericentre, days.
        node, periapsis: periods of the node (backwards) and of the pericentre's argument, years.
        turns: rotations to a revolution.
        state: Cassini's, of which this is one.
        years: that the average and the full model are followed.
    """

    name: str
    strength: float
    axis: float
    e: float
    inclination: float
    period: float
    node: float
    periapsis: float
    turns: float
    state: int
    years: tuple[float, float]

    def shorter(self) -> Case:
        """A twentieth of the full model's years."""
        return replace(self, years=(self.years[0], self.years[1] / 20))

    @property
    def moments(self) -> list[float]:
        """Over the largest."""
        ratios = [[float(x) for x in text.split("/")] for text in PRESETS[self.name].ratios]
        return [x[0] / x[1] if len(x) > 1 else x[0] for x in ratios]

    @property
    def spin(self) -> float:
        """Of the body in step with the orbit, rad/s: its axes follow pericentre and node."""
        slow = 2 * np.pi / YEAR * (1 / self.periapsis - 1 / self.node)
        return self.turns * 2 * np.pi / (self.period * DAY) + slow

    def balance(self, tilt: float) -> float:
        """Torque less what the precession takes, at an angle of the pole from that of the node's plane."""
        least, middle, most = self.moments
        context = context_for("double")
        x2 = float(hansen(context, context.mpf(self.e), round(2 * self.turns), 2))
        # in state 2 the plane's pole is between orbit normal and spin, in state 1 the normal between both
        orbit = np.radians(self.inclination)
        theta = tilt + orbit if self.state == 2 else tilt - orbit
        flat = (most - (least + middle) / 2) * np.cos(theta) * np.sin(theta) * (1 - self.e**2) ** -1.5
        long = (middle - least) / 4 * x2 * (1 + np.cos(theta)) * np.sin(theta)
        torque = 1.5 * self.strength / self.axis**3 * (flat + long)
        return torque - self.spin * 2 * np.pi / (self.node * YEAR) * np.sin(tilt)

    @property
    def bend(self) -> float:
        """Relative size of what the figure axis changes by its bend from the momentum, at whole turns."""
        least, _, most = self.moments
        turns = self.periapsis * YEAR / (self.period * DAY)
        return (3 * self.e) ** 2 * (most - least) / most * turns if self.turns % 1 == 0 else 0.0

    def theory(self) -> float:
        """Angle of the pole from that of the node's plane, rad."""
        low, high = (1e-6, 0.1) if self.state == 2 else (np.radians(self.inclination), 0.3)
        return float(brentq(self.balance, low, high, xtol=1e-16, rtol=4 * EPSILON["double"]))

    def torque(self, pole: np.ndarray, argument: np.ndarray) -> np.ndarray:
        """(arguments of the pericentre, 2): mean torque over L at a pole (X, Y), node's frame, rad/s."""
        count = 256  # of a turn: Hansen's coefficients have died away at Mercury's eccentricity
        mean = 2 * np.pi * np.arange(count) / count
        anomaly = mean.copy()
        for _ in range(100):  # contracts by e
            anomaly = mean + self.e * np.sin(anomaly)
        orbit = np.radians(self.inclination)
        normal = np.array([0.0, -np.sin(orbit), np.cos(orbit)])
        c, s = np.cos(argument)[:, None], np.sin(argument)[:, None]
        first = c * [1.0, 0.0, 0.0] + s * [0.0, np.cos(orbit), np.sin(orbit)]
        across = np.cross(normal, first)
        x, y = np.cos(anomaly) - self.e, np.sqrt(1 - self.e**2) * np.sin(anomaly)
        r = np.hypot(x, y)[:, None]
        seen = (first[:, None] * x[:, None] + across[:, None] * y[:, None]) / r
        axis = np.array([*pole, np.sqrt(1 - pole @ pole)])
        # the axes of pericentre and across, by the shortest turn from the orbit's normal to the pole
        halfway = normal + axis
        a, b = (v - (v @ axis)[:, None] * halfway / (1 + normal @ axis) for v in (first, across))
        c, s = np.cos(self.turns * mean)[:, None], np.sin(self.turns * mean)[:, None]
        a, b = a[:, None] * c + b[:, None] * s, b[:, None] * c - a[:, None] * s
        least, middle, most = self.moments
        along = [
            m * (seen * v).sum(axis=-1)[..., None] * v for m, v in ((least, a), (middle, b), (most, axis))
        ]
        whole = 3 * self.strength / self.axis**3 * np.cross(seen, sum(along)) / r**3
        return np.asarray(whole.mean(axis=1)[:, :2] / (most * self.spin))

    @property
    def balanced(self) -> np.ndarray:
        """(X, Y) of the pole in balance, in the node's frame."""
        place = np.sin(self.theory())
        return np.array([0.0, place if self.state == 2 else -place])

    def linear(self, times: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(times, 2): path of the pole (X, Y) from a place; and what goes round, from the balance."""
        count, step = 16, 1e-6
        argument = 2 * np.pi * np.arange(count) / count
        columns = []
        for shift in step * np.eye(2):
            change = self.torque(self.balanced + shift, argument) - self.torque(
                self.balanced - shift, argument
            )
            columns.append(change.mean(axis=0) / (2 * step))
        node = 2 * np.pi / (self.node * YEAR)
        jacobian = np.array(columns).T + node * np.array([[0, -1], [1, 0]])
        waves = np.fft.fft(self.torque(self.balanced, argument), axis=0) / count
        forced = np.zeros((len(times), 2))
        for k in range(1, count // 2):
            speed = 2 * np.pi * k / (self.periapsis * YEAR)
            size = np.linalg.solve(1j * speed * np.eye(2) - jacobian, waves[k])
            forced += 2 * (np.exp(1j * speed * times)[:, None] * size).real
        roots, modes = np.linalg.eig(jacobian)
        free = np.linalg.solve(modes, start - self.balanced - forced[0])
        free = (np.exp(roots * times[:, None]) * free @ modes.T).real
        return self.balanced + forced + free, forced

    def run(
        self, pole: np.ndarray, level: str, years: float, samples: int, *, estimate: bool = False
    ) -> Result:
        """From a place of the pole (X, Y) seen from that of the node's plane, rad."""
        tilt = float(np.hypot(*pole))
        node = float(np.arctan2(pole[0], -pole[1]))  # of the equator
        return simulate(
            CONFIG.format(
                name=self.name, spin=np.degrees(self.spin) * DAY, node=node, tilt=np.arcsin(tilt), turn=-node,
                strength=self.strength, axis=self.axis, e=self.e, inclination=self.inclination,
                period=self.period, node_rate=-2 * np.pi / (self.node * YEAR),
                periapsis_rate=2 * np.pi / (self.periapsis * YEAR), level=level, years=years, samples=samples,
                estimate=str(estimate).lower(),
            )
        )  # fmt: skip

    def with_node(self, result: Result) -> np.ndarray:
        """(samples, 2): the pole in the frame that turns with the node, rad."""
        axis = result.values("momentum_axis")
        angle = 2 * np.pi * result.values("time") / (self.node * YEAR)
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * axis[:, 0] - s * axis[:, 1], s * axis[:, 0] + c * axis[:, 1]]).T


# G M of the Earth; the axis by Kepler's third law with both masses; nodes and perigee (Williams et al. 2014)
MOON = Case("moon", 3.986004418e14, 3.84748e8, 0.0549, 5.145, 27.55455, 18.6129, 5.9969, 1.0, 2, (300, 100))
# Laplace plane and its node: Peale, Yseboodt & Margot 2007, Icarus 187, 365
MERCURY = Case(
    "mercury", 1.32712440018e20, 5.790905e10, 0.20563, 8.6, 87.96935, 328e3, 328e3, 1.5, 1, (12000, 3000)
)


def mean(places: np.ndarray) -> np.ndarray:
    """Hann-weighted."""
    weights = np.hanning(len(places))
    return np.asarray(weights @ places / weights.sum())


def angle(path: np.ndarray) -> float:
    """Of the mean of a path, rad."""
    return float(np.arcsin(np.hypot(*mean(path))))


@dataclass(frozen=True)
class Found:
    """A state.

    Attributes:
        angle: of the path's mean, rad.
        expected: the same by the linear theory.
        paths: the first, from the theory's place, the last, and the last by the linear theory.
        forced: most of what goes round in that.
        apart, announced: the average's pole from the full model's, rad, and its modelling error.
    """

    angle: float
    expected: float
    paths: tuple[np.ndarray, np.ndarray, np.ndarray]
    forced: float
    apart: np.ndarray
    announced: float

    @property
    def size(self) -> float:
        """Of the path about its mean, by the linear theory."""
        return float(np.linalg.norm(self.paths[2] - mean(self.paths[2]), axis=1).max())

    @property
    def off(self) -> float:
        """Of the path from the linear theory's, over its size."""
        return float(np.linalg.norm(self.paths[1] - self.paths[2], axis=1).max()) / self.size


def find(case: Case) -> Found:
    """The state of a case, and the full model beside it."""
    pole = case.balanced
    paths = []
    for _ in range(3):
        average = case.run(pole, "orbit_averaged", case.years[0], 3001)
        paths.append(case.with_node(average))
        pole = pole + mean(paths[-1]) - paths[-1][0]
    linear, forced = case.linear(average.values("time"), paths[-1][0])
    last = case.run(pole, "orbit_averaged", case.years[1], 1001, estimate=True)
    full = case.run(pole, "full", case.years[1], 1001)
    round_it, shown = float(np.linalg.norm(forced, axis=1).max()), (paths[0], paths[-1], linear)
    return Found(angle(paths[-1]), angle(linear), shown, round_it, last.apart(full), last.announced())


def picture(shown: list[tuple[Case, Found]]) -> Picture:
    """The pole's path about its state, in the frame of the node."""
    panels = []
    for case, found in shown:
        labels = ("from the balance", "from the state found", "the same by the linear theory")
        drawn = list(zip(found.paths, ("grey", "blue", "orange"), labels, strict=True))
        curves = [Curve(*np.degrees(path - mean(found.paths[1])).T * 3600, label, color, width=0.8)
                  for path, color, label in (drawn if case.name == "mercury" else drawn[:2])]  # fmt: skip
        degrees = np.degrees(found.angle)
        title = f"{case.name.title()}, state {case.state}: {degrees:.4f} deg from the node's pole"
        panels.append(Panel(title, "along the node (arcsec)", "across (arcsec)",
                            [*curves, Curve(0, 0, "", "grey", "+", 3)], equal=True))  # fmt: skip
    title = "Cassini's states: the pole in the frame that turns with the orbit's node"
    return Picture(title, "ab", panels, (11.5, 5.6))


@Study
def study(full: bool) -> Answer:
    """Both states against theory, the full model and what was observed."""
    checks, shown = [], []
    for whole in (MOON, MERCURY):
        case = whole if full else whole.shorter()
        found = find(case)
        shown.append((case, found))
        least, _, most = case.moments
        order = 1.5 * (most - least) / most
        path = 2 * np.sin(found.angle) * min(1, np.pi * case.years[1] / case.node)
        name = case.name.title()
        checks += [
            Check(f"{name}: angle of the pole from the node plane's", np.degrees(found.angle),
                  np.degrees(found.expected), np.degrees(0.1 * found.forced + case.bend * found.angle), "deg",
                  "Colombo 1966, Peale 1969; a tenth of what goes round with the pericentre, and the bend",
                  "absolute"),
            Check(f"{name}: pole of the average from the full model's", found.apart.max(), 0.0,
                  3 * order * path + 1e-6, "rad", "3 x 3/2 (C - A)/C of the path", "absolute"),
            covered(f"{name}: pole of the average", found.apart, found.announced),
        ]  # fmt: skip
        print(f"{name}: path from the linear theory's, over its size: {found.off:.2g}", file=sys.stderr)
        if case.name == "mercury":  # the Moon's libration in longitude, left out, is driven near resonance
            checks.append(
                Check(f"{name}: the path from the linear theory's, over its size", found.off, 0.0, 0.1, "1",
                      "precession and what goes round: second order", "absolute")
            )  # fmt: skip
    moon, mercury = (np.degrees(found.angle) for _, found in shown)
    checks += [
        Check("Moon: against the ecliptic", moon, 1.543, 0.01, "deg",
              "Williams et al. 2014; a mean Kepler orbit"),
        Check("Mercury: obliquity", (mercury - MERCURY.inclination) * 60, 2.04, 0.04, "arcmin",
              "Margot et al. 2012, +- 0.08"),
    ]  # fmt: skip
    return checks, picture(shown)
