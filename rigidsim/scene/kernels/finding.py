"""Where a kernel's file is: beside the config, or in folders that are named.

A run's folder remembers the places of its files in ``.kernel``, which only says where to look: whether a file
is the same, its SHA-256 tells.
"""

from __future__ import annotations

import os
from pathlib import Path

from rigidsim.scene.kernels.kernel import Kernel, KernelError

FOLDERS = "RIGIDSIM_KERNELS"
"""Environment variable with folders in which kernels are looked for by their names."""
EMBEDDED = " (embedded config)"
"""What follows a dataset's path where that stands for the config in it."""
NOTE = ".kernel"
"""File of a run's folder with the places of its kernels."""


def kernel_of(given: str, source: str) -> Kernel:
    """The kernel that a config names: ``source`` is where the config is, if it is a file.

    Raises:
        KernelError: it isn't there, or can't be read.
    """
    from rigidsim.scene.kernels.reading import is_path, open_file, open_package  # few scenes have a kernel

    if not is_path(given):
        try:
            return open_package(given)
        except KernelError as error:
            beside = [x for x in folders_of(source) if f"{given}.bsp" in _names(x)]
            hint = f'; the file beside the config is "./{given}.bsp"' if beside else ""
            raise KernelError(f"{error}{hint}") from None
    stem = Path(given).stem
    try:
        path = find_file(given, source, "an SPK file")
    except KernelError as error:
        package = f'; the package is named without a suffix: "{stem}"' if _is_package(stem) else ""
        raise KernelError(f"{error}{package}") from None
    try:
        return open_file(path)
    except OSError as error:
        raise KernelError(f"which can't be read ({error.strerror or error}): {path}") from None


def find_file(given: str, source: str, what: str) -> Path:
    """The absolute path of a kernel that is given by its own; ``what`` it should be.

    Raises:
        KernelError: it isn't there.
    """
    wanted, folders = Path(given).expanduser(), folders_of(source)
    places = [wanted] if wanted.is_absolute() else [folder / wanted for folder in folders]
    try:
        for path in [*places, *(folder / wanted.name for folder in folders)]:
            if path.is_file():
                return path.absolute()
        if any(path.is_dir() for path in places):
            raise KernelError(f"which is a folder; the path of {what} is allowed")
    except OSError as error:  # names that no file system takes
        raise KernelError(f"which can't be looked for ({error.strerror or error})") from None
    looked = ", ".join(dict.fromkeys(str(path.parent) for path in places))
    why = f"which isn't there: looked for in {looked}; put it there, or name its folder in the environment "
    raise KernelError(f"{why}variable {FOLDERS}")


def _names(folder: Path) -> set[str]:
    try:
        return {x.name for x in folder.iterdir()}
    except OSError:
        return set()


def _is_package(name: str) -> bool:
    from rigidsim.scene.kernels.reading import open_package

    try:
        open_package(name)
    except KernelError:
        return False
    return True


def folders_of(source: str) -> list[Path]:
    """Folders to look in: the config's, the one that a run's folder notes, and those that are named."""
    file = Path(source.removesuffix(EMBEDDED)).absolute()
    named = [Path(x) for x in os.environ.get(FOLDERS, "").split(os.pathsep) if x]
    if not file.is_file():
        return [Path.cwd(), *named]
    noted = file.parent / NOTE
    lines = noted.read_text(encoding="utf-8").splitlines() if noted.is_file() else []
    beside = [Path(line.strip()).parent for line in lines if line.strip()]
    return [file.parent, *named, *beside]
