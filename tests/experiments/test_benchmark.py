"""The benchmark gives a number in every row, and the scripts that runs are held against do the same work."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path

import pytest

from experiments import benchmark
from experiments.benchmark import Result
from experiments.benchmarking.rows import rows

_PEERS = "left out"
_PLAIN = ("sparse", "dense", "timeline", "extended", "extended_alike", "warm")


def test_bounds_are_kept_or_not() -> None:
    made = Result("dense", "a run", "a script", 0.6, ratios=[0.5, 0.58, 0.7], estimated=[0.61])
    assert made.ratio == 0.58
    assert made.met
    assert "| 0.58 | 0.6 | met | 3 | 0.5 .. 0.7 | 0.61 |" in made.line
    assert not Result("dense", "a run", "a script", 0.57, ratios=made.ratios).met
    assert Result("dense", "a run", "a script", 0.57, ratios=made.ratios, judged=False).met is None
    assert Result("none", "a run", "nothing", 1.0).met is None


def test_earlier_rows_are_put_into_a_page(tmp_path: Path) -> None:
    made = Result("tiny", "a run", "a script", 2.2, ratios=[2.0, 2.1], ours=0.5, bare=0.25, wall=(0.6, 0.3))
    older = {**asdict(made), "ratios": [7.0], "ratio": 7.0, "met": False}
    del older["measure"]  # as earlier versions wrote it
    for name, rows_of in (("older", [older]), ("newer", [asdict(made)])):
        (tmp_path / f"{name}.json").write_text(json.dumps(rows_of))
    page = tmp_path / "page.md"
    page.write_text(f"before\n{benchmark.BEGIN}\nwhat was there\n{benchmark.END}\nafter\n")
    files = [str(tmp_path / "older.json"), str(tmp_path / "newer.json")]
    arguments = ["--given", *files, "--into", str(page), "--out", str(tmp_path)]
    assert benchmark.main(arguments) == 0  # the last that is given counts
    text = page.read_text()
    assert text.startswith(f"before\n{benchmark.BEGIN}\n| work |")
    assert text.endswith(f"\n{benchmark.END}\nafter\n")
    assert "| 2.05 | 2.2 | met | 2 | 2 .. 2.1 |  | 0.5 / 0.25 | 0.6 / 0.3 |" in text
    assert "what was there" not in text
    with pytest.raises(ValueError, match="no lines"):
        benchmark.replaced("a page without a place", "a table")


def test_unknown_rows_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        benchmark.main(["--rows", "dense,thick"])
    assert "--rows: thick: allowed are sparse, dense, " in capsys.readouterr().err


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
