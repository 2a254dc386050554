"""Sun and Moon by analytic series.

Positions are heyoka's: the Sun from VSOP2013 (Simon et al. 2013, A&A 557, A49: the heliocentric place of the
barycentre of Earth and Moon, reversed: it stands for the Earth's, 4,670 km or 3e-5 of the distance away), the
Moon from ELP2000 (Chapront-Touze & Chapront 1983), both in the mean ecliptic and equinox of J2000, with time
counted from J2000 (TDB). Terms below 1e-6 of the distance are left out. With the barycentre the Sun's torque
is right to 1e-4, the Moon's to some 3e-6. The series are explicit functions of time in double precision,
whatever the run's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, seconds
from rigidsim.model.orbit_planes import OrbitPlane, ecliptic_plane
from rigidsim.model.placements.placement import Circuit, Placement, SourcePlace
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.registry import Setting
from rigidsim.scene.space_axes import ECLIPTIC
from rigidsim.scene.tracing.numbers import plain

_THRESHOLD = 1e-6
_DAY = 86400.0
_MEAN = {"sun": (365.25636, 0.0167), "moon": (27.32166, 0.0549)}
"""Sidereal period (days) and eccentricity, used to judge whether averages over the Earth's spin apply."""
MEAN_DISTANCE = {"sun": 149597870700, "moon": 384400000}  # m


def source_position(body: str, seconds: Symbolic) -> tuple[list[Symbolic], Symbolic]:
    """Geocentric unit vector to the Sun ("sun") or the Moon ("moon"), space axes, and mean distance over
    distance, at a time in seconds since J2000, an expression.
    """
    if body == "sun":
        millennia = seconds * (1.0 / (_DAY * 365250.0))
        earth = hy.model.vsop2013_cartesian(3, time_expr=millennia, thresh=_THRESHOLD)
        position: list[Any] = [-x for x in earth[:3]]  # astronomical units
    else:
        centuries = seconds * (1.0 / (_DAY * 36525.0))
        kilometres = hy.model.elp2000_cartesian_e2000(time_expr=centuries, thresh=_THRESHOLD)
        position = [x * (1.0 / 384400.0) for x in kilometres]
    inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in position]))
    return [x * inverse for x in position], inverse


@dataclass(frozen=True)
class PlacedBySeries(Placement):
    """The geocentric Sun ("sun") or Moon ("moon"); space axes are the mean ecliptic and equinox of J2000."""

    body: str
    epoch: Epoch | None  # date of the scene's time 0
    axes = ECLIPTIC
    moves: ClassVar[bool] = True
    lunisolar = True
    wide = True
    of_time = True
    untracked = "its place is an analytic series"
    without_elements = (
        "the source of an ephemeris has no elements to average over",
        'choose "spin_averaged", or give it an orbit with a node_rate',
    )

    @property
    def plane(self) -> OrbitPlane | None:  # type: ignore[override]
        return ecliptic_plane() if self.body == "sun" else None

    @property
    def without_plane(self) -> str:  # type: ignore[override]
        return "the series of the Moon alone names none" if self.body == "moon" else ""

    @property
    def seconds_ahead(self) -> float:  # type: ignore[override]
        return 0.0 if self.epoch is None else float(ExactNumber(self.epoch.since_j2000()))

    def distance(self, context: Any) -> Any:
        return context.mpf(MEAN_DISTANCE[self.body])

    def seen(self, m: Kinematics) -> SourcePlace:
        found = source_position(self.body, seconds(m, since=self.epoch))
        return SourcePlace(*found, self.distance(m.scene.context))

    def at_start(self, scene: Setting) -> Vector:
        """Place at the start, m, in double precision."""
        context = scene.context
        towards, nearness = source_position(self.body, hy.time)
        function = hy.cfunc([*towards, nearness], [], compact_mode=True)
        *direction, inverse = function([], time=float(plain(scene.start)) + self.seconds_ahead)
        far = self.distance(context) / context.mpf(inverse)
        return [far * context.mpf(x) for x in direction]

    def circuit(self, context: Any) -> Circuit:
        days, e = _MEAN[self.body]
        return Circuit(2 * math.pi / (days * _DAY), e, (1 - e) ** -3)

    def pictured(self) -> dict[str, Any]:
        return {"ephemeris": self.body}
