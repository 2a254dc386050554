"""Starting from an empty folder: ready scenes, validation alone, and what the shell completes."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import support

import rigidsim
from rigidsim.cli.completion import settings
from rigidsim.workflows.ready_scenes import write_new

Config = Callable[..., str]
Command = Callable[..., Any]


# templates

TEMPLATES = Path(__file__).parents[2] / "configs" / "templates"
SCENES = sorted(path.stem for path in TEMPLATES.glob("*.toml"))


@pytest.mark.parametrize("scene", support.cases(SCENES, ("coin",)))
def test_a_template_runs(scene: str) -> None:
    """To its end, without a warning, and what its comments promise happens."""
    run = support.run_text((TEMPLATES / f"{scene}.toml").read_text(), "output.estimate=false")
    summary = run.summary
    stopped = scene in ("coin", "gyroscope")
    assert summary["status"] == ("finished: event" if stopped else "finished")
    assert summary["warnings"] == []
    happened = {"coin": {"caught": 1}, "gyroscope": {"horizontal": 1}}.get(scene, {})
    assert summary["events"] == summary["events"] | happened
    if scene == "coin":  # up and down again: 2 v / g
        assert summary["time_reached"] == pytest.approx(2 * 2.5 / 9.80665, rel=1e-14)
    if scene == "racket":
        assert summary["events"]["flip"] >= 4


# ready scenes by name


def test_a_ready_scene_runs_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rigidsim_command: Command
) -> None:
    """In an empty folder, with the tables and data that it reads; another name of it names the run."""
    monkeypatch.chdir(tmp_path)
    short = ("--set", "time.end=1", "--set", "output.timeline=false", "--json")
    assert rigidsim_command("run", "coin", *short).exit_code == 0
    assert rigidsim_command("run", "dzhanibekov", *short).exit_code == 0
    assert {path.name for path in Path("runs").iterdir()} == {"coin", "dzhanibekov"}
    result = rigidsim_command("check", "mars_with_table")
    assert result.exit_code == 0, result.output
    assert "mars_with_table" in result.stdout
    assert rigidsim.load("toutatis", overrides={"time.end": "3 day"}).config.name == "toutatis"
    assert rigidsim.load("toutatis", overrides=["name=mine"]).config.name == "mine"
    assert rigidsim.run("coin", changes={"time.end": 0.1}, out=None).status == "finished"


# new


def test_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rigidsim_command: Command) -> None:
    monkeypatch.chdir(tmp_path)
    alone = rigidsim_command("new")
    assert alone.exit_code == 0
    assert all(scene in alone.stdout for scene in SCENES)
    assert list(tmp_path.iterdir()) == []
    assert rigidsim_command("new", "coin").exit_code == 0
    assert rigidsim_command("new", "coin", "my_coin").exit_code == 0
    assert rigidsim.load("my_coin.toml").config.name == "my_coin"
    before = Path("coin.toml").read_bytes()
    again = rigidsim_command("new", "coin")
    assert again.exit_code == 2
    assert "coin.toml: is there already, and nothing was written; give another NAME" in again.stderr
    assert Path("coin.toml").read_bytes() == before
    unknown = rigidsim_command("new", "gyroscpe")
    assert unknown.exit_code == 2
    assert 'did you mean "gyroscope"?; the command rigidsim new lists all scenes' in unknown.stderr
    body = rigidsim_command("new", "Didymos").stderr
    assert 'that is a body, which any scene takes as [body] preset = "didymos"; the command' in body
    for name in ("a/b", "..", "a b"):
        bad = rigidsim_command("new", "coin", name)
        assert bad.exit_code == 2
        assert "letters, digits, dots, underscores and hyphens are allowed" in bad.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["coin.toml", "my_coin.toml"]


READY = sorted((Path(__file__).parents[2] / "configs").rglob("*.toml"))


def test_every_ready_scene_is_written_with_what_it_reads(tmp_path: Path) -> None:
    for path in READY:
        place = tmp_path / path.stem
        place.mkdir()
        config, *beside = write_new(path.stem, "mine", place)
        assert sorted(place.iterdir()) == sorted([config, *beside])
        for other in beside:
            assert other.read_bytes() == (path.parent / other.name).read_bytes()
        assert rigidsim.load(config).config.name == "mine"
        name = f'name = "{path.stem}"'.encode()
        assert config.read_bytes() == path.read_bytes().replace(name, b'name = "mine"', 1)
        assert write_new(path.stem, "other", place) == [place / "other.toml"]  # its tables are there already


# check


def test_check(config: Config, rigidsim_command: Command) -> None:
    good = config("good")
    bad = config("bad", body="principal_moments = [1, 2, 4]")
    found = rigidsim_command("check", good)
    assert found.exit_code == 0
    assert found.stdout.startswith("good.toml  valid\nbody     from principal_moments")
    both = rigidsim_command("check", bad, good)
    assert both.exit_code == 2
    assert "bad.toml: 1 problem in the config\n  [body] principal_moments: " in both.stderr
    assert "good.toml  valid" in both.stdout  # the others are looked at all the same
    first, second = map(json.loads, rigidsim_command("check", bad, good, "--json").stdout.splitlines())
    assert (first["valid"], second["valid"]) == (False, True)
    assert first["problems"][0]["where"] == "[body] principal_moments"
    assert first["body"] is first["start"] is None
    assert second["start"]["euler_sequence"] == "zxz"
    assert rigidsim_command("check", good, "--set", "time.end=0").exit_code == 2
    assert rigidsim_command("check", "nowhere.toml").exit_code == 2
    assert rigidsim_command("check").exit_code == 2
    assert sorted(path.name for path in Path().iterdir()) == ["bad.toml", "good.toml"]  # nothing is written


# help and completion


def test_keys_and_their_values_are_completed() -> None:
    assert settings("integrator.meth") == ["integrator.method"]
    assert "body.preset=moon" in settings("body.preset=mo")
    assert settings("output.timeline=") == ["output.timeline=true", "output.timeline=false"]
    assert "integrator.precision=quadruple" in settings("integrator.precision=q")
    assert settings("nowhere=") == []
