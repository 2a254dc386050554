"""What a disturbed run has left, looked at from outside, and what is counted of it."""

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import xarray

import rigidsim
from experiments.durability.scenes import same
from rigidsim.errors import RigidsimError, RunFolderError
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


def check_after(tally: Tally, folder: Path, reference: xarray.Dataset, acknowledged: int, what: str) -> None:
    """A disturbed run's folder: readable, with all that was acknowledged, and with the right bits."""
    everything = reference.sizes["time"]
    acknowledged = everything if acknowledged < 0 else acknowledged
    try:
        if not (folder / "segments").exists() and not (folder / "dataset.h5").exists():
            tally.expect(acknowledged == 0, f"{what}: nothing there, {acknowledged} rows acknowledged")
            return
        run = rigidsim.open_run(folder)
        if not run.saved:
            tally.expect(acknowledged == 0, f"{what}: nothing saved, {acknowledged} rows acknowledged")
            return
        with run.dataset as found:
            rows = found.sizes["time"]
            tally.expect(rows >= acknowledged, f"{what}: {rows} rows, {acknowledged} acknowledged")
            difference = same(found, reference, rows)
            tally.expect(not difference, f"{what}: {difference} differs")
    except RigidsimError as error:
        tally.expect(False, f"{what}: unreadable: {error}")


def check_complete(tally: Tally, folder: Path, reference: xarray.Dataset, what: str) -> None:
    """A completed run is the undisturbed one."""
    run = rigidsim.open_run(folder)
    with run.dataset as found:
        difference = same(found, reference)
        steps = found.attrs["steps"] == reference.attrs["steps"]
    tally.expect(run.status == "finished" and not difference and steps, f"{what}: {difference or run.status}")
    left = {"config.toml", "dataset.h5", "summary.json", "checkpoint.h5"}
    tally.expect(names(folder) == left, f"{what}: left behind {names(folder) ^ left}")
    tally.counts["completed runs identical"] += not difference
