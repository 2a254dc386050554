"""Published bodies. Every value names its source; ``docs/presets.md`` gives details and uncertainties.

The Sun, the planets and the Moon are recognised by their gravitational parameters as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigidsim.scene.exact import parse_number


@dataclass(frozen=True)
class Preset:
    """Principal moments along x, y, z (as ratios to ``largest_moment``), and their source.

    Attributes:
        ratios: I_x, I_y, I_z over the largest moment, as exact texts.
        largest_moment: kg m^2, or the factor C/(M R^2) if ``radius`` is given.
        mass: kg.
        semi_axes: semi-axes for pictures, m.
        source: publication of the numbers.
        radius: R of the factor C/(M R^2), m.
        rotation: the published rotation, rad/s about the body axes; empty if there is no lasting one.
            A scene itself starts as its ``[initial]`` says.
        tables: what else of ``[body]`` is published with them, as it would be written there: gravity_field,
            elasticity, core.
        drawn_as: name of the body whose picture is its own; by default that of the preset.
    """

    ratios: tuple[str, str, str]
    largest_moment: str
    mass: str
    semi_axes: tuple[str, str, str]
    source: str
    radius: str = ""
    rotation: tuple[str, str, str] | tuple[()] = ()
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    drawn_as: str | None = None

    def completed(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """``[body]`` as given, with this preset's tables where it says nothing else.

        Keys of a table count one by one: ``core = {friction = 0}`` keeps the rest of the core. A gravity
        field with a radius or a file of its own is another one.
        """
        found = dict(given)
        for name, table in self.tables.items():
            own = given.get(name)
            if own is None:
                found[name] = dict(table)
            elif isinstance(own, Mapping) and not (name == "gravity_field" and {"radius", "file"} & set(own)):
                found[name] = _filled(table, own)
        return found

    def moments(self, context: Any) -> list[Any]:
        """I_x, I_y, I_z, kg m^2 (mpf)."""
        largest = parse_number(self.largest_moment, "1" if self.radius else "kg m^2").at(context)
        if self.radius:
            radius = parse_number(self.radius, "m").at(context)
            largest *= parse_number(self.mass, "kg").at(context) * radius**2
        return [parse_number(ratio, "1").at(context) * largest for ratio in self.ratios]


def _filled(table: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A table with its keys, and those of the tables within, replaced by one's own."""
    found = {**table, **own}
    for key, inner in table.items():
        if isinstance(inner, Mapping) and isinstance(own.get(key), Mapping):
            found[key] = {**inner, **own[key]}
    return found


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
        rotation=("0", "0", "7.292115e-5 rad/s"),
    ),
    "moon": Preset(
        # A/C = (1 - beta gamma)/(1 + beta), B/C = (1 + gamma)/(1 + beta) with beta = (C - A)/B = 631.0213e-6
        # and gamma = (B - A)/C = 227.7317e-6
        ratios=("99999985629644661479/100063102130000000000", "10002277317/10006310213", "1"),
        largest_moment="0.392863",  # of the mean moment 0.392728 and the ratios
        radius="1738 km",
        mass="7.34579e22",
        semi_axes=("1737400", "1737400", "1737400"),
        source="(C-A)/B, (B-A)/C: Folkner et al. 2014 (DE430), IPN Progr. Rep. 42-196; mean moment "
        "0.392728 M (1738 km)^2: Williams et al. 2014, J. Geophys. Res. Planets 119, 1546; mass: G M of "
        "DE430; radius, rotation: Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22",
        rotation=("0", "0", "13.17635815 deg/day"),
    ),
    "mars": Preset(
        # 1 - H -+ 2 J22 M R^2 / C with H = (C - (A+B)/2)/C = 0.00538017, J22 = 6.311e-5
        ratios=("0.99427276", "0.99496690", "1"),
        largest_moment="0.36367",
        radius="3396 km",
        mass="6.41691e23",
        semi_axes=("3396190", "3396190", "3376200"),
        source="(C-(A+B)/2)/C, C/MR^2: Baland et al. 2020, Celest. Mech. Dyn. Astr. 132, 47, from the "
        "precession of Konopliv et al. 2016, Icarus 274, 253; (B-A)/C, mass: gravity field and G M there; "
        "axes, rotation: Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22",
        rotation=("0", "0", "350.891982 deg/day"),
    ),
    "mercury": Preset(
        # 1 - (J2 +- 2 C22)/0.346 with J2 = 5.0334e-5, C22 = 0.8067e-5
        ratios=("345933532/346000000", "3459658/3460000", "1"),
        largest_moment="0.346",
        radius="2440 km",
        mass="3.30100e23",
        semi_axes=("2440530", "2440530", "2438260"),
        source="C/MR^2: Margot et al. 2012, J. Geophys. Res. 117, E00L09; J2, C22, mass: Verma and Margot "
        "2016, J. Geophys. Res. Planets 121, 1627; axes, rotation: Archinal et al. 2018, "
        "Celest. Mech. Dyn. Astr. 130, 22",
        rotation=("0", "0", "6.1385108 deg/day"),
    ),
    "hyperion": Preset(
        # a homogeneous ellipsoid, (b^2 + c^2)/(a^2 + b^2) and so on
        ratios=("34021/57125", "49096/57125", "1"),
        largest_moment="6.3420e28",  # M (a^2 + b^2)/5
        mass="5.5510e18",
        semi_axes=("190000", "145000", "114000"),
        source="axes, homogeneous: Wisdom, Peale & Mignard 1984, Icarus 58, 137; mass: Jacobson 2022, "
        "Astron. J. 164, 199",
    ),
    "toutatis": Preset(
        # 3.09 : 3.22 : 1
        ratios=("309/322", "1", "100/322"),
        largest_moment="2.6e19",  # M (a^2 + c^2)/5 of the axes: a scale, not a measurement
        mass="1.9e13",
        semi_axes=("1200", "960", "2300"),
        source="ratios, axes, rotation: Hudson & Ostro 1995, Science 270, 84; mass not measured: 2500 kg/m^3 "
        "assumed",
        rotation=("20.7 deg/day", "31.3 deg/day", "98.0 deg/day"),
    ),
    "apophis": Preset(
        ratios=("0.61", "0.965", "1"),
        largest_moment="7.8e14",  # M (a^2 + b^2)/5 of the axes: a scale, not a measurement
        mass="5.35e10",
        semi_axes=("221.9", "153.1", "144.6"),
        source="ratios: Pravec et al. 2014, Icarus 233, 48; axes: the ellipsoid that has them, with the "
        "diameter 0.34 km of Brozovic et al. 2018, Icarus 300, 115; mass not measured: 2600 kg/m^3 assumed",
    ),
}

PRESETS |= {
    "moon_de421": Preset(
        # A/C, B/C as above with beta = LBET = 0.0006310022025364629 and gamma = LGAM = 0.0002277305314199142;
        # C/(M R^2) = 2 (1 + beta) J2/(2 beta - gamma + beta gamma) with J2 = J2M = 0.0002032732576370724
        ratios=("0.99936925210230931440", "0.99959698263372922860", "1"),
        largest_moment="0.39326772667542688771",
        radius="1738 km",
        mass="7.3457891857239608769e22",  # GMB AU^3/(1 + EMRAT) = 4902.8000762277432081 km^3/s^2
        semi_axes=("1737400", "1737400", "1737400"),
        source="constants of JPL's DE421: Folkner, Williams & Boggs 2008, JPL IOM 343R-08-003; "
        "radius of pictures, rotation: Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22",
        rotation=("0", "0", "13.17635815 deg/day"),
        drawn_as="moon",
        tables={
            "gravity_field": {
                "radius": "1738 km",
                "C": {
                    "3,0": "-8.404701525941e-6",
                    "3,1": "2.8452435e-5",
                    "3,2": "4.84638724000903e-6",
                    "3,3": "1.674047530039142e-6",
                    "4,0": "9.642286e-6",
                    "4,1": "-5.692687e-6",
                    "4,2": "-1.5862e-6",
                    "4,3": "-8.12041e-8",
                    "4,4": "-1.273941e-7",
                },
                "S": {
                    "3,1": "5.9008e-6",
                    "3,2": "1.6841984741476e-6",
                    "3,3": "-2.485526e-7",
                    "4,1": "1.574393e-6",
                    "4,2": "-1.517312e-6",
                    "4,3": "-8.027907000000001e-7",
                    "4,4": "8.31475e-8",
                },
            },
            "elasticity": {
                "love_number": "0.02163368386360741",
                "delay": "0.1078586819856588 day",
                "radius": "1738 km",
                "mean_rate": "0.2299715 rad/day",
            },
            "core": {
                "moment": "0.0007",
                "flattening": "0.0003797712936914387",
                "friction": "1.493760249305661e-8 day^-1",
            },
        },
    ),
    "earth_rigid": Preset(
        # C/(M R^2) = J2/H with H = (C - (A + B)/2)/C = 0.0032737548 and J2 = 0.001082625305 of DE421;
        # B - A = 4 sqrt(C22^2 + S22^2) M R^2 with C22 = 1.5745e-6, S22 = -9.0387e-7
        ratios=("0.99671526542024313361", "0.99673722497975686639", "1"),
        largest_moment="0.33069834826969936783",
        radius="6378136.6 m",
        mass="5.9721684106698775088e24",  # GMB AU^3 EMRAT/(1 + EMRAT) = 398600.43623333963457 km^3/s^2
        semi_axes=("6378136.6", "6378136.6", "6356751.9"),
        source="(C-A)/C of the rigid-Earth series: Souchay, Loysel, Kinoshita & Folgueira 1999, Astron. "
        "Astrophys. Suppl. 135, 111; J2, J3, G M: DE421; other harmonics: see docs/presets.md",
        rotation=("0", "0", "7.292115e-5 rad/s"),
        tables={
            "gravity_field": {
                "radius": "6378136.6 m",
                # J3; tesserals of Greenwich, turned to the axis of the smallest moment at
                # 14.929376301576161 deg west
                "C": {
                    "3,0": "2.532474e-6",
                    "3,1": "2.0499998435598484e-6",
                    "3,2": "3.7328856333208324e-7",
                    "3,3": "-6.7555654341113537e-8",
                },
                "S": {
                    "3,1": "8.2405452574729378e-7",
                    "3,2": "-2.9499082790305138e-8",
                    "3,3": "2.1082765085857213e-7",
                },
            },
        },
    ),
}

_ALIKE = 0.01
"""Relative difference up to which a gravitational parameter is that of a known body: for what is written in
few digits (4e14), and less than what the Moon adds to the Earth (0.0123).
"""


@dataclass(frozen=True)
class KnownBody:
    """A body that attracts others.

    Attributes:
        gravitational_parameter: m^3/s^2.
        radius: at the equator, m.
        distance: semi-major axis of its orbit about the Sun, of the Moon's about the Earth, m; 0 for the Sun.
    """

    name: str
    gravitational_parameter: float
    radius: float
    distance: float

    @property
    def called(self) -> str:
        """Its name in a sentence: ``the Sun``, ``Saturn``."""
        return f"the {self.name}" if self.name in ("Sun", "Earth", "Moon") else self.name

    @property
    def owner(self) -> str:
        """Its name as the owner of something: ``the Sun's``, ``Mars'``."""
        return f"{self.called}'" if self.name.endswith("s") else f"{self.called}'s"


KNOWN: tuple[KnownBody, ...] = (
    # nominal G M and equatorial radii of IAU 2015 Resolution B3 for Sun, Earth and Jupiter; else G M of JPL's
    # planetary ephemerides and radii of Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22; semi-major
    # axes of Standish's mean elements at J2000 (JPL), rounded
    KnownBody("Sun", 1.3271244e20, 6.957e8, 0.0),
    KnownBody("Mercury", 2.2031868e13, 2.4397e6, 5.7909e10),
    KnownBody("Venus", 3.24858592e14, 6.0518e6, 1.08209e11),
    KnownBody("Earth", 3.986004e14, 6.3781e6, 1.49598e11),
    KnownBody("Moon", 4.902800e12, 1.7374e6, 3.84400e8),
    KnownBody("Mars", 4.2828375e13, 3.39619e6, 2.27944e11),
    KnownBody("Jupiter", 1.2668653e17, 7.1492e7, 7.78341e11),
    KnownBody("Saturn", 3.7931206e16, 6.0268e7, 1.426666e12),
    KnownBody("Uranus", 5.7939512e15, 2.5559e7, 2.870658e12),
    KnownBody("Neptune", 6.8350999e15, 2.4764e7, 4.498396e12),
)


def known_body(strength: float) -> KnownBody | None:
    """The body with a gravitational parameter (m^3/s^2); None if it is that of no known one."""
    near = min(KNOWN, key=lambda one: abs(one.gravitational_parameter - strength))
    return near if abs(strength / near.gravitational_parameter - 1) < _ALIKE else None
