"""Kinds of sweeps whose announced errors are judged: bodies free and driven, satellites, spins, flights,
gyrostats, and laws with states of their own.
"""

from dataclasses import dataclass

from rigidsim.scene.config import parse
from rigidsim.scene.sweep import Sweep

_HEAD = """
name = "{kind}"
time = {{end = {end}, samples = 2}}
[output]
record = [{record}]
timeline = false
[sweep]
mode = "zip"
seed = {seed}
keep = ["final"]
tile = 64
"""
_FREE = """
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.1, 1, 0.05]
"""
_ORBIT = """
body.principal_moments = [1, 1.5, 1.8]
initial = {{angular_velocity = [0.1, 0.2, 1.1], euler_angles = [0.3, 0.1, 0]}}
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = 0.1, inclination = 0.2, mean_anomaly = 0.4}}
{more}
"""
_PLANAR = """
body.principal_moments = [34021, 49096, 57125]
initial = {{euler_angles = [0, 0, 0], angular_velocity = [0, 0, 1]}}
integrator = {{formulation = "planar", tolerance = {tolerance}}}
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = 0.1}}
"""
_TOP = """
body = {{principal_moments = [1, {second}, 0.5], mass = 1, center_of_mass = [0, 0, 0.3]}}
initial = {{angular_velocity = [0.1, 0.2, 5], euler_angles = [0, 0.5, 0]}}
[[loads]]
kind = "uniform_gravity"
acceleration = [0, 0, -9.8]
"""
_DRIVEN = """
parameters = {{k = 0.1, n = 1}}
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.1, 0.2, 1]
[[loads]]
kind = "torque"
components = ["k*sin(n*t)", "k*cos(n*t)^2/3", "-k*wz/9"]
frame = "body"
"""
_GYROSTAT = """
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.1, 0.2, 1]
rotors = [
  {{name = "free", axis = [0, 0.6, 0.8], moment = 0.1, rate = 5}},
  {{name = "driven", axis = [1, 0, 0], moment = 0.05, rate = -8, torque = "0.02*sin(0.7*t)"}},
]
"""
_LAWS = """
parameters.k = 0.5
body.principal_moments = [1, 2, 2.5]
initial.angular_velocity = [0.1, 0.2, 0.3]
states = [
{{name = "slow", unit = "rad/s", derivative = "(wz - slow)/(3 s)"}},
{{name = "slosh", unit = "rad", derivative = "rolling"}},
{{name = "rolling", unit = "rad/s", derivative = "-(4 s^-2)*slosh - (0.02 s^-1)*rolling + 0.3*(1 s^-1)*wy"}},
]
[[loads]]
kind = "torque"
components = ["-k*qw*qx", "-k*qw*qy - (0.1 N m)*slosh", "-k*qw*qz - (0.05 N m s)*slow"]
frame = "body"
"""
_FLIGHT = """
body = {{principal_moments = [1, 1.6, 2], mass = 1}}
initial = {{angular_velocity = [0.01, 0.02, 0.03], position = [30, 0, 0], velocity = [0, 0.05, 0]}}
[[loads]]
kind = "central_gravity"
gravitational_parameter = 1
"""


@dataclass(frozen=True)
class Kind:
    """Sweeps of one kind.

    Attributes:
        text: of the config, with places for what it is given.
        axes: dotted keys and what they take, but for the count.
        given: for the places.
    """

    text: str
    axes: dict[str, str]
    given: dict[str, str]
    recorded: tuple[str, ...] = ("quaternion",)

    def sweep(self, kind: str, members: int, seed: int) -> Sweep:
        """The sweep of so many random members."""
        record = ", ".join(f'"{name}"' for name in self.recorded)
        lines = [
            f'axes."{key}" = {{{spec}, count = {members}, name = "axis_{n}"}}'
            for n, (key, spec) in enumerate(self.axes.items())
        ]
        head, output = _HEAD.format(kind=kind, record=record, seed=seed, **self.given).split("[output]")
        return Sweep.of(parse(head + self.text.format(**self.given) + "[output]" + output + "\n".join(lines)))


_RATES = {"initial.angular_velocity": "uniform = [[-1, -1, -1], [1, 1, 1]]"}
_MOMENT = {"body.principal_moments[1]": "uniform = [1.55, 2.45]"}
_SATELLITES = {
    "initial.angular_velocity": "uniform = [[-1, -1, 0.2], [1, 1, 2]]",
    "loads[0].orbit.eccentricity": "uniform = [0, 0.6]",
    "body.principal_moments[1]": "uniform = [1.05, 1.75]",
}
_TOPS = {"initial.angular_velocity[2]": "uniform = [1, 9]", "initial.euler_angles[1]": "uniform = [0.1, 2.5]"}
_SPINS = {"initial.euler_angles[2]": "uniform = [0, 3]", "initial.angular_velocity[2]": "uniform = [0, 3]"}
_ROTORS = {"rotors[0].rate": "uniform = [-20, 20]", "rotors[1].rate": "uniform = [-20, 20]"}
_STARTS = {
    "states[0].initial": "uniform = [-1, 1]",
    "states[1].initial": "uniform = [-1, 1]",
    "parameters.k": "uniform = [0.1, 2]",
}
KINDS = {
    "free": Kind(_FREE, _RATES | _MOMENT, {"end": "1000"}),
    "free, short": Kind(_FREE, _RATES | _MOMENT, {"end": "5"}),
    "free, middle axis": Kind(
        _FREE, {"initial.angular_velocity": "normal = [[0, 1, 0], [1e-4, 0, 1e-4]]"} | _MOMENT, {"end": "100"}
    ),
    "satellites": Kind(_ORBIT, _SATELLITES, {"end": "60", "more": ""}),
    "satellites, long": Kind(_ORBIT, _SATELLITES, {"end": "600", "more": ""}),
    "satellites, 1e-9": Kind(_ORBIT, _SATELLITES, {"end": "60", "more": "[integrator]\ntolerance = 1e-9"}),
    "planar": Kind(_PLANAR, _SPINS, {"end": "100", "tolerance": '"auto"'}),
    "planar, long": Kind(_PLANAR, _SPINS, {"end": "628", "tolerance": '"auto"'}),
    "planar, 1e-9": Kind(_PLANAR, _SPINS, {"end": "100", "tolerance": "1e-9"}),
    "tops": Kind(_TOP, _TOPS, {"end": "60", "second": "1"}),
    "tops, asymmetric": Kind(_TOP, _TOPS, {"end": "20", "second": "1.2"}),
    "driven": Kind(_DRIVEN, _RATES | {"parameters.n": "uniform = [0.1, 2]"}, {"end": "200"}),
    "gyrostats": Kind(_GYROSTAT, _RATES | _ROTORS, {"end": "200"}),
    "laws": Kind(_LAWS, _RATES | _STARTS, {"end": "200"}),
    "flights": Kind(
        _FLIGHT,
        {
            "initial.velocity": "uniform = [[-0.02, 0.1, -0.05], [0.02, 0.17, 0.05]]",
            "initial.angular_velocity": "uniform = [[-0.05, -0.05, -0.05], [0.05, 0.05, 0.05]]",
        },
        {"end": "3000"},
        ("quaternion", "position"),
    ),
}  # fmt: skip
