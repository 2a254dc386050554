"""A spin-orbit map without rigidsim: heyoka's batch integrator, numpy, and nothing else.

The same motion as ``configs/sweeps/hyperion_map.toml``: equations of the angle, of the orbit's anomaly and of
one tangent vector, the angle in a unit so large and the vector so small that neither moves the steps, as many
lanes as the processor takes, samples in heyoka's grid, MEGNO by the trapezoid rule. No labels, no files, no
energy balance, nobody looks at a status.

python spin_orbit_map.py RATES ANGLES ORBITS SAMPLES WORKERS: prints seconds, cells a second and a digest
"""

import json
import math
import multiprocessing
import resource
import sys
import time

import heyoka as hy
import numpy as np

A, B, C, ECCENTRICITY = 34021.0, 49096.0, 57125.0, 0.1
LARGE, SMALL = 2.0**20, 2.0**-900


def integrator() -> hy.taylor_adaptive_batch:
    """Compiled for one process."""
    angle, rate, ce, se, da, dr = hy.make_vars("angle", "rate", "ce", "se", "da", "dr")
    distance = 1.0 - ECCENTRICITY * ce
    c = (ce - ECCENTRICITY) / distance
    s = math.sqrt(1 - ECCENTRICITY**2) * se / distance
    ct, st = hy.cos(LARGE * angle), hy.sin(LARGE * angle)
    along, across = ct * c + st * s, ct * s - st * c
    factor = 3.0 * (B - A) / C
    inverse = distance**-1.0
    cube = inverse * inverse * inverse
    turned = LARGE * da
    equations = [
        (angle, rate / LARGE),
        (rate, factor * cube * along * across),
        (ce, -se / distance),
        (se, ce / distance),
        (da, dr / LARGE),
        (dr, factor * cube * turned * (across * across - along * along)),
    ]
    width = hy.recommended_simd_size()
    return hy.taylor_adaptive_batch(equations, np.zeros((6, width)), tol=1e-9)


def cells(task: tuple[np.ndarray, np.ndarray, float, int]) -> np.ndarray:
    """MEGNO of some cells."""
    global _integrator
    rates, angles, end, samples = task
    if _integrator is None:
        _integrator = integrator()
    ta = _integrator
    width = ta.batch_size
    times = np.linspace(0.0, end, samples)
    grid = np.repeat(times[:, None], width, axis=1)
    found = np.empty(len(rates))
    step = np.diff(times)[:, None]
    since = times[:, None].copy()
    since[0] = 1.0
    for first in range(0, len(rates), width):
        chosen = np.minimum(np.arange(first, first + width), len(rates) - 1)
        ta.set_time(0.0)
        ta.state[:] = 0.0
        ta.state[0], ta.state[1], ta.state[2] = angles[chosen] / LARGE, rates[chosen], 1.0
        ta.state[4], ta.state[5] = math.sqrt(0.5) * SMALL / LARGE, math.sqrt(0.5) * SMALL
        _, states = ta.propagate_grid(grid)
        g = 0.5 * np.log((states[:, 4] * (LARGE / SMALL)) ** 2 + (states[:, 5] / SMALL) ** 2)
        area = np.zeros_like(g)
        np.cumsum(step * (g[1:] + g[:-1]) / 2, axis=0, out=area[1:])
        y = 2 * (g - area / since)
        y[0] = 0.0
        megno = (step * (y[1:] + y[:-1]) / 2).sum(axis=0) / end
        stop = min(first + width, len(rates))
        found[first:stop] = megno[: stop - first]
    return found


_integrator = None


def main() -> None:
    """Every cell, by some processes."""
    rates, angles, orbits, samples, workers = (int(x) for x in sys.argv[1:])
    began = time.perf_counter()
    angle, rate = np.meshgrid(np.linspace(0, math.pi, angles), np.linspace(0, 3, rates), indexing="ij")
    pieces = max(rates * angles // 4096, workers)
    tasks = [
        (r, a, 2 * math.pi * orbits, samples)
        for r, a in zip(
            np.array_split(rate.ravel(), pieces), np.array_split(angle.ravel(), pieces), strict=True
        )
    ]
    if workers == 1:
        found = np.concatenate([cells(task) for task in tasks])
    else:
        with multiprocessing.get_context("spawn").Pool(workers) as pool:
            found = np.concatenate(pool.map(cells, tasks, chunksize=1))
    wall = time.perf_counter() - began
    own, below = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(
        json.dumps(
            {
                "cells": rates * angles,
                "wall": wall,
                "cpu": own.ru_utime + own.ru_stime + below.ru_utime + below.ru_stime,
                "peak_kilobytes": max(own.ru_maxrss, below.ru_maxrss),
                "median_megno": float(np.nanmedian(found)),
                "regular": float(np.mean(found < 3)),
            }
        )
    )


if __name__ == "__main__":
    main()
