"""``accuracy_axis``: it is kept, or the summary, a warning and the verdict say that it isn't."""

from pathlib import Path

import pytest

import rigidsim
from rigidsim.cli.screens.summary import verdict_line
from rigidsim.session.verdict import Soundness, verdict_on

FAULTS = Path(__file__).parents[1] / "data" / "faults"


def missed_scene(level: str, *settings: str) -> rigidsim.Experiment:
    """A fast top near a hyperbolic Cassini state, for a short time."""
    given = [f'model.level="{level}"', "time.end=50", "time.samples=21", *settings]
    return rigidsim.load(FAULTS / "accuracy_axis_missed.toml", overrides=given)


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
