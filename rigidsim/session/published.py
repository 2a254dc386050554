"""The published orientation and a run's attitude, sample by sample, and the rotation between the two.

Each row depends on its own time and attitude alone, so that no resumption can be seen in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.scene.frame import Figure
from rigidsim.scene.kernels.reading import KernelError
from rigidsim.scene.kernels.spice import Orientation
from rigidsim.scene.rotations import product, quaternion_of, rotation_matrix
from rigidsim.store.variables import Variable

QUATERNION = "quaternion"
_TURN = 2 * np.pi
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_SMALL = 1e-300

Columns = dict[str, list[np.ndarray]]


@dataclass(frozen=True)
class PublishedAttitude:
    """A published orientation; its axes x, y, z are the figure's first axis, its second, and its pole."""

    orientation: Orientation
    figure: Figure

    @property
    def variables(self) -> list[Variable]:
        """What is recorded of it."""
        kernel = {"kernel": self.orientation.name, "published": self.orientation.described}
        figure = f"its x and z as the first axis and the pole of the figure ({self.figure.described})"

        def named(name: str, dims: tuple[str, ...], units: str, long_name: str, **more: Any) -> Variable:
            return Variable(name, dims, {"units": units, "long_name": long_name, **more, **kernel})

        turns = "in the turn nearest to the run's own where that is recorded, otherwise within one turn"
        return [
            named("published_quaternion", ("quaternion_component",), "1", "published attitude",
                  frame="body to space axes", convention=figure),
            named("published_right_ascension", (), "rad", "right ascension of the published pole",
                  convention=f"of the equator of J2000; {turns}"),
            named("published_declination", (), "rad", "declination of the published pole",
                  convention="of the equator of J2000"),
            named("published_prime_meridian", (), "rad", "published prime meridian, the IAU's W",
                  convention=f"from the equator's node on the equator of J2000; {turns}"),
            named("published_rotation", ("body_axis",), "rad", "rotation from the published attitude",
                  frame="body axes", convention="rotation vector from the published axes to the body's"),
            named("published_angle", (), "rad", "angle of the rotation from the published attitude"),
            named("published_pole_angle", (), "rad", "angle between the figure axis and the published pole"),
        ]  # fmt: skip

    def of_samples(self, rows: Mapping[str, Sequence[np.ndarray]]) -> Columns:
        """Its columns next to the recorded ones: parts of time, quaternion, and angles of the pole."""
        orientation, attitude = self.orientation, rows[QUATERNION][0].astype(np.float64)
        dates = orientation.dates([np.ravel(part) for part in rows["time"]])
        try:
            equatorial = orientation.matrices(dates)
        except KernelError as error:
            raise RunFolderError(f"{orientation.place}: {error}; restore it, then resume the run") from None
        named = self.figure.first, self.figure.second, self.figure.pole
        axes = np.array([[float(x) for x in axis] for axis in named])  # a row each, in body axes
        matrices = orientation.equator @ equatorial
        published = quaternion_of(matrices @ axes)
        published *= np.where((published * attitude).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        (px, py, pz), (fx, fy, fz) = equatorial[:, :, 2].T, equatorial[:, :, 0].T
        ascension, meridian = np.arctan2(py, px), np.arctan2(fz, px * fy - py * fx)
        turned = np.stack(product([*(published * _CONJUGATE).T], [*attitude.T]), axis=1)
        turned *= np.where(turned[:, 0] < 0, -1.0, 1.0)[:, None]
        size = np.linalg.norm(turned[:, 1:], axis=1)
        angle = 2 * np.arctan2(size, turned[:, 0])
        pole = np.einsum("ijn,j->ni", np.array(rotation_matrix([*attitude.T])), axes[2])
        along, across = (pole * matrices[:, :, 2]).sum(axis=1), np.cross(pole, matrices[:, :, 2])
        return {
            "published_quaternion": [published],
            "published_right_ascension": [_near(ascension, rows.get("right_ascension"))],
            "published_declination": [np.arctan2(pz, np.hypot(px, py))],
            "published_prime_meridian": [_near(meridian, rows.get("prime_meridian"))],
            "published_rotation": [turned[:, 1:] * (angle / np.maximum(size, _SMALL))[:, None]],
            "published_angle": [angle],
            "published_pole_angle": [np.arctan2(np.linalg.norm(across, axis=1), along)],
        }


def _near(angles: np.ndarray, own: Sequence[np.ndarray] | None) -> np.ndarray:
    """Angles in the turn that is nearest to the run's own; between 0 and a turn where that isn't known."""
    if own is None:
        return np.mod(angles, _TURN)
    first = own[0].astype(np.float64).reshape(len(angles), -1)[:, 0]
    turns = np.round((first - angles) / _TURN)
    return np.where(np.isfinite(turns), angles + _TURN * turns, np.mod(angles, _TURN))
