"""Settings: the keys of ``[integrator]`` that trade speed for accuracy, their errors per step, and their cost
as a count, so that no clock decides what is chosen; and the accuracy that a config asks for.
"""

import math
from dataclasses import dataclass

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.loads.rigid_bodies import second_body
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import DEFAULT_FORMULATION, DEFAULT_METHOD, METHODS, attitude_variables
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import build_scene
from rigidsim.solve.problem import auto_tolerance


@dataclass(frozen=True)
class Setting:
    """A way to integrate. ``hold_invariants`` projects them from the start; otherwise they aren't at all in
    trials, and late in runs, as "auto" does.
    """

    precision: str | int = "double"
    tolerance: float | None = None
    formulation: str = DEFAULT_FORMULATION
    hold_invariants: bool = False
    method: str = DEFAULT_METHOD

    @property
    def has_steps(self) -> bool:
        """Whether it integrates in steps; a closed form takes none."""
        return METHODS[self.method].has_steps

    @property
    def title(self) -> str:
        """Title for tables."""
        if not self.has_steps:
            return f"{METHODS[self.method].title}, {self.precision}"
        tolerance = "" if self.tolerance is None else f", tolerance {self.tolerance:.0e}"
        held = ", held" if self.hold_invariants else ""
        return f"{precision_title(self.precision)}{tolerance}, {self.formulation}{held}"

    @property
    def bits(self) -> int:
        """Bits of the significand."""
        return working_bits(self.precision)

    @property
    def step_tolerance(self) -> float:
        """Tolerance that the step control works with."""
        return auto_tolerance(epsilon(self.precision)) if self.tolerance is None else self.tolerance

    @property
    def level(self) -> float:
        """Size of the errors made at each step; a tolerance below epsilon doesn't reduce it."""
        return max(self.tolerance or 0.0, epsilon(self.precision))

    @property
    def taylor_order(self) -> int:
        """Order of the Taylor series that the tolerance needs (Jorba and Zou 2005, eq. 11)."""
        return max(2, math.ceil(1 - math.log(self.step_tolerance) / 2))

    def keys(self) -> dict[str, str]:
        """The keys of ``[integrator]``, as they are written there."""
        return {
            "precision": f"{self.precision}" if isinstance(self.precision, int) else f'"{self.precision}"',
            "tolerance": '"auto"' if self.tolerance is None else f"{self.tolerance!r}",
            "formulation": f'"{self.formulation}"',
            "hold_invariants": "true" if self.hold_invariants else '"auto"',
            "method": f'"{self.method}"',
        }


def epsilon(precision: str | int) -> float:
    """Distance from 1 to the next number of a precision, kept within doubles."""
    return 2.0 ** max(1 - working_bits(precision), -1000)


def precision_title(precision: str | int) -> str:
    """Title of a precision for tables; ``precision_titled`` reads it back."""
    return f"{precision} digits" if isinstance(precision, int) else precision


def precision_titled(title: str) -> str | int:
    """The precision with a given title."""
    return int(title.removesuffix(" digits")) if title.endswith(" digits") else title


def setting_of(experiment: Experiment) -> Setting:
    """The setting that an experiment's ``[integrator]`` stands for."""
    integrator = experiment.config.integrator
    tolerance = integrator.tolerance
    return Setting(
        integrator.precision,
        None if isinstance(tolerance, str) else float(tolerance),
        attitude_variables(integrator.formulation),
        integrator.hold_invariants is True,  # "auto" begins plainly, and does no worse than that
        integrator.method,
    )


STEP_SECONDS = 1e-6
"""Duration of a step of a free body in double precision, on one core; for messages only."""
_STEPS: dict[str | int, float] = {"single": 1.25, "double": 1.0, "extended": 9.0, "quadruple": 135.0}
"""Cost of a step over the square of its Taylor order, relative to double precision at its epsilon.

Measured in November 2026: CPU per step of a free body in each precision, medians of five, within 1.3.
"""
_DIGITS_STEP = 155.0  # the same at 50 digits, proportional to the digits beyond
_PROJECTED = 1.05  # factor on a step after which invariants are projected
_CLOSED_START, _CLOSED_SAMPLE = 800.0, 0.4  # of a closed form to 53 bits, first and further samples
_WIDE_CLOSED_SAMPLE, _DIGITS_CLOSED_SAMPLE = 1400.0, 1900.0  # to 64 or 113 bits, and to 50 digits


def cost(setting: Setting, steps: float, samples: int) -> float:
    """Approximate cost in steps of double precision at its epsilon.

    A step's work goes with the square of the Taylor order; steps are about as long at any tolerance.
    """
    digits = max(1.0, setting.precision / 50) if isinstance(setting.precision, int) else None
    if not setting.has_steps:
        if setting.bits <= 53:
            return _CLOSED_START + samples * _CLOSED_SAMPLE
        if digits is not None:
            return samples * _DIGITS_CLOSED_SAMPLE * digits
        return samples * _WIDE_CLOSED_SAMPLE
    step = _STEPS[setting.precision] if digits is None else _DIGITS_STEP * digits
    projected = _PROJECTED if setting.hold_invariants else 1.0
    return steps * step * (setting.taylor_order / 20) ** 2 * projected


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

    Errors of the path are, relative to its size, about as large as the attitude's; the certificate says what
    they are, and a more costly setting is chosen if they are larger.
    """
    integrator = experiment.config.integrator
    of_attitude = asked_of_attitude(experiment)
    found = [] if of_attitude is None else [of_attitude[1]]
    if integrator.accuracy_position is not None:
        scene = build_scene(experiment)
        second = second_body(scene)
        begun = scene if second is None else second.start
        place, velocity = begun.position, begun.velocity
        if place is None or velocity is None:
            what = "given, but the scene has no position; give [initial] position or velocity, or remove it"
            raise ConfigError(Problem("[integrator] accuracy_position", what), experiment.source)
        seconds = abs(float(scene.samples.last - scene.start))
        size = math.hypot(*map(float, place)) or math.hypot(*map(float, velocity)) * seconds
        found.append(min(float(integrator.accuracy_position) / (size or 1.0), _MOST))
    return min(found) if found else None
