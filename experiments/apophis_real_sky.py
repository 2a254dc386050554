"""What is the real sky worth to Apophis' rotation when it passes the Earth in 2029?

The ready scene `apophis_2029`: six degrees of freedom under the Earth, the Moon, the Sun and the planets of
JPL's DE421, from two days before perigee to two days after it. Its orbit is that of `apophis_flyby` at
perigee (JPL Horizons), carried back by another integrator. The first draws of that study fly it, and once
more Kepler's hyperbola about the Earth alone. Horizons' places are relative to the barycentre of DE441, some
100 km from DE421's. Nothing that the Moon and the Sun do in four days should matter next to what isn't known
of the rotation: a tenth of a degree, and a part in a thousand of the rate, for the median member.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from experiments import apophis_flyby as flyby
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.measure import matrices
from experiments.real_bodies import apophis
from experiments.tumbling import Tumbling, tumbling_of

SCENE = CONFIGS / "kernels" / "apophis_2029.toml"
AU = 149597870.7  # km
HORIZONS = 0.00025409077441363115 * AU
VECTOR_DATE = 2462239.5
VECTOR = np.array([-375322.14, -201966.68, -228765.45])
"""Horizons' place at that date, km, less the Earth's by DE421; axes of the ICRF."""


def orbit(days: float) -> np.ndarray:
    """Place and velocity, km and km/day, so many days after perigee."""
    place, speed = (apophis.equatorial(x) for x in flyby.hyperbola(0.0))
    return apophis.flight(place / 1e3, speed / 1e3 * 86400, apophis.PERIGEE, days)


def flights(drawn: flyby.Draws) -> tuple[np.ndarray, np.ndarray]:
    """Rates and directions of the momentum (ecliptic) of all members, after the pass."""
    rates, poles = [], []
    back = matrices(np.array([[np.cos(apophis.OBLIQUITY / 2), np.sin(apophis.OBLIQUITY / 2), 0, 0]]))[0]
    for moments, spin, quaternion in zip(drawn.moments, drawn.rates, drawn.quaternions, strict=True):
        attitude = back @ matrices(quaternion[None])[0]
        settings = (
            "body.preset=",
            "body.mass=5e10",
            f"body.principal_moments={(moments * flyby.LARGEST_MOMENT).tolist()!r}",
            f"initial.angular_velocity={spin.tolist()!r}",
            f"initial.quaternion={Rotation.from_matrix(attitude).as_quat()[[3, 0, 1, 2]].tolist()!r}",
            "time.every='4 day'",
            "output.record=['angular_velocity', 'momentum_axis']",
            "output.estimate=false",
        )
        result = simulate(SCENE, *settings)
        rates.append(result.values("angular_velocity")[-1])
        poles.append(result.values("momentum_axis")[-1] @ back)
    return np.array(rates), np.array(poles)


def picture(
    scene: Result, drawn: flyby.Draws, after: Tumbling, shift: np.ndarray, apart: np.ndarray
) -> Picture:
    """The pass and the momentum, and members on both orbits."""
    hours = scene.values("time") / 3600 - 48
    momentum = scene.values("angular_momentum")
    size = np.linalg.norm(momentum, axis=1)
    poles = momentum / size[:, None]
    ratio = after.effective / drawn.state.effective
    title = "Apophis past the Earth: a new rotation, to which Moon and Sun hardly matter"
    return Picture(title, "abc", [
        Panel("Distance from the Earth (dashed: the Moon's)", "hours from perigee", "1000 km", [
            Curve(hours, np.linalg.norm(scene.values("position"), axis=1) / 1e6),
            Curve(None, 384.4, "", "grey", "--", 0.8),
        ], "y"),
        Panel("Angular momentum of the ready scene", "hours from perigee", "change", [
            Curve(hours, flyby.angle(poles, np.broadcast_to(poles[0], poles.shape)), "pole, deg"),
            Curve(hours, 100 * (size / size[0] - 1), "size, %", "orange"),
        ], limits={"xlim": (-12, 12)}, legend="center right"),
        Panel("Members: worth of Moon, Sun and planets (blue)", "pole shifted by, deg", "", [
            Curve(shift, apart, "pole, deg", "blue", "o"),
            Curve(shift, 100 * np.abs(ratio - 1), "change of the rate, %", "orange", "o"),
        ], "y", legend="center right"),
    ], (14, 4.8))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """The orbit, and members on both."""
    drawn = flyby.draws(96 if full else 24)
    scene = simulate(SCENE, "output.estimate=false", "time.every='1 min'")
    distance = np.linalg.norm(scene.values("position"), axis=1) / 1e3
    nearest = int(distance.argmin())
    begin, vector = orbit(-2.0), orbit(VECTOR_DATE - apophis.PERIGEE)[:3]
    rates, poles = flights(drawn)
    _, other_rates, other_poles = flyby.flown(drawn)
    after, alone = tumbling_of(drawn.moments, rates), tumbling_of(drawn.moments, other_rates)
    shift, apart = flyby.angle(poles, drawn.poles), flyby.angle(poles, other_poles)
    likely = "Benson et al. 2023, abstract; likely: more than half"
    none = "none; little beside what isn't known of the rotation"
    return [
        Check("distance at perigee", float(distance[nearest]), HORIZONS, 1.0, "km",
              "JPL Horizons; a minute's share, which is the scan's step", "absolute"),
        Check("time of perigee after 21:46 TDB", float(scene.values("time")[nearest]) / 60 - 2880, 0.0, 1.0,
              "min", "JPL Horizons, to the minute", "absolute"),
        Check("start, beside the elements carried back", float(np.linalg.norm(
              scene.values("position")[0] / 1e3 - begin[:3])), 0.0, 1e-3, "km", "DOP853; digits", "absolute"),
        Check("place 0.9 days before, beside another vector", float(np.linalg.norm(vector - VECTOR)), 0.0,
              300.0, "km", "JPL Horizons; barycentres of DE441 and DE421", "absolute"),
        Check("share that stays in short-axis mode", float(after.short.mean()), 1.0, 0.5, "1", likely,
              "absolute"),
        Check("share that shifts its pole by 10 degrees", float((shift > 10).mean()), 1.0, 0.5, "1", likely,
              "absolute"),
        Check("pole, from that about the Earth alone, median", float(np.median(apart)), 0.0, 0.1, "deg", none,
              "absolute"),
        Check("effective rate over that about the Earth alone, median",
              float(np.median(after.effective / alone.effective)), 1.0, 1e-3, "1", none, "absolute"),
    ], picture(scene, drawn, after, shift, apart)  # fmt: skip
