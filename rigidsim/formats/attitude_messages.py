"""What rows of CCSDS messages mean: attitudes from body to space axes and rates along body axes (AEM), the
path in SI (OEM).

Conventions of annex F of 504.0-B-2. The quaternion from frame A to frame B turns the axes of A into those of
B, so that it turns a vector's coordinates in B into those in A; Euler angles from A to B are intrinsic turns;
the angular velocity from A to B is how B turns as seen from A. Spin angles place the Z axis of the body: the
attitude is turns by alpha + 90 deg, 90 deg - delta and the spin angle about Z, X, Z.

Version 1 has ATTITUDE_DIR for the direction. Its rates (``/RATE``) are components of the angular velocity by
the standard (annex J of 504.0-B-2), and derivatives of Euler angles as other programs write them: the
reading is taken by which the attitude turns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.digits import FEW, written_resolution
from rigidsim.formats.messages import MessageSegment, read_segments
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.rotations import rotation_matrix
from rigidsim.scene.row_rotations import (
    SEQUENCES,
    TURNS,
    conjugated,
    multiplied,
    normalised,
    of_euler,
    turned,
    vector_of,
)
from rigidsim.scene.space_axes import EQUATOR, SpaceAxes

MESSAGE_COLUMNS = {
    "quaternion": ("qw", "qx", "qy", "qz"), "angular_velocity": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz"),
}  # fmt: skip
"""Names of a message's columns by the variable that they are."""
_ORBIT = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_ACCELERATION = ("X_DDOT", "Y_DDOT", "Z_DDOT")
_KM = 1000.0
_QUATERNION = ("Q1", "Q2", "Q3", "QC")
_ANGLES = ("ANGLE_1", "ANGLE_2", "ANGLE_3")
_ATTITUDES = {
    "QUATERNION": _QUATERNION, "EULER_ANGLE": _ANGLES,
    "SPIN": ("SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", "SPIN_ANGLE_VEL"),
}  # fmt: skip
_RATES = {
    "ANGVEL": ("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z"), "RATE": ("X_RATE", "Y_RATE", "Z_RATE"),
    "NUTATION": ("NUTATION", "NUTATION_PER", "NUTATION_PHASE"),
    "NUTATION_MOM": ("MOMENTUM_ALPHA", "MOMENTUM_DELTA", "NUTATION_VEL"),
}  # fmt: skip
_OF = {
    "QUATERNION": ("", "DERIVATIVE", "ANGVEL", "RATE"), "EULER_ANGLE": ("", "DERIVATIVE", "ANGVEL", "RATE"),
    "SPIN": ("", "NUTATION", "NUTATION_MOM"),
}  # fmt: skip
TYPES = tuple(f"{kind}/{rate}".rstrip("/") for kind, rates in _OF.items() for rate in rates)
_INERTIAL = re.compile(r"(EME ?2000|J2000|ICRF ?\d*|GCRF ?\d*)")
_BODY = re.compile(
    r"(SC BODY|ACC|ACTUATOR|AST|CSS|DSS|ESA|GYRO( FRAME)?|IMU FRAME|INSTRUMENT|MTA|RW|SA|SENSOR|STARTRACKER"
    r"|TAM)( ?\w{1,3})?"
)
_RADIAN = np.pi / 180
_GOOD, _FASTEST = 0.1, 0.7  # mean mismatch of rates and turns; rad a row, above which turns say nothing
_COMPARED = 200  # pairs of rows whose turns are compared with rates


def named_axes(name: str) -> str:
    """A frame by the name of the space axes that it is, if it is one of them."""
    plain = name.replace("_", " ")
    if _INERTIAL.fullmatch(plain):
        return plain.rstrip("0123456789 ") if plain[0] in "IG" else EQUATOR
    return name


class AttitudeRows:
    """Attitudes and rates of a segment.

    Attributes:
        axes: the space axes. settled: whether the frames say which of them are the body's.
        table: quaternions w x y z, then rates in deg/s if there are any, (rows, 4 or 7).
        resolution: half the last digits that are written, of quaternions and of rates.
    """

    def __init__(self, segment: MessageSegment, dates: list[Epoch]) -> None:
        self.segment, self.dates, self.notes = segment, dates, list[str]()
        kind, _, self.rate = segment.key("ATTITUDE_TYPE", TYPES).partition("/")
        if not kind:
            raise segment.fault(f"ATTITUDE_TYPE is missing; allowed: {', '.join(TYPES)}")
        self.kind, self.dots = kind, tuple(f"{name}_DOT" for name in _ATTITUDES[kind])
        self._find_frames()
        names = _ATTITUDES[kind] + (self.dots if self.rate == "DERIVATIVE" else _RATES.get(self.rate, ()))
        names = self._ordered(names)
        given = segment.numbers(names)
        self.numbers = dict(zip(names, given.T, strict=True))
        self.resolution = self._resolution(names)
        self.turns = self._of(*_ATTITUDES[kind])  # the target's coordinates into the source's
        body = conjugated(self.turns) if self.flipped else self.turns
        rates = self._rates(body)
        self.table = body if rates is None else np.concatenate([body, rates], axis=1)

    def _find_frames(self) -> None:
        """From which frame the attitude leads to which, and which of them is the body's."""
        segment, old = self.segment, self.segment.version < 2
        names = [segment.key(f"REF_FRAME_{letter}") for letter in "AB"]
        direction = segment.key("ATTITUDE_DIR", ("A2B", "B2A"))
        if not direction and old:
            what = "ATTITUDE_DIR is missing, by which version 1 says the direction"
            raise segment.fault(f"{what}; add ATTITUDE_DIR = A2B, or B2A")
        if direction == "B2A" and not old:
            what = "ATTITUDE_DIR = B2A, which version 2 doesn't know"
            raise segment.fault(f"{what}; swap REF_FRAME_A and REF_FRAME_B, or write CCSDS_AEM_VERS = 1.0")
        self.names = {f"REF_FRAME_{letter}": name for letter, name in zip("AB", names, strict=True)}
        self.source, self.target = names if direction != "B2A" else names[::-1]
        inertial = [bool(_INERTIAL.fullmatch(x.replace("_", " "))) for x in (self.source, self.target)]
        body = [bool(_BODY.fullmatch(x.replace("_", " "))) for x in (self.source, self.target)]
        if all(inertial) or all(body):
            what = f"REF_FRAME_A = {names[0]} and REF_FRAME_B = {names[1]}"
            raise segment.fault(f"{what}; one frame of space and one of the body are allowed")
        self.flipped = (inertial[1] or body[0]) and not (inertial[0] or body[1])
        self.settled = inertial[0] or inertial[1] or body[0] or body[1]
        self.axes = named_axes(self.target if self.flipped else self.source)
        if self.kind == "SPIN" and self.flipped:
            what = f"ATTITUDE_TYPE = {self.kind} from {self.source} to {self.target}"
            raise segment.fault(
                f"{what}; spin angles lead from a frame of space to the body's: check the frames"
            )

    def _ordered(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the numbers in the order of a row: version 1 may have the scalar first."""
        if self.kind != "QUATERNION":
            return names
        place = self.segment.key("QUATERNION_TYPE", ("FIRST", "LAST"))
        if self.segment.version < 2 and not place and not isinstance(self.segment.rows[0].values, dict):
            what = "QUATERNION_TYPE is missing, by which version 1 says where QC is"
            raise self.segment.fault(f"{what}; add QUATERNION_TYPE = LAST, or FIRST")
        if self.segment.version >= 2 and place == "FIRST":
            what = "QUATERNION_TYPE = FIRST, which version 2 doesn't know: QC is last there"
            raise self.segment.fault(f"{what}; put it last, or write CCSDS_AEM_VERS = 1.0")
        if place != "FIRST":
            return names
        first = [names[n : n + 4] for n in range(0, 4 if self.rate != "DERIVATIVE" else 8, 4)]
        scalar_first = [name for four in first for name in (four[3], *four[:3])]
        return (*scalar_first, *names[len(scalar_first) :])

    def _of(self, *names: str) -> np.ndarray:
        """Quaternions (rows, 4) of the attitude's numbers."""
        values = np.stack([self.numbers[name] for name in names], axis=1)
        if self.kind == "QUATERNION":
            return values[:, [3, 0, 1, 2]]
        if self.kind == "EULER_ANGLE":
            return of_euler(self._sequence(), values * _RADIAN)
        alpha, delta, angle, _ = values.T
        return of_euler("zxz", np.stack([90 + alpha, 90 - delta, angle], axis=1) * _RADIAN)

    def _sequence(self) -> str:
        given = self.segment.key("EULER_ROT_SEQ")
        found = given.lower().translate(str.maketrans("123", "xyz"))
        if found not in SEQUENCES:
            what = f"EULER_ROT_SEQ = {given}" if given else "EULER_ROT_SEQ is missing"
            raise self.segment.fault(
                f"{what}; three axes are allowed, none twice in a row, such as XYZ or ZXZ"
            )
        return found

    def _rates(self, body: np.ndarray) -> np.ndarray | None:
        """Rates (rows, 3) along body axes, deg/s; None where there are none, or none that can be used."""
        readings = list(self._readings(body))
        if not readings:
            return None
        if len(readings) == 1 and self.kind != "SPIN":
            return readings[0][1]
        mismatches = [self._mismatch(body, rates) for _, rates in readings]
        best = min(mismatches)
        if best > _GOOD:
            kind = self.segment.key("ATTITUDE_TYPE")
            why = "the rows are too far apart to confirm them, or the attitude doesn't turn at them"
            self.notes.append(f"rates of {kind} were left out: {why}")
            return None
        words, rates = next(
            reading for reading, x in zip(readings, mismatches, strict=True) if x <= max(1.5 * best, 1e-6)
        )
        if self.rate == "RATE":
            self.notes.append(f"rates were taken as {words}, at which the attitude turns")
        return rates

    def _readings(self, body: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """Ways to read the rates, with their words, the one of the standard first."""
        sign = -1.0 if self.flipped else 1.0
        back = conjugated(body)

        def along_body(vectors: np.ndarray, frame: str) -> np.ndarray:
            """The target's angular velocity as seen from the source, along one of these, as the body's."""
            in_space = (frame == "target") == self.flipped
            return sign * (turned(back, vectors) if in_space else vectors)

        if self.rate == "DERIVATIVE":
            yield "derivatives", along_body(self._derivatives(self.dots), "target")
        elif self.rate in ("ANGVEL", "RATE"):
            given = np.stack([self.numbers[name] for name in _RATES[self.rate]], axis=1)
            for frame in self._rate_frames():
                words = f"components along the axes of {getattr(self, frame)}"
                yield words, along_body(given, frame)
                if self.rate == "RATE":
                    yield f"{words} with the other sign", -along_body(given, frame)
            if self.rate == "RATE" and self.segment.key("EULER_ROT_SEQ"):
                order = self._sequence()
                if len(set(order)) == 3 and order != "xyz" and self.segment.counted == "line":
                    for frame in self._rate_frames():
                        words = "components in the order of EULER_ROT_SEQ along the axes of "
                        words += getattr(self, frame)
                        yield words, along_body(given[:, [order.index(axis) for axis in "xyz"]], frame)
                yield (
                    "derivatives of the Euler angles",
                    along_body(self._derivatives(_RATES["RATE"]), "target"),
                )
        elif self.kind == "SPIN":
            yield "the spin's rates", self._spin(back)

    def _rate_frames(self) -> list[str]:
        """Along which frame's axes rates are given: "source" or "target", or both where it isn't said."""
        key = "ANGVEL_FRAME" if self.rate == "ANGVEL" else "RATE_FRAME"
        given = self.segment.key(key)
        name = self.names.get(given.replace(" ", "_"), given)
        if name in (self.source, self.target):
            return ["source" if name == self.source else "target"]
        if given:
            raise self.segment.fault(f"{key} = {given}; allowed: {self.source}, {self.target}")
        return ["target", "source"]

    def _derivatives(self, names: tuple[str, ...]) -> np.ndarray:
        """The target's angular velocity along its axes, deg/s, by derivatives of quaternions or angles."""
        dots = np.stack([self.numbers[name] for name in names], axis=1)
        if len(names) == 4:
            return multiplied(conjugated(self.turns), dots[:, [3, 0, 1, 2]])[:, 1:] * 2 / _RADIAN
        sequence, halves = self._sequence(), self._angles() / 2
        found = np.zeros((len(dots), 3))
        for n, axis in enumerate(sequence):  # a turn carries the axes of those before it along
            unit = np.eye(3)["xyz".index(axis)]
            turn = np.column_stack([np.cos(halves[:, n]), np.outer(np.sin(halves[:, n]), unit)])
            found = turned(conjugated(turn), found) + np.outer(dots[:, n], unit)
        return found

    def _angles(self) -> np.ndarray:
        """Euler angles (rows, 3), rad."""
        if self.kind == "EULER_ANGLE":
            return np.stack([self.numbers[name] for name in _ANGLES], axis=1) * _RADIAN
        matrix = rotation_matrix([*self.turns.T])
        return np.stack(TURNS.euler_from_matrix(self._sequence(), matrix), axis=1)

    def _spin(self, back: np.ndarray) -> np.ndarray:
        """The body's angular velocity: about its Z axis, which goes round the angular momentum."""
        numbers, along_z = self.numbers, np.array([0.0, 0.0, 1.0])
        spin = np.outer(numbers["SPIN_ANGLE_VEL"], along_z)
        if self.rate == "NUTATION":
            tilt, phase = (numbers[name] * _RADIAN for name in ("NUTATION", "NUTATION_PHASE"))
            momentum = np.column_stack(
                [np.sin(tilt) * np.cos(phase), -np.sin(tilt) * np.sin(phase), np.cos(tilt)]
            )
            return spin + momentum * (360 / numbers["NUTATION_PER"])[:, None]
        if self.rate == "NUTATION_MOM":
            alpha, delta = (numbers[name] * _RADIAN for name in ("MOMENTUM_ALPHA", "MOMENTUM_DELTA"))
            momentum = np.column_stack(
                [np.cos(alpha) * np.cos(delta), np.sin(alpha) * np.cos(delta), np.sin(delta)]
            )
            return spin + turned(back, momentum) * numbers["NUTATION_VEL"][:, None]
        return spin

    def _mismatch(self, body: np.ndarray, rates: np.ndarray) -> float:
        """Relative difference of rates and turns from row to row, its geometric mean; infinite where rows are
        too far apart.
        """
        rows = np.unique(np.linspace(0, len(body) - 2, min(len(body) - 1, _COMPARED)).astype(int))
        if not len(rows):
            return np.inf
        steps = np.array([float(self.dates[n + 1].since(self.dates[n])) for n in rows])[:, None]
        turns = vector_of(normalised(multiplied(conjugated(body[rows]), body[rows + 1])))
        if np.median(np.linalg.norm(turns, axis=1)) > _FASTEST or not steps.all():
            return np.inf
        mean = (rates[rows] + rates[rows + 1]) / 2 * _RADIAN
        size = float(np.linalg.norm(mean, axis=1).mean()) or 1.0
        apart = np.linalg.norm(turns / steps - mean, axis=1) / size
        return float(np.exp(np.mean(np.log(apart + 1e-9))))

    def _resolution(self, names: tuple[str, ...]) -> tuple[float, float]:
        given = [
            self.numbers[name] for name in _ATTITUDES[self.kind][: 4 if self.kind == "QUATERNION" else 3]
        ]
        attitude = written_resolution(np.stack(given, axis=1), False, few=FEW)
        others = [self.numbers[name] for name in names if name not in _ATTITUDES[self.kind]]
        rates = written_resolution(np.stack(others, axis=1), False) if others else 0.0
        if self.kind != "QUATERNION":
            attitude *= _RADIAN / 2
        elif self.rate == "DERIVATIVE":
            rates *= 2 / _RADIAN
        return attitude, rates


def message_columns(path: Path, kind: str) -> dict[str, Any]:
    """A message as what ``Trajectory`` is made of.

    Attitudes are unit quaternions from body to space axes, rates along body axes in deg/s, positions in m.

    Args:
        kind: "AEM" or "OEM".

    Raises:
        RigidsimError: something can't be read, with its line and what to do.
    """
    segments = read_segments(path, kind)
    epochs = [one.epochs() for one in segments]
    reading: Callable[[MessageSegment, list[Epoch]], Any] = AttitudeRows if kind == "AEM" else _OrbitRows
    parts = [reading(*each) for each in zip(segments, epochs, strict=True)]
    notes = [note for part in parts for note in part.notes]
    for n, (before, after) in enumerate(pairwise(epochs), 1):
        if before and after and after[0].since(before[-1]) == 0:  # the end of a segment begins the next one
            del segments[n].rows[0], after[0]
            parts[n].table = parts[n].table[1:]
            place = segments[n].where.rpartition(", ")[2]
            notes.append(f"segment at {place}: its first row, at the time of the row before, was left out")
    axes = {EQUATOR if part.axes in get_args(SpaceAxes) else part.axes for part in parts}
    if len(axes) > 1:
        names = ", ".join(sorted(axes))
        raise RigidsimError(f"{path}: segments in different frames, {names}; write all in one")
    width = min(part.table.shape[1] for part in parts)
    table = np.concatenate([part.table[:, :width] for part in parts])
    wanted = ("quaternion", "angular_velocity") if kind == "AEM" else ("position", "velocity")
    columns = [name for variable in wanted for name in MESSAGE_COLUMNS[variable]][:width]
    if width < max(part.table.shape[1] for part in parts):
        notes.append("rates were left out, since not all segments have them")
    numbers = np.array([row.number for one in segments for row in one.rows])
    return {
        "columns": {name: np.ascontiguousarray(table[:, n]) for n, name in enumerate(columns)},
        "units": {name: "deg/s" for name in MESSAGE_COLUMNS["angular_velocity"] if name in columns},
        "counted": segments[0].counted, "first": int(numbers[0]), "lines": numbers,
        "epochs": tuple(date for dates in epochs for date in dates),
        "axes": parts[0].axes, "settled": all(part.settled for part in parts),
        "resolution": parts[0].resolution, "notes": tuple(dict.fromkeys(notes)),
    }  # fmt: skip


class _OrbitRows:
    """Positions and velocities of a segment (rows, 6), m and m/s."""

    settled, resolution = True, None

    def __init__(self, segment: MessageSegment, dates: list[Epoch]) -> None:
        self.notes: list[str] = []
        self.axes = named_axes(segment.key("REF_FRAME"))
        self.table = segment.numbers(_ORBIT, _ACCELERATION) * _KM
