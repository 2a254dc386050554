"""Files of other tools are judged rightly, with rates and without, at even and uneven rows.

The truth is SciPy's DOP853 at 3e-14 over equations written in ``experiments/compare_conventions.py``.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import seeds

import rigidsim
from experiments.compare_conventions import NEAR, a_mixed_file
from rigidsim.errors import RigidsimError


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_no_verdict_is_false(seed: int) -> None:
    one = a_mixed_file(seed)
    assert not one.wrong, (one.label, one.way, one.found.why)
    assert one.widest > NEAR or one.found.verdict != "undecided", (one.label, one.way, one.found.why)


SPIN = """
name = "spin"
[body]
principal_moments = [10, 14, 19]
[initial]
angular_velocity = [0, 0, -0.03]
[time]
end = 1400
"""


def spinning(rate: float, step: float) -> dict[str, np.ndarray]:
    """A spin about z in closed form."""
    times = np.arange(0, 1400.1, step)
    half, none = rate * times / 2, 0 * times
    quaternion = {"qx": none, "qy": none, "qz": np.sin(half), "qw": np.cos(half)}
    return {"t": times, **quaternion, "wx": none, "wy": none, "wz": none + rate}


def test_aliased_rows_do_not_agree() -> None:
    """A whole turn more from row to row gives the same attitudes."""
    other = spinning(2 * np.pi / 14 - 0.03, 14.0)
    experiment = rigidsim.parse(SPIN)
    found = rigidsim.compare(experiment, other)
    assert found.attitude_error.largest < 1e-9
    assert found.verdict == "undecided"
    assert "other motions have the same rows" in found.why
    assert rigidsim.compare(experiment, spinning(-0.03, 14.0)).verdict == "agrees"


@pytest.mark.parametrize("zero", [7e8, 1.7e13, -1e9])
def test_times_counted_from_another_zero_are_refused_with_the_shift(zero: float) -> None:
    table = spinning(-0.03, 14.0)
    table["t"] = table["t"] + zero
    with pytest.raises(
        RigidsimError, match=rf"another zero; subtract {zero:.15g} from each time".replace("+", r"\+")
    ):
        rigidsim.compare(rigidsim.parse(SPIN), table)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_a_wrong_rate_is_no_rounding_of_even_times(seed: int) -> None:
    """Attitudes that fall behind evenly look like times that do; even times show no rounding, though."""
    random = np.random.default_rng(seed)
    step = float(random.choice([0.5, 1, 2, 5, 10, 20, 50]))
    rate = random.uniform(0.1, 1.0) / step  # rad from row to row
    wrong = rate * (1 + random.choice([-1, 1]) * 10 ** random.uniform(-5, -3))
    scene = rigidsim.parse(SPIN.replace("-0.03", repr(rate)))
    for names in (("wx", "wy", "wz"), ()):
        tables = [spinning(x, step) for x in (wrong, rate)]
        kept = [{k: v for k, v in one.items() if k[0] != "w" or k in names} for one in tables]
        assert rigidsim.compare(scene, kept[0]).verdict != "agrees"
        assert rigidsim.compare(scene, kept[1]).verdict == "agrees"


@pytest.mark.parametrize(("delay", "verdict"), [(0.0, "agrees"), (1.4e-3, "undecided")])
def test_even_times_of_two_decimals_explain_what_they_may(delay: float, verdict: str) -> None:
    """Their rounding goes slowly along the file; a delay that does, too, isn't one of half a digit."""
    rows = np.arange(321)
    half = -0.03 * (3.01002 * rows + delay * np.sin(2 * np.pi * rows / 125)) / 2
    q = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    found = rigidsim.compare(rigidsim.parse(SPIN), {"t": np.round(3.01002 * rows, 2), "q": q})
    assert found.verdict == verdict
    assert ("its times, which are rounded" in found.why) == (verdict == "agrees")


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_another_body_is_no_integration_error_in_rows_far_apart(seed: int) -> None:
    """A free symmetric body in closed form: L / A turns it about L, and it turns about its axis beside."""
    random = np.random.default_rng(seed)
    across, spin = random.uniform(8, 12), random.uniform(0.1, 0.5)
    along = across * random.uniform(1.2, 1.9)
    true = along * (1 + random.choice([-1, 1]) * 10 ** random.uniform(-3, -2))
    start = np.array([random.uniform(0.02, 0.3) * spin, 0.0, spin])
    times = np.arange(40) * random.uniform(np.pi / 3, 0.9 * np.pi) / spin
    turning, proper = start * [1, 1, true / across], spin * (1 - true / across)
    steady = Rotation.from_rotvec([[0, 0, proper * t] for t in times])
    attitude = Rotation.from_rotvec(times[:, None] * turning) * steady
    rates = steady.inv().apply(turning) + np.array([0, 0, proper])
    scene = SPIN.replace("[10, 14, 19]", repr([across, across, along]))
    scene = scene.replace("[0, 0, -0.03]", repr(start.tolist())).replace("1400", repr(float(times[-1])))
    experiment = rigidsim.parse(scene)
    found = rigidsim.compare(experiment, {"t": times, "q": attitude.as_quat(), "w": rates})
    assert found.attitude_error.largest > 1e-6
    assert found.verdict in ("wrong_model", "undecided")
