"""SPICE's toolkit, through spiceypy, and the published orientation of ``[output] orientation``.

The toolkit is loaded where it is needed, its pool of kernels left as it was found.

Text kernels hold right ascension and declination of the pole and the prime meridian as polynomials and sines
(the IAU's, Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22), binary ones Chebyshev series of angles.
SPICE itself reads both, in double precision, as which they are published.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import KernelError, date_of, digest_of, find_file, is_path
from rigidsim.scene.space_axes import CELESTIAL, ECLIPTIC, obliquity, to_ecliptic
from rigidsim.scene.validation_messages import nearest, shown

_EXTRA = "pip install 'rigidsim[spice]'"
_LONGEST_PATH = 255  # characters that SPICE's loader takes

_KIND = "a PCK of SPICE (.tpc or .bpc)"
_MOST = 1000  # bodies of a kernel
_EQUATOR = "J2000"


@cache
def spice() -> Any:
    """The package spiceypy.

    Raises:
        KernelError: it isn't installed.
    """
    try:
        return importlib.import_module("spiceypy")
    except ImportError:
        what = f"which SPICE's toolkit reads and writes, and the package spiceypy isn't installed: {_EXTRA}"
        raise KernelError(what) from None


@contextmanager
def loaded(*paths: Path) -> Iterator[Any]:
    """spiceypy with some kernels loaded, which are unloaded again.

    Raises:
        KernelError: SPICE refuses a kernel, or what is asked of it within the block.
    """
    toolkit = spice()
    long = next((path for path in paths if len(str(path)) > _LONGEST_PATH), None)
    if long is not None:
        raise KernelError(f"whose path has {len(str(long))} characters; SPICE takes at most {_LONGEST_PATH}")
    done: list[str] = []
    try:
        for path in paths:
            toolkit.furnsh(str(path))
            done.append(str(path))
        yield toolkit
    except toolkit.utils.exceptions.SpiceyError as error:
        raise KernelError(f"which SPICE refuses ({_words(error)})") from None
    finally:
        for name in reversed(done):
            toolkit.unload(name)


def _words(error: Any) -> str:
    """The first sentence of what SPICE says, without line breaks."""
    short, text = str(error.short), " ".join(str(error.long).split())
    return f"{short}: {text.split('. ')[0][:160]}"


@dataclass(frozen=True, eq=False)
class Orientation:
    """Published axes of a body along time.

    Attributes:
        place, digest: the kernel's file, and its SHA-256.
        body: number of NAIF by which SPICE knows the axes: of the body, or of the class of a binary kernel.
        described: what it is, for readers.
        ahead: date of the scene's time 0: seconds of TDB since J2000.
        equator: matrix from SPICE's J2000 to the scene's space axes.
    """

    place: Path
    digest: str
    body: int
    described: str
    ahead: Fraction
    equator: np.ndarray

    @property
    def name(self) -> str:
        """The kernel's name."""
        return self.place.name

    def dates(self, seconds: list[np.ndarray]) -> np.ndarray:
        """SPICE's times of some times of the scene, which are given in parts."""
        near = float(self.ahead)
        total: Any = np.longdouble(near) + np.longdouble(float(self.ahead - Fraction(near)))
        for part in reversed(seconds):
            total = total + part
        return np.atleast_1d(total).astype(np.float64)

    def matrices(self, dates: np.ndarray) -> np.ndarray:
        """Matrices (rows, 3, 3) from the published body axes to J2000, at SPICE's times.

        Raises:
            KernelError: the kernel can't be read there.
        """
        with loaded(self.place) as toolkit:
            found = [toolkit.tipbod(_EQUATOR, self.body, date) for date in dates.tolist()]
        return np.asarray(found).reshape(-1, 3, 3).transpose(0, 2, 1)


def resolve_orientation(
    given: str | None,
    asked: str | None,
    host: str | None,
    axes: str | None,
    epoch: Epoch | None,
    run: tuple[Any, Any],
    source: str,
) -> Orientation:
    """The published orientation that a config names.

    Args:
        given, asked: ``[output] orientation`` and ``orientation_of``, one of which is there.
        host: ``[body] host``, the body if none is asked for.
        axes, epoch, run: space axes, date of time 0, and start and end of the run (mpf, s).
        source: where the config is, if it is a file.

    Raises:
        ConfigError: the kernel can't be read, or hasn't the body or the dates.
    """
    if given is None:
        what = f'given "{asked}" without [output] orientation, the kernel that has it; give that, or leave '
        raise ConfigError(Problem("[output] orientation_of", what + "this out"))
    if epoch is None:
        what = 'missing; [output] orientation needs the date of time 0, such as "J2000"'
        raise ConfigError(Problem("[time] epoch", what))
    if axes not in (ECLIPTIC, *CELESTIAL):
        said = "missing; [output] orientation needs to know" if axes is None else f'given "{axes}", which'
        more = " what the space axes are" if axes is None else " differs from SPICE's axes by 0.02 arcsec"
        allowed = ", ".join(f'"{name}"' for name in (*CELESTIAL, ECLIPTIC))
        raise ConfigError(Problem("[frame] axes", f"{said}{more}; allowed: {allowed}"))
    ahead = epoch.since_j2000()
    begin, end = sorted(float(ahead + Fraction(float(time))) for time in run)
    try:
        if not is_path(given):
            raise KernelError(f"which is no path; the path of {_KIND}, with a slash or a suffix, is allowed")
        place = find_file(given, source, _KIND)
        with loaded(place) as toolkit:
            body, described = _axes_in(toolkit, place, asked, host, (begin, end))
            for date in (begin, end):
                toolkit.tipbod(_EQUATOR, body, date)
    except KernelError as error:
        raise ConfigError(Problem("[output] orientation", f'given "{given}", {error}')) from None
    turn = np.eye(3) if axes != ECLIPTIC else np.array(to_ecliptic(list(np.eye(3)), obliquity(np)))
    return Orientation(place, digest_of([place]), body, described, ahead, turn)


def _axes_in(
    toolkit: Any, place: Path, asked: str | None, host: str | None, run: tuple[float, float]
) -> tuple[int, str]:
    """Number and description of the axes that are asked for in a kernel that is loaded."""
    form, kind = toolkit.getfat(str(place))
    if kind != "PCK":
        raise KernelError(f"which is no PCK: SPICE takes it for {form} {kind}; {_KIND} is allowed")
    if form == "KPL":
        text = place.read_text(encoding="ascii", errors="replace")
        codes = {int(code) for code in re.findall(r"\bBODY(-?\d+)_POLE_RA\b", text)}
        names = {code: toolkit.bodc2s(code).lower().replace(" ", "_") for code in sorted(codes)}
    else:
        cell = toolkit.stypes.SPICEINT_CELL(_MOST)
        toolkit.pckfrm(str(place), cell)
        names, host = {int(code): str(code) for code in cell}, None
    known = ", ".join(names.values()) or "nothing"
    wanted = asked or host or (known if len(names) == 1 and form != "KPL" else None)
    if wanted is None:
        raise KernelError(f"and nothing says whose axes; give [output] orientation_of: it has {known}")
    code = number_of(toolkit, wanted)
    if code not in names:
        hint = nearest(wanted, names.values())
        raise KernelError(f"which has nothing of {shown(wanted)}{hint}; it has {known}")
    if form == "KPL":
        return code, f"pole and prime meridian of {names[code]}"
    window = toolkit.pckcov(str(place), code)
    spans = [toolkit.wnfetd(window, i) for i in range(toolkit.wncard(window))]
    if not any(first <= run[0] and run[1] <= last for first, last in spans):
        reach, when = (
            ", ".join(" to ".join(date_of(int(x)) for x in span) for span in many) for many in (spans, [run])
        )
        what = f"which goes from {reach} (TDB), but the run from {when}; "
        raise KernelError(what + "change [time] epoch, start or end, or take a longer kernel")
    return code, f"axes {code}"


def number_of(toolkit: Any, name: str) -> int | None:
    """NAIF's number of a body; None if it has no such name."""
    try:
        return int(toolkit.bods2c(name.replace("_", " ")))
    except toolkit.NotFoundError:
        return None
