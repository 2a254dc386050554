"""What several tests share: running texts, exact values of datasets, angles between attitudes, bounds."""

from __future__ import annotations

import math
from pathlib import Path

import heyoka as hy
import numpy as np
import xarray

import rigidsim
from rigidsim.prepare import prepare

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
EPSILON = {"single": 2.0**-23, "double": 2.0**-52, "extended": 2.0**-63, "quadruple": 2.0**-112}


def run_text(text: str, out: Path, *overrides: str, timeline: bool = False) -> rigidsim.Run:
    """Run a config text, without drawing unless asked for."""
    settings = [f"output.timeline={str(timeline).lower()}", *overrides]
    return rigidsim.run(rigidsim.parse(text, overrides=settings), out=out, force=True)


def wide(dataset: xarray.Dataset, name: str) -> np.ndarray:
    """A variable with its residuals added, as 80-bit numbers (exact for extended precision)."""
    value = dataset[name].values.astype(np.longdouble)
    for suffix in ("_lo", "_lo2", "_lo3"):
        if name + suffix in dataset:
            value = value + dataset[name + suffix].values
    return value


def angle_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Angle (rad) of the rotation between attitudes p and q, shape (n, 4); accurate for tiny angles."""
    p = p / np.sqrt((p * p).sum(axis=1))[:, None]
    q = q / np.sqrt((q * q).sum(axis=1))[:, None]
    chord = np.minimum(np.sqrt(((p - q) ** 2).sum(axis=1)), np.sqrt(((p + q) ** 2).sum(axis=1)))
    return (4 * np.arcsin(np.minimum(chord / 2, 1))).astype(float)


def law(epsilon: float, steps: int, rate: float, duration: float) -> float:
    """The round-off law of attitude errors (Brouwer 1937): (eps / 2) sqrt(steps) |w| t / sqrt 3."""
    return epsilon / 2 * math.sqrt(steps) * rate * duration / math.sqrt(3)


def amplification(experiment: rigidsim.Experiment, points: int = 120) -> float:
    """How much an error made at any time can have grown at any later one: the largest spectral norm of
    the state transition matrix between two times, from the variational equations.

    For a stable motion it grows linearly with time (a change of frequency becomes one of phase), which the
    round-off law contains; where the motion is unstable it grows exponentially as long as the body stays
    near its unstable axis.
    """
    prepared = prepare(experiment)
    system = prepared.system
    variational = hy.var_ode_sys(system.equations, hy.var_args.vars)
    count = len(system.states)
    start = np.concatenate([[float(x) for x in system.initial], np.eye(count).ravel()])
    integrator = hy.taylor_adaptive(list(variational.sys), start, compact_mode=True, time=0.0)
    end = float(prepared.clock.at(prepared.clock.count - 1)) - float(prepared.clock.start)
    states = integrator.propagate_grid(np.linspace(0.0, end, points))[-1]
    matrices = states[:, count:].reshape(points, count, count)
    largest = 1.0
    for i in range(points):
        inverse = np.linalg.pinv(matrices[i])
        norms = np.linalg.norm(matrices[i:] @ inverse, ord=2, axis=(1, 2))
        largest = max(largest, float(norms.max()))
    return largest
