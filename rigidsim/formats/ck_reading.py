"""CK, SPICE's kernel of attitudes, read as a trajectory: at times between its own, which it interpolates."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.kernels.kernel import KernelError
from rigidsim.scene.kernels.spice import loaded

SUFFIX = ".bc"
_TURN = 0.1  # rad from row to row
_FEWEST, _MOST, _FIRST = 200, 20_000, 50
_DIGITS = "123"


def read_ck(path: Path, kernels: Sequence[Path], ahead: Fraction, begin: float, end: float) -> Trajectory:
    """Attitude and, if it is there, angular velocity of the only object of a CK, relative to J2000.

    Args:
        kernels: the clock (SCLK) and, where that needs it, leap seconds (LSK).
        ahead: date of time 0, s of TDB since J2000. begin, end: times of the experiment, s.

    Raises:
        RigidsimError: SPICE refuses a kernel, or the CK doesn't cover the experiment.
    """
    if not path.exists():
        raise RigidsimError(f"{path}: there is no such file")
    try:
        with loaded(*kernels, path) as toolkit:
            objects = [int(number) for number in toolkit.ckobj(str(path))]
            if len(objects) != 1:
                raise RigidsimError(
                    f"{path}: holds {len(objects)} objects ({objects[:9]}); write one to a file"
                )
            return _rows(toolkit, path, objects[0], ahead, (begin, end))
    except KernelError as error:
        raise RigidsimError(f"{path}: {error}; give its clock and leap seconds as --kernels FILE") from None


def _rows(toolkit: Any, path: Path, number: int, ahead: Fraction, span: tuple[float, float]) -> Trajectory:
    clock = toolkit.ckmeta(number, "SCLK")
    window = toolkit.ckcov(str(path), number, False, "INTERVAL", 0.0, "TDB")
    pieces = [toolkit.wnfetd(window, n) for n in range(toolkit.wncard(window))]
    first, last = max(pieces, key=lambda piece: piece[1] - piece[0])
    first, last = max(first, span[0] + float(ahead)), min(last, span[1] + float(ahead))
    if not first < last:
        told = ", ".join(f"{a - float(ahead):.6g} to {b - float(ahead):.6g} s" for a, b in pieces[:3])
        raise RigidsimError(
            f"{path}: covers {told} in the experiment's time, which is {span[0]:.6g} to {span[1]:.6g} s; "
            "check [time] epoch"
        )
    inside = (last - first) * 1e-9  # ticks are rounded

    def at(dates: np.ndarray) -> list[tuple[Any, Any]]:
        return [_pointing(toolkit, number, toolkit.sce2c(clock, date)) for date in dates]

    def dates(count: int) -> np.ndarray:
        return np.linspace(first + inside, last - inside, count)

    rates = [np.linalg.norm(rate) for _, rate in at(dates(_FIRST)) if rate is not None]
    count = int(np.clip(max(rates, default=0.0) * (last - first) / _TURN, _FEWEST, _MOST)) + 1
    chosen = dates(count)
    found = at(chosen)
    columns = {"t": np.array([float(Fraction(date) - ahead) for date in chosen.tolist()])}
    matrices = np.array([matrix.T for matrix, _ in found])  # SPICE's go from the reference to the body
    columns |= {f"r{a}{b}": matrices[:, i, j] for i, a in enumerate(_DIGITS) for j, b in enumerate(_DIGITS)}
    if rates:
        turning = np.array([rate for _, rate in found])
        columns |= {f"w{axis}": turning[:, n] for n, axis in enumerate("xyz")}
    return Trajectory(
        columns, str(path), {"t": "s", **({f"w{axis}": "rad/s" for axis in "xyz"} if rates else {})}
    )


def _pointing(toolkit: Any, number: int, ticks: float) -> tuple[Any, Any]:
    """Matrix from J2000 to the body, and angular velocity in J2000, rad/s; None where it isn't there."""
    try:
        matrix, rate, _ = toolkit.ckgpav(number, ticks, 0.0, "J2000")
    except toolkit.NotFoundError:
        matrix, _ = toolkit.ckgp(number, ticks, 0.0, "J2000")
        return matrix, None
    return matrix, rate
