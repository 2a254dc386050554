"""Is a thrown, spinning body's kinetic energy that of its centre of mass plus that of its rotation?

Method: five particles, rigidly joined, thrown with a spin under gravity; double precision. From the
dataset's position X, velocity V, attitude R and rates w, every particle gets its place x = X + R r and its
velocity v = V + R (w x r) in space, and energies and momenta are summed particle by particle, with no
inertia tensor in them. Samples lie 2^-10 s apart, at exact times.

Held against:
- T = M V^2/2 + w.Iw/2 (Koenig), I = sum m (r^2 - r r) worked out here; the dataset's energies; its momenta,
  L about the origin = X x P + L about the centre of mass. Tolerance: (n + 8) eps of the largest value, the
  standard bound for a sum of n products of 8 rounded factors, n = 5; times sqrt(steps) more where the
  quaternion's norm enters (the dataset's L) or the integration (conservation); and eps of the places and
  velocities in space where the centre of mass is subtracted from them;
- v against dx/dt by central differences of eighth order (Fornberg 1988): they sum 2.08 positions over the
  spacing h, each good to 4 eps of the largest coordinate; truncation, h^8 w^9 r/630, is below 1e-17 m/s;
- conservation: energy; P = P0 + M g t; L about the origin moves by the parabola's integral of X x M g.

Run: python -m experiments.free_flight_energy [--full] [--out DIR]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

from experiments.common import (
    BLUE,
    EPSILON,
    GREEN,
    GREY,
    ORANGE,
    RED,
    Check,
    Result,
    main,
    new_figure,
    save,
    simulate,
    tidy,
)
from experiments.measure import matrices

NAME = "free_flight_energy"
MASSES = np.array([0.5, 0.3, 0.8, 0.2, 0.4])  # kg
PLACES = np.array([[0.4, 0, 0.1], [-0.3, 0.2, 0], [0, -0.25, -0.1], [0.1, 0.3, 0.5], [-0.2, -0.1, 0.3]])  # m
POSITION, VELOCITY = np.array([0.0, 0.0, 1.0]), np.array([4.0, 1.0, 11.0])
GRAVITY = np.array([0.0, 0.0, -9.80665])
EPS = EPSILON["double"]
STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
CONFIG = """
name = "thrown"
[body]
points = [
{points}
]
[initial]
position = [0, 0, 1]
velocity = [4, 1, 11]
angular_velocity = [5, 3, 8]
euler_angles = [0.3, 1.1, 0.2]
[[loads]]
kind = "uniform_gravity"
[time]
end = {end}
every = "2^-10"
"""


@dataclass(frozen=True)
class Particles:
    """The body as particles: positions and velocities in space, (time, particle, 3)."""

    position: np.ndarray
    velocity: np.ndarray

    @property
    def energy(self) -> np.ndarray:
        """Kinetic, summed over the particles, J."""
        return (MASSES * (self.velocity**2).sum(axis=2)).sum(axis=1) / 2

    @property
    def momentum(self) -> np.ndarray:
        """Linear, summed over the particles, kg m/s."""
        return np.einsum("k,tki->ti", MASSES, self.velocity)

    @property
    def angular_momentum(self) -> np.ndarray:
        """About the origin of space, summed over the particles, kg m^2/s."""
        return np.einsum("k,tki->ti", MASSES, np.cross(self.position, self.velocity))


def from_centre() -> np.ndarray:
    """Places of the particles from their centre of mass, body axes, (particle, 3)."""
    return PLACES - MASSES @ PLACES / MASSES.sum()


def particles(result: Result) -> Particles:
    """Every particle's x = X + R r and v = V + R (w x r)."""
    r = from_centre()
    turn = matrices(result.values("quaternion"))
    relative = np.cross(result.values("angular_velocity")[:, None, :], r[None, :, :])
    return Particles(
        result.values("position")[:, None, :] + np.einsum("tij,kj->tki", turn, r),
        result.values("velocity")[:, None, :] + np.einsum("tij,tkj->tki", turn, relative),
    )


def largest(difference: np.ndarray) -> float:
    """Largest absolute component."""
    return float(np.abs(difference).max())


def study(full: bool, out: Path) -> list[Check]:
    """Sums over particles against the body's; see the module's text."""
    points = ",\n".join(
        f"    {{mass = {m}, position = [{x}, {y}, {z}]}}" for m, (x, y, z) in zip(MASSES, PLACES, strict=True)
    )
    result = simulate(CONFIG.format(points=points, end=20 if full else 2))
    body = particles(result)
    r, mass, time = from_centre(), MASSES.sum(), result.values("time")
    inertia = sum(m * (s @ s * np.eye(3) - np.outer(s, s)) for m, s in zip(MASSES, r, strict=True))
    w, x, v = (result.values(name) for name in ("angular_velocity", "position", "velocity"))
    moving, turning = mass * (v**2).sum(axis=1) / 2, np.einsum("ti,ij,tj->t", w, inertia, w) / 2
    kinetic = result.values("energy") - result.values("potential_energy")
    potential = -mass * (x @ GRAVITY)
    rounding = (len(MASSES) + 8) * EPS
    walk = rounding * np.sqrt(result.steps)
    momentum, linear = body.angular_momentum, result.values("linear_momentum")
    own = result.values("angular_momentum")
    near, slow = body.position - x[:, None], body.velocity - v[:, None]
    about_centre = np.einsum("k,tki->ti", MASSES, np.cross(near, slow))
    cancelled = EPS * mass * (largest(body.position) * largest(slow) + largest(near) * largest(body.velocity))
    levers = POSITION * time[:, None] + VELOCITY * time[:, None] ** 2 / 2 + GRAVITY * time[:, None] ** 3 / 6
    gained = np.cross(levers, mass * GRAVITY)
    slope, h = np.zeros_like(body.position[8:]), time[1] - time[0]
    for shift, weight in enumerate(STENCIL):
        slope += weight * body.position[shift : len(time) - 8 + shift] / h
    rotation = result.values("rotational_energy")
    pushed = mass * (VELOCITY + np.outer(time, GRAVITY))
    top, swing = float(body.energy.max()), largest(momentum)
    total = float((body.energy + np.abs(potential)).max())
    difference_bound = float(np.abs(STENCIL).sum()) * 4 * EPS * largest(body.position) / h
    sums, conserved = "(n + 8) eps of the largest value", "(n + 8) eps sqrt(steps) of the largest value"
    gap = body.energy - (moving + turning)
    checks = [
        Check("sum of m v^2/2 less (M V^2/2 + w.Iw/2)", largest(gap), 0.0, rounding * top, "J",
              f"Koenig; {sums}", "absolute"),
        Check("the same less the dataset's kinetic energy", largest(body.energy - kinetic), 0.0,
              rounding * total, "J", f"energy - potential_energy; {sums}", "absolute"),
        Check("w.Iw/2 less the dataset's rotational energy", largest(turning - rotation), 0.0,
              rounding * float(turning.max()), "J", sums, "absolute"),
        Check("velocity V + w x r less dx/dt", largest(body.velocity[4:-4] - slope), 0.0, difference_bound,
              "m/s", "central differences, order 8; 2.08 x 4 eps abs(x) / h", "absolute"),
        Check("sum of m v less the dataset's P", largest(body.momentum - linear), 0.0,
              rounding * largest(linear), "kg m/s", sums, "absolute"),
        Check("sum of m x cross v less X x P + L", largest(momentum - np.cross(x, linear) - own), 0.0,
              walk * swing, "kg m^2/s", conserved, "absolute"),
        Check("the same about the centre of mass less L", largest(about_centre - own), 0.0,
              walk * largest(own) + cancelled, "kg m^2/s",
              f"{conserved}; + eps M (abs(x) v' + x' abs(v)) for x' = x - X, v' = v - V", "absolute"),
        Check("change of T + potential", largest(np.ptp(body.energy + potential)), 0.0, walk * total, "J",
              f"conservation; {conserved}", "absolute"),
        Check("sum of m v less P0 + M g t", largest(body.momentum - pushed), 0.0, walk * largest(linear),
              "kg m/s", f"dP/dt = F; {conserved}", "absolute"),
        Check("L about the origin less its start and its torque's integral",
              largest(momentum - momentum[0] - gained), 0.0, walk * swing, "kg m^2/s",
              f"dL/dt = X x M g; {conserved}", "absolute"),
    ]  # fmt: skip
    draw(result, body, {"M V²/2": moving, "w.Iw/2": turning, "potential": potential}, gap / top, out)
    return checks


def draw(
    result: Result, body: Particles, energies: dict[str, np.ndarray], gap: np.ndarray, out: Path
) -> None:
    """Paths of the particles, the energies, and what is left between the two sums."""
    figure = new_figure(
        12, 6.6, "Kinetic energy of the particles = that of the centre of mass + that of rotation"
    )
    grid = figure.add_gridspec(2, 2, width_ratios=[1.2, 1])
    path, energy, rest = (figure.add_subplot(cell) for cell in (grid[:, 0], grid[0, 1], grid[1, 1]))
    flight = slice(0, 2049)
    x, time = result.values("position"), result.values("time")[flight]
    for k, color in zip(range(len(MASSES)), (BLUE, ORANGE, GREEN, RED, "#984ea3"), strict=True):
        path.plot(
            body.position[flight, k, 0], body.position[flight, k, 2], color=color, linewidth=0.8, alpha=0.75
        )
    path.plot(x[flight, 0], x[flight, 2], color="black", linewidth=2.2, label="centre of mass: a parabola")
    for i in range(0, 2049, 256):
        for k, color in zip(range(len(MASSES)), (BLUE, ORANGE, GREEN, RED, "#984ea3"), strict=True):
            place = body.position[i, k]
            path.plot([x[i, 0], place[0]], [x[i, 2], place[2]], color=GREY, linewidth=1.1)
            path.plot(place[0], place[2], "o", color=color, markersize=3 + 6 * MASSES[k])
    tidy(path, "X (m)", "Z (m)", "Five particles, rigidly joined, thrown with a spin")
    path.set_aspect("equal")
    path.legend(loc="lower center", fontsize=9, framealpha=1)
    for (name, values), color in zip(energies.items(), (BLUE, ORANGE, GREY), strict=True):
        energy.plot(time, values[flight], color=color, label=name)
    energy.plot(
        time,
        (body.energy + energies["potential"])[flight],
        color="black",
        label="sum over particles + potential",
    )
    tidy(energy, "time (s)", "energy (J)", "Energies: the particles' sum is constant")
    energy.set_ylim(-10, 260)
    energy.legend(loc="upper center", fontsize=8.5, framealpha=1, ncols=2)
    rest.plot(time, gap[flight] / EPS, ".", color=BLUE, markersize=2)
    bound = len(MASSES) + 8
    for sign in (1, -1):
        rest.axhline(sign * bound, color=RED, linestyle="--", linewidth=1,
                     label=f"bound: {bound} eps" if sign > 0 else None)  # fmt: skip
    tidy(rest, "time (s)", "difference / (eps T)", "Sum over particles less M V²/2 + w.Iw/2, in roundings")
    rest.legend(loc="upper right", bbox_to_anchor=(1, 0.9), fontsize=9, framealpha=1)
    save(figure, out, NAME)


if __name__ == "__main__":
    sys.exit(main(study, NAME))
