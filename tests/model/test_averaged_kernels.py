"""Averages over the rotation under bodies of a kernel, and under tables: both set states where steps end."""

import numpy as np
import pytest
from support import config, run_text

EARTH = config(
    'principal_moments = ["0.996726", "0.996727", 1]\nhost = "earth"',
    'euler_angles = [0, "0.1 deg", 0]\nangular_velocity = [0, 0, 7.292115e-5]',
    [f'kind = "gravity_gradient"\nsource = "{name}"' for name in ("sun", "moon")],
    'epoch = "2000-01-01T12:00:00 TDB"\nend = "200 day"\nsamples = 21',
    output='record = ["momentum_axis"]',
    more='[ephemeris]\nkernel = "de421"\n[model]\nlevel = "spin_averaged"',
)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_both_announced_errors_are_true() -> None:
    """That of the model beside every rotation, that of the integration beside 80 bits."""
    averaged = run_text(EARTH, estimate=True)
    path = averaged.dataset["momentum_axis"].values

    def apart(*changes: str) -> float:
        other = run_text(EARTH, *changes).dataset["momentum_axis"].values
        return float(np.linalg.norm(path - other, axis=1).max())

    true = apart("model.level=full")
    assert true < 1e-10  # what goes round with the body: (n / w)^2 (B - A) / C
    announced = averaged.summary["modelling"]["momentum_axis"]
    assert true / 1.5 < announced < 10 * true
    true, announced = (
        apart("integrator.precision=extended"),
        averaged.summary["accuracy"]["estimated_attitude_error"],
    )
    assert true / 3 < announced < 20 * max(true, 1e-16)
