"""A setting: the keys of ``[integrator]`` that trade speed for accuracy, and its errors per step."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.config import Experiment
from rigidsim.scene.formulations import DEFAULT_FORMULATION, attitude_variables
from rigidsim.scene.methods import DEFAULT_METHOD, METHODS
from rigidsim.solve.problem import auto_tolerance


@dataclass(frozen=True)
class Setting:
    """A way to integrate.

    Attributes:
        precision: precision as in a config.
        tolerance: None for "auto".
        hold_invariants: whether invariants are projected from the start; otherwise not at all in trials, and
            late in runs, as "auto" does.
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

    def overrides(self, *, without: Collection[str] = ()) -> list[str]:
        """The setting as ``KEY=VALUE`` texts for ``rigidsim.load``.

        Args:
            without: keys of ``[integrator]`` to leave out.
        """
        keys = {
            "precision": f"{self.precision}" if isinstance(self.precision, int) else f'"{self.precision}"',
            "tolerance": '"auto"' if self.tolerance is None else f"{self.tolerance!r}",
            "formulation": f'"{self.formulation}"',
            "hold_invariants": "true" if self.hold_invariants else '"auto"',
            "method": f'"{self.method}"',
        }
        return [f"integrator.{key}={value}" for key, value in keys.items() if key not in without]


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
