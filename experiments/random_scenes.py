"""Random scenes of every kind that rigidsim knows, as config texts: bodies, loads, units, horizons, samples.

The same seed and number always give the same scene. Motions are drawn with rates of order one, and units of
time, mass and length over many decades are put on afterwards.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

_CHAOTIC_HORIZON = 300.0  # rad: past it no number of digits in reach is left
_KINKED_HORIZON = 100.0  # each surface crossed is found to thirty digits for the truth
_TIGHT_HORIZON = 300.0  # where the accuracy asked for needs quadruple precision: seconds instead of minutes
_TIGHT = 1e-15
_LOOSE = 3e-5


Vector = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class RandomScene:
    """One scene.

    Attributes:
        kind: of scene, a key of ``KINDS``.
        text: TOML, with the accuracy asked for.
        accuracy: rad.
        radians: about how far the body turns.
    """

    number: int
    kind: str
    text: str
    accuracy: float
    radians: float


class Draw:
    """Random numbers of one scene, in its own units.

    Attributes:
        time, mass, length: units.
        horizon: of the run at most, rad.
        time_scale: of the motion, units of time.
        lines, more, parameters: of the config.
    """

    def __init__(self, generator: np.random.Generator) -> None:
        self.random = generator
        self.time = 10 ** generator.uniform(-3, 4)
        self.mass = 10 ** generator.uniform(-6, 6)
        self.length = 10 ** generator.uniform(-3, 3)
        self.horizon = 1e4
        self.time_scale = 1.0
        self.lines: list[str] = []
        self.more: list[str] = []
        self.parameters: list[str] = []

    def between(self, low: float, high: float) -> float:
        """Uniform."""
        return float(self.random.uniform(low, high))

    def decades(self, low: float, high: float) -> float:
        """Ten to a uniform power."""
        return float(10 ** self.random.uniform(low, high))

    def direction(self) -> np.ndarray:
        """A unit vector (3,)."""
        vector = self.random.standard_normal(3)
        return vector / np.linalg.norm(vector)

    def moments(self) -> np.ndarray:
        """Of an asymmetric body, in random order."""
        masses = self.random.uniform(0.2, 1.0, 3)  # the second moments of mass: any positive three
        return masses.sum() - masses

    def body(self, moments: Vector, arm: Vector | None = None, *, turned: bool = False) -> None:
        """``[body]``; the arm of gravity in units of length; ``turned``: not the principal axes."""
        size = self.mass * self.length**2
        inertia = np.diag(np.asarray(moments, dtype=float) * size)
        if turned:
            axes = np.linalg.qr(self.random.standard_normal((3, 3)))[0]
            inertia = axes @ inertia @ axes.T
            inertia = (inertia + inertia.T) / 2
            self.lines.append(f"inertia_tensor = {[[float(x) for x in row] for row in inertia]}")
        else:
            self.lines.append(f"principal_moments = {[float(x) for x in np.diag(inertia)]}")
        self.lines.append(f"mass = {self.mass!r}")
        if arm is not None:
            self.lines.append(f"center_of_mass = {[float(x * self.length) for x in arm]}")

    def start(self, rates: Vector, **more: Vector) -> None:
        """``[initial]``; further vectors are in units of length (and time, for velocities)."""
        quaternion = self.random.standard_normal(4)
        self.lines.append("[initial]")
        self.lines.append(f"angular_velocity = {[float(w / self.time) for w in rates]}")
        self.lines.append(f"quaternion = {[float(x) for x in quaternion / np.linalg.norm(quaternion)]}")
        unit = {"position": self.length, "velocity": self.length / self.time}
        self.lines += [f"{k} = {[float(x * unit[k]) for x in v]}" for k, v in more.items()]

    def load(self, kind: str, *lines: str) -> None:
        """``[[loads]]``, with its other keys as they stand."""
        self.more += ["[[loads]]", f'kind = "{kind}"', *lines]

    def source(self, axis: float, motion: float, eccentricity: float, **elements: float) -> None:
        """A gravity gradient along an orbit: semi-major axis, mean motion, and further elements, SI."""
        strength = f"gravitational_parameter = {motion**2 * axis**3!r}"
        self.load("gravity_gradient", strength, orbit(axis, eccentricity=eccentricity, **elements))

    def fly(
        self, rates: Vector, distance: float, speed: float, tilt: float, strength: float, *lines: str
    ) -> None:
        """Start at right angles to the direction of an attractor; in units."""
        self.start(rates, position=[distance, 0, 0], velocity=across(speed, tilt))
        scaled = strength * self.length**3 / self.time**2
        self.load("central_gravity", f"gravitational_parameter = {scaled!r}", *lines)

    def gravity(self, strength: float) -> None:
        """Such that mass times acceleration times a unit of length is the strength."""
        down = [0.0, 0.0, -strength * self.length / self.time**2]
        self.load("uniform_gravity", f"acceleration = {down}")

    def text(self, name: str, time: Sequence[str], integrator: Sequence[str], *output: str) -> str:
        """The config: all that was drawn, and lines of further tables."""
        tables = {"parameters": self.parameters, "body": [*self.lines, *self.more], "time": time}
        tables |= {"integrator": integrator, "output": [*output, "timeline = false"]}
        lines = [line for key, rest in tables.items() if rest for line in (f"[{key}]", *rest)]
        return "\n".join([f'name = "{name}"', *lines, ""])

    def sometimes(self, chance: float) -> bool:
        """True with this chance."""
        return bool(self.random.random() < chance)


def orbit(axis: float, **elements: float) -> str:
    """``orbit`` of a load."""
    given = {"semi_major_axis": axis, **elements}
    return f"orbit = {{{', '.join(f'{name} = {value!r}' for name, value in given.items())}}}"


def across(speed: float, tilt: float) -> list[float]:
    """A velocity at right angles to the x axis."""
    return [0, speed * math.cos(tilt), speed * math.sin(tilt)]


def _symmetric(draw: Draw) -> None:
    along = draw.between(0.1, 1.9)
    draw.body([1, 1, along], turned=draw.sometimes(0.3))
    draw.start(draw.direction())


def _asymmetric(draw: Draw) -> None:
    draw.body(draw.moments(), turned=draw.sometimes(0.4))
    draw.start(draw.direction())


def _near_separatrix(draw: Draw) -> None:
    draw.body(np.sort(draw.moments()))
    draw.start([draw.decades(-12, -2), 1.0, draw.decades(-12, -2)])


def _needle(draw: Draw) -> None:
    thin = draw.decades(-5, -2)
    draw.body([1, 1 - thin * draw.between(-0.5, 0.5), thin])
    draw.start(draw.direction() * [1, 1, draw.between(0.5, 10)])


def _plate(draw: Draw) -> None:
    across = draw.between(0.2, 1)
    draw.body([1, across, 1 + across], turned=draw.sometimes(0.3))
    draw.start(draw.direction())


def _heavy_symmetric(draw: Draw) -> None:
    draw.body([1, 1, draw.between(0.2, 1.5)], [0, 0, draw.between(0.3, 1)])
    draw.start(draw.direction() * [1, 1, draw.between(1, 5)])
    draw.gravity(draw.decades(-1, 0.5))


def _kovalevskaya(draw: Draw) -> None:
    draw.body([2, 2, 1], [draw.between(0.2, 1), 0, 0])
    draw.start(draw.direction() * 2)
    draw.gravity(draw.decades(-1, 0))


def _heavy_asymmetric(draw: Draw) -> None:
    draw.horizon = _CHAOTIC_HORIZON
    draw.body(draw.moments(), draw.direction() * draw.between(0.2, 1))
    draw.start(draw.direction() * draw.between(1, 3))
    draw.gravity(draw.decades(-1, 0.3))


def _fixed_source(draw: Draw) -> None:
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction())
    where = draw.direction() * 1e3 * draw.length
    strength = (draw.decades(-1.5, -0.5) / draw.time) ** 2 * (1e3 * draw.length) ** 3
    place = f"position = {[float(x) for x in where]}"
    draw.load("gravity_gradient", f"gravitational_parameter = {float(strength)!r}", place)


def _on_orbit(draw: Draw, eccentricity: float) -> None:
    draw.horizon = 1e3
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.between(0.5, 1))
    axis = 1e3 * draw.length
    motion = draw.between(0.05, 0.4) / draw.time
    names = ("inclination", "ascending_node", "periapsis", "mean_anomaly")
    draw.source(axis, motion, eccentricity, **{name: draw.between(0, 3) for name in names})


def _central_gravity(draw: Draw) -> None:
    draw.horizon = 1e3
    draw.body(draw.moments())
    distance, motion = draw.decades(1.5, 3), draw.between(0.05, 0.4)
    speed = motion * distance * draw.between(0.9, 1.1)
    tilt = draw.between(0, 3)
    draw.fly(draw.direction(), distance, speed, tilt, motion**2 * distance**3)


def _free_flight(draw: Draw) -> None:
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction(), position=draw.direction(), velocity=draw.direction())
    draw.gravity(draw.between(0.1, 1))


def _viscous(draw: Draw) -> None:
    draw.body(draw.moments())
    draw.start(draw.direction())
    unit = draw.mass * draw.length**2 / draw.time * draw.decades(-5, -2)
    draw.load("viscous_torque", f"coefficients = {[unit * draw.between(0.3, 1) for _ in range(3)]}")


def _torque(frame: str, *components: str, horizon: float = 1e3) -> Callable[[Draw], None]:
    """A torque of strength k and frequency n, in the axes of the body or of space."""

    def drawn(draw: Draw) -> None:
        draw.horizon = horizon
        draw.body(draw.moments(), turned=draw.sometimes(0.3))
        draw.start(draw.direction())
        k = draw.mass * draw.length**2 / draw.time**2 * draw.decades(-4, -1)
        draw.parameters = [f"k = {k!r}", f"n = {draw.between(0.1, 2) / draw.time!r}"]
        draw.load("torque", f"components = {list(components)}", f'frame = "{frame}"')

    return drawn


def _plunge(draw: Draw) -> None:
    """Six degrees of freedom, falling nearly straight towards an attractor and past it."""
    draw.horizon = 30.0
    draw.body(draw.moments())
    distance = draw.decades(1.5, 2.5)
    strength = distance**3 * draw.between(0.05, 0.2) ** 2
    across = math.sqrt(strength / distance) * draw.between(0.1, 0.4)
    draw.start(
        draw.direction() * draw.between(0.2, 1), position=[distance, 0, 0], velocity=[0, across, 0.3 * across]
    )
    scaled = strength * draw.length**3 / draw.time**2
    draw.load("central_gravity", f"gravitational_parameter = {scaled!r}")


KINDS: dict[str, Callable[[Draw], None]] = {
    "symmetric": _symmetric,
    "asymmetric": _asymmetric,
    "near separatrix": _near_separatrix,
    "needle": _needle,
    "plate": _plate,
    "heavy symmetric top": _heavy_symmetric,
    "Kovalevskaya top": _kovalevskaya,
    "heavy asymmetric top": _heavy_asymmetric,
    "fixed source": _fixed_source,
    "circular orbit": lambda draw: _on_orbit(draw, 0.0),
    "eccentric orbit": lambda draw: _on_orbit(draw, draw.between(0.01, 0.4)),
    "central gravity": _central_gravity,
    "free flight": _free_flight,
    "viscous": _viscous,
    "torque, body axes": _torque("body", "k*sin(n*t)", "0.5*k", "-k*wx*wy/n^2"),
    "torque, space axes": _torque("space", "k*cos(n*t)^2", "-k*sin(n*t)", "0.2*k"),
    # a short push, of which no beginning of the motion knows
    "late pulse": _torque("body", "k*exp(-(n*(t - late))^2)", "0", "3*k*exp(-(n*(t - late))^2)"),
    "kinked torque": _torque(
        "body", "k*abs(sin(n*t))", "-k*max(wy, 0)/n", "k*sqrt((wx - wz)^2)/n", horizon=_KINKED_HORIZON
    ),
    "dry friction": _torque(
        "body", "-k*sign(wx)", "-0.6*k*sign(wy)", "0.4*k*cos(n*t)", horizon=_KINKED_HORIZON
    ),
    # it jumps where the quaternion changes its sign, and is the same at q and -q
    "sign of the quaternion": _torque("body", "k*sign(qw)*qx", "0", "0.4*k*qw*qz", horizon=_KINKED_HORIZON),
    "plunge": _plunge,
}


def random_scene(number: int, seed: int = 0) -> RandomScene:
    """Scene ``number`` of a seed; kinds take turns."""
    kind = list(KINDS)[number % len(KINDS)]
    draw = Draw(np.random.default_rng([seed, number]))
    KINDS[kind](draw)
    accuracy = draw.decades(-20, -15) if draw.sometimes(0.05) else draw.decades(-15, -3)
    most = min(draw.horizon, _TIGHT_HORIZON if accuracy < _TIGHT else math.inf)
    radians = draw.decades(1, math.log10(most))
    end = radians * draw.time
    if kind == "late pulse":
        draw.parameters.append(f"late = {end * draw.between(0.5, 0.95)!r}")
    samples = round(draw.decades(math.log10(2), math.log10(2000)))
    fixed = [f"accuracy = {accuracy!r}"]
    if draw.sometimes(0.35):  # where there is a closed form it would nearly always be chosen
        fixed.append('method = "taylor"')
    if accuracy > _LOOSE and draw.sometimes(0.15):
        fixed.append('precision = "single"')
    time = [f"end = {end!r}", f"samples = {samples}"]
    text = draw.text(f"scene{number}", time, fixed, 'record = ["quaternion"]')
    return RandomScene(number, kind, text, accuracy, radians)
