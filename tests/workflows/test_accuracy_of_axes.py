"""``accuracy_axis``: it is kept, or the summary, a warning and the verdict say that it isn't."""

from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.cli.screens.summary import verdict_line
from rigidsim.session.verdict import Soundness, verdict_on

FAULTS = Path(__file__).parents[1] / "data" / "faults"
AXES = ("momentum_axis", "figure_axis")


def missed_scene(level: str, *settings: str) -> rigidsim.Experiment:
    """A fast top near a hyperbolic Cassini state, for a short time."""
    given = [f'model.level="{level}"', "time.end=50", "time.samples=21", *settings]
    return rigidsim.load(FAULTS / "accuracy_axis_missed.toml", overrides=given)


def apart(one: rigidsim.Run, other: rigidsim.Run) -> float:
    """Largest distance between the axes of two runs, rad."""
    with one.dataset as a, other.dataset as b:
        return max(float(np.linalg.norm(a[x].values - b[x].values, axis=1).max()) for x in AXES)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("level", "settings", "code"),
    [
        ("full", ["integrator.tolerance=1e-5", "integrator.accuracy_axis=1e-9"], "not_certified"),
        ("spin_averaged", ["integrator.tolerance=0.1"], "model_uncertain"),
        ("spin_averaged", ["output.estimate=false"], "not_certified"),
    ],
)
def test_an_accuracy_that_is_not_shown_is_told(level: str, settings: list[str], code: str) -> None:
    given = [*settings, 'integrator.precision="double"', 'integrator.method="taylor"']
    run = rigidsim.run(missed_scene(level, *given), out=None, progress=False)
    summary = run.summary
    assert code in summary["warning_codes"]
    assert verdict_on(run.outcome).soundness in (Soundness.INACCURATE, Soundness.LOST)
    assert "sound" not in verdict_line(run.outcome)[0]
    told = summary["accuracy" if level == "full" else "modelling"]
    assert told["requested"] == (1e-9 if "integrator.accuracy_axis=1e-9" in settings else 1e-3)


@pytest.mark.slow
def test_the_full_model_is_held_to_the_accuracy_of_axes() -> None:
    """The choice left the default of ``hold_invariants`` for "false", whose error was a hundred times that of
    the same tolerance by itself; and the certificate was held against ``accuracy`` alone.
    """
    path = FAULTS / "accuracy_axis_missed.toml"
    run = rigidsim.run(path, out=None, progress=False)
    text = path.read_text(encoding="utf-8").replace("accuracy_axis = 0.001", "")
    text = text.replace('level = "auto"', 'level = "full"')
    truth = rigidsim.run(rigidsim.parse(text), out=None, progress=False)
    accuracy = run.summary["accuracy"]
    assert accuracy["requested"] == 1e-3
    assert apart(run, truth) <= accuracy["certified"] <= 1e-3
