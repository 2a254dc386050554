"""Outcomes as JSON lines in a file, so that a campaign can be stopped, gone on with, and shared.

Each line is written at once, by one call in append mode: several processes can share a file. Lines of another
seed or of other code are left alone and not counted.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import rigidsim
from experiments import random_scenes
from experiments.certificates.examining import Outcome


def code_version() -> str:
    """Of all that decides an outcome: rigidsim's sources, the random scenes and this study."""
    folders = [Path(rigidsim.__file__).parent, Path(__file__).parent]
    files = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    digest = hashlib.sha256()
    for path in [*files, Path(random_scenes.__file__)]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


class Ledger:
    """The outcomes of one seed and one state of the code.

    Attributes:
        path: of the file.
        outcomes: by the scene's number, as far as they are known.
    """

    def __init__(self, path: Path, seed: int, version: str) -> None:
        self.path = path
        self._key = {"seed": seed, "version": version}
        self.outcomes: dict[int, Outcome] = {}
        self.read()

    def read(self) -> None:
        """Read what is in the file, be it from other processes; a line that was cut short is no outcome."""
        if not self.path.exists():
            return
        names = {field.name for field in fields(Outcome)}
        for line in self.path.read_text(encoding="utf-8").splitlines():
            try:
                row = json.loads(line)
            except ValueError:
                continue
            if isinstance(row, dict) and all(row.get(k) == v for k, v in self._key.items()):
                given = {name: _number(row[name]) for name in names if name in row}
                self.outcomes[row["number"]] = Outcome(**given)

    def add(self, outcome: Outcome) -> None:
        """Write an outcome behind the others."""
        self.outcomes[outcome.number] = outcome
        row = {**self._key, **{name: _text(value) for name, value in asdict(outcome).items()}}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        cut = self.path.exists() and not self.path.read_bytes().endswith(b"\n") and self.path.stat().st_size
        line = f"{chr(10) if cut else ''}{json.dumps(row, allow_nan=False)}\n"
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            os.write(descriptor, line.encode())
        finally:
            os.close(descriptor)


def _text(value: Any) -> Any:
    """JSON has no numbers that aren't finite."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: Any) -> Any:
    return float(value) if value in ("nan", "inf", "-inf") else value
