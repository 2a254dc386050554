"""What does rigidsim cost over a bare heyoka script?

Question: a free asymmetric body, I = (1, 2, 2.5), w = (0.1, 1, 0.05), in double precision.
  sparse: T = 1e6, 1001 samples, against `propagate_grid` of the same equations (allowed: 1.1);
  dense: T = 1e5, 1e6 samples, default record, against a script that integrates, evaluates the same
  variables with compiled functions and writes them with h5py and the same filters (allowed: 2).

Method: CPU seconds of fresh processes in turn, imports apart, compilation included; the median of the
ratios pair by pair. The machine's noise is in both; single absolute times mean little.

Run: python -m experiments.cost_ratio [--pairs 5]
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

MOMENTS = (1.0, 2.0, 2.5)
RATES = (0.1, 1.0, 0.05)
CASES = {"sparse": (1e6, 1001), "dense": (1e5, 1_000_001)}
CONFIG = """
name = "cost"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1.0, 0.05]
[time]
end = {end}
samples = {samples}
[output]
timeline = {timeline}
"""


def bare_system() -> tuple[list, list]:
    """Rates and quaternion as anyone would write them."""
    import heyoka as hy

    a, b, c = MOMENTS
    wx, wy, wz, qw, qx, qy, qz = hy.make_vars("wx", "wy", "wz", "qw", "qx", "qy", "qz")
    equations = [
        (wx, (b - c) / a * wy * wz),
        (wy, (c - a) / b * wz * wx),
        (wz, (a - b) / c * wx * wy),
        (qw, 0.5 * (-qx * wx - qy * wy - qz * wz)),
        (qx, 0.5 * (qw * wx + qy * wz - qz * wy)),
        (qy, 0.5 * (qw * wy + qz * wx - qx * wz)),
        (qz, 0.5 * (qw * wz + qx * wy - qy * wx)),
    ]
    return equations, [*RATES, 1.0, 0.0, 0.0, 0.0]


def bare(case: str, folder: Path) -> Callable[[], None]:
    """The bare script; returns what is to be timed."""
    import h5py
    import heyoka as hy

    end, samples = CASES[case]

    def integrate() -> np.ndarray:
        equations, state = bare_system()
        integrator = hy.taylor_adaptive(equations, state)
        return integrator.propagate_grid(np.linspace(0.0, end, samples))[-1]

    def write() -> None:
        states = integrate()
        equations, _ = bare_system()
        variables = [v for v, _ in equations]
        w, (qw, qx, qy, qz) = variables[:3], variables[3:]
        lx, ly, lz = (m * x for m, x in zip(MOMENTS, w, strict=True))
        rows = [
            [qw * qw + qx * qx - qy * qy - qz * qz, 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)],
            [2 * (qx * qy + qw * qz), qw * qw - qx * qx + qy * qy - qz * qz, 2 * (qy * qz - qw * qx)],
            [2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), qw * qw - qx * qx - qy * qy + qz * qz],
        ]
        momentum = [r[0] * lx + r[1] * ly + r[2] * lz for r in rows]
        norm = hy.sqrt(lx * lx + ly * ly + lz * lz)
        energy = 0.5 * (w[0] * lx + w[1] * ly + w[2] * lz)
        q_norm = hy.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
        function = hy.cfunc([*momentum, norm, energy, q_norm], variables)
        values = function(np.ascontiguousarray(states.T))
        first = values[:, 0]
        scale = first[3]
        drift = np.sqrt(((values[:3] - first[:3, None]) ** 2).sum(axis=0)) / scale
        columns = {
            "time": np.linspace(0.0, end, samples),
            "angular_velocity": states[:, :3],
            "quaternion": states[:, 3:],
            "angular_momentum": values[:3].T,
            "angular_momentum_norm": values[3],
            "energy": values[4],
            "angular_momentum_drift": drift,
            "angular_momentum_norm_drift": (values[3] - first[3]) / scale,
            "energy_drift": (values[4] - first[4]) / first[4],
            "quaternion_norm_drift": values[5] - first[5],
        }
        with h5py.File(folder / "bare.h5", "w") as file:
            for name, column in columns.items():
                file.create_dataset(
                    name,
                    data=column,
                    chunks=(8192, *column.shape[1:]),
                    compression="gzip",
                    compression_opts=4,
                    shuffle=True,
                )

    return write if case == "dense" else lambda: np.save(folder / "bare.npy", integrate())


def ours(case: str, folder: Path, timeline: bool) -> Callable[[], None]:
    """rigidsim's run of the same, run folder and all."""
    import xarray  # noqa: F401  (imports apart)

    import rigidsim

    if timeline:
        import rigidsim.look.timeline
    end, samples = CASES[case]
    text = CONFIG.format(end=end, samples=samples, timeline=str(timeline).lower())
    experiment = rigidsim.parse(text)
    run = rigidsim.run

    def go() -> None:
        result = run(experiment, out=folder)
        if result.status != "finished":
            raise SystemExit(result.summary["message"])

    return go


def child(kind: str, case: str) -> None:
    """Time one thing in this fresh process; prints CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        if kind == "bare":
            action = bare(case, Path(folder))
        else:
            action = ours(case, Path(folder), timeline=kind == "timeline")
        started = time.process_time()
        action()
        print(json.dumps(time.process_time() - started))


def measure(kind: str, case: str) -> float:
    """CPU seconds of one fresh process."""
    command = [sys.executable, "-m", "experiments.cost_ratio", "--child", kind, "--case", case]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return float(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Print the table of ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--child", choices=["bare", "ours", "timeline"])
    parser.add_argument("--case", choices=list(CASES))
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments.child, arguments.case)
        return
    allowed = {"sparse": 1.1, "dense": 2.0}
    print("case    variant          bare s   rigidsim s   ratio (median, min .. max)   allowed")
    for case in [arguments.case] if arguments.case else CASES:
        for kind, title in (("ours", "dataset"), ("timeline", "with timeline")):
            pairs = [(measure("bare", case), measure(kind, case)) for _ in range(arguments.pairs)]
            ratios = sorted(b / a for a, b in pairs)
            print(
                f"{case:7s} {title:14s} {statistics.median(a for a, _ in pairs):8.2f} "
                f"{statistics.median(b for _, b in pairs):12.2f} {statistics.median(ratios):8.2f} "
                f"({ratios[0]:.2f} .. {ratios[-1]:.2f}) {allowed[case]:18.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
