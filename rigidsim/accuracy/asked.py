"""What a config asks for in the way of accuracy."""

from __future__ import annotations

import math

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import build_scene

_MOST = 1.0  # rad: for a path that may be anywhere


def leaves_choice(experiment: Experiment) -> bool:
    """Whether ``accuracy`` is given and precision, tolerance or method are open to be chosen for it."""
    integrator = experiment.config.integrator
    fixed = {"precision", "tolerance", "method"} <= integrator.model_fields_set
    return wanted(experiment) is not None and not fixed


def wanted(experiment: Experiment) -> float | None:
    """The accuracy of the attitude to choose settings for, rad; None where none is asked for.

    Errors of the path are, for its size, about as large as those of the attitude; the certificate says what
    they are, and a dearer setting is chosen where they are larger than that.
    """
    integrator = experiment.config.integrator
    found = [] if integrator.accuracy is None else [float(integrator.accuracy)]
    if integrator.accuracy_axis is not None and not experiment.config.model.reduced:
        found.append(float(integrator.accuracy_axis))  # no axis is further off than the attitude
    if integrator.accuracy_position is not None:
        scene = build_scene(experiment)
        if scene.position is None or scene.velocity is None:
            what = "given, but the scene has no position; give [initial] position or velocity"
            raise ConfigError(Problem("[integrator] accuracy_position", what), experiment.source)
        seconds = float(scene.samples.last - scene.start)
        size = math.hypot(*map(float, scene.position)) or math.hypot(*map(float, scene.velocity)) * seconds
        found.append(min(float(integrator.accuracy_position) / (size or 1.0), _MOST))
    return min(found) if found else None
