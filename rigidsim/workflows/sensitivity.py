"""Derivatives of a motion by numbers of its config, without a run: for fits, and at any values of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.scene.row_rotations import normalised
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
    ) -> None:
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

    def at(self, values: Mapping[str, float], times: Sequence[float] | np.ndarray) -> Rows:
        """The motion and its derivatives at some values of the keys, the config's where none is given.

        Args:
            values: SI, by names of keys, vectors component by component; of ``initial.attitude`` from the
                config's start.
            times: ascending, s, from the start on.

        Returns:
            All variables in doubles. Attitudes are unit quaternions w x y z, body to space axes, and their
            derivatives rotation vectors, space axes, rad per SI unit of the key.

        Raises:
            ConfigError: a name that is no key's, a scene that there isn't, times before the start, or a
                motion or derivatives that don't stay finite.
        """
        keys = [key.name for key in self._parametrised.keys]
        if unknown := [name for name in values if name not in keys]:
            what = f'given a value for "{unknown[0]}"; allowed: {", ".join(keys)}'
            raise ConfigError(Problem(_WHERE, what), self._source)
        try:
            self._move_to(values)
            internal = self._internal(np.asarray(times, dtype=np.float64))
            if not len(internal):
                raise ConfigError(Problem("times", "given none; at least one is allowed"), self._source)
            rows = self._tangents.at(internal)
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

    def _internal(self, times: np.ndarray) -> np.ndarray:
        """Times in the units of the equations, in the run's precision."""
        scene, scaling = self._parametrised.plain.scene, self._parametrised.plain.scaling
        way = scaling.direction
        order, side = ("ascending", "later") if way > 0 else ("descending", "earlier")
        if times.ndim != 1 or not np.isfinite(times).all() or (way * np.diff(times) < 0).any():
            what = f"given others; finite times in {order} order, in a plain sequence, are allowed"
            raise ConfigError(Problem("times", what), self._source)
        if len(times) and way * times[0] < way * scene.start:
            what = f"given {times[0]:g} s, where the run starts at {float(scene.start):g} s; "
            raise ConfigError(Problem("times", what + f"{side} times are allowed"), self._source)
        return self._precision.of_doubles(way * np.ldexp(times, -scaling.time))
