"""Does a rigid Earth nutate as the published series of a rigid Earth say?

The ready scene `rigid_earth_nutation` (Moon, Sun and planets of JPL's DE421), 50 years around J2000, at three
levels: degree 2 with the Moon and the Sun; then J3 and the planets; then unequal equatorial moments and the
tesserals of degree 3. The figure axis on the mean equator and equinox of date (precession of IAU 1976), every
line above 0.1 mas fitted in both senses at once, with a cubic and the free nutation. Lines of 182.62 and
182.63 d, and of 365.22 and 365.26 d, can't be separated in 50 years, which alone leaves 0.3 mas.
"""

from experiments.bare import precession
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.real_bodies import nutation

SCENE = CONFIGS / "kernels" / "rigid_earth_nutation.toml"
START = 2442412.5
DAY = 86400.0
LEVELS = ("degree 2, Moon and Sun", "with J3 and planets", "triaxial, with tesserals")
H, POLAR = 0.0032737548, 8.0343e37
ROUND = (  # equal equatorial moments, and the zonal part of the field
    "body.preset=",
    f"body.principal_moments={[POLAR * (1 - H), POLAR * (1 - H), POLAR]!r}",
    "body.mass=5.9721684106698775e24",
    "body.gravity_field={radius = '6378136.6 m', C = {'3,0' = 2.532474e-6}}",
)


def run(level: int) -> Result:
    """The scene at a level of 0 to 2."""
    settings = ["output.record=['figure_axis']", "output.estimate=false", *(ROUND if level < 2 else ())]
    if level:
        return simulate(SCENE, *settings)
    first, moon, sun, *others = SCENE.read_text().split("[[loads]]")
    text = "[[loads]]".join([first, moon, sun]) + others[-1][others[-1].index("[frame]") :]
    return simulate(text, *settings, "loads[0].degree=2", "loads[1].degree=2")


def fitted(result: Result) -> nutation.Nutations:
    """Lines of its figure axis."""
    dates = START + result.values("time") / DAY
    return nutation.fit(dates, result.values("figure_axis"), 1 / (1 - H))


def picture(result: Result, fit: nutation.Nutations) -> Picture:
    """The pole's nutation about the mean pole of date, and what the fit leaves."""
    dates = START + result.values("time") / DAY
    poles = precession.to_date(dates, result.values("figure_axis"))[:, :2] / precession.ARCSEC
    years = 2000 + (dates - 2451545.0) / 365.25
    # one above the other, by 3 mas: daily samples of both would cover each other
    rest = [Curve(years, part + shift, f"{label}, shifted by {shift:g} mas", color, width=0.3)
            for part, color, shift, label in ((fit.rest.real, "orange", 1.5, "dpsi sin eps"),
                                              (fit.rest.imag, "blue", -1.5, "deps"))]  # fmt: skip
    left = f"Left over by {len(fit.circles)} circles above 0.1 mas and a cubic"
    return Picture("A rigid Earth's pole about the mean pole of date, 1975 to 2025", "ab", [
        Panel("Nutation: 18.6 years, with half a year and half a month", "dpsi sin eps, arcsec",
              "deps, arcsec", [Curve(*poles.T, width=0.4)], equal=True),
        Panel(left, "year", "mas", rest, limits={"ylim": (-3.2, 3.9)}, legend="upper left"),
    ])  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Five amplitudes at three levels."""
    runs = [run(level) for level in range(len(LEVELS))]
    fits = [fitted(result) for result in runs]
    return [
        Check(f"{line}, {name}", fit.amplitude(line), published, 0.5, "mas",
              "rigid-Earth series; lines that 50 years can't tell apart", "absolute")
        for name, fit in zip(LEVELS, fits, strict=True)
        for line, (_, _, published) in nutation.PUBLISHED.items()
    ], picture(runs[-1], fits[-1])  # fmt: skip
