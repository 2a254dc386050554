"""Averages over the rotation under bodies of a kernel, and under tables: both set states where steps end."""

import numpy as np
from support import run_text

SCENE = """
name = "planet"
[body]
host = "{host}"
principal_moments = [{moments}, 1]
[initial]
euler_angles = {angles}
angular_velocity = [0, 0, {spin}]
[ephemeris]
kernel = "de421"
{loads}
[model]
level = "spin_averaged"
[time]
epoch = "2000-01-01T12:00:00 TDB"
end = "{end}"
samples = 21
[output]
record = ["momentum_axis"]
timeline = false
"""
SOURCE = '[[loads]]\nkind = "gravity_gradient"\nsource = "{}"\n'
EARTH = {
    "host": "earth",
    "moments": '"0.996726", "0.996727"',
    "angles": '[0, "0.1 deg", 0]',
    "spin": 7.292115e-5,
}


def scene(body: dict[str, object], *sources: str, end: str = "60 day") -> str:
    return SCENE.format(**body, loads="".join(map(SOURCE.format, sources)), end=end)


def test_both_announced_errors_are_true() -> None:
    """That of the model beside every rotation, that of the integration beside 80 bits."""
    text = scene(EARTH, "sun", "moon", end="200 day")
    averaged = run_text(text, estimate=True)
    path = averaged.dataset["momentum_axis"].values

    def apart(*changes: str) -> float:
        other = run_text(text, *changes).dataset["momentum_axis"].values
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
