"""A fit made again from its own copies of config and data, and compared bit by bit."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import xarray

from rigidsim.errors import RunFolderError
from rigidsim.workflows.fit.fitting import fit_again
from rigidsim.workflows.fit.folder import FitFolder, digest, kernel_digests, versions
from rigidsim.workflows.read import load


@dataclass(frozen=True)
class FitVerdict:
    """Result of a verification; ``environment``: versions that changed since, which may explain the rest."""

    path: str
    identical: bool
    problems: list[str] = field(default_factory=list)
    differing: list[str] = field(default_factory=list)
    environment: list[str] = field(default_factory=list)
    variables: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
        return asdict(self)


def verify_fit(path: str | Path, *, told: Callable[[str], None] | None = None) -> FitVerdict:
    """Make a finished fit again and compare every number of its dataset, and its fitted config.

    Raises:
        RunFolderError: no finished fit is there.
    """
    given = Path(path)
    folder = FitFolder(given if given.is_dir() else given.parent)
    if not folder.finished:
        raise RunFolderError(f"{path}: holds no finished fit; rigidsim resume {path} goes on with it")
    begun = json.loads(folder.begun.read_text(encoding="utf-8"))
    again = fit_again(folder, told=told)
    problems = []
    for source, known in zip(again.data, begun["data_sha256"], strict=True):
        if source.sha256 != known:
            problems.append(f"data {source.number}: not the bytes that the fit was made from")
    kernels = kernel_digests(folder.copies(load(folder.config)))
    if begun.get("kernels_sha256", kernels) != kernels:
        problems.append("kernels: not the bytes that the fit was made from")
    if again.experiment.text != folder.fitted.read_text(encoding="utf-8"):
        problems.append(f"{folder.fitted.name}: other values than those fitted again")
    if digest(folder.config) != begun["text_sha256"]:
        problems.append(f"{folder.config.name}: not the config that the fit was made from")
    with xarray.open_dataset(folder.dataset, decode_times=False) as saved:
        now = again.dataset
        names = sorted({*map(str, saved.variables), *map(str, now.variables)})
        differing = [
            name
            for name in names
            if name not in saved.variables
            or name not in now.variables
            or not saved[name].variable.equals(now[name].variable)
        ]
    changed = [
        f"{name} {then} -> {versions().get(name)}"
        for name, then in begun["versions"].items()
        if versions().get(name) != then
    ]
    return FitVerdict(
        str(folder.path), not problems and not differing, problems, differing, changed, len(names)
    )
