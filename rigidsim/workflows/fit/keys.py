"""The parameters of a fit: keys of the config as single numbers, and the experiment at other values."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment, validated
from rigidsim.scene.exact import parse_number
from rigidsim.scene.fit_table import KnownWithin
from rigidsim.scene.row_rotations import multiplied, of_vector
from rigidsim.scene.scene import build_scene
from rigidsim.scene.toml_text import apply_overrides, parse_toml
from rigidsim.scene.units import powers, unit_text
from rigidsim.scene.validation_messages import shown
from rigidsim.scene.varied_keys import ATTITUDE, VariedKey, varied_keys
from rigidsim.workflows.read import refuse_backwards

_FORMS = ("euler_angles", "pole", "prime_meridian", "obliquity", "node_longitude")


@dataclass(frozen=True)
class FitKey:
    """One number that is estimated or considered.

    Attributes:
        key: dotted, with its index: ``initial.angular_velocity[2]``.
        unit: SI unit of its values, "1" for none.
        start: the config's value, SI. sigma: known beforehand, SI; None for nothing.
        suffix: unit with which values are written into the config, where they have one there.
        places: keys of the config where it stands. size: against which changes of it are small or not.
    """

    key: str
    unit: str
    start: float
    sigma: float | None = None
    suffix: str = ""
    places: tuple[str, ...] = ()
    size: float = 1.0


class FitKeys:
    """All numbers of a fit, estimated ones first, each in the order of the config.

    Attributes:
        estimated: keys in ``[fit] parameters``. considered: keys in ``[fit] consider``.
        scene: of the config's values.
    """

    def __init__(self, experiment: Experiment) -> None:
        table = experiment.config.fit
        assert table is not None
        self._experiment = experiment
        self._tables = parse_toml(experiment.text, experiment.source)
        self.scene = build_scene(experiment)
        refuse_backwards(self.scene, experiment.source)
        self.estimated = self._all("parameters", table.parameters, "prior", table.prior)
        self.considered = self._all("consider", list(table.consider), "consider", table.consider)
        self._turned = any(one.key.startswith(ATTITUDE) for one in self.all)

    @property
    def all(self) -> tuple[FitKey, ...]:
        """Estimated ones, then considered ones."""
        return (*self.estimated, *self.considered)

    # --- reading --------------------------------------------------------------------------------------------

    def _all(
        self, where: str, keys: Sequence[str], known: str, sigmas: Mapping[str, KnownWithin]
    ) -> tuple[FitKey, ...]:
        every = varied_keys(self._experiment, keys, f"[fit] {where}")
        found, problems = {one.name: self._one(one) for one in every}, []
        for key, table in sorted(sigmas.items(), key=lambda item: len(item[0])):  # components override
            plain = key.replace(" ", "")
            members = [one for one in every if one.name == plain or one.name.startswith(f"{plain}[")]
            given = table.sigma if isinstance(table.sigma, list) else [table.sigma] * len(members)
            try:
                if not members:
                    raise ValueError("is not among the parameters; name it there, or remove its prior")
                if len(given) != len(members):
                    raise ValueError(f"given {shown(given)} as sigma; one for each component is needed")
                for one, value in zip(members, given, strict=True):
                    sigma = _sigma(value, one, self._parameter(one))
                    found[one.name] = replace(found[one.name], sigma=sigma)
            except ValueError as error:
                problems.append(Problem(f'[fit] {known}."{key[:60]}"', str(error)))
        if problems:
            raise ConfigError(problems, self._experiment.source)
        return tuple(found.values())

    def _parameter(self, varied: VariedKey) -> Any:
        table, _, name = varied.name.partition(".")
        return self._experiment.config.parameters.get(name) if table == "parameters" else None

    def _one(self, varied: VariedKey) -> FitKey:
        suffix, unit, given = "", varied.unit, self._parameter(varied)
        if given is not None and given.unit:  # constants of expressions have units of their own
            found = unit_text(powers(given.unit)) or "rad"
            suffix = unit = f"rad{found[1:]}" if found.startswith("1/") else found
        places = tuple(str(place) for place in varied.places)
        size = abs(float(varied.number)) or abs(float(varied.size)) or 1.0
        return FitKey(varied.name, unit, float(varied.number), None, suffix, places, size)

    # --- other values ---------------------------------------------------------------------------------------

    def overrides(self, values: Sequence[float] | np.ndarray) -> list[str]:
        """``KEY=VALUE`` texts of values in the order of ``all``, every digit of the doubles written."""
        found = []
        turn = np.zeros(3)
        for one, value in zip(self.all, values, strict=True):
            if one.key.startswith(ATTITUDE):
                turn[int(one.key[-2])] = value
            else:
                number = repr(float(value))
                text = f'"{number} {one.suffix}"' if one.suffix else number
                found += [f"{place}={text}" for place in one.places]
        return [*(self._start(turn) if self._turned else ()), *found]

    def _start(self, turn: np.ndarray) -> list[str]:
        """The attitude at the start turned by a rotation vector, instead of whatever gives it."""
        initial = self.scene.config.initial
        given = np.array([float(x) for x in self.scene.quaternion])
        quaternion = multiplied(given[None, :], of_vector(turn[None, :]))[0]
        texts = [f"initial.{name}=" for name in _FORMS if getattr(initial, name) is not None]
        if initial.spin_period is not None:
            rates = ", ".join(repr(float(w)) for w in self.scene.angular_velocity)
            texts += ["initial.spin_period=", f"initial.angular_velocity=[{rates}]"]
        shown_values = ", ".join(repr(float(x)) for x in quaternion)
        return [*texts, f"initial.quaternion=[{shown_values}]"]

    def experiment(self, values: Sequence[float] | np.ndarray, base: Experiment) -> Experiment:
        """An experiment at other values, without a text of its own: for runs that nobody keeps."""
        tables = copy.deepcopy(self._tables)
        apply_overrides(tables, self.overrides(values), "fit")
        return replace(base, config=validated(tables, base.source))

    def fitted(self, values: Sequence[float] | np.ndarray) -> Experiment:
        """The config with estimated values written in, and without ``[fit]``."""
        everything = [*values, *(one.start for one in self.considered)]
        return self._experiment.having(["fit=", *self.overrides(everything)])


def _sigma(given: Any, varied: VariedKey, parameter: Any) -> float:
    """A standard deviation in SI, of a key or of a parameter."""
    anything = varied.name.startswith(("parameters", "states")) and varied.unit == "1"
    number = parse_number(given, "" if anything else varied.unit)
    needed = parameter.unit if parameter is not None else ""
    if number.unit and needed and powers(number.unit) != powers(needed):
        raise ValueError(f"given {shown(given)}, where {needed}, the parameter's unit, is needed")
    if not float(number) > 0:
        raise ValueError(f"given {shown(given)} as sigma; a standard deviation above zero is allowed")
    return float(number)
