"""Rods of soft magnetic material, whose magnetisation lags behind the field and damps a satellite.

The flux density B of a rod is a state. With the field H along the rod (A/m), coercivity Hc, remanence Br and
saturation Bs, the limiting loop is B = (2 Bs / pi) atan(k (H -+ Hc)), k = tan(pi Br / 2 Bs) / Hc. Within it

    dB/dH = (2 k Bs / pi) cos^2(pi B / 2 Bs) (q + (1 - q) x^p),
    x = (Hc +- (H - tan(pi B / 2 Bs) / k)) / 2 Hc,

with the upper sign where H grows: x is 1 on the branch that is approached, and 0 on the one that is left
(Flatley & Henretty 1995, NASA CP-3299, 405). Beyond the loop the formula doesn't hold, so that a rod starts
in its middle, at x = 1/2. The moment is V B / mu_0 along the rod.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from rigidsim.errors import ensure
from rigidsim.model.loads.applied import Torque
from rigidsim.model.loads.magnetic_field import FluxDensity
from rigidsim.scene.exact import ZERO, ExactNumber
from rigidsim.scene.fields import Dimensionless, Direction, InUnit, Positive, VariableName, within
from rigidsim.scene.registry import BroughtState, LoadFields, Setting, register_load


class HysteresisRodFields(LoadFields):
    """Torque on rods that the magnetic field of the scene's other loads magnetises with hysteresis."""

    brings_state = True
    kind: Literal["hysteresis_rod"]
    name: VariableName = Field(examples=["rod_x"])
    """its name, under which the flux density in the rod is recorded and read, T"""
    axis: Direction = Field(examples=[[1, 0, 0]])
    """along the rod, body axes"""
    volume: Positive[Annotated[ExactNumber, InUnit("m^3")]] = Field(examples=["0.07 cm^3"])
    """of all rods along the axis"""
    coercivity: Positive[Annotated[ExactNumber, InUnit("A/m")]] = Field(examples=["12 A/m"])
    """H at which the rod's limiting loop crosses B = 0"""
    remanence: Positive[FluxDensity] = Field(examples=["0.004 T"])
    """B at which the rod's limiting loop crosses H = 0"""
    saturation: Positive[FluxDensity] = Field(examples=["0.025 T"])
    """largest B"""
    reversal_slope: Annotated[Dimensionless, within("0", "1")] = ZERO
    """q: slope of B after H turns back on the limiting loop, over the loop's own slope"""
    exponent: Literal[2, 4, 6] = 2
    """p: the larger, the later the slope returns to the loop's own"""

    @property
    def initial(self) -> str:
        """B at the start."""
        return f"2*bs__/pi*atan({_STEEP}*{_H})"

    @property
    def slope(self) -> str:
        """dB/dt."""
        h, change, steep = _H, _H.replace("*b", "*db"), _STEEP
        angle = f"(pi*{self.name}/(2*bs__))"
        there = f"((hc__ + sign({change})*({h} - tan{angle}/{steep}))/(2*hc__))"
        share = f"(q__ + (1 - q__)*{there}^{self.exponent})"
        return f"2/pi*{steep}*bs__*cos{angle}^2*{share}*{change}"

    @property
    def torque(self) -> list[str]:
        """V B / mu_0 times the cross product of axis and field."""
        size = f"v__*{self.name}/{_MU_0}/{_LENGTH}"
        return [f"{size}*(a{j}__*b{k} - a{k}__*b{j})" for j, k in ("yz", "zx", "xy")]

    @property
    def parameters(self) -> dict[str, ExactNumber]:
        """Numbers in these formulas."""
        names = ("ax__", "ay__", "az__", "v__", "hc__", "br__", "bs__", "q__")
        loop = self.coercivity, self.remanence, self.saturation, self.reversal_slope
        return dict(zip(names, (*self.axis, self.volume, *loop), strict=True))

    def brought_states(self) -> Sequence[BroughtState]:
        return [BroughtState(self.name, "T", self.initial, self.slope, self.parameters)]


_LENGTH = "sqrt(ax__^2 + ay__^2 + az__^2)"
_MU_0 = "(pi*(4e-7 T m/A))"
_H = f"((ax__*bx + ay__*by + az__*bz)/{_LENGTH}/{_MU_0})"
_STEEP = "(tan(pi*br__/(2*bs__))/hc__)"


@register_load
class HysteresisRod(Torque):
    """The torque V B / mu_0 a x B_field on rods along a, with hysteresis."""

    Fields = HysteresisRodFields  # type: ignore[assignment]
    title = "hysteresis_rod"

    @classmethod
    def resolve(cls, fields: HysteresisRodFields, around: Setting) -> HysteresisRod:
        given, most = fields.remanence.at(around.context), fields.saturation.at(around.context)
        what = f"given {float(fields.remanence):g} T; less than the saturation is allowed"
        ensure(given < most, around.fault("remanence", what))
        what = "given, but the scene has no magnetic field; add a magnetic_dipole (its moment may be zero)"
        ensure("dbx" in around.names, around.fault("kind", what))
        options = {"parameters": fields.parameters}
        x, y, z = (around.expression("axis", text, "N m", **options) for text in fields.torque)
        return cls((x, y, z), "body", around.body.center_of_mass, pushes=False)
