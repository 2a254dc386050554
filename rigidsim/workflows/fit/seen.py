"""A fitted experiment's motion, with the uncertainty that its fit predicts, to be viewed as a run is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.scene.row_rotations import conjugated, multiplied, normalised, vector_of
from rigidsim.store.run import ShownRun
from rigidsim.workflows.fit.observed import QUATERNION
from rigidsim.workflows.run import run

if TYPE_CHECKING:
    import xarray

    from rigidsim.scene.config import Experiment

_COVARIANCE = "attitude_covariance"
_ROUNDING = 1e-6  # rad: between two ways of integrating a motion that isn't chaotic
_SHARE = 0.1  # of a sigma, by which these may differ where the motion amplifies both


def fitted_run(experiment: Experiment, fit: xarray.Dataset, source: str = "memory") -> ShownRun:
    """Run a fitted experiment at the times of its fit's dataset, and put the predicted covariance beside it.

    Args:
        experiment: with the estimated values. fit: the fit's dataset.

    Raises:
        RunFolderError: the experiment's motion isn't that of the dataset.
    """
    asked = experiment.config.output.record
    more = asked is not None and QUATERNION not in asked and _COVARIANCE in fit
    record = [*asked, QUATERNION] if more and asked else None
    # without its own error, which would mislead beside the fit's
    made = run(experiment.quiet(record, fit["time"].values.tolist()), out=None, progress=False)
    found = made.dataset
    if found.sizes["time"] != fit.sizes["time"]:
        raise RunFolderError(f"{source}: the fitted motion {made.outcome.message}, before the fit's own end")
    if _COVARIANCE in fit:
        covariance = fit[_COVARIANCE].variable.copy()
        covariance.attrs["covariance_of"] = "attitude"
        _refuse_other(found, fit, source)
        found = found.assign({_COVARIANCE: covariance})
    shown = found.assign_attrs(fit=str(fit.attrs.get("sentence", "")))
    return ShownRun(Path(source), made.outcome, shown)


def _refuse_other(found: xarray.Dataset, fit: xarray.Dataset, source: str) -> None:
    """Refuse a config that was changed since: its motion would have another uncertainty."""
    here, there = (normalised(one[QUATERNION].values) for one in (found, fit))
    apart = np.linalg.norm(vector_of(multiplied(here, conjugated(there))), axis=1)
    sigma = np.sqrt(np.nan_to_num(np.einsum("tii->t", fit[_COVARIANCE].values), nan=np.inf))
    worst = int(np.argmax(apart - _SHARE * sigma))
    if apart[worst] > max(_ROUNDING, _SHARE * sigma[worst]):
        raise RunFolderError(
            f"{source}: the motion of fitted.toml is {apart[worst]:.2g} rad from the fit's dataset "
            f"at {found['time'].values[worst]:.6g} s; was it changed? rigidsim verify {source} checks it"
        )
