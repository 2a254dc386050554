"""What stands on a stage is where the dataset says."""

from collections.abc import Callable

import numpy as np
import xarray

from rigidsim.look.stages.registry import build_picture

Build = Callable[..., xarray.Dataset]


def test_the_ellipsoid_of_energy_touches_the_invariable_plane_at_the_tip(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    rolling = build_picture(dataset)[0].stages[1]
    drawn = {part.path: part.values for part in rolling.parts}
    polhode, herpolhode = drawn["body/polhode/recent"], drawn["herpolhode/recent"]
    half_sizes = drawn["body/around/energy_ellipsoid"].max(axis=0)
    np.testing.assert_allclose(((polhode / half_sizes) ** 2).sum(axis=1), 1, rtol=1e-9)
    heights = herpolhode[:, 2]  # L is along Z
    np.testing.assert_allclose(heights, heights[0], rtol=1e-9)
    np.testing.assert_allclose(drawn["around/plane/rim"][:, 2], heights[0], rtol=1e-9)
