"""What a trajectory's differences mean, in this order.

Its attitudes are the experiment's or not. Its attitudes turn at its rates or not. Where the attitudes are
others, its integration errs, its model is another one, or the two can't be separated.
"""

from __future__ import annotations

import numpy as np

from rigidsim.workflows.compare.attitudes_alone import WIDER, WindowsOfAttitudes
from rigidsim.workflows.compare.defects import WindowDefects
from rigidsim.workflows.compare.evidence import ABOVE, Evidence
from rigidsim.workflows.compare.result import (
    AGREES,
    INCONSISTENT_RATES,
    INTEGRATION_ERROR,
    UNDECIDED,
    WRONG_MODEL,
)

Verdict = tuple[str, str]
"""A verdict, and why."""
_ROUNDING = 1e-13  # rad: what references in double precision, and quaternions of doubles, leave
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


def judged(seen: Evidence) -> Verdict:
    """The verdict on a trajectory."""
    if (found := _agreement(seen)) is not None:
        return found
    if seen.states is None:
        return UNDECIDED, f"model and integration can't be distinguished: {seen.why_not}"
    windows = seen.windows
    if windows is None:
        alone = seen.alone
        return (_elsewhere_alone(seen, alone) if alone else None) or _by_attitudes(seen, alone)
    return (
        _contradiction(seen, windows)
        or _elsewhere(seen, _slip(seen), rms(windows.attitude), rms(windows.rates), windows.length)
        or _by_rates(seen, windows)
        or _by_attitudes(seen, seen.alone)
    )


def _agreement(seen: Evidence) -> Verdict | None:
    """Of attitudes that are the experiment's; None for others."""
    floor, reason = seen.floor
    if seen.errors.max() > floor:
        return None
    slip = 0.0 if seen.rate_errors is None else float(seen.rate_errors.max())
    agree = seen.rates is None or slip <= 4 * seen.rate_noise + _AGREE * floor * seen.rate
    if agree and (seen.rates is not None or seen.turn < np.pi):
        return AGREES, reason
    if seen.turn >= np.pi:
        return UNDECIDED, (
            f"its attitudes are the experiment's, but from row to row the motion turns by "
            f"{np.degrees(seen.turn):.3g} deg, so that other motions have the same rows; write more rows, or "
            "angular velocities (wx wy wz) that agree"
        )
    return INCONSISTENT_RATES, (
        f"its attitudes are the experiment's, but they don't turn at its rates, which differ by "
        f"up to {slip:.3g} rad/s, at a motion of {seen.rate:.3g} rad/s"
    )


def _slip(seen: Evidence) -> float:
    """Difference of the first rates, rad/s."""
    return 0.0 if seen.rate_errors is None else float(seen.rate_errors[0])


def unexplained_share(windows: WindowDefects) -> float:
    """Unexplained over explained attitude defects, rms."""
    explained = rms(windows.explained)
    return rms(windows.unexplained) / explained if explained else float("inf")


def _contradiction(seen: Evidence, windows: WindowDefects) -> Verdict | None:
    """Of rates that aren't those at which the attitudes turn; None for others."""
    missed = rms(windows.unexplained) / windows.length
    slip = _slip(seen)
    moved = slip > max(ABOVE * seen.rate_noise, seen.floor[0] * seen.rate)
    if missed <= _NO_RATES * seen.rate and not (moved and slip / _SAME < missed < slip * _SAME):
        return None
    return INCONSISTENT_RATES, (
        f"its attitudes don't turn at its rates: these miss {missed:.3g} rad/s, at a motion of "
        f"{seen.rate:.3g} rad/s; remove the rates to have its attitudes judged alone"
    )


def _elsewhere(seen: Evidence, slip: float, attitude: float, rates: float, length: float) -> Verdict | None:
    """Of another start, which outweighs defects (rad, rad/s) over windows of a length (s)."""
    angle, floor = float(seen.errors[0]), seen.floor[0]
    collected = seen.span / length * (attitude + rates * seen.span)
    noise = seen.rate_noise + seen.attitude_noise / length
    if angle <= floor and slip <= max(ABOVE * noise, floor * seen.rate):
        return None
    if angle + slip * seen.span <= _START * collected:
        return None
    apart = f"{angle:.3g} rad and {slip:.3g} rad/s apart"
    return UNDECIDED, f"it starts elsewhere, {apart}, which outweighs what its equations miss on the way"


def _elsewhere_alone(seen: Evidence, windows: WindowsOfAttitudes) -> Verdict | None:
    """Of attitudes alone whose first rates differ, where their defects are nothing."""
    slip = float(np.linalg.norm(windows.rates[0] - seen.own_rates[windows.rows[0, 0]]))
    size, length = windows.size, windows.length
    if slip * length <= _SURE * size and seen.errors[0] <= seen.floor[0]:
        return None
    return _elsewhere(seen, slip, size, size / length, length)


def _by_rates(seen: Evidence, windows: WindowDefects) -> Verdict | None:
    """By kinematics; None where defects are within the digits."""
    noise = seen.attitude_noise + seen.rate_noise * windows.length + _ROUNDING
    if max(rms(windows.attitude), rms(windows.explained)) <= ABOVE * noise:
        return None
    left, share = rms(windows.unexplained), unexplained_share(windows)
    told = (
        f"of the attitude's defects ({rms(windows.attitude):.2g} rad over spans of {windows.length:.3g} s) "
        f"differences of the rates explain {rms(windows.explained):.2g} rad and leave {left:.2g} rad"
    )
    if share <= _MODEL or left <= 2 * noise:
        mean = rms(np.linalg.norm(windows.acceleration, axis=1))
        return WRONG_MODEL, f"its equations are others, by {mean:.3g} rad/s^2: {told}"
    if seen.turn > _FAR:
        return UNDECIDED, f"{_rows_apart(seen)}: {told}"
    if share >= _INTEGRATOR:
        return INTEGRATION_ERROR, f"its equations are these, loosely integrated: {told}"
    return UNDECIDED, f"both its model and its integration may differ: {told}"


def _by_attitudes(seen: Evidence, windows: WindowsOfAttitudes | None) -> Verdict:
    """By attitudes alone."""
    if windows is None:
        return UNDECIDED, _rows_apart(seen)
    noise = seen.attitude_noise + _ROUNDING
    if windows.size <= ABOVE * noise:
        return UNDECIDED, (
            f"local defects ({windows.size:.2g} rad) are within the digits of the file ({noise:.2g} rad); "
            "write more digits to tell a model from an integration"
        )
    share, left = windows.unexplained / windows.size, windows.unexplained
    told = f"of the attitudes' defects ({windows.size:.2g} rad) other moments or steady torques leave"
    if share <= _ALONE or (left <= 2 * noise and share <= _IN_NOISE):
        more = f"by {windows.acceleration:.3g} rad/s^2"
        return WRONG_MODEL, f"its equations are others, {more}: {told} {left:.2g} rad"
    windows.explain(noise, WIDER)
    if windows.unexplained / windows.size > _ALONE:
        loose = "its equations are these, loosely integrated"
        return INTEGRATION_ERROR, f"{loose}: {told} {windows.unexplained:.2g} rad"
    return UNDECIDED, (
        f"its model and its integration can't be distinguished: {told} {left:.2g} rad; write angular "
        "velocities too (wx wy wz), or more rows"
    )


def _rows_apart(seen: Evidence) -> str:
    turn, most = np.degrees([seen.turn, _FAR])
    return (
        f"rows are too far apart to separate a model from an integration: the motion turns by {turn:.3g} deg "
        f"from row to row; write rows at most {most:.0f} deg apart"
    )


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
