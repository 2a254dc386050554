"""Where do the Moon's free librations lie, of a rigid Moon and of the real one, beside the observed ones?

The ready scene `moon_since_1969` from 1900 on for 150 years, twice, from starts that differ by 100 arcsec:
the difference is free libration alone, whose three periods are fitted. Four Moons: rigid of degree 2; to
degree 4 with the Earth's figure; elastic; with a fluid core.

Published: periods in DE421 (Rambaux & Williams 2011, Celest. Mech. Dyn. Astr. 109, 85) and DE430 (Yang, Li,
Ping & Hanada 2017, Res. Astron. Astrophys. 17, 127), which differ by as much as is allowed, and for the
wobble 5e-4, since 150 years are two of its cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bare import moon as bare
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Study, simulate
from experiments.real_bodies import free_librations as free

SCENE = CONFIGS / "kernels" / "moon_since_1969.toml"
START = 2415056.5  # 1900-02-06
ARCSEC = math.radians(1 / 3600)
TURN, SLIP = np.array([120.0, 0.0, 100.0]) * ARCSEC, np.array([60.0, 0.0, 0.0]) * ARCSEC
NO_CORE, STIFF = "body.core.moment=0", "body.elasticity.love_number=0"
MOONS: dict[str, tuple[str, ...]] = {
    "rigid, degree 2": (NO_CORE, STIFF, "loads[0].degree=2", "loads[0].figure="),
    "rigid, degree 4": (NO_CORE, STIFF),
    "elastic": (NO_CORE,),
    "with a core": (),
}
DE430 = (1056.16, 8806.9, 27262.99)
DE421 = (1056.13, 8822.88, 27257.27)
ALLOWED = (3e-5, 2e-3, 5e-4)
MODES = ("longitude", "latitude", "wobble")
BETA, GAMMA = 0.0006310022025364629, 0.0002277305314199142


@dataclass(frozen=True)
class Modes:
    """Periods of the free librations (days), the ratio of the wobble's axes, and the turns they are from.

    Attributes:
        periods: in longitude, in latitude (from the node), of the wobble.
        ratio: of the wobble's axes.
        days: of the samples.
        body: small turns from one motion to the other about the body axes, arcsec.
    """

    periods: tuple[float, float, float]
    ratio: float
    days: np.ndarray
    body: np.ndarray


def start() -> tuple[np.ndarray, np.ndarray]:
    """DE421's attitude (body to space) at the start, and its rates about the body axes, rad/day."""
    step = 0.05
    before, now, after = (bare.librations("de421", np.array([START + k * step]))[0] for k in (-1, 0, 1))
    return now, bare.between(after[None], before[None])[0] / (2 * step)


def modes(settings: tuple[str, ...], years: int = 150) -> Modes:
    """Of one Moon."""
    attitude, rates = start()
    runs = []
    for turn, slip in ((np.zeros(3), np.zeros(3)), (TURN, SLIP)):
        spin = rates + np.cross(rates, slip)
        result = simulate(
            SCENE,
            f"initial.quaternion={_quaternion(attitude @ _rotation(turn))!r}",
            f"initial.angular_velocity={[f'{x!r} rad/day' for x in spin.tolist()]!r}",
            "initial.euler_angles=",
            "body.core.angular_velocity=",
            "time.epoch='1900-02-06T00:00:00 TDB'",
            f"time.end='{4 * int(years * 365.25 / 4)} day'",
            "time.every='4 day'",
            "output.record=['quaternion']",
            "output.estimate=false",
            *settings,
        )
        runs.append(bare.matrices(result.values("quaternion")))
    days = result.values("time") / 86400
    body = bare.between(runs[0], runs[1]) / ARCSEC
    space = np.einsum("nij,nj->ni", runs[0], body)
    wobble, ratio = free.wobble(days, body)
    periods = free.longitude(days, body), free.latitude(days, space), wobble
    return Modes(periods, ratio, days, body)


def _rotation(vector: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def _quaternion(matrix: np.ndarray) -> list[float]:
    w = math.sqrt(max(1 + np.trace(matrix), 0)) / 2
    if w > 0.1:
        parts = [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
        return [float(x) for x in (w, *(p / (4 * w) for p in parts))]
    raise ValueError("a half turn: start on another day")


def circular() -> tuple[float, float, float]:
    """Periods by the linearised equations on a circular orbit at rest (Hughes 1986, section 9.2)."""
    along, across = BETA, (BETA - GAMMA) / (1 - BETA * GAMMA)
    half = (1 + 3 * along + along * across) / 2
    root = math.sqrt(half**2 - 4 * along * across)
    slow, fast = math.sqrt(half - root), math.sqrt(half + root)
    month = free.MONTH
    return month / math.sqrt(3 * GAMMA), 1 / ((1 - fast) / month - 1 / free.NODE), month / slow


@Study
def study(full: bool) -> Answer:
    """Three periods of four Moons."""
    found = {name: modes(settings) for name, settings in MOONS.items()}
    figure = picture(found)
    real, rigid = found["with a core"], found["rigid, degree 2"]
    checks = [
        Check(f"{mode}, DE421's whole Moon", period, seen, allowed, "d",
              "Rambaux & Williams 2011; how far Yang et al. 2017 are, and two cycles of the wobble")
        for mode, period, seen, allowed in zip(MODES, real.periods, DE421, ALLOWED, strict=True)
    ]  # fmt: skip
    checks += [
        Check("ratio of the wobble's axes", real.ratio, 8.19 / 3.31, 0.006, "1",
              "Yang et al. 2017; their last digits", "absolute"),
        Check("longitude, a rigid Moon: not as observed", rigid.periods[0], DE421[0], 1.0, "d",
              "Rambaux & Williams 2011; a part in a thousand", "apart"),
        Check("wobble, a rigid Moon", rigid.periods[2], DE421[2], 15.0, "d",
              "Rambaux & Williams 2011; what an elastic body changes", "absolute"),
        Check("longitude, a rigid Moon, by a circular orbit", rigid.periods[0], circular()[0], 0.015, "d",
              "linearised equations; eccentricity and inclination"),
    ]  # fmt: skip
    return checks, figure


def picture(found: dict[str, Modes]) -> Picture:
    """Free librations of the real Moon as they are, and each mode's period of each Moon."""
    real = found["with a core"]
    days, slow = free.smoothed(real.days, real.body)

    def periods(k: int, title: str) -> Panel:
        def named(axes: Any) -> None:
            axes.set_yticks(range(len(found)), list(found) if k == 0 else [""] * len(found))
            axes.ticklabel_format(axis="x", useOffset=False)
            axes.locator_params(axis="x", nbins=5)

        colors = ("red", "orange", "green", "blue")
        dots = [Curve(one.periods[k], row, "", colors[row], "o", 2) for row, one in enumerate(found.values())]
        lines = [Curve(DE430[k], None, "in DE430", "grey"), Curve(DE421[k], None, "in DE421", "grey", "--")]
        limits = {"ylim": (-0.5, len(found) + 0.2)}
        return Panel(title, "days", "", [*dots, *lines], legend="upper right", limits=limits, more=named)

    titles = ("Longitude", "Latitude, from the node", "Wobble")
    title = "The Moon's free librations: those of a rigid Moon, and those that are observed"
    return Picture(title, "aabbbb;ccddee", [
        Panel("Wobble, 74.6 years: the axis in the body", "about x, arcsec", "about y, arcsec",
              [Curve(*slow[:, :2].T)], equal=True),
        Panel("Longitude, 2.9 years", "", "about z, arcsec",
              [Curve(1900.1 + days / 365.25, slow[:, 2], "", "orange", width=0.8)]),
        *(periods(k, title) for k, title in enumerate(titles)),
    ], (14, 7.2))  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(study.main())
