"""The Earth's continents are where they are."""

from __future__ import annotations

import numpy as np
import pytest

from rigidsim.look.coasts import coasts, land_map

PLACES = {
    # name: degrees north, degrees east, whether it is land
    "Paris": (48.9, 2.4, True),
    "Kansas": (38.5, -98.0, True),
    "Manaus": (-3.1, -60.0, True),
    "Alice Springs": (-23.7, 133.9, True),
    "the Sahara": (23.0, 10.0, True),
    "Chukotka, beyond 180 degrees": (67.0, -175.0, True),
    "the South Pole": (-89.9, 40.0, True),
    "the North Pole": (89.9, 40.0, False),
    "the Atlantic": (30.0, -40.0, False),
    "the Pacific": (0.0, -150.0, False),
    "the Indian Ocean": (-25.0, 80.0, False),
    "the Mediterranean": (35.0, 18.0, False),
    "the Bering Sea": (57.0, -177.0, False),
}


@pytest.mark.parametrize("name", PLACES)
def test_places_are_on_land_or_at_sea(name: str) -> None:
    north, east, dry = PLACES[name]
    land = land_map()
    height, width = land.shape
    assert land[int((90 - north) / 180 * height), int(east % 360 / 360 * width)] == dry


def test_land_covers_its_share_of_the_earth() -> None:
    land = land_map()
    weight = np.cos(np.deg2rad(90 - (np.arange(len(land)) + 0.5) * 180 / len(land)))
    # 29.2 %: 148.94 of 510.07 million km^2 (CIA World Factbook); coarse coasts miss lakes and islands
    assert (land.mean(axis=1) * weight).sum() / weight.sum() == pytest.approx(0.292, abs=0.01)
    assert len(coasts()) > 50
