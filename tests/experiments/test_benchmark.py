"""The benchmark gives a number in every row, and the scripts that runs are held against do the same work."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from experiments import benchmark
from experiments.benchmarking.rows import rows

_PEERS = "left out"
_PLAIN = ("sparse", "dense", "timeline", "extended", "extended_alike", "warm")


@pytest.mark.slow(100)
def test_every_row_gives_a_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--quick", "--pairs", "1", "--out", str(tmp_path), "--scratch", str(tmp_path)]
    assert benchmark.main(arguments) == 0
    said = capsys.readouterr().out
    found = {result["key"]: result for result in json.loads((tmp_path / "benchmark.json").read_text())}
    assert [*found][:-2] == [row.key for row in rows(quick=True)]
    assert said.count("| not judged |") == sum(result["ratio"] is not None for result in found.values())
    for key, result in found.items():
        if key.startswith("satellite") and _PEERS in result["note"]:
            continue
        assert 0.01 < result["ratio"] < 100, key
        assert bool(result["estimated"]) == (key in _PLAIN)
    # a thousand seconds near the intermediate axis: errors grow to some thousand roundings (bounds: 2^16)
    for key, epsilon in (("dense", 2.0**-52), ("extended", 2.0**-63)):
        differences = found[key]["differences"]
        assert {"time", "quaternion", "angular_momentum", "energy_drift"} <= set(differences)
        assert max(differences.values()) < 2**16 * epsilon
        assert differences["time"] <= 1000 * epsilon
        assert set(found[key]["readers"].values()) <= {"the same numbers", "not installed"}
        assert found[key]["readers"]["h5py"] == found[key]["readers"]["xarray"] == "the same numbers"
        ours, bare = found[key]["size"]
        assert 0.5 < ours / bare < 2
    assert re.search(r"figure: .*benchmark\.png", said)
    assert (tmp_path / "benchmark.png").stat().st_size > 10_000
