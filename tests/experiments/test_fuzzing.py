"""A bounded share of the fuzzing campaign: read or refused, never a traceback."""

import random
from pathlib import Path

import pytest

import rigidsim
from rigidsim import RigidsimError

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
