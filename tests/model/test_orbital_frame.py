"""On a circular orbit the attitude is carried in the frame that turns with it, and recorded in space."""

import numpy as np
from equations import derivative, prepared
from hypothesis import given, settings
from hypothesis import strategies as st
from support import law, tried

from rigidsim.accuracy.comparison import angles_between
from rigidsim.model.system import System

BODY = "principal_moments = [1, 1.75, 2]"
TEXT = """name = "orbit"
[body]
principal_moments = [1, 1.75, 2]
[initial]
angular_velocity = {rates}
quaternion = {quaternion}
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {strength}
orbit = {{semi_major_axis = 1, {orbit}}}
{more}
[time]
start = {start}
end = {end}
samples = 33
[integrator]
formulation = "{formulation}"
precision = "{precision}"
[output]
timeline = false
"""
ANGLE = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))


def orbit_load(elements: str = "") -> str:
    orbit = f"{{semi_major_axis = 1{', ' if elements else ''}{elements}}}"
    return f'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {orbit}'


def initial(system: System) -> np.ndarray:
    """In SI, float64."""
    return np.ldexp([float(x) for x in system.initial], system.state_exponents)


@settings(max_examples=2, deadline=None)
@given(
    rates=st.lists(ANGLE, min_size=3, max_size=3),
    quaternion=st.lists(ANGLE, min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1),
    node=ANGLE,
    inclination=ANGLE.map(abs),
    anomaly=ANGLE,
    start=st.sampled_from([0, -7.5, 1000]),
)
def test_the_attitude_in_space_is_that_of_nine_direction_cosines(
    rates: list[float], quaternion: list[float], node: float, inclination: float, anomaly: float, start: float
) -> None:
    """Two sets of equations with nothing in common but the body, in 128-bit arithmetic."""
    orbit = f"ascending_node = {node}, inclination = {inclination}, mean_anomaly = {anomaly}"
    text = TEXT.format(
        rates=rates, quaternion=quaternion, orbit=orbit, strength=1.1, more="", start=start,
        end=start + 4, formulation="auto", precision="quadruple",
    )  # fmt: skip
    frame, cosines = (tried(text, "quadruple", f) for f in ("quaternion", "rotation_matrix"))
    assert len(frame.attitudes[0]) == len(cosines.attitudes[0]) == 33
    # unstable starts amplify by at most e^(2 n t): the largest rate of a tumbling body here is below 2 n
    rate = float(np.linalg.norm(rates)) + 2
    allowed = 10 * law(2.0**-112, cosines.steps, rate, 4) * np.exp(8)
    assert angles_between(frame.attitudes, cosines.attitudes).max() <= allowed


def test_at_rest_in_the_orbital_frame_it_stays_bit_for_bit() -> None:
    """Principal axes along those of the frame and w = n e_z: every derivative but the orbit's is zero."""
    start = "angular_velocity = [0, 0, 1]\nquaternion = [1, 0, 0, 0]"
    system = prepared(BODY, start, orbit_load(), integrator='formulation = "quaternion"').system
    moving = derivative(system, initial(system), 0.0)
    carried = dict(zip(system.states, moving, strict=True))
    assert [carried[name] for name in ("wx", "wy", "wz", "pw", "px", "py", "pz")] == [0.0] * 7
    assert carried["sin_half_anomaly1"] == 0.5
