"""Where a kernel's file is: beside the config, or in folders that are named.

A run's folder remembers the place of the file in ``.kernel``, which only says where to look: whether it is
the same file, its SHA-256 tells. Workers of a sweep, which know no folder of a config, look where their
parent found it.
"""

from __future__ import annotations

import os
from pathlib import Path

from rigidsim.scene.kernels.kernel import Kernel, KernelError
from rigidsim.scene.kernels.reading import is_path, open_file, open_package

FOLDERS = "RIGIDSIM_KERNELS"
"""Environment variable with folders in which kernels are looked for by their names."""
EMBEDDED = " (embedded config)"
"""What follows a dataset's path where that stands for the config in it."""
NOTE = ".kernel"
"""File of a run's folder with the place of its kernel."""
_FOUND = "RIGIDSIM_KERNELS_FOUND"  # the same of a parent process, for its workers


def kernel_of(given: str, source: str) -> Kernel:
    """The kernel that a config names: ``source`` is where the config is, if it is a file.

    Raises:
        KernelError: it isn't there, or can't be read.
    """
    if not is_path(given):
        try:
            return open_package(given)
        except KernelError as error:
            beside = [x for x in _folders(source) if (x / f"{given}.bsp").is_file()]
            hint = f'; the file beside the config is "./{given}.bsp"' if beside else ""
            raise KernelError(f"{error}{hint}") from None
    path = _find(given, source).absolute()
    try:
        found = open_file(path)
    except OSError as error:
        raise KernelError(f"which can't be read ({error.strerror or error}): {path}") from None
    known = os.environ.get(_FOUND, "").split(os.pathsep)
    folder = str(path.parent)
    os.environ[_FOUND] = os.pathsep.join([folder, *(x for x in known if x and x != folder)])
    return found


def _find(given: str, source: str) -> Path:
    wanted, folders = Path(given).expanduser(), _folders(source)
    places = [wanted] if wanted.is_absolute() else [folder / wanted for folder in folders]
    for path in [*places, *(folder / wanted.name for folder in folders)]:
        if path.is_file():
            return path
    if any(path.is_dir() for path in places):
        raise KernelError("which is a folder; the path of an SPK file is allowed")
    looked = ", ".join(dict.fromkeys(str(path.parent) for path in places))
    stem = wanted.name.removesuffix(wanted.suffix)
    package = f'; the package is named without a suffix: "{stem}"' if _is_package(stem) else ""
    what = f"which isn't there: looked for in {looked}; put it there, or name its folder in the environment "
    raise KernelError(f"{what}variable {FOLDERS}{package}")


def _is_package(name: str) -> bool:
    try:
        open_package(name)
    except KernelError:
        return False
    return True


def _folders(source: str) -> list[Path]:
    """Folders to look in: the config's, the one that a run's folder notes, and those that are named."""
    file = Path(source.removesuffix(EMBEDDED)).absolute()
    named = [Path(x) for x in os.environ.get(FOLDERS, "").split(os.pathsep) if x]
    if not file.is_file():
        found = [Path(x) for x in os.environ.get(_FOUND, "").split(os.pathsep) if x]
        return [Path.cwd(), *named, *found]
    noted = file.parent / NOTE
    beside = [Path(noted.read_text(encoding="utf-8").strip()).parent] if noted.is_file() else []
    return [file.parent, *named, *beside]
