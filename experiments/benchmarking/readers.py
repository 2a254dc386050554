"""The same dataset through other people's readers, and beside that of the bare script."""

import shutil
import subprocess
from pathlib import Path

import numpy as np


def readings(path: Path, variable: str = "energy", rows: int = 5) -> dict[str, str]:
    """By reader: "the same numbers", or what is wrong; "not installed"."""
    import h5py

    with h5py.File(path, "r") as file:
        expected = file[variable][:]
    found = {"h5py": "the same numbers"}
    for name, read in {"xarray": _xarray, "netCDF4": _netcdf4}.items():
        try:
            same = np.array_equal(read(path, variable), expected)
        except ImportError:
            found[name] = "not installed"
        else:
            found[name] = "the same numbers" if same else "OTHER NUMBERS"
    found["h5dump"] = _h5dump(path, variable, expected[:rows])
    return found


def _xarray(path: Path, variable: str) -> np.ndarray:
    import xarray

    with xarray.open_dataset(path) as dataset:
        return np.asarray(dataset[variable].values)


def _netcdf4(path: Path, variable: str) -> np.ndarray:
    import netCDF4

    with netCDF4.Dataset(path) as dataset:
        return np.asarray(dataset[variable][:])


def _h5dump(path: Path, variable: str, expected: np.ndarray) -> str:
    program = shutil.which("h5dump")
    if program is None:
        return "not installed"
    rows = f"-s 0 -c {len(expected)}".split()
    command = [program, *["-y", "-w", "0", "-m", "%.17g", "-d"], variable, *rows, path]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    if said.returncode:
        return f"refused: {said.stderr.strip()[-200:]}"
    numbers = said.stdout.split("DATA {", 1)[1].split("}")[0].replace(",", " ").split()
    same = [float(x) for x in numbers] == expected.tolist()
    return "the same numbers" if same else "OTHER NUMBERS"


def farthest(ours: Path, bare: Path) -> dict[str, float]:
    """Largest difference of each variable of the bare script, with all its digits, from ours.

    Raises:
        KeyError: ours lacks one.
    """
    import h5py

    found = {}
    with h5py.File(ours, "r") as one, h5py.File(bare, "r") as other:
        for name in other:
            if not name.endswith("_lo"):
                rest = f"{name}_lo" if f"{name}_lo" in other else None
                values = [
                    file[name][:].astype(np.longdouble) + (0 if rest is None else file[rest][:])
                    for file in (one, other)
                ]
                found[str(name)] = float(np.max(np.abs(values[0] - values[1])))
    return found
