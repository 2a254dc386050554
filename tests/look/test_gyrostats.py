"""Bodies with rotors: equilibria on the momentum's sphere."""

import numpy as np
import pytest

from rigidsim.look.gyrostats import Gyrostat


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
