"""Derivatives of a motion by numbers of its config, without a run: for fits, and at any values of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.scene.rotations import normalised
from rigidsim.scene.scene import Scene
from rigidsim.solve.by_keys import KeyTangents, Rows, parametrised, refuse_without_derivatives, turned
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.problem import prepare
from rigidsim.solve.tangents import LostTangents

_WHERE = "keys"
_ATTITUDE = "quaternion"


class Tangents:
    """The derivatives of an experiment's motion by some keys, compiled once for any values of these.

    Args:
        record: further variables, by the names of ``[output] record``.
        quickly: to derivatives right to some 1e-7, where the motion allows it.
        where: the part of a config that names the keys, for errors.
        times: s, for which it's made at once. A motion away from the config's end is compiled apart.

    Raises:
        ConfigError: a key that isn't a number of the motion, or a scene without derivatives (single
            precision, averages, kinks).
    """

    def __init__(
        self,
        experiment: Experiment,
        keys: Sequence[str],
        *,
        record: Sequence[str] = (),
        loads: Sequence[Load] = (),
        quickly: bool = False,
        where: str = _WHERE,
        times: Sequence[float] | np.ndarray = (),
    ) -> None:
        self._experiment = experiment
        self._make = partial(_OneWay, keys=keys, record=record, loads=loads, quickly=quickly, where=where)
        self._own = self._make(experiment)
        self._other: _OneWay | None = None
        for way in experiment.ways(np.sort(times).tolist()):
            self._along(way)

    def at(self, values: Mapping[str, float], times: Sequence[float] | np.ndarray) -> Rows:
        """The motion and its derivatives at some values of the keys, the config's where none is given.

        Args:
            values: SI, by names of keys, vectors component by component; of ``initial.attitude`` from the
                config's start.
            times: s, in any order, before the start or after it.

        Returns:
            All variables in doubles. Attitudes are unit quaternions w x y z, body to space axes, and their
            derivatives rotation vectors, space axes, rad per SI unit of the key.

        Raises:
            ConfigError: a name that is no key's, a scene that there isn't, or a motion or derivatives that
                don't stay finite.
        """
        given = np.asarray(times, dtype=np.float64)
        if given.ndim != 1 or not len(given) or not np.isfinite(given).all():
            what = "given others; finite times in a plain sequence, at least one, are allowed"
            raise ConfigError(Problem("times", what), self._experiment.source)
        each, places = np.unique(given, return_inverse=True)
        back, on = self._experiment.ways(each.tolist())
        parts = [motion.at(values, way) for way in (back, on) if (motion := self._along(way)) is not None]
        order = np.r_[len(back) - 1 : -1 : -1, len(back) : len(each)][places]

        def joined(name: str) -> dict[str, np.ndarray]:
            first = getattr(parts[0], name)
            return {key: np.concatenate([getattr(part, name)[key] for part in parts])[order] for key in first}

        return Rows(joined("values"), joined("slopes"))

    def _along(self, way: Sequence[Fraction]) -> _OneWay | None:
        """The motion from the start along these times; None where there are none."""
        if not way:
            return None
        run = self._own.scene.samples
        if way[-1] == run.begin or (way[-1] < run.begin) == (run.direction < 0):
            return self._own
        reach = abs(way[-1] - run.begin)
        if self._other is None or reach > abs(self._other.scene.samples.exact_last - run.begin):
            self._other = self._make(self._experiment.quiet(times=[way[-1]]))
        return self._other


class _OneWay:
    """The same in the direction in which an experiment runs."""

    def __init__(
        self, experiment: Experiment, *, keys: Sequence[str], record: Sequence[str], loads: Sequence[Load],
        quickly: bool, where: str,
    ) -> None:  # fmt: skip
        prepared = prepare(experiment, loads=loads)
        of = prepared.scene, prepared.system
        try:
            refuse_without_derivatives(*of, has_steps=prepared.has_steps, where=where)
            self._parametrised = parametrised(experiment, keys, loads, where, record)
        except ConfigError as error:
            raise error.at(experiment.source) from None
        self._precision, self._source, self._quickly = prepared.precision, experiment.source, quickly
        self._at = list(self._parametrised.values)
        self._tangents = self._compiled()

    @property
    def scene(self) -> Scene:
        """Of the config's values."""
        return self._parametrised.plain.scene

    def at(self, values: Mapping[str, float], times: Sequence[Fraction]) -> Rows:
        """See ``Tangents``; times from the start on."""
        keys = [key.name for key in self._parametrised.keys]
        if unknown := [name for name in values if name not in keys]:
            what = f'given a value for "{unknown[0]}"; allowed: {", ".join(keys)}'
            raise ConfigError(Problem(_WHERE, what), self._source)
        try:
            self._move_to(values)
            rows = self._tangents.at(self._internal(times))
        except LostTangents as error:
            raise ConfigError(Problem(_WHERE, f"the motion can't be differentiated: {error}")) from None
        found = ({name: x.astype(np.float64) for name, x in of.items()} for of in (rows.values, rows.slopes))
        plain = Rows(*found)
        if _ATTITUDE in plain.values:
            plain.values[_ATTITUDE] = normalised(plain.values[_ATTITUDE])
            slopes = turned(rows.values[_ATTITUDE], rows.slopes[_ATTITUDE])
            plain.slopes[_ATTITUDE] = slopes.astype(np.float64)
        return plain

    def _move_to(self, values: Mapping[str, float]) -> None:
        """Begin anew with these values, compiled again where the equations have another form."""
        keys, context = self._parametrised.keys, self._parametrised.context
        wanted = [Fraction(values[key.name]) if key.name in values else key.value(context) for key in keys]
        if wanted == self._at:
            self._tangents.begin()
            return
        self._at, coefficients = wanted, self._parametrised.at(wanted)
        if coefficients is None:
            self._parametrised = self._parametrised.made_at(wanted)
            self._tangents = self._compiled()
        else:
            self._tangents.use(coefficients)

    def _compiled(self) -> KeyTangents:
        return interruptible(lambda: KeyTangents(self._parametrised, self._precision, quickly=self._quickly))

    def _internal(self, times: Sequence[Fraction]) -> np.ndarray:
        """Times in the units of the equations, in the run's precision."""
        scene, scaling = self.scene, self._parametrised.plain.scaling
        doubles = np.array([float(time) for time in times])
        found = self._precision.of_doubles(scaling.direction * np.ldexp(doubles, -scaling.time))
        found[doubles == float(scene.start)] = self._precision.number(self._parametrised.plain.start)
        return found
