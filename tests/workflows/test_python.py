"""rigidsim from Python: experiments from values, runs in memory, what is shown, and how errors speak."""

import html
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

TOP: dict[str, Any] = {
    "name": "top",
    "body": {"principal_moments": [1, 2, 2.5]},
    "initial": {"angular_velocity": [0.1, 1, 0.05]},
    "time": {"end": 4, "samples": 41},
}
EVENT = {"name": "half_turn", "expression": "wy", "direction": "any"}


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


@pytest.mark.slow
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
