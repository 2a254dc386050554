"""rigidsim from Python: experiments from values, runs in memory, what is shown, and how errors speak."""

from __future__ import annotations

import html
import re
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rigidsim
from rigidsim import Experiment
from rigidsim.model.loads import Load

TOP: dict[str, Any] = {
    "name": "top",
    "body": {"principal_moments": [1, 2, 2.5]},
    "initial": {"angular_velocity": [0.1, 1, 0.05]},
    "time": {"end": 4, "samples": 41},
}
EVENT = {"name": "half_turn", "expression": "wy", "direction": "any"}
ROOT = Path(__file__).parents[2]


def _numbers(experiment: Experiment) -> list[Any]:
    rates = experiment.config.initial.angular_velocity
    assert rates is not None
    return [rate.rational for rate in rates]


def test_values_count_as_they_are_written() -> None:
    rates = [0.1, np.float32(0.3), Fraction(1, 3)]
    experiment = Experiment.from_dict({**TOP, "initial": {"angular_velocity": rates}})
    assert _numbers(experiment) == [Fraction(1, 10), Fraction(3, 10), Fraction(1, 3)]
    binary = [mpmath.mpf(0.1), np.longdouble("0.1"), Decimal("1e-30")]
    experiment = Experiment.from_dict(
        {**TOP, "initial": {"angular_velocity": np.array(binary, dtype=object)}}
    )
    assert _numbers(experiment) == [Fraction(0.1), Fraction(1, 10), Fraction(1, 10**30)]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3))
def test_any_double_survives_the_way_through_the_text(rates: list[float]) -> None:
    experiment = rigidsim.parse(Experiment.from_dict({**TOP, "initial": {"angular_velocity": rates}}).text)
    assert [float(rate) for rate in _numbers(experiment)] == rates


def test_tables_and_experiment_are_the_same_thing() -> None:
    loads = [{"kind": "torque", "components": ["0", "0", 'k*sin(t) # "']}]
    given_tables = {**TOP, "parameters": {"k": "1/7"}, "loads": loads[:0], "events": [EVENT], "frame": None}
    experiment = Experiment.from_dict(given_tables)
    assert Experiment.from_dict(experiment.to_dict()).config == experiment.config
    assert experiment.to_dict()["body"]["principal_moments"][2] == Decimal("2.5")
    with pytest.raises(rigidsim.ConfigError, match=r"body.mass: given an object of type object; numbers"):
        Experiment.from_dict({**TOP, "body": {"principal_moments": [1, 2, 2], "mass": object()}})
    with pytest.raises(rigidsim.ConfigError, match="finite numbers are allowed"):
        Experiment.from_dict({**TOP, "time": {"end": float("inf")}})


def test_one_way_of_giving_times_takes_the_place_of_another() -> None:
    experiment = Experiment.from_dict(TOP)
    both = experiment.replace(time={"times": [0, 1, 10]})
    with pytest.raises(rigidsim.ConfigError, match=r"leave the other out \(Experiment.replace removes keys"):
        rigidsim.run(both, out=None)
    other = experiment.replace(time={"samples": None, "times": [0, "0.1 s", 1], "end": None})
    assert rigidsim.run(other, out=None).dataset.time.values.tolist() == [0, 0.1, 1]
    assert other.settings == ("time.samples=", 'time.times=[0, "0.1 s", 1]', "time.end=")
    assert rigidsim.parse(experiment.text, overrides=list(other.settings)).config == other.config
    with pytest.raises(rigidsim.ConfigError, match=r'there is nothing at "every" to remove'):
        experiment.replace({"time.every": None})
    with pytest.raises(rigidsim.ConfigError, match="replacing: given 5; keys and values are allowed"):
        experiment.replace(5)  # type: ignore[arg-type]


class _Wrong(Load):
    """A load whose torque is what it is given."""

    title = "wrong"

    def __init__(self, torque: Any, reads: str = "attitude") -> None:
        self.given = torque
        self.reads = frozenset({reads})

    def torque(self, m: Any) -> Any:
        return self.given


NO_LOADS: list[tuple[Any, str]] = [
    (_Wrong([]), "loads: given an object of type _Wrong; a list of loads is allowed"),
    ([_Wrong], r"loads\[0\]: given the class _Wrong; give an object of it"),
    ([_Wrong([]), {"kind": "torque"}], r"loads\[1\]: given a table; an object of a class derived from"),
    ([_Wrong([], "atitude")], r'loads\[0\]: reads \["atitude"\]; allowed: attitude, vertical, flight'),
    ([_Wrong(5)], "load wrong: its torque is 5; a list of terms is allowed"),
    ([_Wrong([([1, 2], 1.0)])], "load wrong: its torque is .* a vector of three constants"),
]


def test_what_is_no_load_is_told_with_what_is_allowed() -> None:
    for loads, told in NO_LOADS:
        with pytest.raises(rigidsim.ConfigError, match=told):
            rigidsim.run(Experiment.from_dict(TOP), loads=loads, out=None)
    sweep = {"axes": {"time.end": {"values": [1, 2]}}}
    with pytest.raises(rigidsim.ConfigError, match="out: given None; a folder is allowed"):
        rigidsim.sweep(Experiment.from_dict(TOP), changes={"sweep": sweep}, out=None)  # type: ignore[arg-type]


def test_replaced_values_keep_the_rest() -> None:
    experiment = rigidsim.parse(Experiment.from_dict(TOP).text + "# a remark\n")
    other = experiment.replace({"initial.angular_velocity[0]": 0.3}, time={"end": "1 min"}, name="other")
    assert _numbers(other) == [Fraction(3, 10), 1, Fraction(1, 20)]
    assert float(other.config.time.end or 0) == 60
    assert other.config.time.samples == 41
    assert "# a remark" in other.text
    assert other.given == experiment.text
    assert other.settings == ("initial.angular_velocity[0]=0.3", 'time.end="1 min"', 'name="other"')
    assert experiment.config.name == "top"


def test_a_run_in_memory_is_the_saved_one(tmp_path: Path) -> None:
    tables = {
        **TOP,
        "events": [EVENT],
        "integrator": {"precision": "extended"},
        "output": {"timeline": False},
    }
    saved = rigidsim.run(tables, out=tmp_path)
    kept = rigidsim.run(Experiment.from_dict(tables), out=None)
    assert kept.status == saved.status == "finished"
    assert set(kept.dataset.variables) == set(saved.dataset.variables)  # compared in store/test_in_memory.py
    for run in (saved.summary, kept.summary):
        for name in ("cost", "dataset_sha256", "provenance"):
            run.pop(name, None)
    assert kept.summary == saved.summary
    assert [path.name for path in tmp_path.iterdir()] == ["top"]


def test_a_run_in_memory_stops_as_any_other(capsys: pytest.CaptureFixture[str]) -> None:
    changes = {"limits.max_steps": 5, "time.end": 400}
    run = rigidsim.run(TOP, changes=changes, out=None)
    assert capsys.readouterr().err == ""
    rigidsim.run(TOP, changes=changes, out=None, progress=True)
    assert "top: integrating in memory" in capsys.readouterr().err
    assert run.status == "stopped: max_steps"
    assert 0 < run.dataset.sizes["time"] < 41
    with pytest.raises(rigidsim.RunFolderError, match="of memory, and the machine has"):
        rigidsim.run(TOP, changes={"time.samples": 10**12}, out=None)


def test_the_readmes_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- test: from Python -->\n```python\n(.*?)```", text, re.S)
    assert found is not None
    exec(compile(found[1], "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "<Run 'intermediate_axis' (memory): finished>" in printed


def test_a_run_in_memory_shows_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """As text and table, in figures, and in the viewer."""
    seen: list[Path] = []

    def viewer(path: Path, *, web: bool) -> int:
        assert path.stat().st_size > 10_000
        assert web
        seen.append(path)
        return 0

    run = rigidsim.run({**TOP, "name": "a", "description": "<b>"}, out=None)
    assert repr(run) == "<Run 'a' (memory): finished>"
    shown = run._repr_html_()
    assert "angular_momentum" in shown
    assert "estimated error" in shown
    assert run.plot("polhode")._repr_png_().startswith(b"\x89PNG")  # what a notebook asks for
    with pytest.raises(ValueError, match="did you mean 'polhode'"):
        run.plot("polhod")
    monkeypatch.setattr("rigidsim.look.viewer.open_viewer", viewer)
    assert run.view(web=True) == 0
    assert not seen[0].exists()
    experiment = Experiment.from_dict({**TOP, "description": "<b>"})
    assert repr(experiment) == "<Experiment 'top' (config): no load, to t = 4 s, double>"
    assert html.escape("<b>") in experiment._repr_html_()
    assert '<b>"' not in experiment._repr_html_()
