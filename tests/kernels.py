"""Small SPK files for tests, written from the coefficients of a package."""

from __future__ import annotations

import struct
from pathlib import Path

import de421
import numpy as np

RECORD = 1024
_J2000 = 2451545.0
_FIRST, _LAST = 2414992.5, 2524624.5  # Julian dates of de421
_SEGMENTS = ((3, 0, "earthmoon"), (301, 3, "moon"), (399, 3, "moon"), (10, 0, "sun"), (2, 0, "venus"))
_RATIO = 81.3005690699153


def write_spk(path: Path, begin: float, end: float, *, kind: int = 2, shift: float = 0.0) -> Path:
    """The Sun, Venus, the Earth and the Moon as de421 has them from one Julian date to another; the Moon's
    first coefficient may be shifted, km.
    """
    words: list[np.ndarray] = []
    summaries = b""
    address = 3 * RECORD // 8 + 1
    for target, center, name in _SEGMENTS:
        given = np.load(Path(str(de421.__file__)).parent / f"jpl-{name}.npy", mmap_mode="r")
        days = (_LAST - _FIRST) / len(given)
        first, last = int((begin - _FIRST) // days), int(np.ceil((end - _FIRST) / days))
        factor = {301: _RATIO / (1 + _RATIO), 399: -1 / (1 + _RATIO)}.get(target, 1.0)
        blocks = factor * np.array(given[first:last])
        blocks[:, 0, 0] += shift if target == 301 else 0.0
        start = (_FIRST + first * days - _J2000) * 86400
        length = days * 86400
        rows = []
        for number, block in enumerate(blocks):
            rates = np.zeros_like(block) if kind == 3 else np.zeros((0, block.shape[1]))
            middle = start + (number + 0.5) * length
            rows.append(np.concatenate([[middle, length / 2], block.ravel(), rates.ravel()]))
        data = np.concatenate([*rows, [start, length, float(len(rows[0])), float(len(rows))]])
        stop = address + len(data) - 1
        span = start, start + len(rows) * length
        summaries += struct.pack("<2d6i", *span, target, center, 1, kind, address, stop)
        words.append(data)
        address = stop + 1
    head = b"DAF/SPK " + struct.pack("<2i", 2, 6) + b"test".ljust(60) + struct.pack("<3i", 2, 2, address)
    head += b"LTL-IEEE" + bytes(603) + b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP" + bytes(297)
    summary = struct.pack("<3d", 0, 0, len(_SEGMENTS)) + summaries
    body = np.concatenate(words).astype("<f8").tobytes()
    pages = [page.ljust(RECORD, b"\0") for page in (head, summary, b" " * RECORD)]
    path.write_bytes(b"".join(pages) + body.ljust(-(-len(body) // RECORD) * RECORD, b"\0"))
    return path
