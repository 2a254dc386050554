"""A free asymmetric body.

python free_body.py sparse OUT.h5 END SAMPLES: `propagate_grid`, and the states in an HDF5 file
python free_body.py dense OUT.h5 END SAMPLES [extended [TOLERANCE]]: rates, attitude, momentum, energy and
    their drifts by compiled functions, written by h5py with its shuffle and gzip filters; in 80-bit
    arithmetic each value as a double and the rest, at heyoka's own tolerance unless another is given
python free_body.py warm TIMES: integrator and eleven samples again and again, the median CPU seconds
"""

import json
import resource
import statistics
import sys
import time
from typing import Any

import h5py
import heyoka as hy
import numpy as np

A, B, C = 1.0, 2.0, 2.5


def integrator(number: Any = float, **options: Any) -> tuple[Any, Any]:
    """Variables, and an integrator at the start."""
    wx, wy, wz, qw, qx, qy, qz = state = hy.make_vars("wx", "wy", "wz", "qw", "qx", "qy", "qz")
    equations = [
        (wx, number(B - C) / number(A) * wy * wz),
        (wy, number(C - A) / number(B) * wz * wx),
        (wz, number(A - B) / number(C) * wx * wy),
        (qw, 0.5 * (-qx * wx - qy * wy - qz * wz)),
        (qx, 0.5 * (qw * wx + qy * wz - qz * wy)),
        (qy, 0.5 * (qw * wy + qz * wx - qx * wz)),
        (qz, 0.5 * (qw * wz + qx * wy - qy * wx)),
    ]
    start = [number(1) / 10, number(1), number(1) / 20, number(1), number(0), number(0), number(0)]
    return state, hy.taylor_adaptive(equations, start, fp_type=number, **options)


def sparse(out: str, end: float, samples: int) -> None:
    """Few samples."""
    times = np.linspace(0.0, end, samples)
    states = integrator()[1].propagate_grid(times)[-1]
    with h5py.File(out, "w") as file:
        file["time"] = times
        file["angular_velocity"] = states[:, :3]
        file["quaternion"] = states[:, 3:]


def dense(out: str, end: float, samples: int, *more: str) -> None:
    """Many samples with everything that rigidsim records."""
    number = np.longdouble if more else float
    state, engine = integrator(number, **({"tol": number(more[1])} if len(more) > 1 else {}))
    times = np.arange(samples).astype(number) * number(end) / number(samples - 1)
    states = engine.propagate_grid(times)[-1]
    wx, wy, wz, qw, qx, qy, qz = state
    lx, ly, lz = A * wx, B * wy, C * wz
    rows = [
        [qw * qw + qx * qx - qy * qy - qz * qz, 2.0 * (qx * qy - qw * qz), 2.0 * (qx * qz + qw * qy)],
        [2.0 * (qx * qy + qw * qz), qw * qw - qx * qx + qy * qy - qz * qz, 2.0 * (qy * qz - qw * qx)],
        [2.0 * (qx * qz - qw * qy), 2.0 * (qy * qz + qw * qx), qw * qw - qx * qx - qy * qy + qz * qz],
    ]
    momentum = [row[0] * lx + row[1] * ly + row[2] * lz for row in rows]
    norm = hy.sqrt(lx * lx + ly * ly + lz * lz)
    energy = 0.5 * (wx * lx + wy * ly + wz * lz)
    q_norm = hy.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    function = hy.cfunc([*momentum, norm, energy, q_norm], state, fp_type=number)
    values = function(np.ascontiguousarray(states.T))
    first = values[:, 0]
    exact = {
        "time": times,
        "angular_velocity": states[:, :3],
        "quaternion": states[:, 3:],
        "angular_momentum": values[:3].T,
        "angular_momentum_norm": values[3],
        "energy": values[4],
    }
    columns = {}
    for name, column in exact.items():
        columns[name] = column.astype(float)
        if more:
            columns[f"{name}_lo"] = (column - columns[name]).astype(float)
    drifts = {
        "angular_momentum_drift": np.sqrt(((values[:3] - first[:3, None]) ** 2).sum(axis=0)) / first[3],
        "angular_momentum_norm_drift": (values[3] - first[3]) / first[3],
        "energy_drift": (values[4] - first[4]) / first[4],
        "quaternion_norm_drift": values[5] - first[5],
    }
    columns |= {name: column.astype(float) for name, column in drifts.items()}
    packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
    with h5py.File(out, "w") as file:
        for name, column in columns.items():
            chunks = (min(8192, samples), *column.shape[1:])
            file.create_dataset(name, data=column, chunks=chunks, **packed)


def warm() -> float:
    """CPU seconds of a second's motion."""
    started = time.process_time()
    integrator()[1].propagate_grid(np.linspace(0.0, 1.0, 11))
    return time.process_time() - started


if __name__ == "__main__":
    kind, *arguments = sys.argv[1:]
    if kind == "warm":
        warm()
        print(json.dumps({"cpu": statistics.median(warm() for _ in range(int(arguments[0])))}))
    else:
        began, cpu = time.perf_counter(), time.process_time()
        path, until, count, *rest = arguments
        {"sparse": sparse, "dense": dense}[kind](path, float(until), int(count), *rest)
        found = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - began}
        print(json.dumps(found | {"peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))
