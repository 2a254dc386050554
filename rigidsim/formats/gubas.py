"""States that GUBAS writes of two bodies: ``x_out.bin`` and ``LagrangianStateOut*.csv``.

Of each row: place and velocity of the second body from the first, along the axes of the first; angular
velocities; rotation matrices from the second body's axes to the first's, and from these to space axes. The
binary file has km and the second rates along the axes of the first; the table has m, and each rates in its
own axes (General Use Binary Asteroid Simulator, user guide; Davis & Scheeres 2020, Icarus 341, 113439).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigidsim.errors import RigidsimError, ensure

_STATES, _CELLS = 30, 32  # numbers of a row; of the table with time and potential
_TABLE, _MOMENTA = "LagrangianStateOut", "HamiltonianStateOut"
_TIMES = ("t_out.bin", "../output_t/t_out.bin", "phi_t_out.bin")


def is_table(path: Path) -> bool:
    """Whether a text is one of GUBAS' tables, by its name."""
    return _TABLE in path.name or _MOMENTA in path.name


def read_states(path: Path) -> dict[str, np.ndarray]:
    """Columns (rows,) in SI and space axes; the second body's begin with ``rigid_body_``.

    Raises:
        RigidsimError: another file of GUBAS, or no times belong to it.
        OSError: it can't be read.
    """
    if path.suffix == ".bin":
        found = (path.parent / name for name in _TIMES)
        times = next((one for one in found if one.is_file() and one != path), None)
        what = f"{path}: needs t_out.bin next to it or in ../output_t, in which GUBAS writes the times"
        if times is None:
            raise RigidsimError(f"{what}; copy it there")
        seconds, states = np.fromfile(times, "<f8"), np.fromfile(path, "<f8")
        what = f"{path}: has {states.size:,} numbers, where {times} has {seconds.size:,} times of {_STATES}"
        ensure(states.size == _STATES * seconds.size, RigidsimError(f"{what}; give x_out.bin with its times"))
        rows = states.reshape(-1, _STATES)
        rows = np.concatenate([1e3 * rows[:, :6], rows[:, 6:]], axis=1)
    else:
        what = f"{path}: holds momenta; give {_TABLE}{path.name.partition('StateOut')[2]}, which holds rates"
        ensure(_MOMENTA not in path.name, RigidsimError(what))
        try:
            table = np.loadtxt(path, delimiter=",", ndmin=2)
        except ValueError as error:
            raise RigidsimError(f"{path}: {error}; rows of {_CELLS} numbers are allowed") from None
        what = f"{path}: has {table.shape[1]} numbers in a row, where GUBAS writes {_CELLS}; write it again"
        ensure(table.shape[1] == _CELLS, RigidsimError(what))
        seconds, rows = table[:, 0], table[:, [*range(1, 13), *range(22, 31), *range(13, 22)]]
    place, velocity, spin, other = (rows[:, k : k + 3] for k in (0, 3, 6, 9))
    turn, relative = (rows[:, k : k + 9].reshape(-1, 3, 3) for k in (12, 21))
    if path.suffix == ".bin":
        other = np.einsum("tji,tj->ti", relative, other)
    columns = {"time [s]": seconds}
    for mark, matrix, rates in (("", turn, spin), ("rigid_body_", turn @ relative, other)):
        columns |= {f"{mark}r{i + 1}{k + 1}": matrix[:, i, k] for i in range(3) for k in range(3)}
        columns |= {f"{mark}w{axis}": rates[:, i] for i, axis in enumerate("xyz")}
    for stem, vector in (("position", place), ("velocity", velocity)):
        seen = np.einsum("tij,tj->ti", turn, vector)
        columns |= {f"rigid_body_{stem}_{axis}": seen[:, i] for i, axis in enumerate("xyz")}
    return columns
