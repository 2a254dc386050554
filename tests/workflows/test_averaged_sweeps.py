"""Sweeps over averaged models: each member has the error of its model, as a run of its own announces it."""

from pathlib import Path

import numpy as np
import pytest
from support import config
from typer.testing import CliRunner

import rigidsim
from rigidsim.cli.app import app
from rigidsim.workflows.sweeps.members import single_member

pytestmark = pytest.mark.unoptimised

SPINNING = config(
    "principal_moments = [0.98, 0.98, 1]",
    'angular_velocity = [0, 0, 60]\neuler_angles = [0.3, "35 deg", 0]',
    'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
    'orbit = {semi_major_axis = 1, eccentricity = 0.2, inclination = "10 deg"}',
    "end = 10\nsamples = 3",
    output='record = ["momentum_axis"]',
    more='[model]\nlevel = "spin_averaged"\n[sweep]\ntile = 1\n'
    'axes."initial.euler_angles[1]" = {values = ["20 deg", "50 deg"], name = "lean"}',
    name="precessing",
    estimate=True,
)
MIXED = SPINNING.replace('axes."initial.euler_angles[1]"', 'axes."model.level"').replace(
    '["20 deg", "50 deg"], name = "lean"', '["spin_averaged", "full"]'
)


def as_single_runs(text: str, out: Path) -> None:
    """Every announced error of a sweep is that of the member run by itself."""
    found = rigidsim.sweep(rigidsim.parse(text), out=out)
    assert found.summary["warnings"] == []
    errors = found.dataset["modelling_error"].values
    for member, error in enumerate(errors):
        alone = rigidsim.run(single_member(rigidsim.parse(text), member), out=None)
        assert error == alone.dataset.attrs["modelling_error"] > 0
        model = alone.outcome.modelling  # type: ignore[union-attr]
        assert model is not None
        for name, beside in (("norm", "angular_momentum_norm"), ("energy", "energy")):
            known = getattr(model, beside)
            assert (f"modelling_error_{name}" in found.dataset) == (known is not None)
            if known is not None:
                assert found.dataset[f"modelling_error_{name}"].values[member] == known
    told = found.summary["estimated_errors"]
    assert told["modelling"]["largest"] == errors.max()
    assert 0 < found.summary["cost"]["estimate_cpu_seconds"] < found.summary["cost"]["cpu_seconds"]


@pytest.mark.slow
def test_a_sweep_keeps_and_tells_the_error_of_each_model(tmp_path: Path) -> None:
    as_single_runs(SPINNING, tmp_path)
    told = CliRunner().invoke(app, ["info", str(tmp_path / "precessing")], env={"COLUMNS": "400"}).output
    assert "axes of averaged models" in told
    assert "of its integration alone" in told
    assert "for errors" in told


@pytest.mark.slow
def test_beside_full_models_only_averaged_members_have_one(tmp_path: Path) -> None:
    found = rigidsim.sweep(rigidsim.parse(MIXED), out=tmp_path).dataset
    errors = found["modelling_error"].values
    assert errors[0] > 0
    assert np.isnan(errors[1])
