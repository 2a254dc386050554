"""Whether a folder is a fit's, found without loading what makes fits."""

from pathlib import Path

BEGUN = "begun.json"
"""File that a fit's folder holds from its beginning on."""


def is_fit(path: str | Path) -> bool:
    """Whether a path is the folder of a fit, or a file in one."""
    given = Path(path)
    try:
        return ((given if given.is_dir() else given.parent) / BEGUN).is_file()
    except OSError:
        return False
