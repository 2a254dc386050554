"""CCSDS messages as they are written, in KVN or XML: segments, each with its keywords and its rows.

Attitudes (AEM) of 504.0-B-1 and 504.0-B-2, orbits (OEM) of 502.0-B. Covariances are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.scene.epochs import SCALES, Epoch, parse_epoch

_STATES = {"AEM": "attitudeState", "OEM": "stateVector"}
_UNITS = ("deg", "deg/s", "1/s", "s", "km", "km/s", "km/s**2")
_MARKS = ("META_STOP", "DATA_START", "DATA_STOP")


@dataclass(frozen=True)
class MessageRow:
    """Number of its line (KVN), or of the state in the message (XML); its date; its numbers in their order
    (KVN) or by their names (XML).
    """

    number: int
    date: str
    values: Sequence[str] | dict[str, str]


@dataclass(frozen=True)
class MessageSegment:
    """One segment.

    Attributes:
        version: of the message. where: the file and the place of the metadata. counted: what rows are called.
        keys: keywords of the metadata.
    """

    version: float
    where: str
    counted: str
    keys: dict[str, str] = field(default_factory=dict)
    rows: list[MessageRow] = field(default_factory=list)

    def fault(self, what: str, row: MessageRow | None = None) -> RigidsimError:
        """What is wrong with the metadata, or with a row."""
        place = f"segment at {self.where}" if row is None else f"{self.counted} {row.number}"
        return RigidsimError(f"{self.where.rpartition(', ')[0]}, {place.split(', ')[-1]}: {what}")

    def key(self, name: str, allowed: Sequence[str] = ()) -> str:
        """A keyword in capitals, one of those allowed; empty where it is missing."""
        given = " ".join(self.keys.get(name, "").upper().split())
        if given and allowed and given not in allowed:
            raise self.fault(f"{name} = {given}; allowed: {', '.join(allowed)}")
        return given

    def numbers(self, names: Sequence[str], *more: Sequence[str]) -> np.ndarray:
        """Numbers of these names (rows, names); KVN rows may have more, any of these groups of names."""
        counts, total = {len(names)}, len(names)
        for group in more:
            total += len(group)
            counts.add(total)
        found = []
        for row in self.rows:
            if isinstance(row.values, dict):
                if missing := [name for name in names if name not in row.values]:
                    raise self.fault(f"has no {missing[0]}, which is needed besides {', '.join(names)}", row)
                texts = [row.values[name] for name in names]
            else:
                if len(row.values) not in counts:
                    what = f"holds {len(row.values)} numbers; {len(names)} are needed"
                    raise self.fault(f"{what}: {', '.join(names)}", row)
                texts = list(row.values[: len(names)])
            try:
                found.append([float(text) for text in texts])
            except ValueError:
                raise self.fault(f"one of {' '.join(texts)[:80]} is no number", row) from None
        return np.array(found)

    def epochs(self) -> list[Epoch]:
        """The dates of all rows, in the time system of the segment."""
        scale = {"TDT": "TT"}.get(self.key("TIME_SYSTEM"), self.key("TIME_SYSTEM"))
        if scale not in SCALES:
            given = f"TIME_SYSTEM = {scale}" if scale else "TIME_SYSTEM is missing"
            raise self.fault(f"{given}; allowed: {', '.join(SCALES)}: write the times in one of these")
        found = []
        for row in self.rows:
            try:
                found.append(parse_epoch(row.date, scale))
            except ValueError as error:
                raise self.fault(str(error), row) from None
        return found


def read_segments(path: Path, kind: str) -> list[MessageSegment]:
    """The segments with rows.

    Args:
        kind: "AEM" or "OEM".

    Raises:
        RigidsimError: there are none, or a line belongs to nothing.
    """
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    xml = text.lstrip().startswith("<")
    found = [segment for segment in (_of_xml if xml else _of_kvn)(text, kind, path) if segment.rows]
    if not found:
        raise RigidsimError(f"{path}: the {kind} holds no data lines after a META_START")
    objects = {(one.key("OBJECT_NAME"), one.key("OBJECT_ID"), one.key("CENTER_NAME")) for one in found}
    if len(objects) > 1:
        names = " and ".join(sorted({" ".join(filter(None, one)) for one in objects})[:2])
        raise RigidsimError(
            f"{path}: segments of different objects or centres, {names}; split them into files"
        )
    return found


def _of_kvn(text: str, kind: str, path: Path) -> Iterator[MessageSegment]:
    version, passed_over = 0.0, False
    segment: MessageSegment | None = None
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0] == "COMMENT":
            continue
        if words[0] == "META_START":
            if segment is not None:
                yield segment
            segment, passed_over = MessageSegment(version, f"{path}, line {number}", "line"), False
        elif passed_over or words[0].startswith("COVARIANCE"):
            passed_over = words[0] != "COVARIANCE_STOP"
        elif "=" in line:
            key, _, value = line.partition("=")
            if key.strip() == f"CCSDS_{kind}_VERS":
                version = float(value)
            elif segment is not None:
                segment.keys[key.strip().upper()] = value.strip()
        elif segment is not None and re.match(r"\d{4}-", words[0]):
            segment.rows.append(MessageRow(number, words[0], words[1:]))
        elif words[0] not in _MARKS:
            what = "a keyword with =, or a date with numbers after META_START, is allowed"
            raise RigidsimError(f'{path}, line {number}: "{line.strip()[:60]}"; {what}')
    if segment is not None:
        yield segment


def _of_xml(text: str, kind: str, path: Path) -> Iterator[MessageSegment]:
    count = 0
    for message in ElementTree.fromstring(text).iter():
        if _tag(message) != kind.lower():
            continue
        for place, element in enumerate(e for e in message.iter() if _tag(e) == "segment"):
            segment = MessageSegment(
                float(message.get("version", "0")), f"{path}, segment {place + 1}", "row"
            )
            for part in element.iter():
                if _tag(part) == "metadata":
                    segment.keys.update({_tag(leaf): (leaf.text or "").strip() for leaf in part})
                elif _tag(part) == _STATES[kind]:
                    values = dict(_leaves(part, segment, count))
                    segment.rows.append(MessageRow(count, values.pop("EPOCH", ""), values))
                    count += 1
            yield segment


def _leaves(state: ElementTree.Element, segment: MessageSegment, number: int) -> Iterator[tuple[str, str]]:
    """Texts of a state by their names. In version 1 turns have elements by their number, with the axis as an
    attribute.
    """
    for leaf in state.iter():
        if len(leaf):
            continue
        name = leaf.get("rate") or _tag(leaf)
        unit = leaf.get("units", leaf.get("unit", "deg"))
        row = MessageRow(number, "", {})
        if unit.lower() not in _UNITS:
            raise segment.fault(
                f'{name} in "{unit}"; {", ".join(_UNITS)} are allowed, as the standard has it', row
            )
        if axis := leaf.get("angle"):
            name = f"ANGLE_{name[-1]}"
            sequence = segment.keys.get("EULER_ROT_SEQ", "")
            if "XYZ123".find(axis[0].upper()) % 3 != "XYZ123".find(sequence[int(name[-1]) - 1 :][:1]) % 3:
                raise segment.fault(
                    f"{axis} at place {name[-1]} of EULER_ROT_SEQ = {sequence}; mend one", row
                )
        yield name, (leaf.text or "").strip()


def _tag(element: ElementTree.Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]
