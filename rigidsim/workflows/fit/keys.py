"""The parameters of a fit: keys of the config as single numbers, and the experiment at other values of them."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment, validated
from rigidsim.scene.exact import in_its_unit, parse_number, with_unit
from rigidsim.scene.fit_table import KnownWithin
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.sweeps.axes import refuse_unsettable, unit_and_length
from rigidsim.scene.toml_text import apply_overrides, key_steps, parse_toml
from rigidsim.scene.units import powers, unit_text
from rigidsim.scene.validation_messages import shown
from rigidsim.workflows.compare.rotations import multiplied, of_vector

ATTITUDE = "initial.attitude"
"""Key of a rotation vector, rad, in body axes, that turns the attitude at the start."""
_FORMS = ("euler_angles", "pole", "prime_meridian", "obliquity", "node_longitude")
_NOT_FITTED = ("name", "description", "fit", "sweep", "output", "tables", "limits", "integrator", "model")


@dataclass(frozen=True)
class FitKey:
    """One number that is estimated or considered.

    Attributes:
        key: dotted, with its index: ``initial.angular_velocity[2]``.
        unit: SI unit of its values, "1" for none.
        start: the config's value, SI. sigma: known beforehand, SI; None for nothing.
        suffix: unit with which values are written into the config, where they have one there.
    """

    key: str
    unit: str
    start: float
    sigma: float | None = None
    suffix: str = ""


class FitKeys:
    """All numbers of a fit, estimated ones first, each in the order of the config.

    Attributes:
        estimated: those of ``[fit] parameters``. considered: those of ``[fit] consider``.
    """

    def __init__(self, experiment: Experiment) -> None:
        table = experiment.config.fit
        if table is None:
            what = "missing; it names parameters and data, see docs/fits.md"
            raise ConfigError(Problem("[fit]", what), experiment.source)
        self._experiment = experiment
        self._tables = parse_toml(experiment.text, experiment.source)
        self._scene = build_scene(experiment)
        self._problems: list[Problem] = []
        self.estimated = self._all("parameters", table.parameters, table.prior)
        self.considered = self._all("consider", list(table.consider), table.consider)
        self._refuse_rest(table.prior)
        if self._problems:
            raise ConfigError(self._problems, experiment.source)
        self._turned = any(one.key.startswith(ATTITUDE) for one in self.all)

    @property
    def all(self) -> tuple[FitKey, ...]:
        """Estimated ones, then considered ones."""
        return (*self.estimated, *self.considered)

    @property
    def scene(self) -> Scene:
        """The scene of the config's values."""
        return self._scene

    # --- reading --------------------------------------------------------------------------------------------

    def _all(
        self, where: str, keys: Sequence[str], sigmas: Mapping[str, KnownWithin]
    ) -> tuple[FitKey, ...]:
        found: list[FitKey] = []
        for key in keys:
            place = f'[fit] {where} "{key[:60]}"'
            try:
                found += self._of(key, sigmas)
            except ValueError as error:
                self._problems.append(Problem(place, str(error)))
            except ConfigError as error:
                self._problems += [Problem(place, problem.what) for problem in error.problems]
        names = [one.key for one in found]
        for name in sorted({name for name in names if names.count(name) > 1}):
            self._problems.append(Problem(f"[fit] {where}", f'"{name}" is given twice; give it once'))
        return tuple(found)

    def _of(self, key: str, sigmas: Mapping[str, KnownWithin]) -> list[FitKey]:
        """The numbers of one key, each with what is known of it."""
        plain = ".".join(part.strip() for part in key.split("."))
        steps = key_steps(plain, "parameters")
        if str(steps[0]) in _NOT_FITTED:
            raise ValueError(
                "can't be fitted; keys of [body], [initial], [[loads]], [parameters] and the like are allowed"
            )
        if plain == ATTITUDE or re.fullmatch(rf"{ATTITUDE}\[[012]\]", plain):
            indices = range(3) if plain == ATTITUDE else [int(plain[-2])]
            return [self._turn(i, _sigma(sigmas, plain, i, ATTITUDE, "rad")) for i in indices]
        unit, _ = unit_and_length(plain, self._tables)
        refuse_unsettable(plain, copy.deepcopy(self._tables))  # which it changes
        value = self._value(plain, steps)
        if not isinstance(value, list):
            return [self._number(plain, value, unit, _sigma(sigmas, plain, 0, "", unit))]
        return [
            self._number(f"{plain}[{i}]", entry, unit, _sigma(sigmas, f"{plain}[{i}]", i, plain, unit))
            for i, entry in enumerate(value)
        ]

    def _turn(self, index: int, sigma: float | None) -> FitKey:
        if self._scene.config.initial.equilibrium is not None:
            raise ValueError("the start is an equilibrium, which is found; give an attitude instead")
        return FitKey(f"{ATTITUDE}[{index}]", "rad", 0.0, sigma)

    def _value(self, key: str, steps: Sequence[str | int]) -> Any:
        """The value that stands in the config."""
        value: Any = self._tables
        for step in steps:
            try:
                value = value[step]
            except (LookupError, TypeError):
                raise ValueError(
                    "has no value in the config, where a fit starts from; write one, such as "
                    f"{key} = {'[...]' if key.endswith(('angular_velocity', 'moments')) else '...'}"
                ) from None
        return value

    def _number(self, key: str, value: Any, unit: str, sigma: float | None) -> FitKey:
        suffix = ""
        if unit == "1":  # constants of expressions have units of their own
            number, own = in_its_unit(value)
            if own:
                number, unit = with_unit(number, own, value), unit_text(powers(own)) or "rad"
                suffix = unit
        else:
            number = parse_number(value, unit)
        return FitKey(key, unit, float(number), sigma, suffix)

    def _refuse_rest(self, prior: Mapping[str, KnownWithin]) -> None:
        """A prior of something that isn't estimated would be without effect."""
        known = {one.key for one in self.estimated}
        for key in prior:
            plain = ".".join(part.strip() for part in key.split("."))
            if plain not in known and f"{plain}[0]" not in known:
                what = "is not among the parameters; name it there, or remove its prior"
                self._problems.append(Problem(f'[fit] prior."{key[:60]}"', what))

    # --- other values ---------------------------------------------------------------------------------------

    def overrides(self, values: Sequence[float]) -> list[str]:
        """``KEY=VALUE`` texts of values in the order of ``all``, every digit of the doubles written."""
        found = []
        turn = np.zeros(3)
        for one, value in zip(self.all, values, strict=True):
            if one.key.startswith(ATTITUDE):
                turn[int(one.key[-2])] = value
            else:
                text = repr(float(value))
                found.append(f'{one.key}="{text} {one.suffix}"' if one.suffix else f"{one.key}={text}")
        return [*(self._start(turn) if self._turned else ()), *found]

    def _start(self, turn: np.ndarray) -> list[str]:
        """The attitude at the start turned by a rotation vector, instead of whatever gives it."""
        initial = self._scene.config.initial
        given = np.array([float(x) for x in self._scene.quaternion])
        quaternion = multiplied(given[None, :], of_vector(turn[None, :]))[0]
        texts = [f"initial.{name}=" for name in _FORMS if getattr(initial, name) is not None]
        if initial.spin_period is not None:
            rates = ", ".join(repr(float(w)) for w in self._scene.angular_velocity)
            texts += ["initial.spin_period=", f"initial.angular_velocity=[{rates}]"]
        shown_values = ", ".join(repr(float(x)) for x in quaternion)
        return [*texts, f"initial.quaternion=[{shown_values}]"]

    def experiment(self, values: Sequence[float], base: Experiment) -> Experiment:
        """An experiment at other values, without a text of its own: for runs that nobody keeps."""
        tables = copy.deepcopy(self._tables)
        apply_overrides(tables, self.overrides(values), "fit")
        return replace(base, config=validated(tables, base.source))

    def fitted(self, values: Sequence[float]) -> Experiment:
        """The config with estimated values written in, and without ``[fit]``."""
        everything = [*values, *(one.start for one in self.considered)]
        return self._experiment.having(["fit=", *self.overrides(everything)])


def _sigma(
    sigmas: Mapping[str, KnownWithin], key: str, index: int, whole: str, unit: str
) -> float | None:
    """What is known beforehand of a number, by its own key or by that of its vector."""
    table = sigmas.get(key) or sigmas.get(whole)
    if table is None:
        return None
    given = table.sigma
    if isinstance(given, list):
        if index >= len(given):
            raise ValueError(f"given {shown(given)} as sigma; one for each component is needed")
        given = given[index]
    value = float(in_its_unit(given)[0] if unit == "1" else parse_number(given, unit))
    if unit == "1" and isinstance(given, str):
        number, own = in_its_unit(given)
        value = float(with_unit(number, own, given)) if own else value
    if not value > 0:
        raise ValueError(f"given {shown(given)} as sigma; a standard deviation above zero is allowed")
    return value
