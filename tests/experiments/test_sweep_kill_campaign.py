"""The campaign of kills over sweeps, shortened."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from experiments.durability.judging import Tally
from experiments.sweep_kill_campaign import WAYS, campaign


@pytest.mark.slow  # a sweep for each kill
def test_a_few_disturbances_of_each_kind_lose_nothing(tmp_path: Path) -> None:
    tally = Tally()
    campaign(tally, 4, random.Random(3), tmp_path, 600)
    assert tally.failures == []
    assert sum(tally.counts[way] for way in WAYS) >= 4
