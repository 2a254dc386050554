"""Bodies with a fluid core as figures and timelines show them."""

import numpy as np
import pytest
from support import config, run_text

import rigidsim
from rigidsim.look.figures.catalogue import available, figure

CORE = (
    'core = {moment = 0.3, flattening = 0.02, friction = "0.01 s^-1", angular_velocity = [0.1, -0.05, 0.9]}'
)


@pytest.fixture(scope="module")
def run() -> rigidsim.Run:
    return run_text(config(f"principal_moments = [1, 1.2, 1.5]\n{CORE}", time="end = 30\nsamples = 301"))


@pytest.mark.slow
def test_its_axis_and_rate_are_drawn_and_nothing_that_holds_for_rigid_bodies(run: rigidsim.Run) -> None:
    names = available(run.dataset)
    assert "core" in names
    assert "momentum_sphere" not in names
    titles = {axes.get_title(loc="left") or axes.get_title() for axes in figure(run.dataset, "core").axes}
    assert any("Axis of the core" in title for title in titles)
    curves = [line for axes in figure(run.dataset, "core").axes for line in axes.get_lines()]
    core, mantle = (run.dataset[name].values for name in ("core_angular_velocity", "angular_velocity"))
    cosine = (core * mantle).sum(axis=1) / np.linalg.norm(core, axis=1) / np.linalg.norm(mantle, axis=1)
    np.testing.assert_allclose(curves[0].get_ydata(), np.degrees(np.arccos(cosine)), rtol=1e-6)
