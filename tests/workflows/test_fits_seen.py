"""A fit's folder in the viewer: the fitted motion with the uncertainty that its covariance tells."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun")

from support import config

import rigidsim
from rigidsim.look.stages.registry import build_picture
from rigidsim.workflows.view import runs_of

SPIN, SIGMA = 0.7, 0.01  # rad/s, rad
TIMES = np.linspace(0.5, 9.5, 19)
BALL = config(
    "principal_moments = [2, 2, 2]",
    "angular_velocity = [0, 0, 0.69]",
    time="end = 10",
    output='record = ["angular_velocity"]',
    more='[frame]\nfigure_axis = "x"\n'
    '[fit]\nparameters = ["initial.attitude[2]", "initial.angular_velocity[2]"]\n'
    '[[fit.data]]\nfile = "turn.csv"\nobservable = "euler_angles"\ncolumns = ["a", "b", "c"]\n'
    'unit = "deg"\nsigma = "0.01 rad"',
    name="ball",
    estimate=True,
)


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a fit of a uniform spin about z, whose x axis is the figure axis."""
    folder = tmp_path_factory.mktemp("seen")
    phases = SPIN * TIMES + SIGMA * np.random.default_rng(5).standard_normal(len(TIMES))
    rows = [f"{t},{np.rad2deg(phase) % 360},0,0" for t, phase in zip(TIMES, phases, strict=True)]
    (folder / "turn.csv").write_text("\n".join(["time,a,b,c", *rows]))
    (folder / "ball.toml").write_text(BALL)
    rigidsim.fit(folder / "ball.toml", out=folder / "fits")
    return folder / "fits" / "ball"


@pytest.mark.slow
def test_the_cone_of_a_uniform_spin_is_as_wide_as_the_covariance_of_a_straight_line(fits: Path) -> None:
    ((name, run),) = runs_of([fits])
    assert name == "ball"
    dataset = run.dataset
    picture, _ = build_picture(dataset)
    # phase = offset + rate t by least squares; across z it moves the x axis, along z nothing does
    line = np.stack([np.ones(len(TIMES)), TIMES], axis=1)
    covariance = SIGMA**2 * np.linalg.inv(line.T @ line)
    now = np.stack([np.ones(dataset.sizes["time"]), dataset["time"].values], axis=1)
    expected = np.sqrt(np.einsum("ti,ij,tj->t", now, covariance, now))
    (plot,) = picture.plots
    assert plot.unit == "deg"
    angles = np.radians(plot.values)
    np.testing.assert_allclose(angles[:, 0], expected, rtol=1e-5)
    np.testing.assert_allclose(angles[:, 1], 0.0, atol=1e-8)
    assert "attitude_error" not in dataset.attrs  # the integration's own, which isn't what is meant here
    assert "converged" in dataset.attrs["fit"]
