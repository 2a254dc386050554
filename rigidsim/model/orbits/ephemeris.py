"""Positions of the Sun and the Moon from heyoka's analytic series.

The Sun from VSOP2013 (Simon et al. 2013, A&A 557, A49: the heliocentric place of the barycentre of Earth and
Moon, reversed: it stands for the Earth's, 4,670 km or 3e-5 of the distance away), the Moon from ELP2000
(Chapront-Touze & Chapront 1983), both in the mean ecliptic and equinox of J2000, with time counted from J2000
(TDB). Terms below 1e-6 of the distance are left out. With the barycentre the Sun's torque is right to 1e-4,
the Moon's to some 3e-6. The series are explicit functions of time in double precision, whatever the run's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic

_THRESHOLD = 1e-6
_DAY = 86400.0


@dataclass(frozen=True)
class SourcePosition:
    """A geocentric direction and distance."""

    direction: list[Symbolic]  # unit vector, space axes
    inverse_distance: Symbolic  # mean distance over distance


MEAN_DISTANCE = {"sun": 149597870700, "moon": 384400000}
"""Metres; the mean distance that ``SourcePosition.inverse_distance`` is relative to."""


def source_position(body: str, seconds: Symbolic) -> SourcePosition:
    """Position of the Sun ("sun") or the Moon ("moon") at a time in seconds since J2000, an expression."""
    if body == "sun":
        millennia = seconds * (1.0 / (_DAY * 365250.0))
        earth = hy.model.vsop2013_cartesian(3, time_expr=millennia, thresh=_THRESHOLD)
        position: list[Any] = [-x for x in earth[:3]]  # astronomical units
    else:
        centuries = seconds * (1.0 / (_DAY * 36525.0))
        kilometres = hy.model.elp2000_cartesian_e2000(time_expr=centuries, thresh=_THRESHOLD)
        position = [x * (1.0 / 384400.0) for x in kilometres]
    inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in position]))
    return SourcePosition([x * inverse for x in position], inverse)
