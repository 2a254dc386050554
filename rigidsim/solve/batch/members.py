"""Members of a sweep as the batch engine sees them: arrays that tell which value of each axis they have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.overrides import key_steps
from rigidsim.scene.sweeps.draws import DrawnValues
from rigidsim.scene.sweeps.sweep import Axis, Sweep
from rigidsim.solve.batch.double_double import Doubled
from rigidsim.solve.batch.exact_doubles import Distinct, Swept, drawn_in_two_doubles
from rigidsim.solve.batch.tracing import TRACED_TABLES

_HELD = 1 << 21
"""Largest count of an axis's numbers that are kept: 50 MB; those of a longer one are drawn whenever members
are looked at.
"""
_AT_ONCE = 4096  # values that are worked out together


class _AxisColumn(Sequence[ExactNumber]):
    """One number of some of an axis's values, each worked out when it is asked for."""

    def __init__(self, axis: Axis, column: int, indices: Sequence[int]) -> None:
        self._axis, self._column, self._indices = axis, column, indices

    def __len__(self) -> int:
        return len(self._indices)

    def __getitem__(self, index: Any) -> Any:
        return self._axis.exact(int(self._indices[index]))[self._column]


class _Drawn:
    """The values of an axis that are drawn at random, in two doubles, as far as they are known."""

    def __init__(self, axis: Axis, drawn: Sequence[DrawnValues]) -> None:
        self._drawn = drawn
        count, columns = axis.values.count, len(axis.columns)
        self._parts = np.empty((columns, 3, count))
        self._known = np.zeros(count, dtype=bool)
        self._values = [_AxisColumn(axis, column, range(count)) for column in range(columns)]

    def columns(self, which: np.ndarray) -> list[Swept]:
        """See ``AxisNumbers``."""
        new = np.unique(which[~self._known[which]])
        if len(new):
            for part, values in zip(self._parts, self._drawn, strict=True):
                made = drawn_in_two_doubles(values, new)
                part[:, new] = made.high, made.low, made.error
            self._known[new] = True
        return [
            Swept(Distinct(values, Doubled(*part)), which)
            for values, part in zip(self._values, self._parts, strict=True)
        ]


class AxisNumbers:
    """Values of a sweep's axes, each worked out once, however many members share it."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._whole: dict[int, list[Distinct]] = {}
        self._drawn: dict[int, _Drawn] = {}
        self._words: dict[int, dict[str, int]] = {}

    def traced(self, place: int) -> bool:
        """Whether an axis has numbers that can become parameters."""
        axis = self._sweep.axes[place]
        return axis.numeric and key_steps(axis.key, "axes")[0] in TRACED_TABLES

    def columns(self, place: int, which: np.ndarray) -> list[Swept]:
        """The numbers of an axis that members have, one column for each key.

        Args:
            which: index of the axis value that each member has, (members,).
        """
        axis = self._sweep.axes[place]
        drawn = self._drawn_of(place)
        if drawn is not None:
            return drawn.columns(which)
        if place not in self._whole and axis.values.count <= len(which):
            self._whole[place] = self._distinct(place, range(axis.values.count), kept=True)
        if place in self._whole:
            return [Swept(distinct, which) for distinct in self._whole[place]]
        needed, index = np.unique(which, return_inverse=True)
        return [Swept(distinct, index) for distinct in self._distinct(place, needed.tolist())]

    def _drawn_of(self, place: int) -> _Drawn | None:
        """The numbers of an axis that are kept because they are drawn at random; None for other axes."""
        axis = self._sweep.axes[place]
        drawn = axis.values.drawn
        if drawn is None or axis.values.count * len(axis.columns) > _HELD:
            return None
        if place not in self._drawn:
            self._drawn[place] = _Drawn(axis, drawn)
        return self._drawn[place]

    def look_at(self, members: np.ndarray) -> None:
        """Work out numbers of members that take their time, for whatever needs them later."""
        for place, which in enumerate(_rows(self._sweep, members)):
            drawn = self._drawn_of(place)
            if drawn is not None:
                drawn.columns(which)

    def _distinct(self, place: int, indices: Sequence[int], *, kept: bool = False) -> list[Distinct]:
        axis = self._sweep.axes[place]
        columns = range(len(axis.columns))
        if axis.values.drawn is not None:
            which = np.asarray(indices, dtype=np.int64)
            found = [drawn_in_two_doubles(values, which) for values in axis.values.drawn]
            return [Distinct(_AxisColumn(axis, n, indices), found[n], kept=kept) for n in columns]
        entries = [axis.exact(index) for index in indices]
        return [Distinct([entry[n] for entry in entries], kept=kept) for n in columns]

    def nearest(self, place: int) -> np.ndarray | None:
        """The doubles nearest to all values of an axis, (values, components); None if they aren't drawn at
        random.
        """
        values = self._sweep.axes[place].values
        if values.drawn is None:
            return None
        table = np.empty((values.count, len(values.drawn)))
        for first in range(0, values.count, _AT_ONCE):
            which = np.arange(first, min(first + _AT_ONCE, values.count))
            for column, swept in enumerate(self.columns(place, which)):
                table[which, column] = swept.nearest
        return table

    def codes(self, place: int, which: np.ndarray) -> np.ndarray:
        """Codes below the axis's length, equal for members whose axis values have the same text."""
        text = self._sweep.axes[place].values.text
        known = self._words.setdefault(place, {})
        needed, index = np.unique(which, return_inverse=True)
        found = [known.setdefault(text(i), len(known)) for i in needed.tolist()]
        return np.array(found, dtype=np.int64)[index]


def _rows(sweep: Sweep, members: np.ndarray) -> Sequence[np.ndarray]:
    """The index of the value that each member has, for each axis."""
    return np.unravel_index(members, sweep.shape) if sweep.product else (members,) * len(sweep.axes)


@dataclass(frozen=True)
class Members:
    """Members of a sweep as the batch engine sees them.

    Attributes:
        base: the experiment that they vary.
        keys: dotted keys of the numbers that become parameters, such as ``initial.angular_velocity[2]``.
        numbers: for each key the members' exact numbers, SI.
        experiment: function from a member to its own experiment.
        kinds: code of everything else that differs, such as a formulation or a time, (members,):
            members of different kinds belong to different families; None if nothing else differs.
    """

    base: Experiment
    keys: Sequence[str]
    numbers: Sequence[Swept]
    experiment: Callable[[int], Experiment]
    count: int
    kinds: np.ndarray | None = None

    @classmethod
    def of(
        cls, sweep: Sweep, members: Sequence[int] | None = None, axes: AxisNumbers | None = None
    ) -> Members:
        """Members of a ``[sweep]``, all by default, renumbered from 0 in the order given.

        Args:
            axes: the sweep's axes, as far as they are worked out already.
        """
        chosen = np.arange(sweep.count) if members is None else np.asarray(members, dtype=np.int64)
        axes = AxisNumbers(sweep) if axes is None else axes
        keys: list[str] = []
        numbers: list[Swept] = []
        kinds: np.ndarray | None = None
        for place, (axis, which) in enumerate(zip(sweep.axes, _rows(sweep, chosen), strict=True)):
            if axes.traced(place):
                keys += axis.columns
                numbers += axes.columns(place, which)
                continue
            codes = axes.codes(place, which)
            kinds = codes if kinds is None else kinds * axis.values.count + codes

        def experiment(member: int) -> Experiment:
            return sweep.experiment_of(int(chosen[member]))

        return cls(sweep.base, keys, numbers, experiment, len(chosen), kinds)

    def kind(self, member: int) -> Any:
        """What a member's family must share besides its equations."""
        return None if self.kinds is None else int(self.kinds[member])
