"""What a trajectory's differences mean, in this order.

Its attitudes are the experiment's or not. Its attitudes turn at its rates or not. Where the attitudes are
others, its integration errs, its model is another one, or the two can't be separated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigidsim.workflows.compare.attitudes_alone import WIDER, WindowsOfAttitudes
from rigidsim.workflows.compare.defects import WindowDefects
from rigidsim.workflows.compare.result import (
    AGREES,
    INCONSISTENT_RATES,
    INTEGRATION_ERROR,
    UNDECIDED,
    WRONG_MODEL,
)

_ROUNDING = 1e-13  # rad: what references in double precision, and quaternions of doubles, leave
_ABOVE = 5.0  # times what the digits of the file allow, from which on defects tell something
_MODEL, _INTEGRATOR = 0.2, 0.5
"""Unexplained over explained attitude defects. Another model's are explained up to the integral's own error,
some 1e-3 and less, and more in long windows of few rows; an integrator's unexplained ones exceed the
explained by 2 / (rate T), 4 for the usual window, and 0.5 for the longest. In experiments/compare_conventions
they are 0.86 and more in 264 loose integrations, and up to 0.12 in 200 other models (0.14 with another seed).
"""
_ALONE = 5e-4
"""Defects that no change of the equations explains, over all, where attitudes are alone. Another model's are
explained up to the error of the derivatives, some 5e-5 and less.
"""
_IN_NOISE = 0.02  # the same, of defects that are explained to the digits of the file
_SURE = 1e3  # times what attitudes alone miss, by which they have to start elsewhere
_START = 3.0  # times what defects add up to, from which on another start is what the error comes from
_NO_RATES = 0.15
"""Of the turn in a window: unexplained defects beyond that are no integrator's, whose steps would be a
radian long, but those of rates that are something else.
"""
_FAR = np.pi / 3
"""Turn (rad) from row to row, beyond which the rates' integral misses as much as loose integrations."""
_SAME = 3.0  # factor within which the rates' first difference is what the attitudes' turning misses
_AGREE = 10.0  # times the attitude's floor per radian of the motion, that rates may differ by and agree


@dataclass(frozen=True)
class Evidence:
    """What is known of a trajectory.

    Attributes:
        largest: attitude error, rad. floor: what it may be and agree, with the reason in words.
        attitude_noise, rate_noise: by the digits that are written, rad and rad/s.
        start: angle and difference of rates at the first row. rate: of the motion, rad/s. span: s.
        rate_error: largest difference of rates, rad/s; None without them.
        turn: from row to row, rad (median), by the faster of both motions.
    """

    largest: float
    floor: float
    reason: str
    attitude_noise: float
    rate_noise: float
    start: tuple[float, float]
    rate: float
    span: float
    rate_error: float | None
    turn: float


def agreement(known: Evidence) -> tuple[str, str] | None:
    """The verdict of a trajectory whose attitudes are the experiment's, and why; None for others."""
    if known.largest > known.floor:
        return None
    aliased = (
        f"its attitudes are the experiment's, but from row to row the motion turns by "
        f"{np.degrees(known.turn):.3g} deg, so that other motions have the same rows"
    )
    if known.rate_error is None:
        if known.turn >= np.pi:
            return UNDECIDED, f"{aliased}; write more rows, or angular velocities (wx wy wz)"
        return AGREES, known.reason
    if known.rate_error <= 4 * known.rate_noise + _AGREE * known.floor * known.rate:
        return AGREES, known.reason
    if known.turn >= np.pi:
        return UNDECIDED, f"{aliased}, and its rates differ by {known.rate_error:.3g} rad/s; write more rows"
    return INCONSISTENT_RATES, (
        f"its attitudes are the experiment's, but they don't turn at its rates, which differ by "
        f"up to {known.rate_error:.3g} rad/s, at a motion of {known.rate:.3g} rad/s"
    )


def unexplained_share(windows: WindowDefects) -> float:
    """Unexplained over explained attitude defects, rms."""
    explained = _rms(windows.explained)
    return _rms(windows.unexplained) / explained if explained else float("inf")


def contradiction(known: Evidence, windows: WindowDefects) -> tuple[str, str] | None:
    """The verdict of rates that aren't those at which the attitudes turn, and why; None for others."""
    missed = _rms(windows.unexplained) / windows.length
    _, slip = known.start
    moved = slip > max(_ABOVE * known.rate_noise, known.floor * known.rate)
    if missed <= _NO_RATES * known.rate and not (moved and slip / _SAME < missed < slip * _SAME):
        return None
    return INCONSISTENT_RATES, (
        f"its attitudes don't turn at its rates: these miss {missed:.3g} rad/s, at a motion of "
        f"{known.rate:.3g} rad/s; remove the rates to have its attitudes judged alone"
    )


def elsewhere(known: Evidence, attitude: float, rates: float, length: float) -> tuple[str, str] | None:
    """The verdict of another start, which outweighs defects (rad, rad/s) over windows of a length (s)."""
    angle, slip = known.start
    gathered = known.span / length * (attitude + rates * known.span)
    noise = known.rate_noise + known.attitude_noise / length
    if angle <= known.floor and slip <= max(_ABOVE * noise, known.floor * known.rate):
        return None
    if angle + slip * known.span <= _START * gathered:
        return None
    apart = f"{angle:.3g} rad and {slip:.3g} rad/s apart"
    return UNDECIDED, f"it starts elsewhere, {apart}, which outweighs what its equations miss on the way"


def elsewhere_alone(known: Evidence, windows: WindowsOfAttitudes, slip: float) -> tuple[str, str] | None:
    """The verdict of attitudes alone whose first rates differ (rad/s), where their defects are nothing."""
    if slip * windows.length <= _SURE * windows.size and known.start[0] <= known.floor:
        return None
    size, length = windows.size, windows.length
    return elsewhere(replace(known, start=(known.start[0], slip)), size, size / length, length)


def by_rates(known: Evidence, windows: WindowDefects) -> tuple[str, str] | None:
    """The verdict by kinematics, and why; None where defects are within the digits."""
    noise = known.attitude_noise + known.rate_noise * windows.length + _ROUNDING
    if max(_rms(windows.attitude), _rms(windows.explained)) <= _ABOVE * noise:
        return None
    left = _rms(windows.unexplained)
    share = unexplained_share(windows)
    told = (
        f"of the attitude's defects ({_rms(windows.attitude):.2g} rad over spans of {windows.length:.3g} s) "
        f"differences of the rates explain {_rms(windows.explained):.2g} rad and leave {left:.2g} rad"
    )
    if share <= _MODEL or left <= 2 * noise:
        mean = _rms(np.linalg.norm(windows.acceleration, axis=1))
        return WRONG_MODEL, f"its equations are others, by {mean:.3g} rad/s^2: {told}"
    if known.turn > _FAR:
        return UNDECIDED, f"{_rows_apart(known)}: {told}"
    if share >= _INTEGRATOR:
        return INTEGRATION_ERROR, f"its equations are these, loosely integrated: {told}"
    return UNDECIDED, f"both its model and its integration may differ: {told}"


def by_attitudes(known: Evidence, windows: WindowsOfAttitudes | None) -> tuple[str, str]:
    """The verdict by attitudes alone, and why."""
    if windows is None:
        return UNDECIDED, _rows_apart(known)
    noise = known.attitude_noise + _ROUNDING
    if windows.size <= _ABOVE * noise:
        return UNDECIDED, (
            f"local defects ({windows.size:.2g} rad) are within the digits of the file ({noise:.2g} rad); "
            "write more digits to tell a model from an integration"
        )
    share, left = windows.unexplained / windows.size, windows.unexplained
    told = f"of the attitudes' defects ({windows.size:.2g} rad)"
    if share <= _ALONE or (left <= 2 * noise and share <= _IN_NOISE):
        return WRONG_MODEL, (
            f"its equations are others, by {windows.acceleration:.3g} rad/s^2: {told} other moments or "
            f"steady torques leave {left:.2g} rad"
        )
    windows.explain(noise, WIDER)
    if windows.unexplained / windows.size > _ALONE:
        return INTEGRATION_ERROR, (
            f"its equations are these, loosely integrated: {told} other moments or torques leave "
            f"{windows.unexplained:.2g} rad"
        )
    return UNDECIDED, (
        f"its model and its integration can't be distinguished: {told} other moments or steady torques leave "
        f"{left:.2g} rad; write angular velocities too (wx wy wz), or more rows"
    )


def _rows_apart(known: Evidence) -> str:
    turn, most = np.degrees([known.turn, _FAR])
    return (
        f"rows are too far apart to separate a model from an integration: the motion turns by {turn:.3g} deg "
        f"from row to row; write rows at most {most:.0f} deg apart"
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
