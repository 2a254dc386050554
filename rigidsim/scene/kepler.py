"""Kepler's equation."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.tracing.numbers import called


def eccentric_anomaly(context: Any, mean: Any, eccentricity: Any) -> Any:
    """Solution of Kepler's equation M = E - e sin E, to the context's precision."""
    return called(_kepler, context, mean, eccentricity)


def _kepler(context: Any, mean: Any, e: Any) -> Any:
    anomaly = mean + e * context.sin(mean)
    # Newton converges quadratically; the count covers any precision from a start that is good to e^2
    for _ in range(12 + int(context.prec).bit_length()):
        step = (anomaly - e * context.sin(anomaly) - mean) / (1 - e * context.cos(anomaly))
        anomaly -= step
        if abs(step) <= context.ldexp(1, -context.prec // 2 - 2):
            break
    return anomaly
