"""Small SPK files for tests, written from the coefficients of a package."""

from pathlib import Path

import de421
import numpy as np
import spk_files

_J2000 = 2451545.0
_FIRST, _LAST = 2414992.5, 2524624.5  # Julian dates of de421
_SEGMENTS = ((3, 0, "earthmoon"), (301, 3, "moon"), (399, 3, "moon"), (10, 0, "sun"), (2, 0, "venus"))
_RATIO = 81.3005690699153


def write_spk(path: Path, begin: float, end: float, *, kind: int = 2, shift: float = 0.0) -> Path:
    """The Sun, Venus, the Earth and the Moon as de421 has them from one Julian date to another; the Moon's
    first coefficient may be shifted, km.
    """
    segments: dict[tuple[int, int], tuple[float, float, np.ndarray]] = {}
    for target, center, name in _SEGMENTS:
        given = np.load(Path(str(de421.__file__)).parent / f"jpl-{name}.npy", mmap_mode="r")
        days = (_LAST - _FIRST) / len(given)
        first, last = int((begin - _FIRST) // days), int(np.ceil((end - _FIRST) / days))
        factor = {301: _RATIO / (1 + _RATIO), 399: -1 / (1 + _RATIO)}.get(target, 1.0)
        blocks = factor * np.array(given[first:last])
        blocks[:, 0, 0] += shift if target == 301 else 0.0
        if kind == 3:
            blocks = np.concatenate([blocks, np.zeros_like(blocks)], axis=1)
        segments[target, center] = (_FIRST + first * days - _J2000) * 86400, days * 86400, blocks
    spk_files.write_spk(path, segments)
    return path
