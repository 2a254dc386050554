"""What no config can be without, or has: the worth of averaging, and of the geodetic precession."""

from __future__ import annotations

from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import loads_of
from rigidsim.scene.choices import FULL, REDUCED
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain
from rigidsim.solve.problem import prepare
from rigidsim.workflows.physics.table import ARCSEC, AveragedLevel, UnassessedEffect

_OTHER = ("record", "accuracy", "method", "formulation", "hold_invariants", "lyapunov", "sensitivity", "tip")
"""Keys that an average may refuse, and that don't matter for what it errs by."""
_LIGHT = 299792458.0  # m/s


def averaged_levels(experiment: Experiment) -> tuple[list[AveragedLevel], list[UnassessedEffect]]:
    """Each averaged model of a config, and what it errs by in the direction of axes; or why there is none.

    It isn't among the models that are compared, since it keeps no attitude.
    """
    found: list[AveragedLevel] = []
    absent: dict[str, list[str]] = {}
    keys = {"output": experiment.config.output, "integrator": experiment.config.integrator}
    given = [f"{x}.{key}=" for x in keys for key in _OTHER if key in keys[x].model_fields_set]
    for level in REDUCED:
        if experiment.config.model.level != FULL:
            why = "the config's own model is an average, whose error runs measure"
            return [], [UnassessedEffect(what="averaging", why=why)]
        try:
            settings = [f'model.level="{level}"', *given]
            worst = measure_modelling(prepare(experiment.having(settings))).worst
            found.append(AveragedLevel(level=level, largest_arcsec=worst * ARCSEC))
        except ConfigError as error:
            absent.setdefault("; ".join(map(_reason, error.problems)), []).append(level)
        except Unmeasured as why_not:
            absent.setdefault(str(why_not), []).append(level)
    told = {why: f"averaging ({', '.join(levels)})" for why, levels in absent.items()}
    return found, [UnassessedEffect(what=what, why=why) for why, what in told.items()]


def geodetic(scene: Scene) -> UnassessedEffect | None:
    """The geodetic precession, which no equations of ours have: how much it would be about the source by
    which it is largest, 3/2 (G M)^(3/2) / (c^2 r^(5/2)). None without such a source.
    """
    rates = []
    for load in loads_of(scene):
        if source := load.gradient_source:
            distance = float(plain(source.placement.nearest(scene.context)))
            strength = float(plain(source.gravitational_parameter))
            rates.append(1.5 * strength**1.5 / (_LIGHT**2 * distance**2.5))
    if not rates:
        return None
    size = max(rates) * abs(float(scene.samples.last - scene.start)) * ARCSEC
    why = f"the equations have none; a free axis would turn by some {size:.2g} arcsec over the span, one "
    return UnassessedEffect(what="geodetic precession", why=why + "locked to its orbit by none")


def _reason(problem: Problem) -> str:
    """Why a level is refused, without what was given and what to choose: nobody chose it."""
    told = problem.what.partition("; choose")[0]
    return told.partition(", but ")[2] or told
