"""The announced error of an averaged model, held against the full model."""

from dataclasses import replace

import numpy as np

import rigidsim
from experiments.coverage.families import CoverageScene
from experiments.coverage.judging import MOST_STEPS, Judged, compactly, gone_through
from rigidsim.errors import ConfigError
from rigidsim.scene.cautions import WarningCode
from rigidsim.session.diagnostics import Diagnostics
from rigidsim.solve.status import Status

_AXES = ("momentum_axis", "figure_axis")


def judge_average(scene: CoverageScene) -> Judged:
    """Run a scene averaged and in full; the axis whose announced error is nearest to the true one, or below
    it, stands for both.
    """
    experiment = rigidsim.parse(scene.text, overrides=["output.record=['momentum_axis','figure_axis']"])
    model = experiment.config.model
    begin = Judged(scene.number, scene.family, str(model.level), "refused", scene.radians)
    try:
        averaged = compactly(experiment)
    except ConfigError:
        return begin
    seen, progress, _ = gone_through(averaged)
    begin = replace(begin, ended=progress.status.value, steps=progress.steps)
    if progress.status is not Status.FINISHED:
        return begin
    found = Diagnostics(averaged, progress, seen.statistics).modelled(seen.trail)
    truth, progress, _ = gone_through(compactly(experiment.having(['model.level="full"'])), 2 * MOST_STEPS)
    if progress.status is not Status.FINISHED or found.modelling is None:
        return replace(begin, ended="no truth")
    announced = dict(zip(_AXES, (found.modelling.momentum_axis, found.modelling.figure_axis), strict=True))
    pairs = []
    for name in _AXES:
        apart = np.array(seen.exact(name), dtype=float) - np.array(truth.exact(name), dtype=float)
        pairs.append((float(np.linalg.norm(apart, axis=1).max()), announced[name] or 0.0))
    true, said = max(pairs, key=lambda pair: pair[0] / max(pair[1], 1e-300))
    codes = {caution.code for caution in found.cautions()}
    return replace(begin, true=true, announced=said, gone=WarningCode.MODEL_UNCERTAIN in codes)
