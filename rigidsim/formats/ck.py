"""CK, SPICE's kernel of attitudes, with the clock and the frame that it is read by in a text kernel beside.

Segments are of type 5, subtype 3: quaternions and angular velocities, interpolated by polynomials of degree
15 through the 16 nearest rows (NAIF, "CK Required Reading"). Rows are equally spaced, as closely as the run
needs it. Near the ends of a segment SPICE takes those rows alone that are as near on the other side, so that
two more segments with closer rows lie at the run's ends. The clock counts SPICE's own times.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.spice import (
    J2000,
    Attempt,
    Errors,
    SpiceRun,
    fit_and_read_back,
    frame_text,
    run_of,
    write_text,
)  # fmt: skip
from rigidsim.formats.tables import Table
from rigidsim.scene.kernels.spice import spice
from rigidsim.scene.rotations import quaternion_of

_DEGREE = 15
_WINDOW = _DEGREE + 1  # rows that a polynomial goes through
_CLOSER = 16  # rows of the segments at the ends for each of the others
_SUBTYPE = 3
_TURNED = 0.4  # rad from row to row, from which the spacing is found
_MOST_CHECKED = 10_000
_TO_BODY = np.array([1.0, -1.0, -1.0, -1.0])  # SPICE's matrices go from the reference to the body
_FASTEST = 1 << 40  # ticks of a second


def _clock_of(run: SpiceRun) -> tuple[int, int, int]:
    """Second at which the clock begins, its ticks in a unit, and how many units it has."""
    per_second = 1 / run.spacing
    unit = int(per_second) if 1 <= per_second <= _FASTEST else 1 << 16
    begin = int(np.floor(float(run.first * run.spacing)))
    ticks = run.last - round(begin / run.spacing)
    return begin, unit, ticks // unit + 2


def _ticks(run: SpiceRun, counts: np.ndarray) -> np.ndarray:
    return (counts - round(_clock_of(run)[0] / run.spacing)).astype(np.float64)


def write_clock(table: Table, path: Path, source: TableSource) -> None:
    """Write the clock that the rows' times are counted by, and the frame of the attitude."""
    run = run_of(table, source)
    _write_clock(run, path)


def _write_clock(run: SpiceRun, path: Path) -> None:
    begin, unit, units = _clock_of(run)
    number, ident = run.number, -run.number
    seconds = float(unit * run.spacing)
    rows = [
        (f"SCLK_DATA_TYPE_{number}", "( 1 )"), (f"SCLK01_TIME_SYSTEM_{number}", "( 1 )"),
        (f"SCLK01_N_FIELDS_{number}", "( 2 )"), (f"SCLK01_MODULI_{number}", f"( {units} {unit} )"),
        (f"SCLK01_OFFSETS_{number}", "( 0 0 )"), (f"SCLK01_OUTPUT_DELIM_{number}", "( 2 )"),
        (f"SCLK_PARTITION_START_{number}", "( 0 )"), (f"SCLK_PARTITION_END_{number}", f"( {units * unit} )"),
        (f"SCLK01_COEFFICIENTS_{number}", f"( 0 {begin} {seconds!r} )"),
        ("SCLK_KERNEL_ID", "( @2000-01-01/12:00 )"),
    ]  # fmt: skip
    clock = "".join(f"   {name:<32} = {value}\n" for name, value in rows)
    more = [(f"CK_{ident}_SCLK", str(ident)), (f"CK_{ident}_SPK", str(run.body))]
    title = [
        f"Clock and frame of the attitude of the run {run.source.title}: load it with the CK next to it.",
        f"The clock {ident} counts TDB in ticks of {float(run.spacing)!r} s from {begin} s after J2000 on.",
        f"pxform('J2000', '{run.name}', et) goes from J2000 to the body's axes.",
    ]
    write_text(path, "SCLK", title, clock + frame_text(run, ident, 3, more))


def write_ck(table: Table, path: Path, source: TableSource) -> None:
    """Write attitude and angular velocity of one run."""
    run = run_of(table, source)
    length, ident = run.last - run.first, -run.number
    widest = 1 << max((length // (4 * _WINDOW)).bit_length() - 1, 0)

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
        _write_rows(run, made, pieces, [packets[np.searchsorted(counts, piece)] for piece in pieces])
        rows = np.searchsorted(counts, between)
        told = [
            f"CK {ident}, frame {run.name} relative to J2000, by the clock {ident} of the text kernel "
            "next to it",
            f"type 5, subtype 3: quaternion and angular velocity, degree {_DEGREE}; {len(main)} rows, every "
            f"{float(step * run.spacing):.6g} s",
        ]
        return Attempt(told, between, (quaternions[rows], rates[rows]))

    def read(toolkit: Any, date: float) -> tuple[np.ndarray, np.ndarray]:
        matrix, rate, _ = toolkit.ckgpav(ident, toolkit.sce2c(ident, date), 0.0, J2000)
        return quaternion_of(matrix.T[None])[0], rate

    def why_not(errors: Errors) -> str:
        if errors.count:
            what = "the motion has kinks or jumps, about which polynomials are "
            return f"{what}{errors.attitude:.1e} rad from it"
        what = "no rows are close enough: SPICE's times are doubles of seconds since J2000, here "
        return f"{what}{float(run.spacing):.1g} s apart, in which the body turns by {run.turned_by:.2g} rad"

    step = min(run.steps(_TURNED / max(run.largest_rate, 1e-300)), widest)
    fit_and_read_back(run, path, step, attempt, read, why_not, beside=lambda clock: _write_clock(run, clock))


def _write_rows(run: SpiceRun, path: Path, pieces: list[np.ndarray], packets: list[np.ndarray]) -> None:
    toolkit = spice()
    handle = toolkit.ckopn(str(path), "rigidsim", 0)
    try:
        for piece, rows in zip(pieces, packets, strict=True):
            ticks = _ticks(run, piece)
            toolkit.ckw05(
                handle, _SUBTYPE, _DEGREE, ticks[0], ticks[-1], -run.number, J2000, True,
                run.source.title[:40], ticks, rows, float(run.spacing), 1, ticks[:1],
            )  # fmt: skip
    finally:
        toolkit.ckcls(handle)


CK = Format(write_ck, suffix=".bc", beside={".tsc": write_clock}, between=True)
