"""Derivatives of a motion by numbers of its config, without a run: for fits, and at any values of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.solve.by_keys import KeyTangents, Rows, parametrised, refuse_without_derivatives, turned
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.problem import prepare
from rigidsim.solve.tangents import LostTangents

_WHERE = "keys"
_KNOWN = ("quaternion", "angular_velocity", "position", "velocity")


@dataclass(frozen=True)
class Sensitivities:
    """A motion and its derivatives by k keys at n times, float64, SI.

    Attributes:
        keys: the numbers, vectors component by component, in the order given.
        times: (n,), s.
        attitude: (n, 4), unit quaternion w x y z, body to space axes.
        angular_velocity: (n, 3), rad/s, body axes.
        position, velocity: (n, 3), m and m/s, space axes; None unless the body moves.
        d_attitude: (n, k, 3), rotation vector, space axes, rad per SI unit of the key.
        d_angular_velocity, d_position, d_velocity: (n, k, 3), in the axes of what they are of.
        extra: of each other variable (rotors, a core, user-defined states, and those asked for) its values
            (n, components) and derivatives (n, k, components).
    """

    keys: tuple[str, ...]
    times: np.ndarray
    attitude: np.ndarray
    angular_velocity: np.ndarray
    position: np.ndarray | None
    velocity: np.ndarray | None
    d_attitude: np.ndarray
    d_angular_velocity: np.ndarray
    d_position: np.ndarray | None
    d_velocity: np.ndarray | None
    extra: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


def sensitivities(
    experiment: Experiment, keys: Sequence[str], times: Sequence[float] | np.ndarray
) -> Sensitivities:
    """The motion of an experiment and its derivatives by numbers of its config at ascending times (s).

    Raises:
        ConfigError: a key that isn't a number of the motion, a scene without derivatives (single precision,
            averages, kinks), or times before the start.
    """
    return Tangents(experiment, keys).at({}, times)


class Tangents:
    """The derivatives of an experiment's motion by some keys, compiled once for any values of these.

    Args:
        record: further variables, by the names of ``[output] record``, for ``Sensitivities.extra``.
        quickly: to derivatives right to some 1e-7, where the motion allows it.
        where: the part of a config that names the keys, for errors.

    Raises:
        ConfigError: see ``sensitivities``.
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

    @property
    def keys(self) -> tuple[str, ...]:
        """The numbers, vectors component by component, in the order given."""
        return tuple(key.name for key in self._parametrised.keys)

    @property
    def units(self) -> tuple[str, ...]:
        """Their SI units; "1" for none or one that the config doesn't give."""
        return tuple(key.unit for key in self._parametrised.keys)

    @property
    def values(self) -> np.ndarray:
        """Their values in the config, (k,), SI; zero for ``initial.attitude``."""
        return np.array([float(key.number) for key in self._parametrised.keys])

    def at(self, values: Mapping[str, float], times: Sequence[float] | np.ndarray) -> Sensitivities:
        """The motion and its derivatives at some values of the keys, the config's where none is given.

        Args:
            values: SI, by names in ``keys``; of ``initial.attitude`` from the config's start.
            times: ascending, s, from the start on.

        Raises:
            ConfigError: a name that isn't in ``keys``, a scene that there isn't, times before the start, or a
                motion or derivatives that don't stay finite.
        """
        if unknown := [name for name in values if name not in self.keys]:
            what = f'given a value for "{unknown[0]}"; allowed: {", ".join(self.keys)}'
            raise ConfigError(Problem(_WHERE, what), self._source)
        clock = np.asarray(times, dtype=np.float64)
        try:
            return self._sensitivities(clock, self.rows(values, clock))
        except LostTangents as error:
            raise ConfigError(Problem(_WHERE, f"the motion can't be differentiated: {error}")) from None

    def rows(self, values: Mapping[str, float], times: np.ndarray) -> Rows:
        """The same as it comes: all variables in SI.

        Raises:
            ConfigError: see ``at``.
            LostTangents: the motion or derivatives don't stay finite.
        """
        self._move_to(values)
        internal = self._internal(times)
        if not len(internal):
            raise ConfigError(Problem("times", "given none; at least one is allowed"), self._source)
        return self._tangents.at(internal)

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

    def _sensitivities(self, times: np.ndarray, rows: Rows) -> Sensitivities:
        quaternion, by = rows.values["quaternion"], rows.slopes
        norm = np.sqrt((quaternion.astype(np.float64) ** 2).sum(axis=1))[:, None]
        values = {name: x.astype(np.float64) for name, x in rows.values.items()}
        slopes = {name: x.astype(np.float64) for name, x in by.items()}
        return Sensitivities(
            self.keys,
            times,
            values["quaternion"] / norm,
            values["angular_velocity"],
            values.get("position"),
            values.get("velocity"),
            turned(quaternion, by["quaternion"]).astype(np.float64),
            slopes["angular_velocity"],
            slopes.get("position"),
            slopes.get("velocity"),
            {name: (x, slopes[name]) for name, x in values.items() if name not in _KNOWN},
        )
