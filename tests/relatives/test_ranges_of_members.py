"""Members of a sweep beyond the range of a key are refused, though others stand for them in a batch."""

import random
from pathlib import Path

import numpy as np
import pytest
from support import config, seeds

import rigidsim

SCENE = config(
    "principal_moments = [1, 2, 2.5]\nmass = 10",
    'angular_velocity = [1e-3, 0, 1e-3]\nposition = ["7000 km", 0, 0]\nvelocity = [0, "7.5 km/s", 0]',
    [
        'kind = "central_gravity"\nname = "earth"\ngravitational_parameter = "398600.4418 km^3/s^2"\n'
        'radius = "6378 km"\nfigure = {J2 = 0.001, radius = "6378 km", pole = [0, 0, 1]}',
        'kind = "viscous_torque"\ncoefficients = [1e-6, 1e-6, 1e-6]',
        'kind = "torque"\ncomponents = ["1e-16*altitude", "0", "0"]',
    ],
    "end = 1\nsamples = 2",
    output='record = ["angular_velocity"]',
    more='[sweep]\nimpossible = "mark"',
)
# key, what is allowed by docs/config.md, ends between which values are drawn
KEYS = [
    ("loads[0].figure.J2", lambda x: -1 <= x <= 0.5, (-2.0, 1.5)),
    ("loads[0].figure.radius", lambda x: x > 0, (-3e6, 6e6)),
    ("loads[0].radius", lambda x: x > 0, (-3e6, 6e6)),
    ("loads[1].coefficients[1]", lambda x: x >= 0, (-1e-6, 2e-6)),
]


@pytest.mark.parametrize("seed", seeds(1, 50))
@pytest.mark.slow
@pytest.mark.unoptimised
def test_members_beyond_the_range_of_a_key_are_refused(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    key, allowed, ends = chance.choice(KEYS)
    values = [chance.uniform(*ends) for _ in range(6)]
    first = next(v for v in iter(lambda: chance.uniform(*ends), None) if allowed(v))
    values.insert(0, first)
    text = f'{SCENE}axes."{key}" = {{values = {values}, name = "drawn"}}\n'
    found = rigidsim.sweep(rigidsim.parse(text), out=tmp_path).dataset
    finite = np.isfinite(found.angular_velocity_final.values).all(axis=-1)
    assert finite.tolist() == [allowed(v) for v in values]
