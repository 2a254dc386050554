"""The Earth's magnetic field about it: ``field = "igrf"`` of loads by a magnetic field.

Its potential is a sum c_n r^-(n+1) f_n with Schmidt semi-normalized coefficients (Alken et al. 2021, Earth,
Planets and Space 73, 49, eq. 1), and B minus its gradient, in axes that turn with the Earth:

    B = sum (R/r)^(n+2) ((n + 1) f_n u + u x (u x grad f_n)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.turning_harmonics import TurningHarmonics
from rigidsim.scene.arithmetic import Vector, apply, transpose
from rigidsim.scene.earth_axes import earth_axes, rotation_rate
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.geomagnetic_field import MOST, RADIUS, igrf
from rigidsim.scene.registry import Setting
from rigidsim.scene.tracing.numbers import plain

IGRF = "igrf"
_LEAST = 0.99
"""Radii from the centre below which a start is refused; the poles are at 0.998."""


@dataclass(frozen=True)
class EarthField:
    """Coefficients (T) at the epoch, in axes that turn with the Earth.

    Attributes:
        harmonics: unnormalized, with the Earth's axes at time 0 and its rate.
        epoch: the date.
    """

    harmonics: TurningHarmonics
    epoch: Epoch

    @classmethod
    def of(cls, degree: int | None, around: Setting) -> EarthField:
        """The field to a degree; refused where date and axes aren't known."""
        axes = around.axes or (around.ephemeris.axes if around.ephemeris is not None else None)
        epoch, context = around.epoch, around.context
        known = (
            ("[time] epoch", epoch, 'epoch = "2026-01-01T00:00:00 UTC"'),
            ("[frame] axes", axes, 'axes = "ICRF"'),
        )
        for what, found, example in known:
            if found is None:
                why = f'given "{IGRF}", which turns with the Earth and takes {what}; give {example}'
                raise around.fault("field", why)
        assert epoch is not None
        assert axes is not None
        try:
            given = igrf(epoch, degree or MOST)
            for second in (around.start, around.end):
                igrf(epoch.uniform().after(Decimal(round(plain(second)))), 1)
            frame = earth_axes(epoch, axes, context)
        except ValueError as error:
            why = f'given "{IGRF}" for a run from {epoch}; {error}: a run within 1970 to 2029 is allowed'
            raise around.fault("field", why) from None
        coefficients = {}
        for (n, m, sine), value in given.items():
            tesla = ExactNumber(value / 10**9).at(context)
            share = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
            if value:
                coefficients[n, m, sine] = tesla * (context.sqrt(2 * share) if m else 1)
        radius = context.mpf(RADIUS)
        harmonics = TurningHarmonics(coefficients, radius, frame, rotation_rate(context))
        return cls(harmonics, epoch)

    def dipole(self, constant: Any) -> Vector:
        """The magnetic moment of degree 1 at time 0, space axes, A m^2 (mpf).

        Args:
            constant: mu_0 / 4 pi.
        """
        c = self.harmonics.coefficients
        size = self.harmonics.radius**3 / constant
        moment = [size * c[key] for key in ((1, 1, False), (1, 1, True), (1, 0, False))]
        return apply(transpose(self.harmonics.frame), moment)

    def over(self, m: Kinematics, centre: Vector, size: Any) -> list[Symbolic]:
        """B over a size (mpf, T), space axes."""
        which = IGRF, self.epoch, self.harmonics.degree, *centre, size
        if which not in m.made:
            unit = m.scene.context.ldexp(m.scene.context.one, m.scaling.length)
            ratio = self.harmonics.radius / unit
            m.made[which] = self.harmonics.vector(m, m.seen_from(centre), lambda n: ratio ** (n + 2) / size)
        return m.made[which]

    def within(self, far: Any) -> bool:
        """Whether a distance from the centre is inside the Earth."""
        return bool(far < _LEAST * self.harmonics.radius)
