"""The campaign of kills, full disks and damages: it can fail, tells on the way, and finds nothing lost."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import rigidsim
from experiments import kill_campaign
from experiments.durability import damages
from experiments.durability.judging import Tally, check_after, check_complete, saved_rows
from experiments.durability.scenes import same, text_of
from rigidsim.store.folder import RunFolder

SHORT = text_of("double_driven").replace("end = 3000", "end = 30").replace("3001", "31")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return rigidsim.run(rigidsim.parse(SHORT), out=tmp_path_factory.mktemp("runs")).folder


def test_lost_rows_and_changed_bits_are_failures(finished: RunFolder) -> None:
    tally = Tally()
    with rigidsim.open_run(finished.path).dataset as dataset:
        whole = dataset.load()
    assert saved_rows(finished.path) == -1
    check_after(tally, finished.path, whole, 31, "whole")
    check_complete(tally, finished.path, whole, "whole")
    assert (tally.failures, tally.counts["completed runs identical"]) == ([], 1)
    check_after(tally, finished.path, whole, 32, "short")
    assert tally.failures == ["short: 31 rows, 32 acknowledged"]
    changed = whole.copy(deep=True)
    changed["energy"].values[30] = np.nextafter(changed["energy"].values[30], 9)
    assert same(whole, changed) == "energy"
    assert same(whole, changed, rows=30) == ""
    check_after(tally, finished.path, changed, 31, "changed")
    check_complete(tally, finished.path, changed, "changed")
    assert tally.failures[1:] == ["changed: energy differs", "changed: energy"]


def test_damage_changes_the_file(finished: RunFolder, tmp_path: Path) -> None:
    content = finished.dataset.read_bytes()
    other = finished.checkpoint
    for seed in range(60):
        target = tmp_path / "target.h5"
        target.write_bytes(content)
        done = damages.damage(target, random.Random(seed), [other])
        assert done == "lost" if not target.exists() else target.read_bytes() != content, done


@pytest.mark.slow(40)
def test_a_small_campaign(capfd: pytest.CaptureFixture[str]) -> None:
    arguments = "--kills 8 --full-disks 2 --read-only 2 --damages 16 --seconds 240"  # seconds at most
    assert kill_campaign.main(arguments.split()) == 0
    told = capfd.readouterr().out
    assert "kills: 8 of 8" in told
    assert "damages: 16 of 16; failures so far: 0" in told
