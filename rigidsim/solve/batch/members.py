"""Members of a sweep as the batch engine sees them: arrays that tell which value of each axis they have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.overrides import key_steps
from rigidsim.scene.sweeps.sweep import Axis, Sweep
from rigidsim.scene.sweeps.values import Ratios
from rigidsim.solve.batch.double_double import Doubled
from rigidsim.solve.batch.exact_doubles import quotients_in_two_doubles
from rigidsim.solve.batch.replay import Distinct, Swept
from rigidsim.solve.batch.tracing import TRACED_TABLES

_HELD = 1 << 21
"""Largest count of an axis's numbers that are kept: 50 MB; those of a longer one are drawn whenever members
are looked at.
"""


class _AxisColumn(Sequence[ExactNumber]):
    """One number of some of an axis's values, each worked out when it is asked for."""

    def __init__(self, axis: Axis, column: int, indices: Sequence[int]) -> None:
        self._axis, self._column, self._indices = axis, column, indices

    def __len__(self) -> int:
        return len(self._indices)

    def __getitem__(self, index: Any) -> Any:
        return self._axis.exact(int(self._indices[index]))[self._column]


class _Quotients:
    """The values of an axis that are quotients of whole numbers, in two doubles, as far as they are known."""

    def __init__(self, axis: Axis, ratios: Ratios) -> None:
        self._ratios = ratios
        count, columns = axis.values.count, len(axis.columns)
        self._parts = np.empty((columns, 3, count))
        self._known = np.zeros(count, dtype=bool)
        self._values = [_AxisColumn(axis, column, range(count)) for column in range(columns)]

    def columns(self, which: np.ndarray) -> list[Swept]:
        """See ``AxisNumbers``."""
        new = np.unique(which[~self._known[which]])
        if len(new):
            for part, found in zip(self._parts, self._ratios(new.tolist()), strict=True):
                made = quotients_in_two_doubles(*found)
                part[:, new] = made.high, made.low, made.error
            self._known[new] = True
        return [
            Swept(Distinct(values, Doubled(*part)), which)
            for values, part in zip(self._values, self._parts, strict=True)
        ]

    @property
    def nearest(self) -> np.ndarray | None:
        """The doubles nearest to all values, (count, columns); None if some aren't known."""
        return self._parts[:, 0].T if self._known.all() else None


class AxisNumbers:
    """Values of a sweep's axes, each worked out once, however many members share it."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._whole: dict[int, list[Distinct]] = {}
        self._quotients: dict[int, _Quotients] = {}
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
        ratios = axis.values.ratios
        if ratios is not None and axis.values.count * len(axis.columns) <= _HELD:
            if place not in self._quotients:
                self._quotients[place] = _Quotients(axis, ratios)
            return self._quotients[place].columns(which)
        if place not in self._whole and axis.values.count <= len(which):
            self._whole[place] = self._distinct(place, range(axis.values.count))
        if place in self._whole:
            return [Swept(distinct, which) for distinct in self._whole[place]]
        needed, index = np.unique(which, return_inverse=True)
        return [Swept(distinct, index) for distinct in self._distinct(place, needed.tolist())]

    def _distinct(self, place: int, indices: Sequence[int]) -> list[Distinct]:
        axis = self._sweep.axes[place]
        columns = range(len(axis.columns))
        if axis.values.ratios is not None:
            found = [quotients_in_two_doubles(*ratio) for ratio in axis.values.ratios(indices)]
            return [Distinct(_AxisColumn(axis, n, indices), found[n]) for n in columns]
        entries = [axis.exact(index) for index in indices]
        return [Distinct([entry[n] for entry in entries]) for n in columns]

    def nearest(self, place: int) -> np.ndarray | None:
        """The doubles nearest to all values of an axis, (values, components), if they are known already."""
        held = self._quotients.get(place)
        return None if held is None else held.nearest

    def codes(self, place: int, which: np.ndarray) -> np.ndarray:
        """Codes below the axis's length, equal for members whose axis values have the same text."""
        text = self._sweep.axes[place].values.text
        known = self._words.setdefault(place, {})
        needed, index = np.unique(which, return_inverse=True)
        found = [known.setdefault(text(i), len(known)) for i in needed.tolist()]
        return np.array(found, dtype=np.int64)[index]


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
        rows = np.unravel_index(chosen, sweep.shape) if sweep.product else (chosen,) * len(sweep.axes)
        keys: list[str] = []
        numbers: list[Swept] = []
        kinds: np.ndarray | None = None
        for place, (axis, which) in enumerate(zip(sweep.axes, rows, strict=True)):
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
