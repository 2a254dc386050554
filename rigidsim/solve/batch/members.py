"""Members of a sweep as the batch engine sees them: arrays that tell which value of each axis they have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.config import Experiment
from rigidsim.scene.overrides import key_steps
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.batch.replay import Distinct, Swept
from rigidsim.solve.batch.tracing import TRACED_TABLES


class AxisNumbers:
    """Values of a sweep's axes, each worked out once, however many members share it."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._whole: dict[int, list[Distinct]] = {}
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
        if place not in self._whole and axis.values.count <= len(which):
            self._whole[place] = self._distinct(place, range(axis.values.count))
        if place in self._whole:
            return [Swept(distinct, which) for distinct in self._whole[place]]
        needed, index = np.unique(which, return_inverse=True)
        return [Swept(distinct, index) for distinct in self._distinct(place, needed.tolist())]

    def _distinct(self, place: int, indices: Sequence[int]) -> list[Distinct]:
        axis = self._sweep.axes[place]
        entries = [axis.exact(index) for index in indices]
        return [Distinct([entry[i] for entry in entries]) for i in range(len(axis.columns))]

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
