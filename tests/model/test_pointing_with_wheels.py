"""The ready scene of a satellite that points with wheels, against its own equations: momentum and rotation
matrix, by scipy.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import CONFIGS

import rigidsim

(SCENE,) = (path for path in CONFIGS if path.stem == "pointing_with_wheels")
MOMENTS, J = np.array([10.0, 12.0, 8.0]), 0.01
K, D, GAIN, NEAR, MOST, DISTURBANCE = 0.2, 2.4, 0.004, 0.1, 0.1, np.array([2e-3, 0, 0])
FULL, SOFT = 6000 * np.pi / 30, 100 * np.pi / 30


def _slope(_: float, state: np.ndarray) -> np.ndarray:
    """Of the whole momentum in body axes, the matrix to space, the wheels' momenta, the integrals."""
    momentum, matrix, own, sums = state[:3], state[3:12].reshape(3, 3), state[12:15], state[15:]
    rates = (momentum - own) / (MOMENTS - J)
    skew = (matrix - matrix.T) / 2
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])  # 2 q_w q_k
    speed = own / J - rates
    asked = np.clip(K * error + D * rates + GAIN * sums, -MOST, MOST)
    motor = np.clip(asked, -MOST * (FULL + speed) / SOFT, MOST * (FULL - speed) / SOFT)
    x, y, z = rates
    turned = matrix @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    summed = np.where(abs(error) < NEAR, error, 0)
    return np.concatenate([np.cross(momentum, rates) + DISTURBANCE, turned.ravel(), motor, summed])


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "saturated", "end"), [(0.0, False, 60), (622.0, True, 15)])
def test_it_turns_by_its_wheels_within_their_limits(
    rate: float, saturated: bool, end: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """Kinks and jumps leave scipy some 1e-10."""
    changes = [f"time.end={end}", "time.samples=31", f"rotors[0].rate={rate}", "output.estimate=false"]
    data = rigidsim.run(rigidsim.load(SCENE, overrides=changes), out=None, progress=False).dataset
    w, x, y, z = data["quaternion"].values[0]
    begun = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    own = np.array([J * rate, 0, 0])
    start = np.concatenate([own, begun.ravel(), own, np.zeros(3)])
    truth = solve_ivp(
        _slope, (0, end), start, "DOP853", data["time"].values, rtol=1e-12, atol=1e-13, max_step=0.1
    ).y
    rates = (truth[:3] - truth[12:15]) / (MOMENTS - J)[:, None]
    np.testing.assert_allclose(data["angular_velocity"].values, rates.T, atol=1e-8)
    np.testing.assert_allclose(data["rotor_rate"].values, (truth[12:15] / J - rates).T, atol=1e-5)
    np.testing.assert_allclose(data["sum_x"].values, truth[15], atol=1e-7)
    assert bool(data["rotor_rate"].values.max() > FULL - SOFT) == saturated
    said = capfd.readouterr()
    assert "heyoka" not in said.out + said.err  # the engine's own warnings would spoil --json
