"""CCSDS messages of other programs, in KVN or XML: attitudes from body to space axes and rates along body
axes (AEM and APM of 504.0-B-1 and 504.0-B-2), the path in SI (OEM of 502.0-B). Covariances are passed over.

An APM is read as an AEM of one row: of its blocks the first that has an attitude counts, quaternion, Euler
angles or spin, with rates in the same or another block.

Conventions of annex F of 504.0-B-2. The quaternion from frame A to frame B turns the axes of A into B's, so
that it turns a vector's coordinates in B into coordinates in A; Euler angles from A to B are intrinsic turns;
the angular velocity from A to B is how B turns as seen from A. Spin angles place the Z axis of the body: the
attitude is turns by alpha + 90 deg, 90 deg - delta and the spin angle about Z, X, Z.

Version 1 has ATTITUDE_DIR for the direction. Its rates (``/RATE``) are components of the angular velocity by
the standard (annex J of 504.0-B-2), and derivatives of Euler angles as other programs write them: the
reading is taken by which the attitude turns.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args
from xml.etree import ElementTree

import numpy as np

from rigidsim.errors import RigidsimError, ensure
from rigidsim.formats.digits import FEW, written_resolution
from rigidsim.scene.epochs import SCALES, Epoch, parse_epoch
from rigidsim.scene.rotations import (
    SEQUENCES,
    TURNS,
    conjugated,
    multiplied,
    normalised,
    of_euler,
    rotation_matrix,
    turned,
    vector_of,
)
from rigidsim.scene.space_axes import EQUATOR, SpaceAxes

MESSAGE_COLUMNS = {
    "quaternion": ("qw", "qx", "qy", "qz"), "angular_velocity": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz"),
}  # fmt: skip
"""Names of a message's columns by the variable that they are."""
_STATES = {"AEM": "attitudeState", "OEM": "stateVector"}
_UNITS = ("deg", "deg/s", "1/s", "s", "km", "km/s", "km/s**2")
_BLOCKS = {
    "QUAT": r"Q_\w+|Q[123C](_DOT)?", "EULER": r"EULER_\w+|[XYZ]_(ANGLE|RATE)|RATE_FRAME", "ANGVEL": "",
    "SPIN": r"SPIN_\w+|NUTATION\w*",
}  # fmt: skip
"""Blocks of an APM, with the keywords of version 1, which has no marks around them in KVN."""
_RENAMED = {f"{x}_FRAME_{letter}": f"REF_FRAME_{letter}" for x in ("Q", "EULER", "SPIN") for letter in "AB"}
_RENAMED |= {f"{x}_DIR": "ATTITUDE_DIR" for x in ("Q", "EULER", "SPIN")}
_ELEMENTS = {
    "quaternionState": "QUAT", "eulerAngleState": "EULER", "eulerElementsThree": "EULER",
    "angularVelocity": "ANGVEL", "spin": "SPIN", "eulerElementsSpin": "SPIN",
}  # fmt: skip
_STATED = {"QUAT": ("QUATERNION", "Q1"), "EULER": ("EULER_ANGLE", "ANGLE_1"), "SPIN": ("SPIN", "SPIN_ALPHA")}
"""Attitudes of an APM by their blocks, in the order in which they are taken, and a keyword of each."""
_MARKS = ("META_STOP", "DATA_START", "DATA_STOP")
_ORBIT = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_ACCELERATION = ("X_DDOT", "Y_DDOT", "Z_DDOT")
_KM = 1000.0
_ANGLES = ("ANGLE_1", "ANGLE_2", "ANGLE_3")
_ATTITUDES = {
    "QUATERNION": ("Q1", "Q2", "Q3", "QC"), "EULER_ANGLE": _ANGLES,
    "SPIN": ("SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", "SPIN_ANGLE_VEL"),
}  # fmt: skip
_RATES = {
    "ANGVEL": ("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z"), "RATE": ("X_RATE", "Y_RATE", "Z_RATE"),
    "NUTATION": ("NUTATION", "NUTATION_PER", "NUTATION_PHASE"),
    "NUTATION_MOM": ("MOMENTUM_ALPHA", "MOMENTUM_DELTA", "NUTATION_VEL"),
}  # fmt: skip
_PLAIN, _SPUN = ("", "/DERIVATIVE", "/ANGVEL", "/RATE"), ("", "/NUTATION", "/NUTATION_MOM")
_TYPES = tuple(f"{kind}{rate}" for kind in _ATTITUDES for rate in (_SPUN if kind == "SPIN" else _PLAIN))
_ROTATIONS = {name.upper(): name for name in SEQUENCES}
_ROTATIONS |= {name.translate(str.maketrans("xyz", "123")): name for name in SEQUENCES}
_INERTIAL = re.compile(r"(EME ?2000|J2000|ICRF ?\d*|GCRF ?\d*)")
_BODY = re.compile(
    r"(SC BODY|ACC|ACTUATOR|AST|CSS|DSS|ESA|GYRO( FRAME)?|IMU FRAME|INSTRUMENT|MTA|RW|SA|SENSOR|STARTRACKER"
    r"|TAM)( ?\w{1,3})?"
)
_RADIAN = np.pi / 180
_GOOD, _FASTEST = 0.1, 0.7  # mean mismatch of rates and turns; rad a row, above which turns say nothing
_COMPARED = 200  # pairs of rows whose turns are compared with rates


@dataclass
class _Segment:
    """One segment.

    Attributes:
        version: of the message. path, place: its file, and where in it the metadata are. counted: what rows
            are called.
        keys: keywords of the metadata.
        rows: of each the number of its line (KVN), or of the state in the message (XML); its date; its
            numbers in their order (KVN) or by their names (XML).
    """

    version: float
    path: Path
    place: str
    counted: str
    keys: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[int, str, Sequence[str] | dict[str, str]]] = field(default_factory=list)

    def fault(self, what: str, row: int | None = None) -> RigidsimError:
        """What is wrong with the metadata, or with a row of some number."""
        place = self.place if row is None else f"{self.counted} {row}"
        return RigidsimError(f"{self.path}, {place}: {what}")

    def key(self, name: str, allowed: Collection[str] = (), *, needed: bool = False) -> str:
        """A keyword in capitals, one of those allowed; empty where it is missing and isn't needed."""
        given = " ".join(self.keys.get(name, "").upper().split())
        if allowed and given not in allowed and (given or needed):
            what = f"{name} = {given}" if given else f"{name} is missing"
            raise self.fault(f"{what}; allowed: {', '.join(allowed)}")
        return given

    def numbers(self, names: Sequence[str], more: Sequence[str] = ()) -> np.ndarray:
        """Numbers of these names (rows, names); KVN rows may have a group of more."""
        found = []
        for number, _, values in self.rows:
            if isinstance(values, dict):
                if missing := [name for name in names if name not in values]:
                    raise self.fault(
                        f"has no {missing[0]}, which is needed besides {', '.join(names)}", number
                    )
                values = [values[name] for name in names]
            elif len(values) not in (len(names), len(names) + len(more)):
                what = f"holds {len(values)} numbers; {len(names)} are needed: {', '.join(names)}"
                raise self.fault(what, number)
            try:
                found.append([float(text) for text in values[: len(names)]])
            except ValueError:
                raise self.fault(f"one of {' '.join(values)[:80]} is no number", number) from None
        return np.array(found)

    def epochs(self) -> list[Epoch]:
        """The dates of all rows, in the time system of the segment."""
        scale = self.key("TIME_SYSTEM", (*SCALES, "TDT"), needed=True).replace("TDT", "TT")
        found = []
        for number, text, _ in self.rows:
            try:
                found.append(parse_epoch(text, scale))
            except ValueError as error:
                raise self.fault(str(error), number) from None
        return found


def _segments(path: Path, kind: str, text: str) -> list[_Segment]:
    """The segments with rows."""
    if kind == "APM":
        return [_of_apm(text, path)]
    read = _of_xml if text.lstrip().startswith("<") else _of_kvn
    found = [segment for segment in read(text, kind, path) if segment.rows]
    if not found:
        raise RigidsimError(f"{path}: the {kind} holds no data lines after a META_START")
    objects = {(one.key("OBJECT_NAME"), one.key("OBJECT_ID"), one.key("CENTER_NAME")) for one in found}
    if len(objects) > 1:
        names = " and ".join(sorted({" ".join(filter(None, one)) for one in objects})[:2])
        raise RigidsimError(
            f"{path}: segments of different objects or centres, {names}; split them into files"
        )
    return found


def _of_kvn(text: str, kind: str, path: Path) -> Iterator[_Segment]:
    version, passed_over = 0.0, False
    segment: _Segment | None = None
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0] == "COMMENT":
            continue
        if words[0] == "META_START":
            if segment is not None:
                yield segment
            segment, passed_over = _Segment(version, path, f"line {number}", "line"), False
        elif passed_over or words[0].startswith("COVARIANCE"):
            passed_over = words[0] != "COVARIANCE_STOP"
        elif "=" in line:
            key, _, value = line.partition("=")
            if key.strip() == f"CCSDS_{kind}_VERS":
                version = _version(value, path)
            elif segment is not None:
                segment.keys[key.strip().upper()] = value.strip()
        elif segment is not None and re.match(r"\d{4}-", words[0]):
            segment.rows.append((number, words[0], words[1:]))
        elif words[0] not in _MARKS:
            what = "a keyword with =, or a date with numbers after META_START, is allowed"
            raise RigidsimError(f'{path}, line {number}: "{line.strip()[:60]}"; {what}')
    if segment is not None:
        yield segment


def _of_xml(text: str, kind: str, path: Path) -> Iterator[_Segment]:
    count = 0
    for message in _root(text, path).iter():
        if _tag(message) != kind.lower():
            continue
        version = _version(message.get("version", "0"), path)
        for place, element in enumerate(e for e in message.iter() if _tag(e) == "segment"):
            segment = _Segment(version, path, f"segment {place + 1}", "row")
            for part in element.iter():
                if _tag(part) == "metadata":
                    segment.keys.update({_tag(leaf): (leaf.text or "").strip() for leaf in part})
                elif _tag(part) == _STATES[kind]:
                    values = dict(_leaves(part, segment, count))
                    segment.rows.append((count, values.pop("EPOCH", ""), values))
                    count += 1
            yield segment


def _of_apm(text: str, path: Path) -> _Segment:
    """A segment of one row with the attitude of an APM, and the rates beside it."""
    segment, blocks = _Segment(0.0, path, "the message", "row"), {name: dict[str, str]() for name in _BLOCKS}
    blocks[""] = {}
    read = _keys_of_xml if text.lstrip().startswith("<") else _keys_of_kvn
    for block, key, value in read(text, segment):
        name = _RENAMED.get(key, key)
        if block and name in blocks[block]:
            raise segment.fault(f"{key} is there twice; leave one of them")
        blocks[block][name] = value
    segment.version = _version(blocks[""].get("CCSDS_APM_VERS", ""), path)
    euler = blocks["EULER"]
    if any(f"{axis}_ANGLE" in euler for axis in "XYZ"):
        segment.keys = euler
        sequence = _ROTATIONS[segment.key("EULER_ROT_SEQ", _ROTATIONS, needed=True)].upper()
        what = f"EULER_ROT_SEQ = {sequence}, of whose angles two would have one name; write a quaternion"
        ensure(len(set(sequence)) == 3, segment.fault(what))
        found = ((n, euler.get(f"{axis}_ANGLE")) for n, axis in enumerate(sequence, 1))
        euler |= {f"ANGLE_{n}": angle for n, angle in found if angle is not None}
    name = next((name for name, (_, first) in _STATED.items() if first in blocks[name]), "")
    ensure(name, segment.fault("it has no attitude; a quaternion, Euler angles or a spin are needed"))
    own, rates = blocks[name], _rates_of_apm(segment, name, blocks)
    segment.keys = {**blocks[""], **own, **rates, "ATTITUDE_TYPE": _STATED[name][0] + rates.pop("", "")}
    segment.rows = [(0, segment.keys.get("EPOCH", ""), {**own, **rates})]
    return segment


def _rates_of_apm(segment: _Segment, name: str, blocks: dict[str, dict[str, str]]) -> dict[str, str]:
    """Rates beside the attitude of an APM, from whichever block, with the frame that they are along, and
    under "" the end of the type.
    """
    own = blocks[name]
    if name == "SPIN":
        firsts = {"/NUTATION": "NUTATION", "/NUTATION_MOM": "MOMENTUM_ALPHA"}
        return {"": next((kind for kind, first in firsts.items() if first in own), "")}
    if f"{_STATED[name][1]}_DOT" in own:
        return {"": "/DERIVATIVE"}
    for rate, where, frame in (("ANGVEL", "ANGVEL", "ANGVEL_FRAME"), ("RATE", "EULER", "RATE_FRAME")):
        given = blocks[where]
        if _RATES[rate][0] not in given:
            continue
        ends = [
            [one.get(f"REF_FRAME_{letter}", "").upper() for letter in order]
            for one in (own, given)
            for order in ("BA" if one.get("ATTITUDE_DIR", "").upper() == "B2A" else "AB",)
        ]
        what = f"rates from {' to '.join(ends[1])} and an attitude from {' to '.join(ends[0])}; write both"
        ensure(sorted(ends[0]) == sorted(ends[1]), segment.fault(f"{what} between the same frames"))
        along = given.get(frame, "")
        if re.fullmatch(r"(EULER|REF)_FRAME_[AB]", along.upper()):
            along = given.get(f"REF_FRAME_{along[-1].upper()}", "")
        found = {"": f"/{rate}", frame: along}
        for key in _RATES[rate]:
            text = given.get(key, "")  # the other frame turns the other way
            found[key] = text if ends[0] == ends[1] else text[1:] if text[:1] == "-" else f"-{text}"
        return found
    return {"": ""}


def _keys_of_kvn(text: str, segment: _Segment) -> Iterator[tuple[str, str, str]]:
    """Block, keyword and value of each line of an APM; the block is empty for others than attitudes."""
    inside = None
    for number, line in enumerate(text.splitlines(), 1):
        key, equals, value = (x.strip() for x in line.partition("="))
        if not line.strip() or line.split()[0] in ("COMMENT", *_MARKS, "META_START"):
            continue
        if mark := re.fullmatch(r"(\w+)_(START|STOP)", key):
            inside = (mark[1] if mark[1] in _BLOCKS else "") if mark[2] == "START" else None
            continue
        place = f"{segment.path}, line {number}"
        if not equals:
            raise RigidsimError(f'{place}: "{line.strip()[:60]}"; a keyword with = is allowed')
        value, _, unit = value.partition("[")
        old = (name for name, keys in _BLOCKS.items() if re.fullmatch(keys, key))
        block = next(old, "") if inside is None else inside
        if block and unit and unit.rstrip("] ").lower() not in _UNITS:
            raise RigidsimError(f"{place}: {key} in [{unit}; allowed: {', '.join(_UNITS)}")
        yield block, key.upper(), value.strip()


def _keys_of_xml(text: str, segment: _Segment) -> Iterator[tuple[str, str, str]]:
    """The same."""
    message = _root(text, segment.path)
    yield "", "CCSDS_APM_VERS", message.get("version", "0")
    inside = set()
    for element in message.iter():
        if block := _ELEMENTS.get(_tag(element)):
            inside |= set(element.iter())
            segment.keys = {_tag(leaf): leaf.text or "" for leaf in element}
            for key, value in _leaves(element, segment, 0):
                if key == "EPOCH":
                    yield "", key, value
                elif key != "COMMENT":
                    yield block, key, value
        elif element not in inside and not len(element):
            yield "", _tag(element), (element.text or "").strip()


def _root(text: str, path: Path) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RigidsimError(f"{path}: is no XML ({error}); write it again") from None


def _leaves(state: ElementTree.Element, segment: _Segment, number: int) -> Iterator[tuple[str, str]]:
    """Texts of a state by their names. In version 1 turns have elements by their number, with the axis as an
    attribute.
    """
    for leaf in state.iter():
        if len(leaf):
            continue
        name = leaf.get("rate") or _tag(leaf)
        unit = leaf.get("units", leaf.get("unit", "deg"))
        if unit.lower() not in _UNITS:
            raise segment.fault(f'{name} in "{unit}"; allowed: {", ".join(_UNITS)}', number)
        if axis := leaf.get("angle"):
            name = f"ANGLE_{name[-1]}"
            sequence = _ROTATIONS[segment.key("EULER_ROT_SEQ", _ROTATIONS, needed=True)]
            if "xyz123".find(axis[0].lower()) % 3 != "xyz".find(sequence[int(name[-1]) - 1]):
                what = f"{axis} at place {name[-1]} of EULER_ROT_SEQ = {sequence.upper()}; mend one"
                raise segment.fault(what, number)
        yield name, (leaf.text or "").strip()


def _tag(element: ElementTree.Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _version(text: str, path: Path) -> float:
    try:
        return float(text)
    except ValueError:
        raise RigidsimError(f"{path}: the message's version is {text.strip()[:20]}; write a number") from None


def _named_axes(name: str) -> str:
    """A frame by the name of the space axes that it is, if it is one of them."""
    plain = name.replace("_", " ")
    if _INERTIAL.fullmatch(plain):
        return plain.rstrip("0123456789 ") if plain[0] in "IG" else EQUATOR
    return name


class _OrbitRows:
    """Positions and velocities of a segment (rows, 6), m and m/s."""

    settled, resolution = True, None

    def __init__(self, segment: _Segment, dates: list[Epoch]) -> None:
        self.notes: list[str] = []
        self.axes = _named_axes(segment.key("REF_FRAME"))
        self.table = segment.numbers(_ORBIT, _ACCELERATION) * _KM


class _AttitudeRows:
    """Attitudes and rates of a segment, which lead from a frame, the source, to another one, the target.

    Attributes:
        axes: the space axes. settled: whether the frames say which of them are the body's.
        table: quaternions w x y z, then rates in deg/s if there are any, (rows, 4 or 7).
        resolution: half the last digits that are written, of quaternions and of rates.
    """

    def __init__(self, segment: _Segment, dates: list[Epoch]) -> None:
        self.segment, self.dates, self.notes = segment, dates, list[str]()
        self.kind, _, self.rate = segment.key("ATTITUDE_TYPE", _TYPES, needed=True).partition("/")
        self._find_frames()
        names = list(_ATTITUDES[self.kind])
        self.dots = [f"{name}_DOT" for name in names] if self.rate == "DERIVATIVE" else []
        names += self.dots or _RATES.get(self.rate, ())
        old = segment.version < 2
        if self.kind == "QUATERNION":
            by_place = not isinstance(segment.rows[0][2], dict)
            allowed = ("LAST", "FIRST") if old else ("LAST",)
            if segment.key("QUATERNION_TYPE", allowed, needed=old and by_place) == "FIRST":
                for n in range(0, 4 + len(self.dots), 4):
                    names[n : n + 4] = [names[n + 3], *names[n : n + 3]]
        self.numbers = dict(zip(names, segment.numbers(names).T, strict=True))
        self.turns = self._attitude()  # the target's coordinates into the source's
        self.body = conjugated(self.turns) if self.flipped else self.turns
        rates = self._rates()
        self.table = self.body if rates is None else np.concatenate([self.body, rates], axis=1)
        self.resolution = self._resolution()

    def _find_frames(self) -> None:
        """From which frame the attitude leads to which, and whether to space axes rather than from them."""
        segment, old = self.segment, self.segment.version < 2
        direction = segment.key("ATTITUDE_DIR", ("A2B", "B2A") if old else ("A2B",), needed=old)
        self.names = {f"REF_FRAME_{letter}": segment.key(f"REF_FRAME_{letter}") for letter in "AB"}
        self.source, self.target = list(self.names.values())[:: -1 if direction == "B2A" else 1]
        plain = [name.replace("_", " ") for name in (self.source, self.target)]
        inertial, body = ([bool(form.fullmatch(x)) for x in plain] for form in (_INERTIAL, _BODY))
        self.flipped = (inertial[1] or body[0]) and not (inertial[0] or body[1])
        self.settled = any([*inertial, *body])
        self.axes = _named_axes(self.target if self.flipped else self.source)
        given = f"from {self.source} to {self.target}"
        if all(inertial) or all(body):
            raise segment.fault(f"{given}; one frame of space and one of the body are allowed")
        if self.kind == "SPIN" and self.flipped:
            raise segment.fault(f"SPIN {given}; spin angles lead from a frame of space to the body's")

    def _stack(self, names: Sequence[str]) -> np.ndarray:
        return np.stack([self.numbers[name] for name in names], axis=1)

    def _sequence(self) -> str:
        return _ROTATIONS[self.segment.key("EULER_ROT_SEQ", _ROTATIONS, needed=True)]

    def _attitude(self) -> np.ndarray:
        """Quaternions (rows, 4) of the attitude's numbers."""
        values = self._stack(_ATTITUDES[self.kind])
        if self.kind == "QUATERNION":
            return values[:, [3, 0, 1, 2]]
        if self.kind == "EULER_ANGLE":
            return of_euler(self._sequence(), values * _RADIAN)
        alpha, delta, angle, _ = values.T
        return of_euler("zxz", np.stack([90 + alpha, 90 - delta, angle], axis=1) * _RADIAN)

    def _rates(self) -> np.ndarray | None:
        """Rates (rows, 3) along body axes, deg/s; None where there are none, or none that can be used."""
        readings = self._readings()
        if not readings or (len(readings) == 1 and self.kind != "SPIN"):
            return readings[0][1] if readings else None
        if len(self.dates) == 1 and self.kind != "SPIN":  # by the standard
            return readings[0][1]
        mismatches = [self._mismatch(rates) for _, rates in readings]
        best = min(mismatches)
        if best > _GOOD and len(self.dates) > 1:
            kind = self.segment.key("ATTITUDE_TYPE")
            why = "the rows are too far apart to confirm them, or the attitude doesn't turn at them"
            self.notes.append(f"rates of {kind} were left out: {why}")
            return None
        words, rates = readings[next(n for n, x in enumerate(mismatches) if x <= max(1.5 * best, 1e-6))]
        if self.rate == "RATE":
            self.notes.append(f"rates were taken as {words}, at which the attitude turns")
        return rates

    def _readings(self) -> list[tuple[str, np.ndarray]]:
        """Ways to read the rates, with their words, the one of the standard first."""
        if self.kind == "SPIN":
            return [("the spin's rates", self._spin())]
        if self.rate in ("", "DERIVATIVE"):
            return [("derivatives", self._derived(self.dots))] if self.rate else []
        given = self._stack(_RATES[self.rate])
        named = self.segment.key(key := "ANGVEL_FRAME" if self.rate == "ANGVEL" else "RATE_FRAME")
        frame = self.names.get(named.replace(" ", "_"), named)
        if frame not in ("", self.source, self.target):
            raise self.segment.fault(f"{key} = {named}; allowed: {self.source}, {self.target}")
        frames = [self.target, self.source] if not frame else [frame]
        found = []
        for frame in frames:
            words, rates = f"components along the axes of {frame}", self._along_body(given, frame)
            found.append((words, rates))
            if self.rate == "RATE":
                found.append((f"{words} with the other sign", -rates))
        if self.rate == "RATE" and self.segment.key("EULER_ROT_SEQ"):
            order = self._sequence()
            if len(set(order)) == 3 and order != "xyz" and self.segment.counted == "line":
                sorted_ = given[:, [order.index(axis) for axis in "xyz"]]
                words = "components in the order of EULER_ROT_SEQ along the axes of"
                found += [(f"{words} {frame}", self._along_body(sorted_, frame)) for frame in frames]
            found.append(("derivatives of the Euler angles", self._derived(_RATES["RATE"])))
        return found

    def _along_body(self, vectors: np.ndarray, frame: str) -> np.ndarray:
        """The target's angular velocity as seen from the source, along the axes of one of them, as the body's
        along its own.
        """
        if (frame == self.target) == self.flipped:
            vectors = turned(conjugated(self.body), vectors)
        return -vectors if self.flipped else vectors

    def _derived(self, names: Sequence[str]) -> np.ndarray:
        """The body's angular velocity by derivatives of quaternions or angles, deg/s."""
        dots = self._stack(names)
        if len(names) == 4:
            doubled = multiplied(conjugated(self.turns), dots[:, [3, 0, 1, 2]])[:, 1:] * 2
            return self._along_body(doubled / _RADIAN, self.target)
        sequence = self._sequence()
        if self.kind == "EULER_ANGLE":
            angles = self._stack(_ANGLES) * _RADIAN
        else:
            angles = np.stack(TURNS.euler_from_matrix(sequence, rotation_matrix([*self.turns.T])), axis=1)
        found = np.zeros((len(dots), 3))
        for axis, half, dot in zip(sequence, angles.T / 2, dots.T, strict=True):
            unit = np.eye(3)["xyz".index(axis)]
            turn = np.column_stack([np.cos(half), np.outer(np.sin(half), unit)])
            # a turn carries the axes of those before it along
            found = turned(conjugated(turn), found) + np.outer(dot, unit)
        return self._along_body(found, self.target)

    def _spin(self) -> np.ndarray:
        """The body's angular velocity: about its Z axis, which goes round the angular momentum."""
        numbers = self.numbers
        spin = np.outer(numbers["SPIN_ANGLE_VEL"], [0.0, 0.0, 1.0])
        if self.rate == "NUTATION":
            tilt, phase = (numbers[name] * _RADIAN for name in ("NUTATION", "NUTATION_PHASE"))
            momentum = [np.sin(tilt) * np.cos(phase), -np.sin(tilt) * np.sin(phase), np.cos(tilt)]
            return spin + np.column_stack(momentum) * (360 / numbers["NUTATION_PER"])[:, None]
        if self.rate == "NUTATION_MOM":
            alpha, delta = (numbers[name] * _RADIAN for name in ("MOMENTUM_ALPHA", "MOMENTUM_DELTA"))
            momentum = [np.cos(alpha) * np.cos(delta), np.sin(alpha) * np.cos(delta), np.sin(delta)]
            along = turned(conjugated(self.body), np.column_stack(momentum))
            return spin + along * numbers["NUTATION_VEL"][:, None]
        return spin

    def _mismatch(self, rates: np.ndarray) -> float:
        """Relative difference of rates and turns from row to row, its geometric mean; infinite where rows are
        too far apart.
        """
        body = self.body
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

    def _resolution(self) -> tuple[float, float]:
        quaternion, names = self.kind == "QUATERNION", _ATTITUDES[self.kind]
        attitude = written_resolution(self._stack(names[: 4 if quaternion else 3]), False, few=FEW)
        others = [name for name in self.numbers if name not in names]
        rates = written_resolution(self._stack(others), False) if others else 0.0
        if not quaternion:
            return attitude * (_RADIAN / 2), rates
        return attitude, rates * (2 / _RADIAN) if self.dots else rates


def _chosen(segments: list[_Segment], path: Path, chosen: str) -> list[_Segment]:
    """The segment of a number from 1, or the first that reaches a date."""
    count = f"{len(segments)} segment{'s' * (len(segments) > 1)}"
    if chosen.isdigit():
        what = f"{path}: given segment {chosen} of a message with {count}; 1 to {len(segments)} is allowed"
        ensure(1 <= int(chosen) <= len(segments), RigidsimError(what))
        return [segments[int(chosen) - 1]]
    ends = [(one.epochs()[0], one.epochs()[-1]) for one in segments]
    try:
        date = parse_epoch(chosen, ends[0][0].scale)
    except ValueError as error:
        what = f"{path}: given the segment {chosen!r}; a number from 1 is allowed, or a date within a segment"
        raise RigidsimError(f"{what} ({error})") from None
    for one, (begin, end) in zip(segments, ends, strict=True):
        if begin.since(date) <= 0 <= end.since(date):
            return [one]
    spans = ", ".join(f"{begin} to {end}" for begin, end in ends[:8])
    raise RigidsimError(f"{path}: given the segment of {date}, which is in none; its {count}: {spans}")


def message_columns(path: Path, kind: str, text: str | None = None, segment: str = "") -> dict[str, Any]:
    """A message as what ``Trajectory`` is made of.

    Attitudes are unit quaternions from body to space axes, rates along body axes in deg/s, positions in m.

    Args:
        kind: "AEM", "APM" or "OEM".
        text: the message, if it was read already.
        segment: number from 1 of the only one that counts, or a date within it.

    Raises:
        RigidsimError: something can't be read, with its line and what to do.
    """
    if text is None:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    segments = _segments(path, kind, text)
    segments = _chosen(segments, path, segment) if segment else segments
    epochs = [one.epochs() for one in segments]
    reading: Any = _OrbitRows if kind == "OEM" else _AttitudeRows
    parts = [reading(*each) for each in zip(segments, epochs, strict=True)]
    notes = [note for part in parts for note in part.notes]
    for n, (before, after) in enumerate(pairwise(epochs), 1):
        if before and after and after[0].since(before[-1]) == 0:  # the end of a segment begins the next one
            del segments[n].rows[0], after[0]
            parts[n].table = parts[n].table[1:]
            words = "its first row, at the time of the row before, was left out"
            notes.append(f"segment at {segments[n].place}: {words}")
    axes = {EQUATOR if part.axes in get_args(SpaceAxes) else part.axes for part in parts}
    if len(axes) > 1:
        names = ", ".join(sorted(axes))
        raise RigidsimError(f"{path}: segments in different frames, {names}; write all in one")
    widths = [part.table.shape[1] for part in parts]
    table = np.concatenate([part.table[:, : min(widths)] for part in parts])
    wanted = ("position", "velocity") if kind == "OEM" else ("quaternion", "angular_velocity")
    columns = [name for variable in wanted for name in MESSAGE_COLUMNS[variable]][: min(widths)]
    if min(widths) < max(widths):
        notes.append("rates were left out, since not all segments have them")
    numbers = np.array([row[0] for one in segments for row in one.rows])
    return {
        "columns": {name: np.ascontiguousarray(table[:, n]) for n, name in enumerate(columns)},
        "units": {name: "deg/s" for name in MESSAGE_COLUMNS["angular_velocity"] if name in columns},
        "counted": segments[0].counted, "lines": numbers,
        "epochs": tuple(date for dates in epochs for date in dates),
        "axes": parts[0].axes, "settled": all(part.settled for part in parts),
        "resolution": parts[0].resolution, "notes": tuple(dict.fromkeys(notes)),
    }  # fmt: skip
