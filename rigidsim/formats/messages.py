"""Rows of CCSDS messages: quaternions of an AEM, positions and velocities of an OEM, in KVN or XML."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.scene.epochs import Epoch, parse_epoch

_DATE = re.compile(r"(\d{4})-(\d\d\d?)(?:-(\d\d))?T([\d:.]+)Z?")
_ATTITUDE = {"Q1": "qx", "Q2": "qy", "Q3": "qz", "QC": "qw"}
_ORBIT = {"X": "x", "Y": "y", "Z": "z", "X_DOT": "vx", "Y_DOT": "vy", "Z_DOT": "vz"}
_KM = 1000.0

Row = tuple[int, str, dict[str, float], dict[str, str]]
"""Number of the line (KVN) or of the row, date, values by name, and the keys that are valid for it."""


def message_rows(
    path: Path, message: str
) -> tuple[tuple[Epoch, ...], dict[str, np.ndarray], str, int, tuple[str, str]]:
    """Dates, columns by name (positions in m, velocities in m/s), what rows are counted as, the first's
    number, and the frames from and to which an attitude turns; empty where rows differ in them.

    Args:
        message: "AEM" or "OEM".

    Raises:
        RigidsimError: it holds no rows, or none that can be used.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    names = _ATTITUDE if message == "AEM" else _ORBIT
    xml = text.lstrip().startswith("<")
    rows = list(_of_xml(text, names) if xml else _of_kvn(text, message))
    if not rows:
        raise RigidsimError(f"{path}: the {message} holds no data lines")
    for number, _, values, keys in rows:
        kind = keys.get("ATTITUDE_TYPE", "missing")
        if message == "AEM" and not kind.upper().startswith("QUATERNION"):
            raise RigidsimError(
                f"{path}: ATTITUDE_TYPE = {kind}; QUATERNION is allowed: export the attitude as quaternions, "
                "or as CSV"
            )
        if not set(names) <= set(values):
            raise RigidsimError(f"{path}, row {number}: holds {len(values)} values; {len(names)} are needed")
    epochs = tuple(_date(date, keys.get("TIME_SYSTEM", ""), f"{path}, row {n}") for n, date, _, keys in rows)
    scale = 1.0 if message == "AEM" else _KM
    columns = {plain: np.array([row[2][name] for row in rows]) * scale for name, plain in names.items()}
    named = {(keys.get("REF_FRAME_A", ""), keys.get("REF_FRAME_B", "")) for *_, keys in rows}
    frames = named.pop() if len(named) == 1 else ("", "")
    return epochs, columns, "row" if xml else "line", rows[0][0], frames


def _of_kvn(text: str, message: str) -> Iterator[Row]:
    keys: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0] == "COMMENT":
            continue
        if "=" in line:
            key, _, value = line.partition("=")
            keys[key.strip()] = value.strip()
        elif words[0].startswith("COVARIANCE"):
            return
        elif _DATE.fullmatch(words[0]):
            order = list(_ORBIT)
            if message == "AEM":
                order = [*"123C"] if keys.get("QUATERNION_TYPE") != "FIRST" else [*"C123"]
                order = [f"Q{part}" for part in order]
            values = dict(zip(order, map(float, words[1:]), strict=False))
            yield number, words[0], values, dict(keys)


def _of_xml(text: str, names: dict[str, str]) -> Iterator[Row]:
    keys: dict[str, str] = {}
    count = 0
    for element in ElementTree.fromstring(text).iter():
        if _tag(element) == "metadata":
            keys = _leaves(element)
        elif any(_tag(child) == "EPOCH" for child in element):
            leaves = _leaves(element)
            values = {name: float(leaves[name]) for name in names if name in leaves}
            yield count, leaves["EPOCH"], values, keys
            count += 1


def _leaves(element: ElementTree.Element) -> dict[str, str]:
    """Texts of all elements within that have no further ones, by their names."""
    return {_tag(leaf): (leaf.text or "").strip() for leaf in element.iter() if not len(leaf)}


def _tag(element: ElementTree.Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _date(text: str, scale: str, where: str) -> Epoch:
    match = _DATE.fullmatch(text)
    if match is None or match[3] is None:
        raise RigidsimError(f"{where}: the date {text}; dates as 2029-04-13T21:46:00 are allowed")
    try:
        return parse_epoch(f"{match[1]}-{match[2]}-{match[3]}T{match[4]} {scale}")
    except ValueError as error:
        raise RigidsimError(f"{where}: {error}") from None
