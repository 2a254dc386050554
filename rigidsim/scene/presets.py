"""Published bodies. Every value names its source; the docs print the same text."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Preset:
    """Principal moments along x, y, z (as ratios of ``largest_moment``), and what they come from.

    Attributes:
        ratios: I_x, I_y, I_z over the largest moment, as exact texts.
        largest_moment: kg m^2.
        mass: kg.
        semi_axes: m, for the picture.
        source: where the numbers are published.
    """

    ratios: tuple[str, str, str]
    largest_moment: str
    mass: str
    semi_axes: tuple[str, str, str]
    source: str


PRESETS: dict[str, Preset] = {
    "earth": Preset(
        # 1 - H twice, with the dynamical flattening H = (C - A)/C = 0.00327379492
        ratios=("0.99672620508", "0.99672620508", "1"),
        largest_moment="8.0365e37",
        mass="5.9722e24",
        semi_axes=("6378136.6", "6378136.6", "6356751.9"),
        source="(C-A)/C: Mathews, Herring & Buffett 2002, J. Geophys. Res. 107(B4), 2068; "
        "C, axes: Groten 2004, J. Geodesy 77, 724 (mean equatorial moment: A = B); "
        "mass: Astronomical Almanac",
    ),
}
