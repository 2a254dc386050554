"""Kernels read through jplephem: packages such as ``de421``, and SPK files.

In a package the Moon is geocentric and all else barycentric, the Earth with the Moon as their barycentre; in
an SPK file each segment tells its own centre.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import re
from collections.abc import Callable
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, TypeVar

import numpy as np

from rigidsim.scene.kernels.kernel import DAY, J2000_DATE, Kernel, KernelError
from rigidsim.scene.kernels.series import BlockSeries, joined
from rigidsim.scene.kernels.soundness import refuse_constants, refuse_exchanged
from rigidsim.scene.validation_messages import nearest

T = TypeVar("T")

_EXTRA = "pip install 'rigidsim[ephemeris]'"
_PACKAGES = ("de405", "de406", "de421", "de422", "de423")
_STRENGTHS = {
    "sun": "GMS", "mercury": "GM1", "venus": "GM2", "mars": "GM4", "jupiter": "GM5", "saturn": "GM6",
    "uranus": "GM7", "neptune": "GM8", "pluto": "GM9", "earth_moon_barycenter": "GMB",
}  # fmt: skip
_CUBIC_KILOMETRE = 10**9  # m^3
_BARYCENTER = "earth_moon_barycenter"
_FRAME = 1  # of SPICE: J2000, which DE kernels since DE403 identify with the ICRF
_TYPES = (2, 3)
_LARGEST_CACHED = 4
_RECORD = 1024  # bytes, of SPK files
_IDENTIFIERS = (b"DAF/SPK", b"NAIF/DAF")  # of SPK files today, and before 1997
_UNREADABLE = (OSError, ValueError, LookupError, ArithmeticError)
"""What the numbers of a file that isn't what it should be lead to."""


def _by_reader(read: Callable[[], T]) -> T:
    """What jplephem or numpy reads; a ValueError for whatever they find wrong in a file."""
    try:
        return read()
    except (OSError, MemoryError):
        raise
    except Exception as error:
        raise ValueError(_words(error)) from None


def _jplephem(part: str) -> ModuleType:
    try:
        return importlib.import_module(f"jplephem.{part}")
    except ImportError:
        what = f"which is read by the package jplephem, which isn't installed: {_EXTRA}"
        raise KernelError(what) from None


def is_path(given: str) -> bool:
    """Whether a kernel is given as a file's path rather than a package's name."""
    return "/" in given or "\\" in given or "." in given


# --- packages -----------------------------------------------------------------------------------------------


class PackagedKernel(Kernel):
    """A package with one file of coefficients for each body, and a file of constants."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self._folder = name, folder
        self._used: dict[str, BlockSeries] = {}
        # its files alone count: nothing of the package is run
        ephem = _jplephem("ephem")
        module = SimpleNamespace(__name__=name, __file__=str(folder / "__init__.py"))
        try:
            refuse_exchanged(name, folder / "constants.npy")
            _by_reader(lambda: np.load(folder / "constants.npy", mmap_mode="r"))  # is as large as it says
            self._data = _by_reader(lambda: ephem.Ephemeris(module))
            self.constants = {
                key: float(value)
                for key, value in vars(self._data).items()
                if isinstance(value, float | np.floating)
            }
            self._begin, self._end = (Fraction(self.constants[key]) for key in ("jalpha", "jomega"))
            self._ratio = Fraction(self.constants["EMRAT"])
            refuse_constants(self.constants, self.strength)
        except KernelError:
            raise
        except _UNREADABLE as error:
            raise KernelError(_damaged("constants.npy", error, f"install {name} again")) from None

    @property
    def bodies(self) -> list[str]:
        found = [x for x in self._data.names if x not in ("librations", "nutations", "earthmoon")]
        return sorted([*found, "earth", _BARYCENTER])

    def known(self, body: str) -> bool:
        return body in self.bodies

    def _series(self, file: str, target: str, center: str) -> BlockSeries:
        if target not in self._used:
            path = self._folder / f"jpl-{file}.npy"
            try:
                given = _by_reader(lambda: np.load(path, mmap_mode="r", allow_pickle=False))
                span = (self._end - self._begin) * DAY
                if given.ndim != 3 or given.shape[1] != 3 or given.dtype != np.float64 or 0 in given.shape:
                    raise ValueError(f"an array of {given.dtype} {given.shape}")
                joined(given)
                refuse_exchanged(self.name, path)
            except _UNREADABLE as error:
                remedy = f"install {self.name} again"
                raise KernelError(_damaged(f"jpl-{file}.npy", error, remedy)) from None
            begin = (self._begin - J2000_DATE) * DAY
            plain = given.view(np.ndarray)  # which is quicker to index than a memmap
            self._used[target] = BlockSeries(target, center, begin, span / len(given), plain)
        return self._used[target]

    def path_of(self, body: str) -> list[tuple[Fraction, BlockSeries]]:
        if body not in ("earth", "moon", _BARYCENTER):
            return [(Fraction(1), self._series(body, body, "barycenter"))]
        found = [(Fraction(1), self._series("earthmoon", "earth_moon", "barycenter"))]
        if body != _BARYCENTER:
            share = {"earth": Fraction(-1), "moon": self._ratio}[body] / (1 + self._ratio)
            found.append((share, self._series("moon", "moon", "earth")))
        return found

    def strength(self, body: str) -> Fraction | None:
        key = _STRENGTHS.get(body, "GMB")
        if key not in self.constants or "AU" not in self.constants:
            return None
        whole = Fraction(self.constants[key]) * Fraction(self.constants["AU"]) ** 3
        whole = whole * _CUBIC_KILOMETRE / DAY**2
        share = {"earth": self._ratio, "moon": Fraction(1)}.get(body)
        return whole if share is None else whole * share / (1 + self._ratio)

    @property
    def digest(self) -> str:
        files = {"earth_moon": "earthmoon"}
        used = sorted(f"jpl-{files.get(x, x)}.npy" for x in self._used)
        return digest_of([self._folder / name for name in ["constants.npy", *used]])


@lru_cache(maxsize=8)
def _digest_of(paths: tuple[tuple[str, int, int], ...]) -> str:
    total = hashlib.sha256()
    for path, _, _ in paths:
        with Path(path).open("rb") as file:
            while part := file.read(1 << 20):
                total.update(part)
    return total.hexdigest()


def digest_of(paths: list[Path]) -> str:
    """SHA-256 of files one after the other, read once per process as long as they don't change."""
    known = [(str(path), (found := path.stat()).st_size, found.st_mtime_ns) for path in paths]
    return _digest_of(tuple(known))


# --- SPK files ----------------------------------------------------------------------------------------------


class SpkKernel(Kernel):
    """An SPK file."""

    def __init__(self, path: Path) -> None:
        self.name, self.place = path.name, path
        spk = _jplephem("spk")
        file = path.open("rb")
        try:
            daf = _by_reader(lambda: spk.DAF(file))
            if daf.locidw not in _IDENTIFIERS:
                raise ValueError(f"it begins with {daf.locidw.decode('ascii', 'replace')}")
            most = path.stat().st_size // _RECORD
            if _by_reader(lambda: any(number > most for number, _ in enumerate(daf.summary_records()))):
                raise ValueError("its list of segments has no end")
            self._file = _by_reader(lambda: spk.SPK(daf))
        except _UNREADABLE as error:
            file.close()
            what = f"which is no SPK file, or a damaged one ({_words(error)}); "
            what += "a file .bsp of SPICE is allowed"
            raise KernelError(what) from None
        if not self._file.segments:
            raise KernelError("which has no segments; an SPK file with positions of bodies is allowed")
        last = max(segment.end_i for segment in self._file.segments)
        size = path.stat().st_size
        if 8 * last > size:
            what = f"which is truncated: it has {size} bytes, and its segments go on to {8 * last}"
            raise KernelError(f"{what}; copy it again")
        names = _jplephem("names").target_names
        self._names = {_word(text): code for code, text in sorted(names.items(), reverse=True)}
        self._segments: dict[int, list[Any]] = {}
        for segment in self._file.segments:
            self._segments.setdefault(int(segment.target), []).append(segment)
        self._used: dict[int, BlockSeries] = {}

    def _candidates(self, body: str) -> list[int]:
        """Codes by which a body may be placed, the best first."""
        if re.fullmatch(r"-?\d{1,9}", body):
            return [int(body)]
        code = self._names.get("earth_barycenter" if body == _BARYCENTER else body)
        if code is None:
            return []
        # a planet far from its moons is where its system is
        system = [code // 100] if 100 < code < 1000 and code % 100 == 99 and code != 399 else []
        return [code, *system]

    @cached_property
    def _labels(self) -> dict[int, str]:
        found = {code: name for name, code in self._names.items()}
        found |= {code: found[100 * code + 99] for code in (1, 2, 4, 5, 6, 7, 8, 9)}
        return {**found, 3: _BARYCENTER}

    @property
    def bodies(self) -> list[str]:
        return sorted({self._labels.get(code, str(code)) for code in self._segments})

    def known(self, body: str) -> bool:
        return any(code in self._segments for code in self._candidates(body))

    def path_of(self, body: str) -> list[tuple[Fraction, BlockSeries]]:
        code = next(code for code in self._candidates(body) if code in self._segments)
        found: list[tuple[Fraction, BlockSeries]] = []
        while code != 0:
            if code not in self._segments or len(found) > len(self._segments):
                name = self._labels.get(code, str(code))
                what = (
                    f'which places "{body}" relative to "{name}", and that relative to nothing; a file with '
                )
                raise KernelError(what + "both is allowed")
            series, center = self._series(code)
            if series is not None:
                found.append((Fraction(1), series))
            code = center
        return found

    def _series(self, code: int) -> tuple[BlockSeries | None, int]:
        """The series of a target, None if it is where its centre is, and that centre's code."""
        segments = self._segments[code]
        center = int(segments[-1].center)
        if code not in self._used:
            segments = [x for x in segments if int(x.center) == center]
            self._used[code] = self._joined(code, center, segments)
        series = self._used[code]
        return (None if not series.coefficients.any() else series), center

    def _joined(self, code: int, center: int, segments: list[Any]) -> BlockSeries:
        """Segments of one body, which follow one another, as one series."""
        label, other = (self._labels.get(x, f"body_{x}").replace("-", "minus_") for x in (code, center))
        read = sorted((self._read(label, segment) for segment in segments), key=lambda x: x[0])
        begin, length, given = read[0]
        blocks = [given]
        for following, its_length, more in read[1:]:
            reached = begin + length * sum(map(len, blocks))
            if its_length != length or more.shape[2] != given.shape[2] or following > reached:
                what = f'whose segments of "{label}" have blocks of several kinds, or gaps; a file with one '
                raise KernelError(what + "segment of each body is allowed")
            blocks.append(more[round((reached - following) / length) :])
        label = f"body_{label}" if label[0].isdigit() else label
        return BlockSeries(
            label, other, begin, length, blocks[0] if len(blocks) == 1 else np.concatenate(blocks)
        )

    def _read(self, label: str, segment: Any) -> tuple[Fraction, Fraction, np.ndarray]:
        if segment.data_type not in _TYPES:
            what = (
                f'whose "{label}" is of SPK type {segment.data_type}; types 2 and 3 (Chebyshev) are allowed: '
            )
            raise KernelError(what + "write it anew as one of them, as SPICE's spkmerge or JPL's Horizons do")
        if segment.frame != _FRAME:
            raise KernelError(f'whose "{label}" is in frame {segment.frame} of SPICE; J2000 (1) is allowed')
        try:
            words = segment.end_i - 3, segment.end_i
            begin, length, _, count = _by_reader(lambda: self._file.daf.read_array(*words))
            coefficients = _by_reader(segment.load_array)[2]
            covered = segment.start_second, segment.end_second
            if not (length > 0 and begin <= covered[0] < covered[1] <= begin + count * length):
                raise ValueError("its blocks don't cover its span")
            blocks = np.moveaxis(coefficients[:3], 0, 1)
            if len(blocks) != count:
                raise ValueError("blocks are missing")
            joined(blocks)
        except _UNREADABLE as error:
            raise KernelError(_damaged(f'segment of "{label}"', error, "copy it again")) from None
        return Fraction(float(begin)), Fraction(float(length)), blocks

    def strength(self, body: str) -> None:
        return None

    @property
    def digest(self) -> str:
        assert self.place is not None
        return digest_of([self.place])


def _word(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _words(error: Exception) -> str:
    return str(error).split("\n")[0][:120] or type(error).__name__


def _damaged(what: str, error: Exception, remedy: str) -> str:
    return f"whose {what} is damaged or truncated ({_words(error)}); {remedy}"


# --- opening ------------------------------------------------------------------------------------------------


@lru_cache(maxsize=_LARGEST_CACHED)
def _opened(path: str, size: int, changed: int) -> SpkKernel:
    return SpkKernel(Path(path))


def open_file(path: Path) -> Kernel:
    """The kernel of an SPK file, read once per process as long as it doesn't change.

    Raises:
        KernelError: it is no such file, or damaged.
    """
    found = path.stat()
    return _opened(str(path), found.st_size, found.st_mtime_ns)


def open_package(name: str) -> Kernel:
    """The kernel of an installed package.

    Raises:
        KernelError: there is none of this name, or it is damaged.
    """
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is None or spec.origin is None:
        hint = f"pip install {name}" if name in _PACKAGES else f"allowed: {', '.join(_PACKAGES)}"
        what = (
            f"which is no installed package{nearest(name, _PACKAGES)}; {hint}, or the path of an SPK file, "
        )
        raise KernelError(what + 'with a slash or a suffix: "./de440.bsp"')
    folder = Path(spec.origin).parent
    if not (folder / "constants.npy").exists() or not list(folder.glob("jpl-*.npy")):
        raise KernelError(f"which is a package, but none of an ephemeris; allowed: {', '.join(_PACKAGES)}")
    return PackagedKernel(name, folder)
