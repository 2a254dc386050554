"""SPK files written by hand: SPICE's arrays of doubles, with segments of types 2 and 3, little-endian."""

import struct
from collections.abc import Mapping
from pathlib import Path

import de421
import numpy as np

_RECORD = 1024
_FTP = b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP"
FIRST, LAST = 2440368.5, 2440624.5
"""Julian dates between which ``write_kernel`` places bodies."""


def write_spk(path: Path, segments: Mapping[tuple[int, int], tuple[float, float, np.ndarray]]) -> None:
    """An SPK file: by target and centre the first block's begin and the length of all (s since J2000), and
    coefficients (blocks, 3, terms), km; (blocks, 6, terms), with velocities, is type 3.
    """
    summaries, words, at = [], [], 3 * _RECORD // 8 + 1
    for (target, center), (begin, length, blocks) in segments.items():
        count, parts, terms = blocks.shape
        middles = begin + length * (np.arange(count) + 0.5)
        rows = np.column_stack([middles, np.full(count, length / 2), blocks.reshape(count, -1)])
        data = [*rows.ravel(), begin, length, 2 + parts * terms, count]
        last = at + len(data) - 1
        span = begin, begin + length * count
        summaries.append(struct.pack("<2d6i", *span, target, center, 1, parts // 3 + 1, at, last))
        words += data
        at = last + 1
    header = struct.pack("<8sII60sIII8s", b"DAF/SPK ", 2, 6, b"by hand".ljust(60), 2, 2, at, b"LTL-IEEE")
    directory = struct.pack("<3d", 0, 0, len(summaries)) + b"".join(summaries)
    names = b"".join(b"by hand".ljust(40) for _ in summaries)
    with path.open("wb") as file:
        file.write((header.ljust(699, b"\0") + _FTP).ljust(_RECORD, b"\0"))
        file.write(directory.ljust(_RECORD, b"\0") + names.ljust(_RECORD, b" "))
        file.write(np.array(words, dtype="<f8").tobytes())


def write_kernel(path: Path) -> None:
    """Sun, Earth and Moon by the coefficients of DE421 for 256 days of 1969, as SPK files have them."""
    folder = Path(str(de421.__file__)).parent
    constants = {str(k): v for k, v in np.load(folder / "constants.npy").astype("U6,f8").tolist()}
    ratio, origin = constants["EMRAT"], constants["jalpha"]

    def blocks(file: str, days: int) -> tuple[float, float, np.ndarray]:
        given = np.load(folder / f"jpl-{file}.npy", mmap_mode="r")
        first = round((FIRST - origin) / days)
        found = np.array(given[first : first + round((LAST - FIRST) / days)])
        return (FIRST - 2451545.0) * 86400, days * 86400.0, found

    begin, length, moon = blocks("moon", 4)
    write_spk(
        path,
        {
            (10, 0): blocks("sun", 16),
            (3, 0): blocks("earthmoon", 16),
            (399, 3): (begin, length, -moon / (1 + ratio)),
            (301, 3): (begin, length, moon * ratio / (1 + ratio)),
        },
    )
