"""Kernels: bodies, the series that place them relative to each other, and constants.

A package such as ``de421`` has a file of coefficients for each body: the Moon is geocentric there and all
else barycentric, the Earth with the Moon as their barycentre. In an SPK file, which is made of SPICE's arrays
of doubles (NAIF, "DAF Required Reading" and "SPK Required Reading"), each segment names its own centre.

The position of one body relative to another is a Chebyshev series in blocks of one length: T_k being
Chebyshev's polynomials and u the time in a block, from -1 to 1,

    x = c_0 + c_1 T_1(u) + c_2 T_2(u) + ...

The coefficients are doubles, which count exactly.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from functools import cached_property, lru_cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from pydantic import Field, StrictStr

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import J2000, Epoch
from rigidsim.scene.fields import ConfigTable
from rigidsim.scene.space_axes import CELESTIAL, ECLIPTIC, ICRF, obliquity, to_ecliptic
from rigidsim.scene.validation_messages import nearest, shown


@dataclass(frozen=True, eq=False, repr=False)
class BlockSeries:
    """Position of ``target`` relative to ``center``; km and seconds of TDB, axes of the ICRF.

    Attributes:
        target, center: names for states and messages: letters, digits and underscores.
        begin: beginning of the first block, seconds since J2000.
        length: of each block, s.
        coefficients: (blocks, 3, terms).
    """

    target: str
    center: str
    begin: Fraction
    length: Fraction
    coefficients: np.ndarray

    @property
    def end(self) -> Fraction:
        """End of the last block, seconds since J2000."""
        return self.begin + self.length * len(self.coefficients)

    @cached_property
    def terms(self) -> int:
        """Number of coefficients of one component in one block."""
        return int(self.coefficients.shape[2])

    @cached_property
    def exponent(self) -> int:
        """Exponent of a power of two of km that is above all positions, but for what polynomials add."""
        return math.frexp(float(np.abs(self.coefficients[:, :, 0]).max()))[1]

    def block_at(self, time: Any) -> int:
        """Number of the block that begins at a time (mpf, seconds since J2000) or contains it."""
        found = int((time - _mpf_like(time, self.begin)) / _mpf_like(time, self.length) // 1)
        return min(max(found, 0), len(self.coefficients) - 1)

    def at(self, context: Any, time: Any, order: int = 0) -> Vector:
        """Position at a time (mpf, seconds since J2000), or a derivative of it: km/s^order (mpf)."""
        number = self.block_at(time)
        begin, length = exactly(context, self.begin + number * self.length), exactly(context, self.length)
        u = 2 * (time - begin) / length - 1
        values = chebyshev(context, u, self.terms, order)
        scale = (2 / length) ** order
        return [
            scale * sum((context.mpf(float(c)) * t for c, t in zip(row, values, strict=True)), context.zero)
            for row in self.coefficients[number]
        ]

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """Positions at times (n,), seconds since J2000, in double precision: (n, 3), km."""
        since = (times - float(self.begin)) / float(self.length)
        number = np.clip(np.floor(since).astype(int), 0, len(self.coefficients) - 1)
        values = np.cos(np.arccos(np.clip(2 * (since - number) - 1, -1, 1))[:, None] * np.arange(self.terms))
        return np.einsum("nik,nk->ni", self.coefficients[number], values)


def chebyshev(context: Any, u: Any, terms: int, order: int) -> list[Any]:
    """Values (mpf) of T_0, T_1, ... at u, or of their derivatives of an order."""
    rows = [[context.one, u]]
    for k in range(2, terms):
        rows[0].append(2 * u * rows[0][k - 1] - rows[0][k - 2])
    for n in range(1, order + 1):
        lower, own = rows[-1], [context.zero, context.one if n == 1 else context.zero]
        for k in range(2, terms):
            own.append(2 * n * lower[k - 1] + 2 * u * own[k - 1] - own[k - 2])
        rows.append(own)
    return rows[-1][:terms]


def exactly(context: Any, value: Fraction) -> Any:
    """A fraction as mpf."""
    return context.mpf(value.numerator) / value.denominator


def _mpf_like(number: Any, value: Fraction) -> Any:
    return number * 0 + exactly(number.context, value)


# --- kernels ------------------------------------------------------------------------------------------------


J2000_DATE = Fraction(2451545)
DAY = 86400
FOLDERS = "RIGIDSIM_KERNELS"
"""Environment variable with folders in which kernels are looked for by their names."""
EMBEDDED = " (embedded config)"
"""What follows a dataset's path where that stands for the config in it."""
NOTE = ".kernel"
"""File of a run's folder with the places of its kernels, where they are looked for, too."""
_PACKAGES = ("de405", "de406", "de421", "de422", "de423")
_STRENGTHS = {
    "sun": "GMS", "mercury": "GM1", "venus": "GM2", "mars": "GM4", "jupiter": "GM5", "saturn": "GM6",
    "uranus": "GM7", "neptune": "GM8", "pluto": "GM9", "earth_moon_barycenter": "GMB",
}  # fmt: skip
_CUBIC_KILOMETRE = 10**9  # m^3
_BARYCENTER = "earth_moon_barycenter"
_FRAME = 1  # of SPICE: J2000, which DE kernels since DE403 identify with the ICRF
_TYPES = (2, 3)
_IDENTIFIERS = (b"DAF/SPK", b"NAIF/DAF")  # of SPK files today, and before 1997
_UNREADABLE = (OSError, ValueError, LookupError, ArithmeticError, EOFError, TokenError, struct.error)
"""What the numbers of a file that isn't what it should be lead to."""


class KernelError(ValueError):
    """A kernel can't be read, or lacks something; the message goes on from ``given "...",``."""


@dataclass(frozen=True)
class RelativeEphemeris:
    """One body of a kernel seen from another: the sum of series, each times an exact factor.

    Attributes:
        source, host: names of both.
        links: factors and series.
    """

    source: str
    host: str
    links: tuple[tuple[Fraction, BlockSeries], ...]

    @property
    def span(self) -> tuple[Fraction, Fraction]:
        """Times between which it is known, seconds since J2000."""
        series = [x for _, x in self.links]
        return max(x.begin for x in series), min(x.end for x in series)

    @property
    def exponent(self) -> int:
        """Exponent of a power of two of km of the distance's order."""
        return max(series.exponent for _, series in self.links)

    def at(self, context: Any, time: Any, order: int = 0) -> Vector:
        """Vector (mpf, km) at a time (mpf, seconds since J2000), or a derivative of it."""
        total = [context.zero] * 3
        for factor, series in self.links:
            vector, size = series.at(context, time, order), exactly(context, factor)
            total = [x + size * y for x, y in zip(total, vector, strict=True)]
        return total

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """Vectors at times (n,), seconds since J2000, in double precision: (n, 3), km."""
        found = [float(factor) * series.sampled(times) for factor, series in self.links]
        return np.sum(found, axis=0)


class Kernel(ABC):
    """Bodies of one kernel.

    Attributes:
        name: as in the config, without its place.
        place: path of its file; None for an installed package.
        bodies: names of the bodies, for messages.
    """

    name: str
    place: Path | None = None
    bodies: list[str]

    def known(self, body: str) -> bool:
        """Whether it places a body of a name."""
        return body in self.bodies

    @abstractmethod
    def path_of(self, body: str) -> list[tuple[Fraction, BlockSeries]]:
        """A body's place relative to the solar system's barycentre, as links of a ``RelativeEphemeris``."""

    def strength(self, body: str) -> Fraction | None:
        """Gravitational parameter of a body, m^3/s^2; None if the kernel has none."""
        return None

    @property
    @abstractmethod
    def digest(self) -> str:
        """SHA-256 of what was read of it."""

    def sight(self, source: str, host: str) -> RelativeEphemeris:
        """One body seen from another; ``host`` may be empty, which is the solar system's barycentre."""
        factors: dict[BlockSeries, Fraction] = {}
        for sign, path in ((1, self.path_of(source)), (-1, self.path_of(host) if host else [])):
            for factor, series in path:
                factors[series] = factors.get(series, Fraction(0)) + sign * factor
        links = tuple((factor, series) for series, factor in factors.items() if factor != 0)
        if not links:
            raise KernelError(f'which has "{source}" where "{host or "the barycentre"}" is')
        return RelativeEphemeris(source, host, links)


class PackagedKernel(Kernel):
    """A package with a file of coefficients for each body, and one of constants; none of its code runs."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self._folder = name, folder
        self._used: dict[str, BlockSeries] = {}
        found = {path.stem.removeprefix("jpl-") for path in folder.glob("jpl-*.npy")}
        self.bodies = sorted({*found, "earth", _BARYCENTER} - {"librations", "nutations", "earthmoon"})
        with self._undamaged("constants.npy") as given:
            self._constants = {key.decode("ascii"): float(value) for key, value in given}
            self._begin, self._end = (Fraction(self._constants[key]) for key in ("jalpha", "jomega"))
            self._ratio = Fraction(self._constants["EMRAT"])
            if not self._begin < self._end or self._ratio == -1:
                raise ValueError("its span is empty")

    @contextmanager
    def _undamaged(self, file: str) -> Iterator[np.ndarray]:
        """What a file holds; whatever is wrong with it in the block is refused."""
        try:  # a view is quicker to index than a memmap
            yield np.load(self._folder / file, mmap_mode="r").view(np.ndarray)
        except _UNREADABLE as error:
            raise _damaged(file, error, f"install {self.name} again") from None

    def _series(self, file: str, target: str, center: str) -> BlockSeries:
        if file not in self._used:
            with self._undamaged(f"jpl-{file}.npy") as given:
                if given.ndim != 3 or given.shape[1] != 3 or given.dtype != np.float64 or 0 in given.shape:
                    raise ValueError(f"an array of {given.dtype} {given.shape}")
            begin, length = (self._begin - J2000_DATE) * DAY, (self._end - self._begin) * DAY / len(given)
            self._used[file] = BlockSeries(target, center, begin, length, given)
        return self._used[file]

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
        if key not in self._constants or "AU" not in self._constants:
            return None
        whole = Fraction(self._constants[key]) * Fraction(self._constants["AU"]) ** 3
        share = {"earth": self._ratio, "moon": Fraction(1)}.get(body, 1 + self._ratio) / (1 + self._ratio)
        return whole * _CUBIC_KILOMETRE / DAY**2 * share

    @property
    def digest(self) -> str:
        used = sorted(f"jpl-{file}.npy" for file in self._used)
        return digest_of([self._folder / name for name in ["constants.npy", *used]])


class SpkKernel(Kernel):
    """An SPK file."""

    def __init__(self, path: Path) -> None:
        self.name, self.place = path.name, path
        try:
            daf, names = (import_module(f"jplephem.{module}") for module in ("daf", "names"))
        except ImportError:
            what = "whose layout and bodies the package jplephem knows, and it isn't installed: "
            raise KernelError(what + "pip install 'rigidsim[ephemeris]'") from None
        size = path.stat().st_size // 8
        try:
            with path.open("rb") as file:
                array = daf.DAF(file)
                if not array.locidw.startswith(_IDENTIFIERS):
                    raise ValueError(f"it begins with {array.locidw.decode('ascii')}")
                summaries = [values for _, values in islice(array.summaries(), size + 1)]
            if len(summaries) > size:
                raise ValueError("its list of segments has no end")
            self._words = np.memmap(path, f"{array.endian}f8", "r", shape=(size,)).view(np.ndarray)
        except _UNREADABLE as error:
            what = f"which is no SPK file, or a damaged one ({_words(error)}); a file .bsp of SPICE is "
            raise KernelError(f"{what}allowed") from None
        if not summaries:
            raise KernelError("which has no segments; an SPK file with positions of bodies is allowed")
        if (last := max(values[-1] for values in summaries)) > size:
            what = f"which is truncated: it has {path.stat().st_size} bytes, and its segments extend to "
            raise KernelError(f"{what}{8 * last}; copy it again")
        self._segments: dict[int, list[Any]] = {}
        for values in summaries:
            self._segments.setdefault(values[2], []).append(values)
        self._used: dict[int, BlockSeries] = {}
        self._codes = {_word(text): code for code, text in sorted(names.target_names.items(), reverse=True)}
        found = {code: name for name, code in self._codes.items()}
        found |= {code: found[100 * code + 99] for code in (1, 2, 4, 5, 6, 7, 8, 9)}
        self._labels = {**found, 3: _BARYCENTER}
        self.bodies = sorted({self._labels.get(code, str(code)) for code in self._segments})

    def _code(self, body: str) -> int | None:
        """Code by which a body is placed; None if it isn't."""
        if re.fullmatch(r"-?\d{1,9}", body):
            code = int(body)
        else:
            code = self._codes.get("earth_barycenter" if body == _BARYCENTER else body, -1)
            if code not in self._segments and 100 < code < 1000 and code % 100 == 99 and code != 399:
                code //= 100  # a planet far from its moons is where its system is
        return code if code in self._segments else None

    def known(self, body: str) -> bool:
        return self._code(body) is not None

    def path_of(self, body: str) -> list[tuple[Fraction, BlockSeries]]:
        code = self._code(body)
        found: list[tuple[Fraction, BlockSeries]] = []
        for _ in self._segments:
            if code not in self._segments:
                break
            series, code = self._series(code)
            if series.coefficients.any():  # else it is where its centre is
                found.append((Fraction(1), series))
            if code == 0:
                return found
        what = f'which places "{body}" relative to "{self._labels.get(code, code)}", and that relative to '
        raise KernelError(f"{what}nothing; a file with both is allowed")

    def _series(self, code: int) -> tuple[BlockSeries, int]:
        """The series of a target, of the segments that follow one another, and its centre's code."""
        center = self._segments[code][-1][3]
        if code not in self._used:
            label, other = (self._labels.get(x, f"body_{x}").replace("-", "minus_") for x in (code, center))
            segments = [x for x in self._segments[code] if x[3] == center]
            read = sorted((self._read(label, *segment) for segment in segments), key=lambda x: x[0])
            begin, length, given = read[0]
            blocks = [given]
            for following, its_length, more in read[1:]:
                reached = begin + length * sum(map(len, blocks))
                if its_length != length or more.shape[2] != given.shape[2] or following > reached:
                    what = f'whose segments of "{label}" have blocks of several kinds, or gaps; a file with '
                    raise KernelError(what + "one segment of each body is allowed")
                blocks.append(more[round((reached - following) / length) :])
            label = f"body_{label}" if label[0].isdigit() else label
            whole = blocks[0] if len(blocks) == 1 else np.concatenate(blocks)
            self._used[code] = BlockSeries(label, other, begin, length, whole)
        return self._used[code], center

    def _read(self, label: str, *summary: Any) -> tuple[Fraction, Fraction, np.ndarray]:
        """Begin, length and coefficients (blocks, 3, terms) of the blocks of a segment."""
        start, end, _, _, frame, kind, first, last = summary
        if kind not in _TYPES:
            what = f'whose "{label}" is of SPK type {kind}; types 2 and 3 (Chebyshev) are allowed: '
            raise KernelError(what + "convert it to one of these, as SPICE's spkmerge or JPL's Horizons do")
        if frame != _FRAME:
            raise KernelError(f'whose "{label}" is in frame {frame} of SPICE; J2000 (1) is allowed')
        try:
            words = self._words[first - 1 : last]
            begin, length, size, count = words[-4:].tolist()
            if not (length > 0 and begin <= start < end <= begin + count * length):
                raise ValueError("its blocks don't cover its span")
            rows = words[: int(count * size)].reshape(int(count), int(size))[:, 2:]
            blocks = rows.reshape(int(count), 3 * (kind - 1), -1)[:, :3].astype(np.float64, copy=False)
            if not np.isfinite(blocks).all():
                raise ValueError("numbers that aren't finite")
        except _UNREADABLE as error:
            raise _damaged(f'segment of "{label}"', error, "copy it again") from None
        return Fraction(begin), Fraction(length), blocks

    @property
    def digest(self) -> str:
        assert self.place is not None
        return digest_of([self.place])


def _word(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _words(error: Exception) -> str:
    return str(error).split("\n")[0][:120] or type(error).__name__


def _damaged(what: str, error: Exception, remedy: str) -> KernelError:
    return KernelError(f"whose {what} is damaged or truncated ({_words(error)}); {remedy}")


def digest_of(paths: list[Path]) -> str:
    """SHA-256 of files one after the other."""
    total = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: total)
    return total.hexdigest()


# --- where they are -----------------------------------------------------------------------------------------


def is_path(given: str) -> bool:
    """Whether a kernel is given as a file's path rather than a package's name."""
    return "/" in given or "\\" in given or "." in given


def kernel_of(given: str, source: str) -> Kernel:
    """The kernel that a config names: ``source`` is where the config is, if it is a file.

    Raises:
        KernelError: it isn't there, or can't be read.
    """
    if is_path(given):
        path = find_file(given, source, "an SPK file")
        try:
            return _opened(str(path), (found := path.stat()).st_size, found.st_mtime_ns)
        except OSError as error:
            raise KernelError(f"which can't be read ({error.strerror or error}): {path}") from None
    if (folder := _package(given)) is not None:
        return PackagedKernel(given, folder)
    what = f"which is no installed package of an ephemeris{nearest(given, _PACKAGES)}; allowed: an installed "
    what += f"one of {', '.join(_PACKAGES)} (pip install NAME), or the path of an SPK file, with a slash or "
    raise KernelError(f'{what}a suffix: "./{given}.bsp"')


@lru_cache(maxsize=4)
def _opened(path: str, size: int, changed: int) -> SpkKernel:
    """The kernel of an SPK file, read once per process as long as it doesn't change."""
    return SpkKernel(Path(path))


def _package(name: str) -> Path | None:
    """Folder of an installed package of an ephemeris; None if there is none of this name."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        spec = None
    folder = Path() if spec is None or spec.origin is None else Path(spec.origin).parent
    return folder if (folder / "constants.npy").exists() and list(folder.glob("jpl-*.npy")) else None


def find_file(given: str, source: str, what: str) -> Path:
    """The absolute path of a file, such as a kernel, that is given by its own; ``what`` it should be.

    Raises:
        KernelError: it isn't there.
    """
    wanted, folders = Path(given).expanduser(), folders_of(source)
    places = [wanted] if wanted.is_absolute() else [folder / wanted for folder in folders]
    try:
        for path in [*places, *(folder / wanted.name for folder in folders)]:
            if path.is_file():
                return path.absolute()
        if any(path.is_dir() for path in places):
            raise KernelError(f"which is a folder; the path of {what} is allowed")
    except OSError as error:  # names that no file system takes
        raise KernelError(f"which can't be looked for ({error.strerror or error})") from None
    looked = ", ".join(dict.fromkeys(str(path.parent) for path in places))
    why = f"which isn't there: looked for in {looked}; put it there, or name its folder in the environment "
    raise KernelError(f"{why}variable {FOLDERS}")


def folders_of(source: str) -> list[Path]:
    """Folders to look in: the config's, the one that a run's folder notes, and those that are named."""
    file = Path(source.removesuffix(EMBEDDED)).absolute()
    named = [Path(x) for x in os.environ.get(FOLDERS, "").split(os.pathsep) if x]
    if not file.is_file():
        return [Path.cwd(), *named]
    notes = [folder / NOTE for folder in (file.parent, file.parent.parent)]  # of a run, and of its segments
    texts = [noted.read_text(encoding="utf-8") for noted in notes if noted.is_file()]
    lines = [line for text in texts for line in text.splitlines()]
    beside = [Path(line.strip()).parent for line in lines if line.strip()]
    return [file.parent, *named, *beside]


# --- what a scene sees of them ------------------------------------------------------------------------------


_METRES = 1000


class EphemerisTable(ConfigTable):
    """``[ephemeris]``: where sources given by name are."""

    kernel: StrictStr = Field(examples=["de421", "./de440.bsp"])
    """an installed package (de405, de421, de423), or the path of an SPK file from the config's folder, with a
    slash or a suffix; its SHA-256 is kept in the dataset
    """


@dataclass(frozen=True, eq=False, repr=False)
class Ephemeris:
    """A kernel as a scene uses it.

    Attributes:
        kernel: where bodies are.
        given: its name or path as the config gives it.
        axes: name of the scene's space axes.
        ahead: date of the scene's time 0: seconds of TDB since J2000.
        run: start and end of the run, s (mpf).
        used: what the scene has seen of it so far.
    """

    kernel: Kernel
    given: str
    axes: str
    ahead: Fraction
    run: tuple[Any, Any]
    used: list[RelativeEphemeris] = field(default_factory=list)

    def refused(self, what: str) -> ConfigError:
        """The error of the kernel's key."""
        return ConfigError(Problem("[ephemeris] kernel", f'given "{self.given}", {what}'))

    def check_body(self, body: str, fault: Callable[[str], ConfigError]) -> None:
        """Refuse a body that the kernel doesn't place."""
        if not self.kernel.known(body):
            bodies = self.kernel.bodies
            raise fault(
                f"given {shown(body)}{nearest(body, bodies)}; {self.kernel.name} has {', '.join(bodies)}; "
                'others are in SPK files, which [ephemeris] kernel names by their path ("./NAME.bsp")'
            )

    def sight(self, source: str, host: str) -> RelativeEphemeris:
        """One body seen from another (empty: the barycentre) over the run.

        Raises:
            ConfigError: the run goes beyond the kernel's span, or the kernel is damaged.
        """
        try:
            found = self.kernel.sight(source, host)
        except KernelError as error:
            raise self.refused(str(error)) from None
        first, last = found.span
        begin, end = sorted(self.run)
        ahead = exactly(begin.context, self.ahead)
        if begin + ahead < exactly(begin.context, first) or end + ahead > exactly(begin.context, last):
            asked = " to ".join(date_of(int(x + ahead)) for x in self.run)
            reach = " to ".join(map(date_of, found.span))
            what = f'which has "{source}" from {reach} (TDB), but the run goes from {asked}; '
            raise self.refused(what + "change [time] epoch, start or end, or take a longer kernel")
        self.used.append(found)
        return found

    def start_of(self, body: str, context: Any) -> tuple[Vector, Vector]:
        """Place and velocity of a body at the start, m and m/s (mpf), space axes, from the barycentre."""
        sight = self.sight(body, "")
        return self.place(context, sight, self.run[0]), self.place(context, sight, self.run[0], 1)

    def place(self, context: Any, sight: RelativeEphemeris, time: Any, order: int = 0) -> Vector:
        """Vector (mpf, m, space axes) of a sight at a time of the scene (mpf, s), or a derivative of it."""
        found = [_METRES * x for x in sight.at(context, time + exactly(context, self.ahead), order)]
        return to_ecliptic(found, obliquity(context)) if self.axes == ECLIPTIC else found


def resolve_ephemeris(
    table: EphemerisTable | None, axes: str | None, epoch: Epoch | None, run: tuple[Any, Any], source: str
) -> Ephemeris | None:
    """The ephemeris of a config; None without one. ``source`` is where the config is, if it is a file.

    Raises:
        ConfigError: it can't be read, or lacks a date or axes.
    """
    if table is None:
        return None
    if epoch is None:
        what = 'missing; [ephemeris] needs the date of time 0, such as "2000-01-01T12:00:00 TDB" or "J2000"'
        raise ConfigError(Problem("[time] epoch", what))
    if axes not in (None, ECLIPTIC, *CELESTIAL):
        what = (
            f'given "{axes}", which differs from the kernel\'s axes by the bias of 0.02 arcsec of the frame '
        )
        what += f'J2000; "{ICRF}" (the default here), "GCRF" or "{ECLIPTIC}" is allowed'
        raise ConfigError(Problem("[frame] axes", what))
    try:
        kernel = kernel_of(table.kernel, source)
    except KernelError as error:
        raise ConfigError(Problem("[ephemeris] kernel", f'given "{table.kernel}", {error}')) from None
    return Ephemeris(kernel, table.kernel, axes or ICRF, epoch.since_j2000(), run)


def host_of(ephemeris: Ephemeris | None, host: str | None, masses: Sequence[str]) -> str:
    """The body of the kernel that ``[body] host`` names; empty where it names one of ``[[bodies]]``, or none.

    Raises:
        ConfigError: neither has it.
    """
    if ephemeris is None or host is None or host in masses:
        return ""

    def fault(what: str) -> ConfigError:
        also = f", [[bodies]] are {', '.join(masses)}" if masses else ""
        return ConfigError(Problem("[body] host", what + also))

    ephemeris.check_body(host, fault)
    return host


def date_of(seconds: Fraction | int) -> str:
    """Date of a time in seconds since J2000 (TDB), or its Julian date past the years that have one."""
    try:
        whole = J2000.after(Decimal(round(seconds)))
    except (ValueError, OverflowError):
        return f"JD {float(J2000_DATE + Fraction(seconds) / DAY):.1f}"
    return whole.calendar().removesuffix("T00:00:00")
