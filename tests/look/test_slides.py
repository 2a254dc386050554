"""Figures for slides, and the plate's wobble in space."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")


from rigidsim.look import figures

Build = Callable[..., xarray.Dataset]


def test_a_thin_plate_wobbles_twice_a_turn(symmetric_top: Build) -> None:
    """I = (1, 1, 2): the axis turns by L t / A about L, the body by L cos(theta) / C about the axis."""
    dataset = symmetric_top()
    assert "wobble" in figures.available(dataset)
    (axes,) = figures.figure(dataset, "wobble").axes
    wobble, spin = (line.get_ydata()[-1] for line in axes.get_lines())
    momentum = dataset["angular_momentum"].values[0]
    cosine = np.cos(0.5)
    assert wobble == pytest.approx(
        np.linalg.norm(momentum) * float(dataset["time"][-1]) / (2 * np.pi), rel=1e-6
    )
    assert wobble / spin == pytest.approx(2 / cosine, rel=1e-9)
