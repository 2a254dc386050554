"""What kernels of SPICE share that are written of a run: dates, numbers and names, and how close they are.

SPICE's times are doubles of seconds of TDB since J2000. What is written begins and ends at such, and is laid
out on multiples of their spacing, so that its times are exact, and the run is evaluated at just these.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from shutil import copyfile
from textwrap import wrap
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.ccsds import labels
from rigidsim.formats.registry import RunMotion, TableSource
from rigidsim.formats.tables import Table
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import KernelError
from rigidsim.scene.kernels.spice import loaded, spice
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.rotations import product, rotation_matrix
from rigidsim.scene.row_rotations import angles_between, normalised
from rigidsim.scene.space_axes import CELESTIAL, EQUATOR

J2000 = "J2000"
_WANTED, _ALLOWED = 2e-13, 1e-12
"""Errors of the attitude (rad) that are aimed at, and beyond which nothing is written; the latter, relative
to the largest, those of the angular velocity, too.
"""
_LONGEST_NAME = 26  # characters, with "FRAME_" those of a variable of SPICE's
_LINE = 78
_PUBLIC, _MANY = 1_400_000, 600_000  # numbers of frames that NAIF leaves to its users
_CHECKED = 64  # recorded samples that the run is compared at when it is integrated again
_SAME = 1e-11  # rad
_MOST_TIMES = 4_000_000
_MOST_HALVINGS = 6


def refused(what: str) -> RigidsimError:
    """The error of an export that can't be, with what to do."""
    return RigidsimError(f"{what}; csv and aem hold the samples themselves")


@dataclass(frozen=True)
class Errors:
    """Largest differences between what SPICE reads and the run, rad and of the largest rate; at how many
    times between those that were fitted.
    """

    attitude: float
    rate: float
    count: int

    def small(self, floor: float) -> bool:
        """Whether no closer fit is needed; ``floor``: as of ``SpiceRun``."""
        return self.attitude <= max(_WANTED, floor) and self.rate <= max(_ALLOWED, floor)

    def better(self, other: Errors) -> bool:
        """Whether a closer fit was worth it."""
        return max(self.attitude, self.rate) < max(other.attitude, other.rate) / 2

    def allowed(self, floor: float) -> bool:
        """Whether a kernel with them may be written."""
        return max(self.attitude, self.rate) <= max(_ALLOWED, 2 * floor)


@dataclass(frozen=True)
class SpiceRun:
    """A run as SPICE sees it; times are whole numbers of its ``spacing``, counted from J2000.

    Attributes:
        first, last: between which it is written.
        number: of its own, from its config, so that kernels of different runs can be loaded together.
        body: NAIF's number of the body; 0 if nothing says which it is.
        turn: quaternion from the scene's space axes to J2000.
    """

    source: TableSource
    table: Table
    motion: RunMotion
    epoch: Epoch
    axes: str
    spacing: Fraction
    first: int
    last: int
    number: int
    name: str
    body: int
    turn: np.ndarray
    notes: tuple[str, ...]

    @property
    def class_number(self) -> int:
        """Number of its frame as a PCK's."""
        return _class(self.number)

    @property
    def ahead(self) -> Fraction:
        """Date of time 0, s."""
        return self.epoch.since_j2000()

    def date(self, counts: Any) -> Any:
        """SPICE's times, exactly."""
        return np.ldexp(np.asarray(counts, dtype=np.float64), math.frexp(float(self.spacing))[1] - 1)

    def steps(self, seconds: float) -> int:
        """The largest power of two of spacings that isn't longer."""
        return 1 << max(math.floor(math.log2(seconds / float(self.spacing))), 0)

    @cached_property
    def largest_rate(self) -> float:
        """Largest recorded norm of the angular velocity, rad/s."""
        variable = self.table.dataset.get("angular_velocity")
        if variable is None:
            return float(np.linalg.norm(self.at([self.first])[1]))
        return float(np.linalg.norm(variable.values, axis=1).max())

    @property
    def turned_by(self) -> float:
        """Angle by which the body turns from one of SPICE's times to the next."""
        return self.largest_rate * float(self.spacing)

    @property
    def floor(self) -> float:
        """Angle by which times of the run, doubles too, may be off SPICE's; none where those are whole."""
        if (self.ahead / self.spacing).denominator == 1:
            return 0.0
        return self.largest_rate * float(np.spacing(float(max(map(abs, self.motion.span)))))

    def at(self, counts: Sequence[int] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (rows, 4) from body axes to J2000, and angular velocities in J2000, rad/s."""
        return self.at_times([int(k) * self.spacing - self.ahead for k in counts])

    def at_times(self, times: list[Fraction]) -> tuple[np.ndarray, np.ndarray]:
        """The same at any times of the scene, ascending, and at some samples besides, which are compared."""
        if len(times) > _MOST_TIMES:
            raise refused(f"the run turns so often that {len(times)} times would be needed of it")
        known = self._samples
        wanted = sorted({*times, *known})
        quaternions, rates = self.motion.at(wanted)
        place = {time: row for row, time in enumerate(wanted)}
        self._compare(known, quaternions[[place[time] for time in known]])
        rows = [place[time] for time in times]
        quaternion = quaternions[rows] / np.linalg.norm(quaternions[rows], axis=1)[:, None]
        there = np.stack(product([*self.turn], [*quaternion.T]), axis=1)
        matrix: np.ndarray = np.array(rotation_matrix([*there.T]))
        return there, np.einsum("ijn,nj->ni", matrix, rates[rows])

    @cached_property
    def _rows(self) -> list[int]:
        begin, end = self.motion.span
        rows = np.unique(np.linspace(0, self.table.rows - 1, _CHECKED).astype(int)).tolist()
        return [row for row in rows if begin <= time_of(self.table, row) <= end]

    @cached_property
    def _samples(self) -> list[Fraction]:
        return [time_of(self.table, row) for row in self._rows]

    def _compare(self, known: Sequence[Fraction], again: np.ndarray) -> None:
        saved = self.table.dataset["quaternion"].isel(time=self._rows).values
        away = angles_between(normalised(saved), normalised(again)).max(initial=0.0)
        announced = self.source.attributes.get("attitude_error") or 0.0
        if not away <= max(_SAME, 10 * float(announced)):
            what = f"integrated again, the run is {away:.2g} rad from its own samples: it was made by other "
            raise refused(f"{what}versions or on another machine (rigidsim verify checks it)")

    def comments(self, what: Sequence[str], errors: Errors) -> list[str]:
        """Lines of a kernel's comment area: what it holds, and how large its errors are."""
        told = self.source.attributes
        announced = [
            f"{words}: {float(told[key]):.2g} rad"
            for key, words in (
                ("attitude_error", "error of the attitude at the end, as the run announces it"),
                ("modelling_error", "error of the averaged model, as the run announces it"),
            )
            if key in told
        ] or ["the run announces no error of its attitude"]
        near = self.turned_by
        texts = [
            f"Attitude of the run {self.source.title}, by rigidsim {told.get('version_rigidsim', '?')}",
            f"SHA-256 of its config: {told.get('config_sha256', '?')}",
            *self.notes,
            f"time 0 of the run: {self.epoch}, TDB {float(self.ahead)!r} s from J2000 in SPICE's count",
            f"body: {self.body}" if self.body else "body: not named (--object-id); 0 stands for it",
            *what,
            *announced,
            f"interpolation: read back by SPICE at {errors.count} times between its rows, "
            f"it is at most {errors.attitude:.1e} rad from the run, its angular velocity {errors.rate:.1e} "
            "of the largest",
            f"numbers: the run's {self.source.bits} bits rounded to doubles; SPICE's times are doubles, here "
            f"{float(self.spacing):.2g} s apart, in which the body turns by {near:.1e} rad",
        ]
        return [line for text in texts for line in _lines(text)]


def _lines(text: str) -> list[str]:
    plain = "".join(c if " " <= c <= "~" else "?" for c in text)
    return wrap(plain, _LINE, subsequent_indent="   ")


def time_of(table: Table, row: int) -> Fraction:
    """Time of a sample, s."""
    parts = parts_in(table.dataset, "time")
    return sum((Fraction(float(table.dataset[part].values[row])) for part in parts), Fraction(0))


def run_of(table: Table, source: TableSource) -> SpiceRun:
    """A run as SPICE sees it.

    Raises:
        RigidsimError: its date, its axes or its attitude aren't known, or SPICE's times are too coarse.
    """
    if "quaternion" not in table.dataset or not table.rows:
        missing = "recorded no quaternion" if table.rows else "holds no samples yet"
        what = f"the run {missing}, which such a kernel is made of"
        raise RigidsimError(what + ("; name it in [output] record" if table.rows else ""))
    assert source.motion is not None
    named = labels(source.naming, source.attributes)
    if named.frame not in (*CELESTIAL, EQUATOR):
        allowed = ", ".join((*CELESTIAL, EQUATOR))
        raise RigidsimError(f"--axes: given {named.frame}, which SPICE doesn't know; allowed: {allowed}")
    ahead = named.epoch.since_j2000()
    begin, end = (ahead + time for time in source.motion.span)
    end = min(end, ahead + time_of(table, table.rows - 1))
    size = max(abs(time) for time in (begin, end, begin - ahead, end - ahead))  # of dates, and of the run's
    spacing = Fraction(2) ** (math.frexp(float(size))[1] - 53)
    first, last = math.ceil(begin / spacing), math.floor(end / spacing)
    if last - first < 64:
        what = f"the run lasts {float(end - begin):.2g} s, and SPICE's times, seconds since J2000, are "
        raise refused(f"{what}{float(spacing):.1g} s apart there; give it an epoch nearer to J2000")
    half = [1.0, 0.0, 0.0, 0.0] if named.turn is None else [float(x) for x in named.turn[2:]] + [0.0, 0.0]
    notes = *named.notes, "SPICE takes EME2000, ICRF and GCRF for the same, J2000"
    number = 100_000_000 + int(str(source.attributes.get("config_sha256", "0"))[:7], 16)
    return SpiceRun(
        source, table, source.motion, named.epoch, named.frame, spacing, first, last,
        number, _name_of(source, number), _body_of(source), np.array(half), notes,
    )  # fmt: skip


def _class(number: int) -> int:
    return _PUBLIC + number % _MANY


def _name_of(source: TableSource, number: int) -> str:
    """Name of the frame: the object's or the run's, in capitals."""
    given = source.naming.object_name or source.title
    name = re.sub(r"[^A-Z0-9]+", "_", given.upper()).strip("_")
    if not name or len(name) > _LONGEST_NAME:
        what = f'--object-name: the frame would be named "{name}"; 1 to {_LONGEST_NAME} letters, digits and '
        raise RigidsimError(what + "underscores are allowed: give a shorter name")
    if spice().namfrm(name) not in (0, -number, _class(number)):  # those are of an earlier export
        what = f'--object-name: the frame would be named "{name}", which SPICE has already; give another name'
        raise RigidsimError(what)
    return name


def _body_of(source: TableSource) -> int:
    """NAIF's number of the body; 0 where neither an option nor ``[body] host`` names it."""
    assert source.motion is not None
    given = source.naming.object_id
    name = given or source.motion.host
    if re.fullmatch(r"-?\d{1,9}", name):
        return int(name)
    toolkit = spice()
    try:
        return int(toolkit.bodn2c(name.replace("_", " "))) if name else 0
    except toolkit.NotFoundError:
        if not given:
            return 0
        what = f'--object-id: given "{given[:40]}"; a number or a name that SPICE knows is allowed: 301, moon'
        raise RigidsimError(what) from None


@dataclass(frozen=True)
class Attempt:
    """A kernel that was written.

    Attributes:
        told: lines on what it holds.
        checked: times between those that it is made of, as counts.
        truth: quaternions and angular velocities of the run there, as of ``SpiceRun.at``.
    """

    told: list[str]
    checked: np.ndarray
    truth: tuple[np.ndarray, np.ndarray]


def fit_and_read_back(
    run: SpiceRun,
    path: Path,
    step: int,
    attempt: Callable[[int, Path], Attempt | None],
    read: Callable[[Any, float], tuple[np.ndarray, np.ndarray]],
    why_not: Callable[[Errors], str],
    beside: Callable[[Path], None] | None = None,
) -> None:
    """Write a kernel as closely spaced as the run needs it: what SPICE reads of it is compared with the run.

    Args:
        step: the widest spacing, halved until the kernel is close enough or gets no closer.
        attempt: writes a kernel of a spacing; None where SPICE's times are too coarse for it.
        read: quaternion and angular velocity in J2000 at one of SPICE's times, by its toolkit.
        why_not: why no kernel is close enough.
        beside: writes the text kernel that it is read with.

    Raises:
        RigidsimError: no kernel is close enough, or SPICE can't write it.
    """
    errors, made = Errors(math.inf, math.inf, 0), None
    with _scratch() as folder:
        trial, others = folder / "kernel", [folder / "beside"] if beside else []
        if beside:
            beside(others[0])
        for _ in range(_MOST_HALVINGS):
            trial.unlink(missing_ok=True)
            if (following := attempt(step, trial)) is None:
                break
            made, before = following, errors
            with loaded(*others, trial) as toolkit:
                found = [read(toolkit, date) for date in run.date(made.checked).tolist()]
            quaternions, rates = (np.array(values) for values in zip(*found, strict=True))
            slow = np.linalg.norm(rates - made.truth[1], axis=1).max() / max(run.largest_rate, 1e-300)
            away = angles_between(quaternions, made.truth[0]).max()
            errors = Errors(float(away), float(slow), len(found))
            if errors.small(run.floor) or not errors.better(before):
                break
            step //= 2
        if made is None or not errors.allowed(run.floor):
            raise refused(why_not(errors))
        toolkit = spice()
        handle = toolkit.dafopw(str(trial))
        try:
            toolkit.dafac(handle, run.comments(made.told, errors))
        finally:
            toolkit.dafcls(handle)
        copyfile(trial, path)


@contextmanager
def _scratch() -> Iterator[Path]:
    """A folder with a short path, as SPICE needs it; its errors are told as ours."""
    try:
        with tempfile.TemporaryDirectory(prefix="rigidsim-spice-") as folder:
            try:
                yield Path(folder)
            except KernelError as error:
                raise RigidsimError(f"a kernel {error}") from None
            except spice().utils.exceptions.SpiceyError as error:
                said = " ".join(str(getattr(error, "long", error)).split())[:200]
                raise RigidsimError(f"SPICE can't write the kernel: {said}") from None
    except OSError as error:
        raise RigidsimError(f"the temporary folder: {error.strerror or error}; set TMPDIR") from None


def frame_text(run: SpiceRun, number: int, kind: int, more: Sequence[tuple[str, str]] = ()) -> str:
    """The definition of a frame of SPICE's, of class 2 (PCK) or 3 (CK), as lines of a text kernel."""
    rows = [
        (f"FRAME_{run.name}", str(number)), (f"FRAME_{number}_NAME", f"'{run.name}'"),
        (f"FRAME_{number}_CLASS", str(kind)), (f"FRAME_{number}_CLASS_ID", str(number)),
        (f"FRAME_{number}_CENTER", str(run.body)), *more,
    ]  # fmt: skip
    return "".join(f"   {name:<32} = {value}\n" for name, value in rows)


def write_text(path: Path, kind: str, title: Sequence[str], data: str) -> None:
    """Write a text kernel."""
    lines = [line for text in title for line in _lines(text)]
    path.write_text(
        "\n".join([f"KPL/{kind}", "", *lines, "", "\\begindata", "", data, "\\begintext", ""]),
        encoding="ascii", newline="\n",
    )  # fmt: skip
