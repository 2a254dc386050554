"""Kernels of SPICE that are written of a run: CK and binary PCK, each with the text kernel it is read by; and
CK of other programs, read.

SPICE's times are doubles of seconds of TDB since J2000. What is written begins and ends at such, and is laid
out on multiples of their spacing, so that its times are exact, and the run is evaluated at just these. Either
kernel is written as closely spaced as the run needs it: what SPICE reads of it between its rows is compared
with the run.

A CK's segments are of type 5, subtype 3: quaternions and angular velocities, interpolated by polynomials of
degree 15 through the 16 nearest rows (NAIF, "CK Required Reading"). Near the ends of a segment SPICE takes
those rows alone that are as near on the other side, so that two more segments with closer rows lie at the
run's ends. The clock counts SPICE's own times.

A PCK's segments are of type 2: Chebyshev series of the angles phi, delta and w of [w]_3 [delta]_1 [phi]_3,
from an inertial frame to the body's axes (NAIF, "PCK Required Reading"), whose derivatives are the angular
velocity. Of the inertial frames that SPICE has, the one is taken from whose pole the body's z axis stays
farthest away. A second segment of a single interval ends where the run does.

A CK is read as a trajectory, at times between its own, which SPICE interpolates, or as observations, at its
own times. Attitudes and rates are always SPICE's; its own times are found in the segments. Of segments that
overlap SPICE takes the last one in the file, and so do the own times.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from shutil import copyfile
from textwrap import wrap
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.ccsds import labels
from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.tables import Table
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import KernelError
from rigidsim.scene.kernels.spice import loaded, number_of, spice
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.rotations import (
    angles_between,
    multiplied,
    normalised,
    product,
    quaternion_of,
    rotation_matrix,
)
from rigidsim.scene.space_axes import CELESTIAL, EQUATOR, from_equator

J2000 = "J2000"
_WANTED, _ALLOWED = 2e-13, 1e-12
"""Errors of the attitude (rad) that are aimed at, and beyond which nothing is written; the latter, relative
to the largest, is the bound of the angular velocity, too.
"""
_LONGEST_NAME = 26  # characters; a variable of SPICE has six more, for "FRAME_"
_LINE = 78
_PUBLIC, _MANY = 1_400_000, 600_000  # numbers of frames that NAIF leaves to its users
_CHECKED = 64  # recorded samples that the run is compared at when it is integrated again
_SAME = 1e-11  # rad
_MOST_TIMES = 4_000_000
_MOST_HALVINGS = 6
_SHORTEST = 64  # of SPICE's times in a run

Motion = tuple[np.ndarray, np.ndarray]
"""Quaternions (rows, 4) from body axes to J2000, and angular velocities (rows, 3) in J2000, rad/s."""
Attempt = tuple[list[str], np.ndarray, Motion]
"""Of a kernel that was written: lines on what it holds, counts of times between those that it is made of,
and the run there.
"""


def refused(what: str) -> RigidsimError:
    """The error of an export that can't be, with what to do."""
    return RigidsimError(f"{what}; csv and aem hold the samples themselves")


class SpiceRun:
    """A run as SPICE sees it; times are whole numbers of its ``spacing``, counted from J2000.

    Attributes:
        first, last: between which it is written.
        ahead: date of time 0, s.
        number: unique, from the config, so that kernels of different runs can be loaded together.
        class_number: of its frame as a PCK's.
        name, body: of the frame; NAIF's number of the body, 0 if nothing says which it is.
        fastest: largest recorded norm of the angular velocity, rad/s.
    """

    def __init__(self, table: Table, source: TableSource) -> None:
        if "quaternion" not in table.dataset or not table.rows:
            missing = "recorded no quaternion" if table.rows else "holds no samples yet"
            what = f"the run {missing}, which such a kernel is made of"
            raise RigidsimError(what + ("; name it in [output] record" if table.rows else ""))
        named = labels(source.naming, source.attributes)
        if named.frame not in (*CELESTIAL, EQUATOR):
            allowed = ", ".join((*CELESTIAL, EQUATOR))
            raise RigidsimError(f"--axes: given {named.frame}, which SPICE doesn't know; allowed: {allowed}")
        self.source, self.table, self.named, self.motion = source, table, named, source.motion
        self.ahead = named.epoch.since_j2000()
        begin, end = (self.ahead + time for time in self.motion.span)
        begin, end = max(begin, self.ahead + self._time(0)), min(end, self.ahead + self._time(table.rows - 1))
        size = max(abs(time) for time in (begin, end, begin - self.ahead, end - self.ahead))
        self.spacing = Fraction(2) ** (math.frexp(float(size))[1] - 53)
        self.first, self.last = math.ceil(begin / self.spacing), math.floor(end / self.spacing)
        if self.last - self.first < _SHORTEST:
            what = f"the run lasts {float(end - begin):.2g} s, and SPICE's times, seconds since J2000, are "
            raise refused(f"{what}{float(self.spacing):.1g} s apart there; give it an epoch nearer to J2000")
        half = [1.0, 0.0] if named.turn is None else list(map(float, named.turn[2:]))
        self._turn = [*half, 0.0, 0.0]
        self.number = 100_000_000 + int(str(source.attributes.get("config_sha256", "0"))[:7], 16)
        self.class_number = _PUBLIC + self.number % _MANY
        self.name, self.body = self._name(), self._body()
        places = np.unique(np.linspace(0, table.rows - 1, _CHECKED).astype(int)).tolist()
        times = {row: self._time(row) for row in places}
        self._known = {x: t for x, t in times.items() if self.motion.span[0] <= t <= self.motion.span[1]}
        known = table.dataset.get("angular_velocity")
        rates = self.at([self.first])[1] if known is None else known.values
        self.fastest = float(np.linalg.norm(rates, axis=1).max())
        whole = (self.ahead / self.spacing).denominator == 1  # else times, doubles too, may be off SPICE's
        self.floor = (
            0.0 if whole else self.fastest * float(np.spacing(float(max(map(abs, self.motion.span)))))
        )

    def _time(self, row: int) -> Fraction:
        """Time of a sample, s."""
        parts = (self.table.dataset[part].values[row] for part in parts_in(self.table.dataset, "time"))
        return sum((Fraction(float(part)) for part in parts), Fraction(0))

    def _name(self) -> str:
        """Name of the frame: the object's or the run's, in capitals."""
        given = self.source.naming.object_name or self.source.title
        name = re.sub(r"[^A-Z0-9]+", "_", given.upper()).strip("_")
        what = f'--object-name: the frame would be named "{name}"'
        if not 0 < len(name) <= _LONGEST_NAME:
            raise RigidsimError(f"{what}; 1 to {_LONGEST_NAME} letters, digits and underscores are allowed")
        if spice().namfrm(name) not in (0, -self.number, self.class_number):  # those are of an earlier export
            raise RigidsimError(f"{what}, which SPICE has already; give another name")
        return name

    def _body(self) -> int:
        given = self.source.naming.object_id
        name = given or self.motion.host
        number = number_of(spice(), name) if name else 0
        if given and number is None:
            what = f'--object-id: given "{given[:40]}"; a number or a name that SPICE knows is allowed: 301, '
            raise RigidsimError(what + "moon")
        return number or 0

    def date(self, counts: Any) -> Any:
        """SPICE's times, exactly."""
        return np.ldexp(np.asarray(counts, dtype=np.float64), math.frexp(float(self.spacing))[1] - 1)

    def step(self, turned: float, most: int) -> int:
        """The largest power of two of spacings in which it turns by no more than some angle, rad."""
        seconds = turned / max(self.fastest, 1e-300)
        return min(1 << max(math.floor(math.log2(seconds / float(self.spacing))), 0), most)

    def at(self, counts: Sequence[int] | np.ndarray) -> Motion:
        """Its motion at SPICE's times."""
        return self.at_times([int(k) * self.spacing - self.ahead for k in counts])

    def at_times(self, times: list[Fraction]) -> Motion:
        """Its motion at any ascending times of the scene, and at some samples besides, which are compared."""
        if len(times) > _MOST_TIMES:
            raise refused(f"the run turns so often that {len(times)} times would be needed of it")
        wanted = sorted({*times, *self._known.values()})
        quaternions, rates = self.motion.at(wanted)
        place = {time: row for row, time in enumerate(wanted)}
        again = quaternions[[place[time] for time in self._known.values()]]
        saved = self.table.dataset["quaternion"].isel(time=list(self._known)).values
        away = angles_between(normalised(saved), normalised(again)).max(initial=0.0)
        if not away <= max(_SAME, 10 * float(self.source.attributes.get("attitude_error") or 0.0)):
            what = f"integrated again, the run is {away:.2g} rad from its own samples: it was made by other "
            raise refused(f"{what}versions or on another machine (rigidsim verify checks it)")
        rows = [place[time] for time in times]
        quaternion = quaternions[rows] / np.linalg.norm(quaternions[rows], axis=1)[:, None]
        there = np.stack(product(self._turn, [*quaternion.T]), axis=1)
        matrix: np.ndarray = np.array(rotation_matrix([*there.T]))
        return there, np.einsum("ijn,nj->ni", matrix, rates[rows])

    def write(
        self,
        path: Path,
        step: int,
        attempt: Callable[[int, Path], Attempt | None],
        read: Callable[[Any, float], tuple[Any, np.ndarray]],
        remedy: str,
        beside: Callable[[Path], None] | None = None,
    ) -> None:
        """Write a kernel as closely spaced as the run needs it.

        Args:
            step: the widest spacing, halved until the kernel is close enough or gets no closer.
            attempt: writes a kernel of a spacing; None where SPICE's times are too coarse for it.
            read: matrix from J2000 and angular velocity in J2000 at one of SPICE's times, by its toolkit.
            remedy: what may help where no kernel is close enough.
            beside: writes the text kernel that it is read with.

        Raises:
            RigidsimError: no kernel is close enough, or SPICE can't write it.
        """
        away, slow, made = math.inf, math.inf, None
        with _scratch() as folder:
            trial, others = folder / "kernel", [folder / "beside"] if beside else []
            if beside:
                beside(others[0])
            for _ in range(_MOST_HALVINGS):
                trial.unlink(missing_ok=True)
                if (following := attempt(step, trial)) is None:
                    break
                made, before = following, max(away, slow)
                _, checked, (quaternions, rates) = made
                with loaded(*others, trial) as toolkit:
                    found = [read(toolkit, date) for date in self.date(checked).tolist()]
                matrices, turning = (np.array(values) for values in zip(*found, strict=True))
                away = float(angles_between(quaternion_of(matrices.transpose(0, 2, 1)), quaternions).max())
                slow = float(np.linalg.norm(turning - rates, axis=1).max() / max(self.fastest, 1e-300))
                close = away <= max(_WANTED, self.floor) and slow <= max(_ALLOWED, self.floor)
                if close or not max(away, slow) < before / 2:
                    break
                step //= 2
            if made is None or not max(away, slow) <= max(_ALLOWED, 2 * self.floor):
                why = f"the closest is {away:.1e} rad from the run, {slow:.1e} in its rate"
                if made is None:
                    why = f"SPICE's times are {float(self.spacing):.1g} s apart, in which the body turns by "
                    why += f"{self.fastest * float(self.spacing):.2g} rad"
                raise refused(f"no kernel is close enough: {why}. {remedy}")
            toolkit = spice()
            handle = toolkit.dafopw(str(trial))
            try:
                toolkit.dafac(handle, self._comments(made[0], away, slow, len(made[1])))
            finally:
                toolkit.dafcls(handle)
            copyfile(trial, path)

    def _comments(self, what: Sequence[str], away: float, slow: float, count: int) -> list[str]:
        """Lines of a kernel's comment area: what it holds, and how large its errors are."""
        known, spacing = self.source.attributes, float(self.spacing)
        announced = [
            f"{words}: {float(known[key]):.2g} rad"
            for key, words in (
                ("attitude_error", "error of the attitude at the end, as the run announces it"),
                ("modelling_error", "error of the averaged model, as the run announces it"),
            )
            if key in known
        ] or ["the run announces no error of its attitude"]
        texts = [
            f"Attitude of the run {self.source.title}, by rigidsim {known.get('version_rigidsim', '?')}",
            f"SHA-256 of its config: {known.get('config_sha256', '?')}",
            *self.named.notes,
            "SPICE takes EME2000, ICRF and GCRF for the same, J2000",
            f"time 0 of the run: {self.named.epoch}, TDB {float(self.ahead)!r} s from J2000 in SPICE's count",
            f"body: {self.body}" if self.body else "body: not named (--object-id); its ID is 0",
            *what,
            *announced,
            f"interpolation: read by SPICE at {count} times between its rows, attitudes differ from the run "
            f"by at most {away:.1e} rad, angular velocities by {slow:.1e} of the largest",
            f"numbers: the run's {self.source.bits} bits rounded to doubles; SPICE's times are doubles, here "
            f"{spacing:.2g} s apart, in which the body turns by {self.fastest * spacing:.1e} rad",
        ]
        return _lines(texts)

    def write_text(
        self, path: Path, kind: str, title: list[str], number: int, frame_class: int, rows: dict[str, str]
    ) -> None:
        """Write a text kernel: some variables, and the frame of a class of SPICE's: 2 (PCK) or 3 (CK)."""
        frame = {
            f"FRAME_{self.name}": str(number), f"FRAME_{number}_NAME": f"'{self.name}'",
            f"FRAME_{number}_CLASS": str(frame_class), f"FRAME_{number}_CLASS_ID": str(number),
            f"FRAME_{number}_CENTER": str(self.body),
        }  # fmt: skip
        data = "".join(f"   {name:<32} = {value}\n" for name, value in (rows | frame).items())
        title = [*title, f"pxform('J2000', '{self.name}', et) goes from J2000 to the body's axes."]
        lines = [f"KPL/{kind}", "", *_lines(title), "", "\\begindata", "", data, "\\begintext", ""]
        path.write_text("\n".join(lines), encoding="ascii", newline="\n")


def _lines(texts: Sequence[str]) -> list[str]:
    plain = ("".join(c if " " <= c <= "~" else "?" for c in text) for text in texts)
    return [line for text in plain for line in wrap(text, _LINE, subsequent_indent="   ")]


@contextmanager
def _scratch() -> Iterator[Path]:
    """A folder with a short path, as SPICE needs it; SPICE's errors become ours."""
    try:
        with tempfile.TemporaryDirectory(prefix="rigidsim-spice-") as folder:
            yield Path(folder)
    except KernelError as error:
        raise RigidsimError(f"a kernel {error}") from None
    except spice().utils.exceptions.SpiceyError as error:
        said = " ".join(str(getattr(error, "long", error)).split())[:200]
        raise RigidsimError(f"SPICE can't write the kernel: {said}") from None
    except OSError as error:
        raise RigidsimError(f"the temporary folder: {error.strerror or error}; set TMPDIR") from None


# --- CK -----------------------------------------------------------------------------------------------------

_CK_DEGREE = 15
_WINDOW = _CK_DEGREE + 1  # rows that a polynomial goes through
_CLOSER = 16  # rows of the segments at the ends for each of the others
_SUBTYPE = 3
_CK_TURNED = 0.4  # rad from row to row, from which the spacing is found
_MOST_CHECKED = 10_000
_TO_BODY = np.array([1.0, -1.0, -1.0, -1.0])  # SPICE's matrices go from the reference to the body
_MOST_TICKS = 1 << 40  # of a second


def _begin(run: SpiceRun) -> int:
    """Second at which the clock begins."""
    return int(np.floor(float(run.first * run.spacing)))


def _write_clock(run: SpiceRun, path: Path) -> None:
    number, ident, begin = run.number, -run.number, _begin(run)
    per_second = 1 / run.spacing
    unit = int(per_second) if 1 <= per_second <= _MOST_TICKS else 1 << 16  # ticks
    units = (run.last - round(begin / run.spacing)) // unit + 2
    title = [
        f"Clock and frame of the attitude of the run {run.source.title}: load it with the CK next to it.",
        f"The clock {ident} counts TDB in ticks of {float(run.spacing)!r} s from {begin} s after J2000 on.",
    ]
    clock = {
        f"SCLK_DATA_TYPE_{number}": "( 1 )", f"SCLK01_TIME_SYSTEM_{number}": "( 1 )",
        f"SCLK01_N_FIELDS_{number}": "( 2 )", f"SCLK01_MODULI_{number}": f"( {units} {unit} )",
        f"SCLK01_OFFSETS_{number}": "( 0 0 )", f"SCLK01_OUTPUT_DELIM_{number}": "( 2 )",
        f"SCLK_PARTITION_START_{number}": "( 0 )", f"SCLK_PARTITION_END_{number}": f"( {units * unit} )",
        f"SCLK01_COEFFICIENTS_{number}": f"( 0 {begin} {float(unit * run.spacing)!r} )",
        "SCLK_KERNEL_ID": "( @2000-01-01/12:00 )",
        f"CK_{ident}_SCLK": str(ident), f"CK_{ident}_SPK": str(run.body),
    }  # fmt: skip
    run.write_text(path, "SCLK", title, ident, 3, clock)


def write_ck(table: Table, path: Path, source: TableSource) -> None:
    """Write attitude and angular velocity of one run."""
    run = SpiceRun(table, source)
    length, ident, zero = run.last - run.first, -run.number, round(_begin(run) / run.spacing)

    def attempt(step: int, made: Path) -> Attempt | None:
        close = step // _CLOSER
        if close < 2:
            return None
        main = run.first + step * np.arange(length // step + 1)
        ends = close * np.arange(_WINDOW * _CLOSER + 1)
        pieces = [main, run.first + ends, run.last - ends[::-1]]
        halves = [(piece[:-1] + piece[1:]) // 2 for piece in pieces]
        some = np.unique(np.linspace(0, len(halves[0]) - 1, min(len(halves[0]), _MOST_CHECKED)).astype(int))
        between = np.unique(np.concatenate([halves[0][some], *halves[1:]]))
        counts = np.unique(np.concatenate([*pieces, between]))
        quaternions, rates = run.at(counts)
        packets = np.concatenate([quaternions * _TO_BODY, rates], axis=1)
        toolkit = spice()
        handle = toolkit.ckopn(str(made), "rigidsim", 0)
        try:
            for piece in pieces:
                ticks, rows = (piece - zero).astype(np.float64), packets[np.searchsorted(counts, piece)]
                toolkit.ckw05(
                    handle, _SUBTYPE, _CK_DEGREE, ticks[0], ticks[-1], ident, J2000, True,
                    source.title[:40], ticks, rows, float(run.spacing), 1, ticks[:1],
                )  # fmt: skip
        finally:
            toolkit.ckcls(handle)
        what = [
            f"CK {ident}, frame {run.name} relative to J2000, by the clock {ident} of the text kernel "
            "next to it",
            f"type 5, subtype 3: quaternion and angular velocity, degree {_CK_DEGREE}; {len(main)} rows, "
            f"every {float(step * run.spacing):.6g} s",
        ]
        rows = np.searchsorted(counts, between)
        return what, between, (quaternions[rows], rates[rows])

    def read(toolkit: Any, date: float) -> tuple[Any, np.ndarray]:
        matrix, rate, _ = toolkit.ckgpav(ident, toolkit.sce2c(ident, date), 0.0, J2000)
        return matrix, rate

    widest = 1 << max((length // (4 * _WINDOW)).bit_length() - 1, 0)
    remedy = "Polynomials don't follow kinks and jumps"
    run.write(path, run.step(_CK_TURNED, widest), attempt, read, remedy, lambda at: _write_clock(run, at))


def write_clock(table: Table, path: Path, source: TableSource) -> None:
    """Write the clock that the rows' times are counted by, and the frame of the attitude."""
    _write_clock(SpiceRun(table, source), path)


# --- PCK ----------------------------------------------------------------------------------------------------

_PCK_DEGREE = 23
_TERMS = _PCK_DEGREE + 1
_PCK_TURNED = 6.0  # rad within an interval, from which its length is found
_FRAMES = (J2000, "ECLIPJ2000", "GALACTIC")
_ENOUGH, _LEAST = 0.3, 0.02  # sine of the angle from the pole
_MOST_INTERVALS = 400  # that are checked
_NOISE = 5e-16  # rad, of coefficients
_NODES = np.cos(np.pi * (np.arange(_TERMS)[::-1] + 0.5) / _TERMS)
_EXTREMES = np.cos(np.pi * np.arange(_TERMS + 1)[::-1] / _TERMS)
_TURN = 2 * np.pi


def write_pck(table: Table, path: Path, source: TableSource) -> None:
    """Write the orientation of one run."""
    run = SpiceRun(table, source)
    length, number = run.last - run.first, run.class_number

    def attempt(step: int, made: Path) -> Attempt | None:
        if step < 4 * _TERMS:
            return None
        segments = [run.first + step * np.arange(length // step)]
        if segments[0][-1] + step != run.last:
            segments.append(np.array([run.last - step]))
        begins = np.unique(np.concatenate(segments))
        frame, series, checks, truth = _fitted(run, begins, step)
        seconds, toolkit = float(step * run.spacing), spice()
        handle = toolkit.pckopn(str(made), "rigidsim", 0)
        try:
            for segment in segments:
                found = series[np.searchsorted(begins, segment)]
                first, last = run.date(segment[0]), run.date(segment[-1] + step)
                toolkit.pckw02(
                    handle, number, frame, float(first), float(last), source.title[:40],
                    seconds, len(segment), _PCK_DEGREE, found.ravel(), float(first),
                )  # fmt: skip
        finally:
            toolkit.pckcls(handle)
        what = [
            f"PCK class {number}, frame {run.name} of the text kernel next to it, relative to {frame}",
            f"type 2, degree {_PCK_DEGREE}; {sum(map(len, segments))} intervals of {seconds:.6g} s",
        ]
        return what, checks, truth

    def read(toolkit: Any, date: float) -> tuple[Any, np.ndarray]:
        matrix, rate = toolkit.xf2rav(toolkit.tisbod(J2000, number, date))
        return matrix, rate

    remedy = "Chebyshev series don't follow kinks, nor a z axis near a frame's pole; try --format ck"
    run.write(path, run.step(_PCK_TURNED, 1 << (length.bit_length() - 1)), attempt, read, remedy)


def write_frame(table: Table, path: Path, source: TableSource) -> None:
    """Write the frame that the orientation is read by."""
    run = SpiceRun(table, source)
    title = f"Frame of the orientation of the run {source.title}: load it with the binary PCK next to it."
    run.write_text(path, "FK", [title], run.class_number, 2, {})


def _fitted(run: SpiceRun, begins: np.ndarray, step: int) -> tuple[str, np.ndarray, np.ndarray, Motion]:
    """Inertial frame, coefficients (intervals, 3, terms), counts of times to check, the run there."""
    half = step / 2 * float(run.spacing)
    middles = [(Fraction(int(begin)) + Fraction(step, 2)) * run.spacing - run.ahead for begin in begins]
    # doubles near the nodes, at which a run in double precision is exact
    nodes = [Fraction(float(middle + Fraction(half * x))) for middle in middles for x in _NODES.tolist()]
    places = [float((node - middles[i // _TERMS]) / Fraction(half)) for i, node in enumerate(nodes)]
    chosen = begins[np.unique(np.linspace(0, len(begins) - 1, min(len(begins), _MOST_INTERVALS)).astype(int))]
    checks = np.unique((chosen[:, None] + np.rint(step / 2 * (1 + _EXTREMES)).astype(np.int64)).ravel())
    check_times = [int(k) * run.spacing - run.ahead for k in checks]
    times = sorted({*nodes, *check_times})
    quaternions, rates = run.at_times(times)
    place = {time: row for row, time in enumerate(times)}
    frame, there = _frame_for(quaternions[[place[time] for time in nodes]])
    # from the body to the frame
    matrices: np.ndarray = np.moveaxis(np.array(rotation_matrix([*there.T])), 2, 0)
    pole = matrices[:, :, 2]
    angles = [
        np.arctan2(pole[:, 0], -pole[:, 1]), np.arctan2(np.hypot(pole[:, 0], pole[:, 1]), pole[:, 2]),
        np.arctan2(matrices[:, 2, 0], matrices[:, 2, 1]),
    ]  # fmt: skip
    table = np.unwrap(np.stack(angles, axis=0).reshape(3, len(begins), _TERMS), axis=2)
    polynomials = np.polynomial.chebyshev.chebvander(np.reshape(places, (len(begins), _TERMS)), _PCK_DEGREE)
    found = np.linalg.solve(polynomials, np.moveaxis(table, 0, 2)).transpose(0, 2, 1)
    found[np.abs(found) < _NOISE] = 0.0  # of which derivatives make the most
    found[:, :, 0] -= _TURN * np.round(found[:, :, 0] / _TURN)
    rows = [place[time] for time in check_times]
    return frame, found, checks, (quaternions[rows], rates[rows])


def _frame_for(quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The inertial frame whose pole is far enough from the body's z axis, and quaternions to it."""
    found = []
    for frame in _FRAMES:
        to_frame = quaternion_of(np.asarray(spice().pxform(J2000, frame, 0.0))[None])[0]
        there = np.stack(product([*to_frame], [*quaternions.T]), axis=1)
        x, y, _ = (row[2] for row in rotation_matrix([*there.T]))
        found.append((float(np.hypot(x, y).min()), frame, there))
        if found[-1][0] > _ENOUGH:
            break
    away, frame, there = max(found, key=lambda one: one[0])
    if away < _LEAST:
        what = f"the body's z axis comes within {np.degrees(away):.2g} deg of a pole of each of SPICE's "
        raise refused(f"{what}inertial frames, where a PCK's angles aren't defined; --format ck holds it")
    return frame, there


CK = Format(write_ck, suffix=".bc", beside={".tsc": write_clock}, between=True, ascending=True)
PCK = Format(write_pck, suffix=".bpc", beside={".tf": write_frame}, between=True, ascending=True)


# --- CK of other programs, read -----------------------------------------------------------------------------


CK_SUFFIX = ".bc"
_TURNED = 0.1  # rad from row to row
_FEWEST, _MOST, _FIRST = 200, 20_000, 50
_RATE_NAMES = ("wx", "wy", "wz")
_DIRECTORY = 100  # times for each of which a directory holds one more
_PACKET = {0: 8, 1: 4, 2: 14, 3: 7}  # numbers of a row of type 5, by its subtype
_INSTANTS, _RATES, _LINES, _POLYNOMIALS = 1, 2, 3, 5  # types of segments that are read


def read_ck(path: Path, kernels: Sequence[Path], ahead: Fraction, begin: float, end: float) -> Trajectory:
    """Attitude and, if it is there, angular velocity of the only object of a CK, relative to J2000.

    Args:
        kernels: the clock (SCLK) and, where that needs it, leap seconds (LSK).
        ahead: date of time 0, s of TDB since J2000. begin, end: times of the experiment, s.

    Raises:
        RigidsimError: SPICE refuses a kernel, or the CK doesn't cover the experiment.
    """
    with _opened(path, kernels, "as --kernels FILE") as (toolkit, number):
        clock = toolkit.ckmeta(number, "SCLK")
        window = toolkit.ckcov(str(path), number, False, "INTERVAL", 0.0, "TDB")
        pieces = [toolkit.wnfetd(window, n) for n in range(toolkit.wncard(window))]
        first, last = max(pieces, key=lambda piece: piece[1] - piece[0])
        first, last = max(first, begin + float(ahead)), min(last, end + float(ahead))
        if not first < last:
            covered = ", ".join(f"{a - float(ahead):.6g} to {b - float(ahead):.6g} s" for a, b in pieces[:3])
            raise RigidsimError(
                f"{path}: covers {covered} in the experiment's time, which is {begin:.6g} to {end:.6g} s; "
                "check [time] epoch"
            )
        inside = (last - first) * 1e-9  # ticks are rounded

        def at(count: int) -> tuple[np.ndarray, list[tuple[Any, Any]]]:
            dates = np.linspace(first + inside, last - inside, count)
            return dates, [_pointing(toolkit, number, toolkit.sce2c(clock, date)) for date in dates]

        rates = [np.linalg.norm(rate) for _, rate in at(_FIRST)[1] if rate is not None]
        turns = max(rates, default=0.0) * (last - first) / _TURNED
        dates, found = at(int(np.clip(turns, _FEWEST, _MOST)) + 1)
    matrices = np.array([matrix.T for matrix, _ in found])  # SPICE's go from the reference to the body
    columns = {"t": np.array([float(Fraction(date) - ahead) for date in dates.tolist()])}
    columns |= {f"r{a}{b}": matrices[:, i, j] for i, a in enumerate("123") for j, b in enumerate("123")}
    units = {"t": "s"}
    if rates:
        columns |= dict(zip(_RATE_NAMES, np.array([rate for _, rate in found]).T, strict=True))
        units |= dict.fromkeys(_RATE_NAMES, "rad/s")
    return Trajectory(columns, str(path), units)


def read_rows(path: Path, kernels: Sequence[Path], epoch: Epoch, axes: str | None) -> Trajectory:
    """Attitude and, if it is there, angular velocity of the only object of a CK at the times of its rows,
    with columns named as in exported tables; rates are nan where a segment has none.

    Args:
        kernels: the clock (SCLK), where that needs it leap seconds (LSK), and what else its frame needs (FK).
        epoch: date of time 0. axes: the space axes of the attitudes here.

    Raises:
        RigidsimError: SPICE refuses a kernel, or a segment is of another type (4, 6).
    """
    ahead = epoch.since_j2000()
    with _opened(path, kernels, "as kernels = [...] next to file") as (toolkit, number):
        clock = toolkit.ckmeta(number, "SCLK")
        ticks, rated = _own_ticks(toolkit, path)
        dates = [toolkit.sct2e(clock, tick) for tick in ticks]
        try:  # one after the other: SPICE takes an earlier segment at the end of one without rates otherwise
            matrices = np.array([toolkit.ckgp(number, tick, 0.0, "J2000")[0] for tick in ticks])
            turning = [toolkit.ckgpav(number, tick, 0.0, "J2000")[1] for tick in ticks[rated]]
        except toolkit.NotFoundError:
            raise RigidsimError(f"{path}: SPICE finds no attitude at the time of one of its rows") from None
    # SPICE's matrices go from the reference to the body
    attitudes = multiplied(np.array(from_equator(axes, np)), quaternion_of(matrices.transpose(0, 2, 1)))
    columns = {"time": np.array([float(Fraction(date) - ahead) for date in dates])}
    columns |= {f"quaternion_{x}": attitudes[:, n] for n, x in enumerate("wxyz")}
    if turning:
        rates = np.full((len(ticks), 3), np.nan)
        rates[rated] = np.einsum("nij,nj->ni", matrices[rated], np.array(turning))
        columns |= {f"angular_velocity_{x}": rates[:, n] for n, x in enumerate("xyz")}
    units = {"time": "s"} | {name: "rad/s" for name in columns if name.startswith("angular")}
    return Trajectory(columns, str(path), units)


@contextmanager
def _opened(path: Path, kernels: Sequence[Path], how: str) -> Iterator[tuple[Any, int]]:
    """SPICE's toolkit with a CK loaded, and the number of its object; ``how`` other kernels are given."""
    for each in (path, *kernels):
        if not each.is_file():
            raise RigidsimError(f"{each}: there is no such file")
    try:
        with loaded(*kernels, path) as toolkit:
            objects = [int(number) for number in toolkit.ckobj(str(path))]
            if len(objects) != 1:
                raise RigidsimError(
                    f"{path}: holds {len(objects)} objects ({objects[:9]}); write one to a file"
                )
            yield toolkit, objects[0]
    except KernelError as error:
        raise RigidsimError(f"{path}: {error}; give its clock and leap seconds {how}") from None


def _own_ticks(toolkit: Any, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The times of all rows, ticks of the clock, ascending; and which rows have rates."""
    handle = toolkit.dafopr(str(path))
    try:
        segments = []
        toolkit.dafbfs(handle)
        while toolkit.daffna():
            _, whole = toolkit.dafus(toolkit.dafgs(), 2, 6)
            kind, rated, first, last = (int(x) for x in whole[2:])
            if kind not in (_INSTANTS, _RATES, _LINES, _POLYNOMIALS):
                raise RigidsimError(
                    f"{path}: a segment of type {kind} can't be read; segments of "
                    f"types {_INSTANTS}, {_RATES}, {_LINES} and {_POLYNOMIALS} are allowed: sample it into "
                    "a CSV"
                )
            values = np.asarray(toolkit.dafgda(handle, first, last), dtype=np.float64)
            segments.append((*_segment(values, kind, rated=bool(rated)), bool(rated)))
    finally:
        toolkit.dafcls(handle)
    found = dict[float, bool]()
    for place, (ticks, _, _, of_rates) in enumerate(segments):
        hidden = np.zeros(len(ticks), dtype=bool)
        for _, begins, ends, _ in segments[place + 1 :]:
            span = np.searchsorted(begins, ticks, side="right") - 1
            hidden |= (span >= 0) & (ticks <= ends[span])
        found |= dict.fromkeys(ticks[~hidden].tolist(), of_rates)
    every = sorted(found)
    return np.array(every), np.array([found[tick] for tick in every], dtype=bool)


def _segment(values: np.ndarray, kind: int, *, rated: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of the rows of one segment, and begins and ends of the spans in which SPICE has attitudes by it,
    all in ticks, by the numbers of its array.
    """
    if kind == _RATES:
        count = (_DIRECTORY * (len(values) + 1)) // (10 * _DIRECTORY + 1)  # which it doesn't hold itself
        begins, ends = values[8 * count : 10 * count].reshape(2, count)
        return begins, begins, ends
    count = int(values[-1])
    row = _PACKET[int(values[-4])] if kind == _POLYNOMIALS else 7 if rated else 4
    ticks = values[row * count : (row + 1) * count]
    if kind == _INSTANTS:
        return ticks, ticks, ticks
    after = (row + 1) * count + (count - 1) // _DIRECTORY
    begins = values[after : after + int(values[-2])]
    last = np.append(np.searchsorted(ticks, begins[1:]), count) - 1
    return ticks, begins, ticks[last]


def _pointing(toolkit: Any, number: int, ticks: float) -> tuple[Any, Any]:
    """Matrix from J2000 to the body, and angular velocity in J2000, rad/s; None where it isn't there."""
    try:
        return toolkit.ckgpav(number, ticks, 0.0, "J2000")[:2]
    except toolkit.NotFoundError:
        return toolkit.ckgp(number, ticks, 0.0, "J2000")[0], None
