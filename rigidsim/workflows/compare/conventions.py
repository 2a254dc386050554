"""The convention that a trajectory is written in: the reading nearest to the experiment.

Mismatches are averaged as logarithms, over rows that lie closer together near the beginning: the right
reading is near there even if the motion is another one later, and wrong readings are of the order of a
radian at nearly all rows. Of readings that are equally near the plainest one is taken, and the others are
named, since this motion can't tell them apart.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from rigidsim.scene.rotations import quaternion_of
from rigidsim.scene.row_rotations import (
    SEQUENCES,
    angles_between,
    conjugated,
    multiplied,
    normalised,
    of_euler,
    turned,
    vector_of,
)
from rigidsim.store.many_rows import blocks_of, gathered, largest
from rigidsim.workflows.compare.columns import Attitudes

BODY_TO_SPACE, SPACE_TO_BODY = "body_to_space", "space_to_body"
_LEAST = 1e-9  # rad: mismatches below are alike
_ALIKE = 0.35  # of mean natural logarithms: readings within a factor of 1.4 are equally near
_OFFSET_GAIN = 3.0  # the same, that a constant offset has to gain: a factor of 20
_OFFSET_LEAST = 1e-5  # rad; a smaller one is another start rather than another frame
_UNLIKE = float(np.log(0.3))  # of relative mismatches: rates are near the experiment's in no reading
_RATE_UNITS = {
    "rad/s": 1.0,
    "deg/s": np.pi / 180,
    "rpm": np.pi / 30,
    "rad/day": 1 / 86400.0,
    "deg/day": np.pi / 180 / 86400.0,
}


@dataclass(frozen=True)
class Reading:
    """One way to read the attitude of a trajectory.

    Attributes:
        order: of a quaternion's columns: "wxyz" or "xyzw"; empty for others.
        sequence: of Euler angles, empty for others; ``fixed`` if the turns are about fixed axes.
        unit: of Euler angles, "rad" or "deg"; empty for others.
    """

    order: str = ""
    direction: str = BODY_TO_SPACE
    sequence: str = ""
    fixed: bool = False
    unit: str = ""

    def quaternions(self, given: Attitudes, rows: np.ndarray | slice) -> np.ndarray:
        """Attitudes (rows, 4) w x y z, body to space axes, as they are read in this way."""
        if given.quaternions is not None:
            values = given.quaternions[rows]
            found = values if self.order == "wxyz" else values[:, [3, 0, 1, 2]]
        elif given.matrices is not None:
            found = quaternion_of(given.matrices[rows])
        else:
            assert given.angles is not None
            angles = given.angles[rows] * (np.pi / 180 if self.unit == "deg" else 1.0)
            sequence = self.sequence
            if self.fixed:  # turns about fixed axes are those about the body's in the other order
                angles, sequence = angles[:, ::-1], sequence[::-1]
            found = of_euler(sequence, angles)
        found = normalised(found)
        return found if self.direction == BODY_TO_SPACE else conjugated(found)

    def __str__(self) -> str:
        words = [self.order and f"quaternion {self.order}", self.direction.replace("_", " ")]
        if self.sequence:
            words.insert(0, f"{self.sequence} about {'fixed' if self.fixed else 'body'} axes, {self.unit}")
        return ", ".join(word for word in words if word)


@dataclass(frozen=True)
class Frames:
    """A constant rotation between the axes of a trajectory and the experiment's.

    Attributes:
        side: "space" where the space axes differ, "body" where the body axes do, "none".
        turn: (4,) takes the trajectory's attitudes to the experiment's, from the left (space) or right.
    """

    side: str
    turn: np.ndarray

    def applied(self, quaternions: np.ndarray) -> np.ndarray:
        """Attitudes in the experiment's axes."""
        if self.side == "none":
            return quaternions
        return (
            multiplied(self.turn, quaternions) if self.side == "space" else multiplied(quaternions, self.turn)
        )

    def of_body(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors along the trajectory's body axes in the experiment's."""
        return turned(conjugated(self.turn), vectors) if self.side == "body" else vectors

    @property
    def angle(self) -> float:
        """Its angle, rad."""
        return 0.0 if self.side == "none" else float(np.linalg.norm(vector_of(self.turn)))


NONE = Frames("none", np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class FoundReading:
    """The convention of a trajectory.

    Attributes:
        score: mean logarithm of the mismatch, rad, with the experiment at the rows compared.
        undecided: other readings that are equally near.
    """

    reading: Reading
    frames: Frames
    score: float
    undecided: list[str]

    def quaternions(self, given: Attitudes) -> np.ndarray:
        """All attitudes in the experiment's convention and axes."""
        return gathered(
            self.frames.applied(self.reading.quaternions(given, rows)) for rows in blocks_of(len(given.times))
        )


def rows_compared(count: int) -> np.ndarray:
    """Rows that conventions are found by: all over the trajectory, more of them near its beginning."""
    even = np.linspace(0, count - 1, 150)
    early = np.geomspace(1, count, 100) - 1
    return np.unique(np.concatenate([even, early]).astype(int))


def find_convention(given: Attitudes, motion: np.ndarray, allowed: Collection[Reading] = ()) -> FoundReading:
    """The reading nearest to the experiment's attitudes (rows, 4), to which the trajectory may have further
    rows; of those allowed, if any.
    """
    rows = slice(len(motion))
    tried = []
    for cost, reading in enumerate(readings(given)):
        if allowed and reading not in allowed:
            continue
        read = reading.quaternions(given, rows)
        tried.append((_score(read, motion), cost, reading, NONE, read))
    best = min(tried, key=lambda x: x[0])[0]
    offset = []
    for _, cost, reading, _, read in tried:
        for side, turn in _turns(read[0], motion[0]):
            frames = Frames(side, turn)
            if frames.angle > _OFFSET_LEAST:
                score = _score(frames.applied(read), motion)
                offset.append((score, cost, reading, frames, read))
    if offset and min(x[0] for x in offset) < best - _OFFSET_GAIN:
        tried = offset
        best = min(x[0] for x in offset)
    near = sorted((x for x in tried if x[0] <= best + _ALIKE), key=lambda x: (x[1], x[3].side != "space"))
    score, _, reading, frames, _ = near[0]
    named = [f"{x[2]}{_axes(x[3])}" for x in near[1:]]
    return FoundReading(reading, frames, score, named)


def _axes(frames: Frames) -> str:
    return "" if frames.side == "none" else f", other {frames.side} axes"


def readings(given: Attitudes) -> Iterator[Reading]:
    """All ways to read an attitude, the plainest first."""
    directions = (BODY_TO_SPACE,) if given.trajectory.settled else (BODY_TO_SPACE, SPACE_TO_BODY)
    if given.quaternions is not None:
        orders = ("wxyz",) if given.named else ("wxyz", "xyzw")
        yield from (Reading(order=order, direction=d) for order in orders for d in directions)
    elif given.matrices is not None:
        yield from (Reading(direction=d) for d in directions)
    else:
        units = ["deg", "rad"] if _degrees(given) else ["rad", "deg"]
        if given.angle_unit in units:
            units = [given.angle_unit]
        for unit in units:
            for fixed in (False, True):
                for direction in directions:
                    yield from (
                        Reading(sequence=s, fixed=fixed, unit=unit, direction=direction) for s in SEQUENCES
                    )


def _degrees(given: Attitudes) -> bool:
    """Whether Euler angles look like degrees: beyond a few turns of radians."""
    assert given.angles is not None
    return largest(given.angles) > 4 * np.pi


def _score(read: np.ndarray, motion: np.ndarray) -> float:
    return float(np.mean(np.log(angles_between(read, motion) + _LEAST)))


def _turns(read: np.ndarray, motion: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The rotations that take the first attitude to the experiment's, from either side."""
    yield "space", normalised(multiplied(motion, conjugated(read)))
    yield "body", normalised(multiplied(conjugated(read), motion))


@dataclass(frozen=True)
class RateReading:
    """How angular velocities are read: unit, and axes ("body" or "space")."""

    unit: str
    axes: str

    def rates(self, given: np.ndarray, found: FoundReading, quaternions: np.ndarray) -> np.ndarray:
        """Angular velocities (rows, 3) in the experiment's body axes, rad/s.

        Args:
            quaternions: attitudes of the same rows in the experiment's convention and axes.
        """
        values = given * _RATE_UNITS[self.unit]
        if self.axes == "body":
            return found.frames.of_body(values)
        if found.frames.side == "space":
            values = turned(found.frames.turn, values)
        return turned(conjugated(quaternions), values)


def possible_rates(given: Attitudes) -> list[RateReading]:
    """Units and axes in which rates may be written, the plainest first."""
    units = [given.rate_unit] if given.rate_unit in _RATE_UNITS else list(_RATE_UNITS)
    return [RateReading(str(unit), axes) for unit in units for axes in ("body", "space")]


def find_rates(
    given: Attitudes,
    found: FoundReading,
    quaternions: np.ndarray,
    motion: np.ndarray,
    allowed: Collection[RateReading] = (),
) -> tuple[RateReading, list[str]]:
    """The reading of rates nearest to the experiment's (rows, 3), and others that are equally near.

    Args:
        quaternions: attitudes of its rows as the trajectory has them, in the experiment's convention.
        allowed: readings that may be taken; any if there are none.
    """
    assert given.rates is not None
    size = float(np.sqrt(np.mean(np.sum(motion**2, axis=1)))) or 1.0
    tried = []
    for reading in possible_rates(given):
        if allowed and reading not in allowed:
            continue
        read = reading.rates(given.rates, found, quaternions)
        apart = np.linalg.norm(read - motion, axis=1) / size
        tried.append((float(np.mean(np.log(apart + _LEAST))), reading))
    best = min(score for score, _ in tried)
    near = [reading for score, reading in tried if score <= best + _ALIKE]
    if not allowed and best > _UNLIKE:  # near in no unit: as the columns are named
        near = [reading for _, reading in tried[:1]]
    return near[0], [f"rates along {x.axes} axes, {x.unit}" for x in near[1:]]
