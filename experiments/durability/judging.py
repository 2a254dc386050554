"""What a disturbed run has left, looked at from outside, and what is counted of it."""

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from rigidsim.errors import RunFolderError
from rigidsim.store import netcdf


@dataclass
class Tally:
    """What was counted, and what went wrong; told as it happens."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    def expect(self, good: bool, what: str) -> bool:
        """Note a failure."""
        if not good:
            self.failures.append(what)
            print(f"FAILED: {what}", flush=True)
        return good

    def tell(self, what: str) -> None:
        """One line on the way."""
        print(f"{what}; failures so far: {len(self.failures)}", flush=True)

    def print_totals(self) -> None:
        """Everything counted."""
        for name, count in sorted(self.counts.items()):
            print(f"{name:40s} {count}")
        print(f"{'failures':40s} {len(self.failures)}", flush=True)


def ended(folder: Path) -> bool:
    """Whether nothing is left to do."""
    return (folder / "dataset.h5").exists() and not (folder / "segments").exists()


def names(folder: Path) -> set[str]:
    """Of all files of a run folder."""
    found = set()
    for place in (folder, folder / "segments"):
        try:
            found.update(entry.name for entry in os.scandir(place))
        except OSError:
            continue
    return found


def saved_rows(folder: Path) -> int:
    """Samples in segments that have their names, from outside; -1 for all of them."""
    if (folder / "dataset.h5").exists():
        return -1
    last = max((n for n in names(folder / "segments") if n[0].isdigit()), default=None)
    if last is None:
        return 0
    try:
        labels = netcdf.root_attributes(folder / "segments" / last)
    except RunFolderError:  # gone meanwhile: the dataset took its place
        return saved_rows(folder)
    return int(labels.get("first_sample", 0)) + int(labels["rows"])
