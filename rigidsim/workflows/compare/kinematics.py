"""Conventions of a trajectory by its own numbers: those in which its attitude turns at its rates.

From a row to the next an attitude turns by the mean of the rates at both, up to (rate x interval)^2 / 12 of
it, whatever acts on the body and whatever its moments are. A constant turn of the axes changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.scene.row_rotations import conjugated, multiplied, vector_of
from rigidsim.workflows.compare.columns import Attitudes
from rigidsim.workflows.compare.conventions import (
    NONE,
    FoundReading,
    RateReading,
    Reading,
    possible_rates,
    readings,
    rows_compared,
)

_LEAST, _ALIKE = 1e-9, 0.35  # as those of conventions, of relative mismatches
_GOOD = float(np.log(0.1))  # mean logarithm of the mismatch, above which no reading is right
_FASTEST = 0.7  # rad from row to row, above which turns don't tell rates


@dataclass(frozen=True)
class Turning:
    """A reading of attitude and rates that obeys kinematics: mismatch (mean logarithm, relative)."""

    mismatch: float
    reading: Reading
    rates: RateReading


def turning_readings(given: Attitudes, second: float) -> list[Turning]:
    """The readings that obey kinematics about equally well, the plainest first; none where rows are too far
    apart to tell, or where none does.

    Args:
        second: s, the trajectory's unit of time.
    """
    if given.rates is None:
        return []
    rows = rows_compared(len(given.times) - 1)
    here, there = given.at(rows), given.at(rows + 1)
    assert here.rates is not None
    assert there.rates is not None
    steps = (there.times * second - here.times * second)[:, None]
    every = slice(None)
    tried = []
    for reading in readings(given):
        found = FoundReading(reading, NONE, 0.0, [])
        before, after = reading.quaternions(here, every), reading.quaternions(there, every)
        turns = vector_of(multiplied(conjugated(before), after))
        if np.median(np.linalg.norm(turns, axis=1)) > _FASTEST:
            continue
        for plain in possible_rates(given):
            mean = (plain.rates(here.rates, found, before) + plain.rates(there.rates, found, after)) / 2
            size = float(np.linalg.norm(mean, axis=1).mean()) or 1.0
            apart = np.linalg.norm(turns / steps - mean, axis=1) / size
            mismatch = float(np.mean(np.log(apart + _LEAST)))
            tried.append(Turning(mismatch, reading, plain))
    best = min((one.mismatch for one in tried), default=0.0)
    return [one for one in tried if one.mismatch <= best + _ALIKE] if best < _GOOD else []
