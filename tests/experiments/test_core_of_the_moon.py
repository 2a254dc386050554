"""The Moon with a fluid core, rigid and elastic, against the equations of ``experiments.bare.moon``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidsim

pytest.importorskip("de421")
pytest.importorskip("jplephem")

from experiments.bare.moon import Moon, between, matrices

READY = Path(__file__).parents[2] / "configs" / "kernels" / "rigid_moon.toml"
DAYS = 1460


def written(moon: Moon) -> dict[str, Any]:
    """The same scene, from the package's constants."""
    c = moon.constants

    def numbers(names: tuple[str, ...], unit: str) -> list[str]:
        return [f"{float(c[name])!r} {unit}" for name in names]

    core = {"moment": repr(float(c["IFAC"])), "flattening": repr(float(c["COBLAT"]))}
    core["friction"] = f"{float(c['KVC'])!r} day^-1"
    mass = moon.kernel.parameters["moon"] * 1e9 / 86400**2 / 6.67430e-11
    changes: dict[str, Any] = {
        "body.core": core | {"angular_velocity": numbers(("OMGCX", "OMGCY", "OMGCZ"), "rad/day")},
        "body.principal_moments": [repr(float(x * mass * (c["AM"] * 1e3) ** 2)) for x in moon.moments],
        "initial.euler_angles": numbers(("PHI", "THT", "PSI"), "rad"),
        "initial.angular_velocity": numbers(("OMEGAX", "OMEGAY", "OMEGAZ"), "rad/day"),
        "time.every": "4 day",
        "time.end": f"{DAYS} day",
        "output": {"record": ["quaternion", "core_angular_velocity"], "estimate": False, "timeline": False},
    }
    if moon.love:
        elasticity = {"love_number": repr(float(c["K2M"])), "radius": f"{float(c['AM'])!r} km"}
        elasticity |= {"mean_rate": "0.2299715 rad/day", "raised_by": ["earth"]}
        changes["body.elasticity"] = elasticity
    return changes


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [False])
def test_the_moon_with_a_core(elastic: bool) -> None:
    """Both in double precision: rounding of some hundred steps in either."""
    without = ["degree3", "degree4", "figure", "planets", "delay" if elastic else "distortion"]
    moon = Moon("de421", without)
    found = moon.integrate(DAYS, 1e-17)
    data = rigidsim.run(rigidsim.load(READY).replace(written(moon)), out=None).dataset
    count = min(data.sizes["time"], len(found["quaternion"]))
    apart = between(matrices(data["quaternion"].values[:count]), matrices(found["quaternion"][:count]))
    assert np.abs(apart).max() <= 1e-12
    core = data["core_angular_velocity"].values[:count] * 86400 - found["states"][:count, 7:10]
    assert np.abs(core).max() <= 1e-13  # rad/day
