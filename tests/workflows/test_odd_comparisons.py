"""Trajectories as nobody means them: a body that stands still, attitudes that are all zero."""

import numpy as np

import rigidsim

TUMBLING = """
name = "tumbling"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 0.5, 0.2]
[time]
end = 60
"""


def standing(quaternion: list[float]) -> dict[str, np.ndarray]:
    times = np.arange(61.0)
    names = ["qw", "qx", "qy", "qz", "wx", "wy", "wz"]
    return {
        "t": times,
        **{name: np.full(61, value) for name, value in zip(names, [*quaternion, 0, 0, 0], strict=True)},
    }


def test_a_body_that_stands_still_does_not_agree_with_one_that_tumbles() -> None:
    # "1 0 0 0" has no decimals, which isn't to say that its attitude is known to half a unit.
    found = rigidsim.compare(rigidsim.parse(TUMBLING), standing([1, 0, 0, 0]))
    assert found.attitude_error.largest > 2
    assert found.verdict != "agrees"
