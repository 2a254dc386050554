"""Where a kernel's file is: beside the config, in the working folder, or in folders that are named."""

from __future__ import annotations

import os
from pathlib import Path

from rigidsim.scene.kernels.kernel import Kernel, KernelError
from rigidsim.scene.kernels.reading import is_path, open_file, open_package

FOLDERS = "RIGIDSIM_KERNELS"
"""Environment variable with folders in which kernels are looked for by their names."""


def remember(folder: Path) -> None:
    """Look for kernels by their paths from this folder, too: in this process and those that it begins."""
    known = os.environ.get(FOLDERS, "").split(os.pathsep)
    given = str(folder.absolute())
    os.environ[FOLDERS] = os.pathsep.join([given, *(x for x in known if x and x != given)])


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
    path = find_file(given, source)
    try:
        return open_file(path)
    except OSError as error:
        raise KernelError(f"which can't be read ({error.strerror or error}): {path}") from None


def find_file(given: str, source: str) -> Path:
    """The file of a path as given; ``KernelError`` if there is none."""
    wanted = Path(given).expanduser()
    folders = _folders(source)
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
    """Folders to look in, the config's first."""
    config = Path(source)
    named = [Path(x) for x in os.environ.get(FOLDERS, "").split(os.pathsep) if x]
    return [*([config.absolute().parent] if config.is_file() else []), *named, Path.cwd()]
