"""What neighbours of a motion tell of the growth of its errors."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Spread:
    """Growth of errors of one epsilon per step, at times along the motion.

    Attributes:
        times: internal units, ascending.
        steps: steps of the loose tolerance that the motion took until then.
        rates, attitude, position, velocity: root mean square over the neighbours, in epsilons of internal
            units; attitude as an angle, rates relative to their size; zeros if the motion has none.
        cut: sum of the steps' truncation errors so far, in epsilons of the size of the states they befall;
            zeros if the tolerance allows none beyond rounding.
        extent, fastest: largest distance from the origin and speed so far, internal units.
        whole: False if the motion could not be followed to the requested end.
    """

    times: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    rates: list[float] = field(default_factory=list)
    attitude: list[float] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    cut: list[float] = field(default_factory=list)
    extent: float = 0.0
    fastest: float = 0.0
    whole: bool = True
