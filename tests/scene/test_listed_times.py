"""``[time] times = "FILE"``: sample times from the column of time of a table, digit by digit."""

from fractions import Fraction
from pathlib import Path

import pytest
from support import config

import rigidsim
from rigidsim.scene.scene import build_scene

CONFIG = config(time='times = "theirs.csv"\nepoch = "2024-03-01T00:00:00 UTC"')


def read(folder: Path, table: str) -> rigidsim.Experiment:
    (folder / "theirs.csv").write_text(table)
    (folder / "listed.toml").write_text(CONFIG)
    return rigidsim.load(folder / "listed.toml")


@pytest.mark.parametrize(
    ("table", "times"),
    [
        ("# a run\nqw,t [min],wx\n1,0,0\n1,0.1,0\n1,2e-1,0\n", [0, 6, 12]),
        ("time_day\twx\n0\t1\n0.00001\t1\n", [0, Fraction("0.864")]),
        ("dt;t [min]\n0,5;0\n0,5;0,1\n", [0, 6]),
        ("t,q\n2024-03-01T00:00:00 UTC,1\n2024-03-01 00:00:01.5 UTC,1\n", [0, Fraction("1.5")]),
        ("0 1\n0.1 1\n0.30000000000000000001 1\n", [0, Fraction("0.1"), Fraction("0.30000000000000000001")]),
    ],
)  # fmt: skip
def test_times_are_those_that_are_written(tmp_path: Path, table: str, times: list[Fraction]) -> None:
    experiment = read(tmp_path, table)
    assert list(build_scene(experiment).samples.times or ()) == times
    assert "wx" not in experiment.text, "only times are taken into the config"
    alone = rigidsim.parse(experiment.text)  # without the file
    assert build_scene(alone).samples.times == build_scene(experiment).samples.times


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("qw,qx\n1,0\n", "names no column t or time"),
        ("t,wx\n0,1\n0,2\n", "times must increase"),
        ("wx,t\n0,1\n2\n", "line 3 has 1 values, where the line of names has 2"),
    ],
)
def test_tables_that_hold_no_times_are_refused(tmp_path: Path, table: str, told: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=told):
        build_scene(read(tmp_path, table))


def test_a_config_without_its_table_says_where_it_belongs() -> None:
    with pytest.raises(rigidsim.ConfigError, match="without files next to it"):
        build_scene(rigidsim.parse(CONFIG))
