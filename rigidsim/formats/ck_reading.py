"""CK, SPICE's kernel of attitudes: read as a trajectory, at times between its own, which SPICE interpolates,
or as observations, at its own times.

Attitudes and rates are always SPICE's; its own times are found in the segments, whose layout is NAIF's "CK
Required Reading". Of segments that overlap SPICE takes the last one in the file, and so do the own times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.kernels.reading import KernelError
from rigidsim.scene.kernels.spice import loaded
from rigidsim.scene.rotations import quaternion_of
from rigidsim.scene.row_rotations import multiplied
from rigidsim.scene.space_axes import from_equator

SUFFIX = ".bc"
_TURN = 0.1  # rad from row to row
_FEWEST, _MOST, _FIRST = 200, 20_000, 50
_RATE_NAMES = ("wx", "wy", "wz")
_DIRECTORY = 100  # times for each of which a directory holds one more
_PACKET = {0: 8, 1: 4, 2: 14, 3: 7}  # numbers of a row of type 5, by its subtype
_INSTANTS, _RATES, _LINES, _POLYNOMIALS = 1, 2, 3, 5  # types of segments that have rows


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
        turns = max(rates, default=0.0) * (last - first) / _TURN
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
        RigidsimError: SPICE refuses a kernel, or a segment has no rows (types 4 and 6).
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
                    f"{path}: a segment of type {kind}, which holds polynomials and no rows; segments of "
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
