"""Two principal moments are equal if they differ by the rounding of the numbers that were given."""

from pathlib import Path

import mpmath
import numpy as np
import pytest
from support import config

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.scene import Scene, build_scene

FAULTS = Path(__file__).parents[1] / "data" / "faults"


def scene(body: str, more: str = "", precision: str = '"double"') -> Scene:
    integrator = f"precision = {precision}"
    text = config(body, "angular_velocity = [0.3, 0.2, 1]", (), "end = 1", integrator, more=more)
    return build_scene(rigidsim.parse(text))


def turned(moments: list[float], random: np.random.Generator) -> tuple[str, np.ndarray]:
    """A tensor in axes turned at random as a program in double precision prints it, and its axes as rows."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    tensor = axes.T @ np.diag(moments) @ axes
    rows = [[float(tensor[min(i, j), max(i, j)]) for j in range(3)] for i in range(3)]
    return f"inertia_tensor = {rows!r}", axes


def sine_between(a: list[object], b: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross([float(str(x)) for x in a], b)))


def test_the_axis_of_the_fault_is_refused_and_by_default_that_of_symmetry() -> None:
    text = (FAULTS / "figure_axis_noise.toml").read_text()
    with pytest.raises(ConfigError, match="the two largest principal moments are equal"):
        build_scene(rigidsim.parse(text))
    by_default = build_scene(rigidsim.parse(text.replace('figure_axis = "largest"', "")))
    assert by_default.figure.described == "axis of symmetry"


def test_turned_symmetric_bodies_are_symmetric() -> None:
    random = np.random.default_rng(25)
    for _ in range(20):
        pair, single = random.uniform(0.6, 1.0, 2)
        size = 10 ** random.uniform(-6, 38)
        body, axes = turned([pair * size, pair * size, single * size], random)
        found = scene(body)
        assert found.figure.described == "axis of symmetry", body
        # rounding of the elements over the difference of the moments turns an axis
        allowed = 16 * 2.0**-52 * max(pair, single) / abs(pair - single)
        assert sine_between(found.figure.pole, axes[2]) <= allowed
        if pair > single:
            with pytest.raises(ConfigError, match="two largest principal moments are equal"):
                scene(body, '[frame]\nfigure_axis = "largest"')
        else:
            largest = scene(body, '[frame]\nfigure_axis = "largest"')
            assert sine_between(largest.figure.pole, axes[2]) <= allowed
        small, middle, large = sorted(found.body.principal_moments)
        assert small == middle or middle == large
        # the tensor is the one of these moments, and the one given up to its rounding
        assert mpmath.mpf(sum(found.body.inertia[i][i] for i in range(3))) == pytest.approx(
            (2 * pair + single) * size, rel=1e-14
        )


@pytest.mark.parametrize(
    ("difference", "digits", "precision"),
    [
    (1e-12, 17, '"double"'),
    (1e-28, 34, '"quadruple"'),
],
)  # fmt: skip
def test_nearly_symmetric_bodies_have_three_moments(difference: float, digits: int, precision: str) -> None:
    """As long as the digits tell them: here in 60 digits, written with as many as said."""
    random = np.random.default_rng(27)
    with mpmath.workdps(60):
        for _ in range(20):
            raw = mpmath.matrix(random.normal(size=(3, 3)).tolist())
            axes = mpmath.qr(raw)[0].T
            moments = mpmath.diag([1, 1 + mpmath.mpf(difference), mpmath.mpf(3) / 2])
            tensor = axes.T * moments * axes
            texts = [[mpmath.nstr(tensor[min(i, j), max(i, j)], digits) for j in range(3)] for i in range(3)]
            rows = ", ".join("[" + ", ".join(f'"{x}"' for x in row) + "]" for row in texts)
            found = scene(f"inertia_tensor = [{rows}]", precision=precision)
            assert found.figure.described == "axis of largest moment"
            small, middle, _ = sorted(found.body.principal_moments)
            assert float((middle - small) / difference) == pytest.approx(
                1, abs=16 * 10.0 ** (1 - digits) / difference + 1e-12
            )
