"""What a message about a damaged file advises is possible, and leads on.

Truth: the command that the message names is given; it ends well, and its dataset is that of the whole file.
"""

import random
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray
from made_by_commands import called
from support import seeds

LOOKS = ("info", "resume", "verify", "plot", "analyse", "export --format csv")


def damage(path: Path, draw: random.Random) -> None:
    content = bytearray(path.read_bytes())
    how = draw.choice(["cut", "flipped", "empty"])
    if how == "cut":
        del content[draw.randrange(len(content)) :]
    elif how == "empty":
        content.clear()
    else:
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(content)


@pytest.mark.parametrize("seed", seeds(1, 25))
@pytest.mark.slow
@pytest.mark.unoptimised
def test_the_advice_about_a_damaged_dataset_leads_on(
    seed: int, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    draw = random.Random(seed)
    shutil.copytree(made / "runs", "runs", ignore=shutil.ignore_patterns("analysis.h5"))
    damage(Path("runs/free/dataset.h5"), draw)
    for look in draw.sample(LOOKS, 2):
        first, *options = look.split()
        result = called([first, "runs/free", *options])
        if first == "verify" and result.exit_code == 1:  # it names what differs, and that the seal is broken
            assert "dataset.h5" in result.output
            continue
        assert result.exit_code == 2, result.output
        command = re.search(r"rigidsim (run \S+ --out ELSEWHERE)", result.stderr)
        assert command, result.stderr
    for config, folder in (("runs/free/config.toml", "elsewhere"), (str(made / "free.toml"), "whole")):
        assert called(["run", config, "--out", folder]).exit_code == 0
    with (
        xarray.open_dataset("elsewhere/free/dataset.h5", engine="h5netcdf") as again,
        xarray.open_dataset("whole/free/dataset.h5", engine="h5netcdf") as whole,
    ):
        assert np.array_equal(again["quaternion"], whole["quaternion"])
