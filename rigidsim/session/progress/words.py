"""Wording shared by the progress bar and plain lines."""

from __future__ import annotations

NOTHING_LEFT = "nothing is left to do: {}; --until prolongs a finished run to a later end"
PHASES = {
    "lyapunov": "Lyapunov exponents",
    "modelling": "full model beside",
    "dataset": "writing dataset.h5",
    "timeline": "drawing timeline.rrd",
    "certify": "certifying",
}


def left(elapsed: float, fraction: float) -> str:
    """Time to go at the mean pace so far; a guess from the first moments would be far off."""
    if fraction >= 1:
        return "0:00:00 left"
    if fraction <= 0 or elapsed < 0.3:
        return "-:--:-- left"
    seconds = elapsed * (1 / fraction - 1)
    if seconds >= 360_000:
        return f"{seconds / 86400:.3g} days left"
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d} left"


def rate_text(value: float) -> str:
    """A rate to three digits, with a prefix."""
    for factor, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * factor:  # what rounds to 1000 has the next prefix
            return f"{value / factor:.3g} {suffix}"
    return f"{value:.3g}"


class Pace:
    """Pace of a session, from what it did itself.

    Args:
        fraction: fraction of the run that was done before it.
    """

    def __init__(self, steps: int = 0, fraction: float = 0.0) -> None:
        self._steps, self._fraction = steps, fraction

    def words(self, elapsed: float, steps: int, fraction: float) -> tuple[str, str]:
        """Steps per second and the time left, in words.

        Args:
            elapsed: seconds since the session began.
        """
        share = (fraction - self._fraction) / (1 - self._fraction) if self._fraction < 1 else 1.0
        return rate_text((steps - self._steps) / max(elapsed, 1e-9)), left(elapsed, share)
