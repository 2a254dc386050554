"""What does a fit of eight parameters to 10,000 rows cost, beside one run and beside SciPy's least_squares?

Method: a free body and one in a gravity gradient tumble 700 times, and are seen 10,000 times, each time its
attitude to 1e-3 rad and its angular velocity to 1e-3 rad/s. Estimated are the attitude and rates at the start
and two moments: from near, where attitudes are off by some ten of their sigmas, and from ten times as far.
CPU time of this process, all of it compiled before:

- one run at the 10,000 times (what its summary gives for integrating and recording);
- the search of `fit`: everything from the first evaluation of the motion to the last, without reading the
  config and the data and building the equations, which are given beside it;
- `scipy.optimize.least_squares`, method "lm", derivatives by its own differences, on
  `rigidsim.run(..., out=None)`, from the same start, residuals as in the fit: of the free body from near.
  Each of its runs compiles the equations of other numbers, which counts here.

Held against, from near: ten times the run, and a fifth of SciPy's time. Both must end in the same values,
within twice what SciPy's tolerance leaves open (0.025 sigmas).

Run: python -m experiments.fit_cost [--rounds N]      Exit: 1 if one fails
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import rigidsim
from experiments.common import Check, table
from rigidsim.workflows.fit import fitting

T = TypeVar("T")

ROWS = 10_000
SIGMA = 1e-3  # rad, and rad/s
MOST_RUNS, MOST_OF_SCIPY = 10.0, 0.2
_ASKED = "asked of this project"
FREE = """
name = "seen"
[body]
principal_moments = [1.9, 2.6, 1]
[initial]
angular_velocity = [0.02, 0.3, 0.9]
[time]
end = 5000
samples = 10001
[output]
record = ["quaternion", "angular_velocity"]
timeline = false
estimate = false
"""
GRADIENT = """
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1.0
orbit = {semi_major_axis = 10, eccentricity = 0.1}
"""
SCENES = {"free": FREE, "gravity gradient": FREE + GRADIENT}
OFF = np.array([0.03, -0.05, 0.04, 2e-5, -1e-5, 1e-5, 4e-5, -2e-5])
"""Where the fit starts, less the truth: attitude (rad), rates (rad/s) and two moments (kg m^2)."""
FIT = """
[fit]
parameters = ["initial.attitude", "initial.angular_velocity",
              "body.principal_moments[0]", "body.principal_moments[1]"]
[[fit.data]]
file = "FILE"
observable = "quaternion"
columns = ["w", "x", "y", "z"]
sigma = "1e-3 rad"
[[fit.data]]
file = "FILE"
observable = "angular_velocity"
columns = ["a", "b", "c"]
sigma = 1e-3
"""


def spent(work: Callable[[], T]) -> tuple[float, T]:
    """CPU seconds of a piece of work, and what it made."""
    began = time.process_time()
    made = work()
    return time.process_time() - began, made


class Scene:
    """One body with its observations."""

    def __init__(self, text: str, folder: Path, far: float) -> None:
        self.at_rows = rigidsim.parse(text)
        true = rigidsim.run(self.at_rows, out=None, progress=False).dataset.isel(time=slice(1, None))
        times = true["time"].values
        noise = np.random.default_rng(3)
        turns = Rotation.from_rotvec(SIGMA * noise.standard_normal((ROWS, 3)))
        self.attitudes = turns * Rotation.from_quat(true["quaternion"].values[:, [1, 2, 3, 0]])
        self.rates = true["angular_velocity"].values + SIGMA * noise.standard_normal((ROWS, 3))
        rows = np.column_stack([times, self.attitudes.as_quat()[:, [3, 0, 1, 2]], self.rates])
        file = folder / "seen.csv"
        np.savetxt(file, rows, "%.17g", ",", header="time,w,x,y,z,a,b,c", comments="")
        truth = np.array([0, 0, 0, 0.02, 0.3, 0.9, 1.9, 2.6])
        self.start = truth + far * OFF
        self.begun = rigidsim.parse(text + FIT.replace("FILE", str(file))).replace(self.changes(self.start))

    @staticmethod
    def changes(values: np.ndarray) -> dict[str, Any]:
        """The config's values for those of the parameters."""
        x, y, z, w = Rotation.from_rotvec(values[:3]).as_quat().tolist()
        return {
            "initial.quaternion": [w, x, y, z],
            "initial.angular_velocity": values[3:6].tolist(),
            "body.principal_moments": [*values[6:].tolist(), 1.0],
        }

    def run(self) -> float:
        """CPU seconds of one run's integration."""
        made = rigidsim.run(self.at_rows, out=None, progress=False)
        return float(made.summary["cost"]["cpu_by_phase"]["integrate_and_record"])

    def fit(self) -> tuple[float, float, Any]:
        """CPU seconds of the search and of the whole fit, and the fit."""
        searched: list[float] = []
        search = fitting.search

        def timed(*arguments: Any) -> Any:
            seconds, found = spent(lambda: search(*arguments))
            searched.append(seconds)
            return found

        fitting.search = timed
        try:
            whole, found = spent(lambda: rigidsim.fit(self.begun))
        finally:
            fitting.search = search
        return searched[0], whole, found

    def by_scipy(self) -> tuple[float, Any, int]:
        """CPU seconds of SciPy's fit, what it found, and its runs."""
        runs = 0

        def residuals(values: np.ndarray) -> np.ndarray:
            nonlocal runs
            runs += 1
            made = rigidsim.run(self.at_rows.replace(self.changes(values)), out=None, progress=False)
            made = made.dataset.isel(time=slice(1, None))
            computed = Rotation.from_quat(made["quaternion"].values[:, [1, 2, 3, 0]])
            turns = (self.attitudes * computed.inv()).as_rotvec()
            return np.concatenate([turns, self.rates - made["angular_velocity"].values]).ravel() / SIGMA

        seconds, found = spent(lambda: least_squares(residuals, self.start, method="lm", x_scale="jac"))
        return seconds, found, runs


def costs(name: str, scene: Scene, rounds: int) -> tuple[float, float, Any]:
    """The search in runs' integrations and the CPU seconds of the whole fit, medians of rounds; the fit."""
    scene.fit()  # compiles
    searches, wholes, runs = [], [], []
    for _ in range(rounds):
        runs.append(statistics.median(scene.run() for _ in range(5)))
        search, whole, found = scene.fit()
        searches.append(search / runs[-1])
        wholes.append(whole)
    search, whole, run = (statistics.median(x) for x in (searches, wholes, runs))
    print(
        f"{name}: run {1e3 * run:.0f} ms; search {search:.1f} runs, {found.evaluations} evaluations; "
        f"all of the fit {whole / run:.1f} runs",
        flush=True,
    )
    return search, whole, found


def beside_scipy(scene: Scene, whole: float, found: Any) -> list[Check]:
    """A fit beside SciPy's."""
    seconds, other, runs = scene.by_scipy()
    start = Rotation.from_rotvec(scene.start[:3])  # of which the fit's attitude is counted
    ours = np.array([one.value for one in found.parameters])
    ours[:3] = (start * Rotation.from_rotvec(ours[:3])).as_rotvec()
    sigmas = np.array([one.sigma for one in found.parameters])
    apart = float(np.abs((ours - other.x) / sigmas).max())
    print(f"SciPy: {seconds:.0f} s, {runs} runs; fit {whole:.2f} s", flush=True)
    return [
        Check("all of a fit by SciPy's time", whole / seconds, 0, MOST_OF_SCIPY, "1", _ASKED, "absolute"),
        # SciPy stops where the sum of 60,000 squares changes by less than 1e-8 of it: sqrt(6e-4) sigmas
        Check("values apart", apart, 0, 0.05, "sigmas", "twice SciPy's own tolerance", "absolute"),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure both scenes from both starts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args(arguments).rounds
    checks = []
    with tempfile.TemporaryDirectory() as folder:
        for name, text in SCENES.items():
            near = Scene(text, Path(folder), 0.1)
            search, whole, found = costs(f"{name}, near", near, rounds)
            checks.append(Check(f"{name}: runs' integration", search, 0, MOST_RUNS, "1", _ASKED, "absolute"))
            if text == FREE:
                checks += beside_scipy(near, whole, found)
            costs(f"{name}, ten times as far", Scene(text, Path(folder), 1.0), rounds)
    print(table(checks, "what a fit costs"))
    return int(not all(check.passed for check in checks))


if __name__ == "__main__":
    sys.exit(main())
