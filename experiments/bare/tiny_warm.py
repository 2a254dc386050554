"""A free asymmetric body for one second, again and again in one process: integrator and run.

python tiny_warm.py TIMES: prints the median CPU seconds of a time
"""

import json
import statistics
import sys
import time

import heyoka as hy
import numpy as np


def once() -> None:
    """Equations, integrator, eleven samples."""
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
    integrator.propagate_grid(np.linspace(0.0, 1.0, 11))


def seconds() -> float:
    """CPU of one time."""
    started = time.process_time()
    once()
    return time.process_time() - started


once()
print(json.dumps({"cpu": statistics.median(seconds() for _ in range(int(sys.argv[1])))}))
