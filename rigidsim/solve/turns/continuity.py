"""What joins a block of samples to the one before, as a value and as numbers of a checkpoint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.checkpoint_arrays import Arrays


@dataclass
class Continuity:
    """What joins the variables of a block of samples to those of the block before.

    Attributes:
        turns: full turns added to the joined angles, (angles,).
        last_angles, last_quaternion: latest sample's values, float64, the angles before those turns; None
            before the first block.
        last_time, last_state: the latest sample's, float64, internal units, if turns are counted from it.
        wrapped_from: time (internal units) of the first sample with unknown turns: from there on, angles
            are recorded within one turn; nan if all are known, and -inf for states that aren't samples.
    """

    turns: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    last_angles: np.ndarray | None = None
    last_quaternion: np.ndarray | None = None
    last_time: float = math.nan
    last_state: np.ndarray | None = None
    wrapped_from: float = math.nan

    def pack(self) -> Arrays:
        """It as arrays of a checkpoint."""
        arrays = {"joined_turns": self.turns, "joined_wrapped": np.array([self.wrapped_from])}
        if self.last_angles is not None:
            arrays["joined_angles"] = self.last_angles
        if self.last_quaternion is not None:
            arrays["joined_quaternion"] = self.last_quaternion
        if self.last_state is not None:
            arrays |= {"joined_state": self.last_state, "joined_time": np.array([self.last_time])}
        return arrays

    @classmethod
    def unpacked(cls, arrays: Mapping[str, np.ndarray]) -> Continuity:
        """Restored from them."""
        return cls(
            np.asarray(arrays.get("joined_turns", np.zeros(3)), dtype=np.int64),
            arrays.get("joined_angles"),
            arrays.get("joined_quaternion"),
            float(arrays.get("joined_time", [math.nan])[0]),
            arrays.get("joined_state"),
            float(arrays.get("joined_wrapped", [math.nan])[0]),
        )
