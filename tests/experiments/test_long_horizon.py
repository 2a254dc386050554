"""The study of long runs: its fit knows the laws, and its measurement the closed form."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

from experiments import long_horizon as study

HORIZON = 3e3


def made_up(walk: float, drift: float, starts: int = 400, horizon: float = 1e7) -> xarray.Dataset:
    """Random walks of a rate, which tilt a phase, with a constant drift of the rate beside them."""
    moments = np.array(study.times(horizon)[1:])
    generator = np.random.default_rng(1)
    steps = np.diff(moments, prepend=0.0)
    rate = walk * np.cumsum(generator.standard_normal((starts, len(moments))) * np.sqrt(steps), axis=1)
    rate += drift * moments
    phase = np.cumsum(rate * steps, axis=1)
    errors = np.abs(np.array([rate, rate, phase]))
    return xarray.Dataset(
        {"error": (("quantity", "start", "time"), errors), "cpu_seconds": ("start", np.zeros(starts))},
        coords={"quantity": list(study.QUANTITIES), "time": moments},
        attrs={"body": "free asymmetric body", "precision": "double", "held": 0},
    )


def test_a_random_walk_has_the_exponents_of_brouwer() -> None:
    data = made_up(1e-17, 0.0)
    for quantity in study.QUANTITIES:
        fitted = study.fit(data, quantity)
        assert fitted is not None
        # four times the uncertainty that the fit itself claims, over 400 walks of some per cent
        assert abs(fitted.exponent - study.LAW[quantity]) < 4 * fitted.sigma + 0.02
        assert fitted.sigma < 0.05
    assert all(check.passed for check in study.checks([data]))


@pytest.fixture(scope="module")
def measured() -> dict[tuple[str, bool], xarray.Dataset]:
    return {
        (body, held): study.measure(body, "double", held, HORIZON, starts=3)
        for body in study.BODIES
        for held in (False, True)
    }


@pytest.mark.slow
@pytest.mark.parametrize("body", study.BODIES)
def test_errors_stay_within_the_law(body: str, measured: dict[tuple[str, bool], xarray.Dataset]) -> None:
    plain, held = (measured[body, h]["error"].sel(quantity="attitude") for h in (False, True))
    # five times (eps/2) sqrt(steps) t / sqrt 3 with at most 4 steps to a radian: five sigma of a random walk
    law = 5 * 2.0**-53 * (4 * HORIZON) ** 0.5 * HORIZON * 1.5 / 3**0.5
    assert plain.max() < law
    assert (plain > 0).all()
    # held: no more than some eps to a radian is left
    assert held.max() < 8 * 2.0**-52 * HORIZON
