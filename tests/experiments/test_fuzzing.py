"""A bounded share of the fuzzing campaign: read or refused, never a traceback."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

import rigidsim
from experiments import fuzzing
from rigidsim import RigidsimError
from rigidsim.scene.scene import build_scene

TEXT = """
name = "base"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
[time]
end = 10
samples = 11
[output]
timeline = false
"""


def message(text: str) -> str | None:
    """Of the refusal; None where the config is read."""
    try:
        build_scene(rigidsim.parse(text))
    except RigidsimError as error:
        return str(error)
    return None


@pytest.mark.parametrize("seed", range(2))
def test_mutated_configs_are_read_or_refused(seed: int) -> None:
    rng = random.Random(seed)
    outcomes = [message(fuzzing.hostile_config(rng).decode("utf-8", "replace")) for _ in range(100)]
    refusals = [text for text in outcomes if text is not None]
    assert len(refusals) > 50  # the mutations do hurt
    assert all(0 < len(text) < 20_000 for text in refusals)


def test_a_damaged_dataset_is_always_known(tmp_path: Path) -> None:
    """A single byte anywhere: the seal, or what it seals, doesn't agree any more."""
    run = rigidsim.run(rigidsim.parse(TEXT), out=tmp_path)
    path = run.folder.dataset
    whole = path.read_bytes()
    rng = random.Random(1)
    for _ in range(25):
        position, bit = rng.randrange(len(whole)), 1 << rng.randrange(8)
        path.write_bytes(whole[:position] + bytes([whole[position] ^ bit]) + whole[position + 1 :])
        with pytest.raises(RigidsimError, match="dataset"):
            _ = rigidsim.open_run(run.folder.path).dataset
    for kept in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:kept])
        with pytest.raises(RigidsimError, match="dataset"):
            _ = rigidsim.open_run(run.folder.path).dataset
