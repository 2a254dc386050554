"""The accuracy that a config asks for."""

from __future__ import annotations

import math

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import build_scene

_MOST = 1.0  # rad: for a path that may be anywhere


def leaves_choice(experiment: Experiment) -> bool:
    """Whether ``accuracy`` is given and precision, tolerance or method are left open to be chosen for it."""
    integrator = experiment.config.integrator
    fixed = {"precision", "tolerance", "method"} <= integrator.model_fields_set
    return wanted(experiment) is not None and not fixed


def asked_of_attitude(experiment: Experiment) -> tuple[str, float] | None:
    """The key of ``[integrator]`` that asks most of the attitude, and the accuracy, rad; None if none does.

    The full model keeps ``accuracy_axis`` by its attitude: no axis errs by more than that.
    """
    integrator = experiment.config.integrator
    found: list[tuple[str, float]] = []
    if integrator.accuracy is not None:
        found.append(("accuracy", float(integrator.accuracy)))
    if integrator.accuracy_axis is not None and not experiment.config.model.reduced:
        found.append(("accuracy_axis", float(integrator.accuracy_axis)))
    return min(found, key=lambda asked: asked[1], default=None)


def wanted(experiment: Experiment) -> float | None:
    """Accuracy of the attitude for which settings are chosen, rad; None if none is asked for.

    Errors of the path are, relative to its size, about those of the attitude; the certificate tells what
    they are, and a more costly setting is chosen if they are larger.
    """
    integrator = experiment.config.integrator
    of_attitude = asked_of_attitude(experiment)
    found = [] if of_attitude is None else [of_attitude[1]]
    if integrator.accuracy_position is not None:
        scene = build_scene(experiment)
        if scene.position is None or scene.velocity is None:
            what = "given, but the scene has no position; give [initial] position or velocity"
            raise ConfigError(Problem("[integrator] accuracy_position", what), experiment.source)
        seconds = float(scene.samples.last - scene.start)
        size = math.hypot(*map(float, scene.position)) or math.hypot(*map(float, scene.velocity)) * seconds
        found.append(min(float(integrator.accuracy_position) / (size or 1.0), _MOST))
    return min(found) if found else None
