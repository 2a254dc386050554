"""A free asymmetric body, few samples: `propagate_grid`, and the states in an HDF5 file.

python free_body_sparse.py OUT.h5 END SAMPLES
"""

import json
import resource
import sys
import time

import h5py
import heyoka as hy
import numpy as np

out, end, samples = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
began, cpu = time.perf_counter(), time.process_time()

a, b, c = 1.0, 2.0, 2.5
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
integrator = hy.taylor_adaptive(equations, [0.1, 1.0, 0.05, 1.0, 0.0, 0.0, 0.0])
times = np.linspace(0.0, end, samples)
states = integrator.propagate_grid(times)[-1]
with h5py.File(out, "w") as file:
    file["time"] = times
    file["angular_velocity"] = states[:, :3]
    file["quaternion"] = states[:, 3:]

print(
    json.dumps(
        {
            "cpu": time.process_time() - cpu,
            "wall": time.perf_counter() - began,
            "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        }
    )
)
