"""Members of a sweep as the batch engine sees them: arrays that tell which value of each axis they have."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import heyoka as hy
import numpy as np

from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.scene.toml_text import key_steps
from rigidsim.solve.batch.replay import Index, SharedReals, real_of
from rigidsim.solve.batch.tracing import TRACED_TABLES

_HELD = 1 << 16  # values of axes that are held, each worked out once for all members that share it
_WHOLE = 1 << 11
"""Values up to which an axis of a product is worked out as a whole, once for all members."""


class AxisNumbers:
    """Values of a sweep's axes."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep = sweep
        self._words: dict[int, dict[str, int]] = {}
        self._whole: dict[int, list[np.ndarray]] = {}
        self._reals = lru_cache(_HELD)(self._reals_of)

    def traced(self, place: int) -> bool:
        """Whether an axis has numbers that can become parameters."""
        axis = self.sweep.axes[place]
        return axis.numeric and key_steps(axis.key, "axes")[0] in TRACED_TABLES

    def _reals_of(self, place: int, index: int) -> list[hy.real]:
        return [real_of(number) for number in self.sweep.axes[place].exact(index)]

    def columns(self, place: int, which: np.ndarray, *, whole: bool) -> list[SharedReals]:
        """The numbers that members have, a column for each key.

        Args:
            which: index of each one's value.
            whole: all values of the axis are worked out, if it isn't too long.
        """
        count = self.sweep.axes[place].values.count
        if whole and self.sweep.product and count <= _WHOLE:
            if place not in self._whole:
                self._whole[place] = self._columns(place, range(count))
            index, columns = Index(which, place), self._whole[place]
        else:
            needed, inverse = np.unique(which, return_inverse=True)
            index, columns = Index(inverse), self._columns(place, needed.tolist())
        return [SharedReals(column, index) for column in columns]

    def _columns(self, place: int, needed: Sequence[int]) -> list[np.ndarray]:
        return [np.array(column) for column in zip(*(self._reals(place, i) for i in needed), strict=True)]

    def codes(self, place: int, which: np.ndarray) -> np.ndarray:
        """Codes below the axis's length, equal for members whose axis values have the same text."""
        text = self.sweep.axes[place].values.text
        known = self._words.setdefault(place, {})
        needed, index = np.unique(which, return_inverse=True)
        found = [known.setdefault(text(i), len(known)) for i in needed.tolist()]
        return np.array(found, dtype=np.int64)[index]


class Members:
    """Members of a ``[sweep]`` as the batch engine sees them, renumbered from 0 in the order given.

    Args:
        members: all by default.
        axes: the sweep's axes, as far as they are worked out already.

    Attributes:
        keys: dotted keys of the numbers that become parameters, such as ``initial.angular_velocity[2]``.
        kinds: code of everything else that differs, such as a formulation or a time, (members,): members of
            different kinds belong to different families; zeros if nothing else differs.
    """

    def __init__(
        self, sweep: Sweep, members: Sequence[int] | None = None, axes: AxisNumbers | None = None
    ) -> None:
        self._chosen = np.arange(sweep.count) if members is None else np.asarray(members, dtype=np.int64)
        self._axes = AxisNumbers(sweep) if axes is None else axes
        self.sweep, self.count = sweep, len(self._chosen)
        self.keys: list[str] = []
        self.kinds = np.zeros(self.count, dtype=np.int64)
        self._traced: list[tuple[int, np.ndarray]] = []
        rows = np.unravel_index(self._chosen, sweep.shape) if sweep.product else None
        for place, axis in enumerate(sweep.axes):
            which = self._chosen if rows is None else rows[place]
            if self._axes.traced(place):
                self.keys += axis.columns
                self._traced.append((place, which))
            else:
                self.kinds = self.kinds * axis.values.count + self._axes.codes(place, which)

    def experiment(self, member: int) -> Experiment:
        """A member's own experiment."""
        return self.sweep.experiment_of(int(self._chosen[member]))

    def exact(self, member: int) -> list[ExactNumber]:
        """A member's exact numbers for ``keys``, SI."""
        return [x for place, which in self._traced for x in self.sweep.axes[place].exact(int(which[member]))]

    def columns(self, members: np.ndarray, *, whole: bool) -> list[SharedReals]:
        """The numbers of some members for each key (see ``AxisNumbers``)."""
        found: list[SharedReals] = []
        for place, which in self._traced:
            found += self._axes.columns(place, which[members], whole=whole)
        return found
