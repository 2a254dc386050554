"""The scenes of the comparison; every number is a dyadic fraction, so that all peers start alike."""

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Scene:
    """A rotating body about a fixed point, principal axes.

    Attributes:
        moments: about the fixed point, kg m^2.
        rates: initial angular velocity, body axes, rad/s.
        quaternion: initial, body to space.
        weight: m g l of the centre of mass at l on body axis z, gravity along -Z, N m; 0 for none.
        lever: l, m; the mass is 1 kg.
        orbit_rate: n of a circular orbit in the plane XY that starts on X, rad/s; 0 for no gravity gradient.
        ends: short and long horizon, s.
    """

    name: str
    title: str
    moments: tuple[float, float, float]
    rates: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    ends: tuple[float, float]
    weight: float = 0.0
    lever: float = 0.5
    orbit_rate: float = 0.0

    @property
    def rate(self) -> float:
        """abs(w) at the start, rad/s."""
        return math.hypot(*self.rates)

    @property
    def start(self) -> list[float]:
        """The seven initial values: rates, quaternion."""
        return [*self.rates, *self.quaternion]

    def from_orbital(self, quaternion: Sequence[float], end: float) -> list[float]:
        """From the frame that turns with the orbit to space: the product with a rotation of n t about Z."""
        w, x, y, z = quaternion
        c, s = math.cos(self.orbit_rate * end / 2), math.sin(self.orbit_rate * end / 2)
        return [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]

    def config(self, end: float) -> str:
        """The same scene for rigidsim, sampled at its start and end alone."""
        lines = [
            f'name = "{self.name}"',
            "[body]",
            f"principal_moments = {list(self.moments)}",
            *(["mass = 1", f"center_of_mass = [0, 0, {self.lever}]"] if self.weight else []),
            "[initial]",
            f"angular_velocity = {list(self.rates)}",
            f"quaternion = {list(self.quaternion)}",
        ]
        if self.weight:
            gravity = self.weight / self.lever
            lines += ["[[loads]]", 'kind = "uniform_gravity"', f"acceleration = [0, 0, {-gravity}]"]
        if self.orbit_rate:
            lines += ["[[loads]]", 'kind = "gravity_gradient"']
            lines += [f"gravitational_parameter = {self.orbit_rate**2}", "orbit = {semi_major_axis = 1}"]
        lines += ["[time]", f"end = {end}", "samples = 2", "[output]", "timeline = false"]
        return "\n".join([*lines, 'record = ["quaternion"]', ""])


SCENES = {
    scene.name: scene
    for scene in (
        Scene(
            "free_top",
            "free asymmetric top",
            moments=(1.0, 2.0, 3.0),
            rates=(0.5, 0.25, 1.0),
            quaternion=(0.5, 0.5, 0.5, 0.5),
            ends=(128.0, 8192.0),
        ),
        Scene(
            "heavy_top",
            "heavy symmetric top",
            moments=(1.0, 1.0, 0.5),
            rates=(0.25, 0.5, 2.0),
            quaternion=(0.5, 0.5, 0.5, 0.5),  # the axis starts level
            ends=(64.0, 4096.0),
            weight=1.0,
        ),
        Scene(
            "satellite",
            "tumbling satellite, gravity gradient",
            moments=(1.0, 2.0, 2.5),
            rates=(0.25, 0.125, 1.0),
            quaternion=(0.5, 0.5, 0.5, 0.5),
            ends=(128.0, 8192.0),
            orbit_rate=0.0625,
        ),
    )
}
