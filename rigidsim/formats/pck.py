"""Binary PCK, SPICE's kernel of a body's orientation, with the frame that it is read by in a text kernel.

Segments are of type 2: Chebyshev series of the angles phi, delta and w of [w]_3 [delta]_1 [phi]_3, from an
inertial frame to the body's axes (NAIF, "PCK Required Reading"), whose derivatives are the angular velocity.
Of the inertial frames that SPICE has, the one is taken from whose pole the body's z axis stays farthest away.
A second segment of a single interval ends where the run does.
"""

from __future__ import annotations

from fractions import Fraction
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
    refused,
    run_of,
    write_text,
)  # fmt: skip
from rigidsim.formats.tables import Table
from rigidsim.scene.kernels.spice import spice
from rigidsim.scene.rotations import product, quaternion_of, rotation_matrix

_DEGREE = 23
_TERMS = _DEGREE + 1
_TURNED = 6.0  # rad within an interval, from which its length is found
_FRAMES = (J2000, "ECLIPJ2000", "GALACTIC")
_ENOUGH, _LEAST = 0.3, 0.02  # sine of the angle from the pole
_MOST_CHECKED = 400  # intervals
_NOISE = 5e-16  # rad, of coefficients
_NODES = np.cos(np.pi * (np.arange(_TERMS)[::-1] + 0.5) / _TERMS)
_EXTREMES = np.cos(np.pi * np.arange(_TERMS + 1)[::-1] / _TERMS)
_TURN = 2 * np.pi


def write_frame(table: Table, path: Path, source: TableSource) -> None:
    """Write the frame that the orientation is read by."""
    run = run_of(table, source)
    title = [
        f"Frame of the orientation of the run {run.source.title}: load it with the binary PCK next to it.",
        f"pxform('J2000', '{run.name}', et) goes from J2000 to the body's axes.",
    ]
    write_text(path, "FK", title, frame_text(run, run.class_number, 2))


def write_pck(table: Table, path: Path, source: TableSource) -> None:
    """Write the orientation of one run."""
    run = run_of(table, source)
    length, number = run.last - run.first, run.class_number

    def attempt(step: int, made: Path) -> Attempt | None:
        if step < 4 * _TERMS:
            return None
        begins = [run.first + step * np.arange(length // step)]
        if begins[0][-1] + step != run.last:
            begins.append(np.array([run.last - step]))
        frame, series, checks, truth = _fitted(run, begins, step)
        _write_series(run, made, frame, begins, series, step)
        told = [
            f"PCK class {number}, frame {run.name} of the text kernel next to it, relative to {frame}",
            f"type 2, degree {_DEGREE}; {sum(map(len, begins))} intervals of "
            f"{float(step * run.spacing):.6g} s",
        ]
        return Attempt(told, checks, truth)

    def read(toolkit: Any, date: float) -> tuple[np.ndarray, np.ndarray]:
        matrix, rate = toolkit.xf2rav(toolkit.tisbod(J2000, number, date))
        return quaternion_of(np.asarray(matrix).T[None])[0], rate

    def why_not(errors: Errors) -> str:
        known = f" ({errors.attitude:.1e} rad, {errors.rate:.1e} in its rate)" if errors.count else ""
        why = f"no Chebyshev series of its angles keep 1e-12{known}: it has kinks, its z axis "
        return f"{why}comes near a frame's pole, or it turns too fast for SPICE's times; try --format ck"

    step = min(run.steps(_TURNED / max(run.largest_rate, 1e-300)), 1 << (length.bit_length() - 1))
    fit_and_read_back(run, path, step, attempt, read, why_not)


def _fitted(
    run: SpiceRun, begins: list[np.ndarray], step: int
) -> tuple[str, list[np.ndarray], np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Inertial frame, coefficients (intervals, 3, terms) of each segment, times to check, the run there."""
    every = np.unique(np.concatenate(begins))
    half = step / 2 * float(run.spacing)
    middles = [(Fraction(int(begin)) + Fraction(step, 2)) * run.spacing - run.ahead for begin in every]
    # doubles near the nodes, at which a run in double precision is exact
    nodes = [Fraction(float(middle + Fraction(half * x))) for middle in middles for x in _NODES.tolist()]
    places = [float((node - middles[i // _TERMS]) / Fraction(half)) for i, node in enumerate(nodes)]
    chosen = every[np.unique(np.linspace(0, len(every) - 1, min(len(every), _MOST_CHECKED)).astype(int))]
    extremes = np.rint(step / 2 * (1 + _EXTREMES)).astype(np.int64)
    checks = np.unique((chosen[:, None] + extremes).ravel())
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
    table = np.unwrap(np.stack(angles, axis=0).reshape(3, len(every), _TERMS), axis=2)
    polynomials = np.polynomial.chebyshev.chebvander(np.reshape(places, (len(every), _TERMS)), _DEGREE)
    found = np.linalg.solve(polynomials, np.moveaxis(table, 0, 2)).transpose(0, 2, 1)
    found[np.abs(found) < _NOISE] = 0.0  # of which derivatives make the most
    found[:, :, 0] -= _TURN * np.round(found[:, :, 0] / _TURN)
    rows = [place[time] for time in check_times]
    series = [found[np.searchsorted(every, begin)] for begin in begins]
    return frame, series, checks, (quaternions[rows], rates[rows])


def _frame_for(quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The inertial frame whose pole is far enough from the body's z axis, and quaternions to it."""
    best: tuple[float, str, np.ndarray] | None = None
    for frame in _FRAMES:
        to_frame = quaternion_of(np.asarray(spice().pxform(J2000, frame, 0.0))[None])[0]
        there = np.stack(product([*to_frame], [*quaternions.T]), axis=1)
        x, y, _ = (row[2] for row in rotation_matrix([*there.T]))
        away = float(np.hypot(x, y).min())
        if best is None or away > best[0]:
            best = away, frame, there
        if away > _ENOUGH:
            break
    assert best is not None
    if best[0] < _LEAST:
        what = f"the body's z axis comes within {np.degrees(best[0]):.2g} deg of a pole of each of SPICE's "
        raise refused(f"{what}inertial frames, where a PCK's angles aren't defined; --format ck holds it")
    return best[1], best[2]


def _write_series(
    run: SpiceRun, path: Path, frame: str, begins: list[np.ndarray], series: list[np.ndarray], step: int
) -> None:
    toolkit = spice()
    handle = toolkit.pckopn(str(path), "rigidsim", 0)
    try:
        for begin, found in zip(begins, series, strict=True):
            first, last = run.date(begin[0]), run.date(begin[-1] + step)
            toolkit.pckw02(
                handle, run.class_number, frame, float(first), float(last), run.source.title[:40],
                float(step * run.spacing), len(begin), _DEGREE, found.ravel(), float(first),
            )  # fmt: skip
    finally:
        toolkit.pckcls(handle)


PCK = Format(write_pck, suffix=".bpc", beside={".tf": write_frame}, between=True)
