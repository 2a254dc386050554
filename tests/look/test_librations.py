"""Physical librations in figures: found again from attitudes that were made with known ones."""

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

from rigidsim.look.figures.catalogue import available, figure
from rigidsim.look.sources import librations

YEAR = 3.15576e7
MONTH = 2 * np.pi / (27.3217 * 86400)
NODE = -2 * np.pi / (18.6 * YEAR)
SLOW = 2 * np.pi / (2.9 * YEAR)
ARCSEC = np.pi / 648000


def made(span: float, every: float, turned: Rotation | None = None) -> tuple[xarray.Dataset, np.ndarray]:
    """A Moon with librations of some hundred arcseconds in an inclined frame; tau, rho and I sigma."""
    t = np.arange(0, span, every)
    tau = 100 * ARCSEC * np.cos(SLOW * t)
    rho = 80 * ARCSEC * np.cos((MONTH - NODE) * t)
    sigma = 90 * ARCSEC * np.sin((MONTH - NODE) * t)
    inclination = np.deg2rad(1.54)
    phi = NODE * t + sigma / np.sin(inclination)
    psi = MONTH * t - phi + tau + 0.3
    tilt = Rotation.from_euler("X", 23.4, degrees=True)
    attitude = tilt * Rotation.from_euler("ZXZ", np.stack([phi, inclination + rho, psi], axis=1))
    source = np.stack([np.cos(MONTH * t + 0.3), np.sin(MONTH * t + 0.3), 0 * t], axis=1)
    nadir = attitude.inv().apply(tilt.apply(source))
    # the rates that carry each attitude to the next
    steps = (attitude[:-1].inv() * attitude[1:]).as_rotvec()
    turns = MONTH * every - np.linalg.norm(steps, axis=1) > np.pi
    assert not turns.any()
    rates = np.vstack([steps, steps[-1:]]) / every
    body = Rotation.identity() if turned is None else turned
    axes = body.as_matrix().T  # principal axes as rows, in body axes
    data = xarray.Dataset(
        {
            "quaternion": (
                ("time", "quaternion_component"),
                np.roll((attitude * body.inv()).as_quat(), 1, axis=1),
            ),
            "angular_velocity": (("time", "body_axis"), body.apply(rates)),
            "nadir": (("time", "body_axis"), body.apply(nadir)),
        },
        coords={"time": t},
        attrs={"principal_moments": [0.99937, 0.9996, 1.0], "principal_axes": axes.tolist()},
    )
    return data, np.stack([tau, rho, sigma])


@pytest.mark.parametrize("days", [5])
@pytest.mark.slow
@pytest.mark.unoptimised
def test_known_librations_are_found(days: int) -> None:
    """In other body axes than the principal ones for samples that are farther apart."""
    other = Rotation.from_euler("XYZ", [0.3, -0.4, 0.5]) if days > 1 else None
    data, (tau, rho, sigma) = made(3 * 18.6 * YEAR, days * 86400.0, other)
    found = librations(data)
    assert found is not None
    longitude, latitude = found
    assert latitude is not None
    # lines through swings that are cut off at the ends, and a normal fitted to the path
    for mine, given in ((longitude, tau), (latitude[:, 0], rho), (latitude[:, 1], sigma)):
        assert np.abs(mine - given).max() < 2 * ARCSEC
    assert "libration" in available(data)
    titles = [axes.get_title(loc="left") for axes in figure(data, "libration").axes]
    assert sum("Physical" in title for title in titles) == 2
