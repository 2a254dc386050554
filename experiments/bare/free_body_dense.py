"""A free asymmetric body, many samples: rates, attitude, momentum, energy and their drifts by compiled
functions, written by h5py with its shuffle and gzip filters.

python free_body_dense.py OUT.h5 END SAMPLES [extended [TOLERANCE]]

With "extended" in 80-bit arithmetic, each value as the nearest double and what that leaves over. The
tolerance is heyoka's own (the type's epsilon) unless another is given.
"""

import json
import resource
import sys
import time

import h5py
import heyoka as hy
import numpy as np

out, end, samples = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
number = np.longdouble if "extended" in sys.argv[4:] else float
began, cpu = time.perf_counter(), time.process_time()

a, b, c = 1.0, 2.0, 2.5
wx, wy, wz, qw, qx, qy, qz = state = hy.make_vars("wx", "wy", "wz", "qw", "qx", "qy", "qz")
equations = [
    (wx, number(b - c) / number(a) * wy * wz),
    (wy, number(c - a) / number(b) * wz * wx),
    (wz, number(a - b) / number(c) * wx * wy),
    (qw, 0.5 * (-qx * wx - qy * wy - qz * wz)),
    (qx, 0.5 * (qw * wx + qy * wz - qz * wy)),
    (qy, 0.5 * (qw * wy + qz * wx - qx * wz)),
    (qz, 0.5 * (qw * wz + qx * wy - qy * wx)),
]
start = [number(1) / 10, number(1), number(1) / 20, number(1), number(0), number(0), number(0)]
options = {"tol": number(sys.argv[5])} if len(sys.argv) > 5 else {}
integrator = hy.taylor_adaptive(equations, start, fp_type=number, **options)
times = np.arange(samples).astype(number) * number(end) / number(samples - 1)
states = integrator.propagate_grid(times)[-1]

lx, ly, lz = a * wx, b * wy, c * wz
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
    if number is not float:
        columns[f"{name}_lo"] = (column - columns[name]).astype(float)
drifts = {
    "angular_momentum_drift": np.sqrt(((values[:3] - first[:3, None]) ** 2).sum(axis=0)) / first[3],
    "angular_momentum_norm_drift": (values[3] - first[3]) / first[3],
    "energy_drift": (values[4] - first[4]) / first[4],
    "quaternion_norm_drift": values[5] - first[5],
}
columns |= {name: column.astype(float) for name, column in drifts.items()}
with h5py.File(out, "w") as file:
    for name, column in columns.items():
        file.create_dataset(
            name,
            data=column,
            chunks=(min(8192, samples), *column.shape[1:]),
            compression="gzip",
            compression_opts=4,
            shuffle=True,
        )

print(
    json.dumps(
        {
            "cpu": time.process_time() - cpu,
            "wall": time.perf_counter() - began,
            "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        }
    )
)
