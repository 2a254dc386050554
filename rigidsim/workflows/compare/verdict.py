"""What a trajectory's differences mean: it agrees, its integration errs, its model is another one, or neither
can be told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.workflows.compare.defects import WindowDefects
from rigidsim.workflows.compare.result import AGREES, INTEGRATION_ERROR, UNDECIDED, WRONG_MODEL

_ROUNDING = 1e-13  # rad: what references in double precision, and quaternions of doubles, leave
_ABOVE = 5.0  # times what the digits of the file allow, from which on defects tell something
_MODEL, _INTEGRATOR = 0.2, 0.5
"""Unexplained over explained attitude defects. Another model's are explained up to the integral's own error,
some 1e-3 and less, and more in long windows of few rows; an integrator's unexplained ones exceed the
explained by 2 / (rate T), 4 for the usual window, and 0.5 for the longest. In experiments/compare_conventions
they are 0.86 and more in 264 loose integrations, and up to 0.12 in 200 other models (0.14 with another seed).
"""
_START = 3.0  # times what defects add up to, from which on another start is what the error comes from
_NO_RATES = 0.3  # of the turn in a window: unexplained defects beyond that mean that rates are something else


@dataclass(frozen=True)
class Evidence:
    """What is known of a trajectory.

    Attributes:
        largest: attitude error, rad. floor: what it may be and agree.
        attitude_noise, rate_noise: by the digits that are written, rad and rad/s.
        start: angle and difference of rates at the first row. rate: of the motion, rad/s. span: s.
        windows: None without rates, or where rows are too far apart.
        missing: why there are no windows.
    """

    largest: float
    floor: float
    attitude_noise: float
    rate_noise: float
    start: tuple[float, float]
    rate: float
    span: float
    windows: WindowDefects | None
    missing: str

    @property
    def gathered(self) -> float:
        """What local defects add up to over the span, rad, if nothing makes them grow or cancel."""
        if self.windows is None:
            return 0.0
        count = self.span / self.windows.length
        return count * (_rms(self.windows.attitude) + _rms(self.windows.rates) * self.span)


def unexplained_share(windows: WindowDefects) -> float:
    """Unexplained over explained attitude defects, rms."""
    explained = _rms(windows.explained)
    return _rms(windows.unexplained) / explained if explained else float("inf")


def judged(known: Evidence) -> tuple[str, str]:
    """The verdict, and why."""
    if known.largest <= known.floor:
        return AGREES, f"the attitude error is within {known.floor:.2g} rad everywhere"
    windows = known.windows
    if windows is None:
        return UNDECIDED, f"model and integration can't be told apart: {known.missing}"
    noise = known.attitude_noise + known.rate_noise * windows.length + _ROUNDING
    signal = max(_rms(windows.attitude), _rms(windows.explained))
    angle, slip = known.start
    moved = angle > known.floor or slip > max(_ABOVE * known.rate_noise, known.floor * known.rate)
    if moved and angle + slip * known.span > _START * known.gathered:
        apart = f"{angle:.3g} rad and {slip:.3g} rad/s apart"
        return UNDECIDED, f"it starts elsewhere, {apart}, which outweighs what its equations miss on the way"
    if signal <= _ABOVE * noise:
        return UNDECIDED, (
            f"local defects ({signal:.2g} rad in {windows.length:.3g} s) are within the digits of the file "
            f"({noise:.2g} rad); write more digits to tell a model from an integration"
        )
    left = _rms(windows.unexplained)
    if left > _NO_RATES * known.rate * windows.length:
        return UNDECIDED, "its rates are not the rates at which its attitude turns, in any convention tried"
    share = unexplained_share(windows)
    told = (
        f"of the attitude's defects ({_rms(windows.attitude):.2g} rad over spans of {windows.length:.3g} s) "
        f"differences of the rates explain {_rms(windows.explained):.2g} rad and leave {left:.2g} rad"
    )
    if share <= _MODEL or left <= 2 * noise:
        mean = _rms(np.linalg.norm(windows.acceleration, axis=1))
        return WRONG_MODEL, f"its equations are others, by {mean:.3g} rad/s^2: {told}"
    if share >= _INTEGRATOR:
        return INTEGRATION_ERROR, f"its equations are these, loosely integrated: {told}"
    return UNDECIDED, f"both its model and its integration may differ: {told}"


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
