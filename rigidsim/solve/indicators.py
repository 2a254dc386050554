"""Indicators of chaos, from the growth of a small displacement at a run's samples.

With d(t) the length of a tangent vector over its initial one and g = ln d (observable ``tangent_growth``),

    largest exponent   g(T) / T,
    FLI                sup over t of g(t)                        (Froeschle, Lega & Gonczi 1997,
                                                                  Celest. Mech. Dyn. Astron. 67, 41),
    MEGNO              Y(T) = 2/T int t g' dt and its mean over time
                                                                 (Cincotta & Simo 2000,
                                                                  Astron. Astrophys. Suppl. 147, 205).

The mean of Y tends to 2 for quasi-periodic motion and grows like half the largest exponent times T in chaos.
By parts, int t g' dt = t g(t) - int g dt, so that no derivative of g is needed; the integrals are taken by
the trapezoid rule over the samples, added in their order: ``sum`` would add those of a single motion in
another order than those of many, and a member's bits would depend on its neighbours. Several samples a
period make the value good to a few per cent; to separate order from chaos one an orbit will do.
"""

from typing import NamedTuple

import numpy as np


class Indicators(NamedTuple):
    """Indicators of some motions, each (members,); those of a motion whose growth was lost refer to the time
    before.
    """

    megno: np.ndarray  # mean of Y over time
    fli: np.ndarray  # largest growth
    largest_exponent: np.ndarray  # 1/s
    until: np.ndarray  # time up to which they are known, seconds since the start


def indicators(times: np.ndarray, growth: np.ndarray) -> Indicators:
    """Chaos indicators of motions.

    Args:
        times: seconds, ascending from the start, (samples,), or (samples, members).
        growth: ``tangent_growth`` at these times, (samples, members); NaN once it was lost.

    Returns:
        Zeros for motions at their start, where nothing has grown yet; NaN for motions without a finite value.
    """
    since = times - times[:1] if times.ndim == 2 else (times - times[0])[:, None]
    finite = np.isfinite(growth)
    known = np.logical_and.accumulate(finite, axis=0)
    g = np.where(known, growth, 0.0)
    step = np.where(known[1:], np.diff(since, axis=0), 0.0)
    area = np.zeros_like(g)
    np.cumsum(step * (g[1:] + g[:-1]) / 2, axis=0, out=area[1:])
    with np.errstate(invalid="ignore", divide="ignore"):
        y = np.where(since > 0, 2 * (g - area / since), 0.0)
        mean = np.zeros_like(g)
        np.cumsum(step * (y[1:] + y[:-1]) / 2, axis=0, out=mean[1:])
        last = np.broadcast_to(known.sum(axis=0) - 1, growth.shape[1:])
        there = last >= 0
        place = np.maximum(last, 0)[None, :]
        until = np.take_along_axis(np.broadcast_to(since, growth.shape), place, axis=0)[0]
        until = np.where(there, until, np.nan)
        grown = np.take_along_axis(g, place, axis=0)[0]
        megno = np.where(until > 0, mean[-1] / until, 0.0)
        exponent = np.where(until > 0, grown / until, 0.0)
    fli = np.where(known, g, -np.inf).max(axis=0)
    lost = ~there
    return Indicators(*(np.where(lost, np.nan, x) for x in (megno, fli, exponent, until)))
