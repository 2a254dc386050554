"""diffrax: Dopri8 with a PID controller, float64, compiled by jax for one CPU core."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from experiments.peers.scenes import Scene

TITLES = {"dopri8": "diffrax Dopri8"}
_solvers: dict[str, Any] = {}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative and absolute tolerances."""
    return [10.0**-n for n in range(5, 15)]


def _field(scene: Scene) -> Callable[[Any, Any, Any], Any]:
    """The equations of ``compiled``."""
    a, b, c = scene.moments
    n = scene.orbit_rate

    def field(t: Any, state: Any, _: Any) -> Any:
        p, q, r, w, x, y, z = state
        dp, dq, dr = (b - c) / a * q * r, (c - a) / b * r * p, (a - b) / c * p * q
        if scene.weight:
            dp += scene.weight / a * 2.0 * (y * z + w * x)
            dq -= scene.weight / b * 2.0 * (x * z - w * y)
        if n:
            k = 3 * n * n
            rx = w * w + x * x - y * y - z * z
            ry, rz = 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
            dp += k * (c - b) / a * ry * rz
            dq += k * (a - c) / b * rz * rx
            dr += k * (b - a) / c * rx * ry
        return jnp.stack(
            [
                dp,
                dq,
                dr,
                -0.5 * (x * p + y * q + z * r) + n / 2 * z,
                0.5 * (w * p + y * r - z * q) + n / 2 * y,
                0.5 * (w * q + z * p - x * r) - n / 2 * x,
                0.5 * (w * r + x * q - y * p) - n / 2 * w,
            ]
        )

    return field


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``; one compilation per scene, tolerance and end being arguments."""
    jax.config.update("jax_enable_x64", True)
    if scene.name not in _solvers:
        term, start = diffrax.ODETerm(_field(scene)), jnp.array(scene.start)

        @jax.jit
        def integrate(until: Any, tolerance: Any) -> Any:
            return diffrax.diffeqsolve(
                term,
                diffrax.Dopri8(),
                0.0,
                until,
                None,
                start,
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
                saveat=diffrax.SaveAt(t1=True),
                max_steps=None,
            ).ys[-1]

        integrate(1.0, 1e-6).block_until_ready()
        _solvers[scene.name] = integrate
    integrate = _solvers[scene.name]

    def solve() -> Sequence[float]:
        return scene.from_orbital(np.asarray(integrate(end, knob))[3:7].tolist(), end)

    return solve
