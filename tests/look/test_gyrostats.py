"""Bodies with rotors: equilibria and separatrices on the momentum's sphere, figures, wheels that turn."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")
pytest.importorskip("rerun")

from support import config

import rigidsim
from rigidsim.look.gyrostats import Gyrostat
from rigidsim.look.pages import leading
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.timeline import write_timeline

Read = Callable[[Path, str], dict[str, np.ndarray]]

TWO_ROTORS = config(
    initial="angular_velocity = [0.3, 1, -0.2]",
    time="end = 20\nsamples = 401",
    more='[[rotors]]\nname = "free"\naxis = [1, 0, 1]\nmoment = 0.1\nrate = 300\n'
    '[[rotors]]\nname = "kept"\naxis = [0, 1, 0]\nmoment = 0.2\nrate = 2\nfixed = true',
)
DRIVEN = config(
    "principal_moments = [50, 90, 110]",
    "angular_velocity = [0.001, 0, 0.6]",
    time="end = 120\nsamples = 481",
    more='[[rotors]]\nname = "wheel"\naxis = [1, 0, 0]\nmoment = 0.1\ntorque = "0.5*step(60 - t)"\n'
    '[[states]]\nname = "heat"\nunit = "J"\nderivative = "0.5*rate_wheel*step(60 - t)"',
)


@pytest.fixture(scope="module")
def two() -> xarray.Dataset:
    return rigidsim.run(rigidsim.parse(TWO_ROTORS), out=None).dataset.load()


@pytest.fixture(scope="module")
def driven() -> xarray.Dataset:
    return rigidsim.run(rigidsim.parse(DRIVEN), out=None).dataset.load()


def linearised(gyrostat: Gyrostat, direction: np.ndarray) -> np.ndarray:
    """Eigenvalues of K w' = (K w + h) x w about a spin that stays, w' = 0."""
    tensor, inner = gyrostat.tensor, gyrostat.inner
    rate = np.linalg.solve(tensor, gyrostat.size * direction - inner)

    def cross(v: np.ndarray) -> np.ndarray:
        return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    matrix = np.linalg.solve(tensor, cross(tensor @ rate + inner) - cross(rate) @ tensor)
    return np.linalg.eigvals(matrix)


def random_gyrostat(generator: np.random.Generator) -> Gyrostat:
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    tensor = turn @ np.diag(generator.uniform(1, 2, 3)) @ turn.T
    inner = generator.normal(size=3) * 10 ** generator.uniform(-2, 0.5)
    if generator.random() < 0.3:  # along a principal axis
        inner = turn[:, generator.integers(3)] * generator.normal() * 0.5
    return Gyrostat(tensor, inner, 1.3)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_equilibria_are_all_there_are_with_the_exponents_of_the_linearised_equations() -> None:
    generator, counts = np.random.default_rng(28), set()
    for _ in range(24):
        gyrostat = random_gyrostat(generator)
        found = gyrostat.equilibria
        counts.add(len(found))
        # index of a field on the sphere (Poincaré, Hopf): two more extrema than saddles
        assert sum(-1 if one.unstable else 1 for one in found) == 2
        for one in found:
            rate = gyrostat.rates(one.direction)
            assert np.linalg.norm(np.cross(one.direction, rate)) < 1e-8
            squares = linearised(gyrostat, one.direction) ** 2
            largest = squares[np.abs(squares).argmax()]
            assert one.square == pytest.approx(largest.real, rel=1e-5, abs=1e-9)
    assert counts == {2, 4, 6}


@pytest.mark.slow
@pytest.mark.unoptimised
def test_rotors_are_in_the_recording_and_turn_by_their_rates(
    two: xarray.Dataset, driven: xarray.Dataset, read_back: Read, tmp_path: Path
) -> None:
    write_timeline(driven, tmp_path / "driven.rrd")
    turned = read_back(tmp_path / "driven.rrd", "/scene/body/rotor_wheel")["Transform3D:quaternion"]
    # spun up by 0.5 N m for a minute, to some 300 rad/s: 12 turns a sample, drawn 200 times slower
    picture = build_picture(driven)[0]
    (axle,) = [part for part in picture.stages[0].parts if part.path.endswith("axle")]
    assert axle.words == "rotor wheel, drawn turning 200 times slower"
    assert "rotor_rates" in leading(driven)[0]
    time = driven["time"].values
    own = 0.5 / 0.1 * np.where(time < 60, time**2 / 2, 1800 + 60 * (time - 60))
    body = np.append(
        0,
        np.cumsum(np.diff(time) * (lambda w: (w[1:] + w[:-1]) / 2)(driven["angular_velocity"].values[:, 0])),
    )
    start = 0.001 * time  # at rest relative to a body that turns
    half = (own + start - body) / 200 / 2
    np.testing.assert_allclose(turned[:, 3], np.cos(half), atol=2e-4)
    np.testing.assert_allclose(turned[:, 0], np.sin(half), atol=2e-4)

    write_timeline(two, tmp_path / "two.rrd")
    slow = read_back(tmp_path / "two.rrd", "/scene/body/rotor_kept")["Transform3D:quaternion"]
    np.testing.assert_allclose(slow[:, 1], np.sin(two["time"].values), atol=1e-6)  # 2 rad/s, as it is
    shares = [
        read_back(tmp_path / "two.rrd", f"/scene/{name}")["Arrows3D:vectors"]
        for name in ("body/body_momentum", "body/rotor_momentum", "centre/angular_momentum")
    ]
    matrix = rotation_matrix(two["quaternion"].values)
    np.testing.assert_allclose(np.einsum("tij,tj->ti", matrix, shares[0] + shares[1]), shares[2], atol=2e-6)
