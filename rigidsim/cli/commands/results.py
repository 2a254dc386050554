"""Commands on the results of a run or a sweep: ``analyse``, ``export``, ``plot``, ``view``."""

import sys
from pathlib import Path

import rigidsim.workflows.analyse as analysing
import rigidsim.workflows.export as exporting
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.analysis import print_analysis
from rigidsim.cli.screens.page import answer
from rigidsim.errors import RigidsimError
from rigidsim.formats.registry import Naming
from rigidsim.look.figure_names import OVERVIEW, SPECTRUM
from rigidsim.look.figures import available, check_name, figure_format, save_figure
from rigidsim.look.figures.sweeps import drawable, sweep_figure
from rigidsim.store.folder import SweepFolder, folder_at
from rigidsim.store.outputs import ANALYSIS, refuse_loss, write_drawn, writing
from rigidsim.store.run import SavedRun, ShownRun
from rigidsim.store.sweeps.saved import SavedSweep, open_saved, open_sweep
from rigidsim.workflows.compare.as_run import open_any
from rigidsim.workflows.view import render, runs_of, show, shown

ALL = "all"


def analyse(
    run_path: Path, variable: list[str] | None, lines: int, out: Path | None, force: bool, as_json: bool
) -> None:
    """Find lines, save them, print them."""
    opened = open_any(run_path)
    _report_notes(opened)
    usual = opened.folder.analysis if isinstance(opened, SavedRun) else _in_folder_of(opened, ANALYSIS)
    places = analysing.places_of(out or usual, opened.files, force=force)
    analysis = analysing.analyse(opened, variable or (), lines=lines)
    write_drawn(analysis.dataset, places.dataset, analysis.figure(), places.figure)
    answer(as_json, analysis.as_dict(), print_analysis, analysis, places)


def export(
    run_path: Path, file_format: str | None, out: Path | None, force: bool, angle_unit: str | None,
    epoch: str | None, axes: str | None, object_name: str | None, object_id: str | None,
    message: str | None, variable: list[str] | None,
) -> None:  # fmt: skip
    """Write a run or a sweep for other tools."""
    given = {"epoch": epoch, "axes": axes, "object_name": object_name, "object_id": object_id}
    asked = dict(part.partition("=")[::2] for part in (message or "").split(",") if part.strip())
    naming = Naming(**{key: value for key, value in given.items() if value is not None}, message=asked)
    written = exporting.export(
        open_saved(run_path),
        file_format,
        out,
        force=force,
        naming=naming,
        angle_unit=angle_unit,
        variables=variable or (),
    )
    for path in written:
        print(path)


def plot(run_path: Path, what: list[str] | None, out: Path | None, for_slides: str | None) -> None:
    """Draw figures of a run, or maps of a sweep."""
    swept = isinstance(folder_at(run_path), SweepFolder)
    if swept or SPECTRUM in (what or []):
        refuse_options("is for figures of a single run other than spectrum", for_slides=for_slides)
    saved: SavedSweep | SavedRun | ShownRun = open_sweep(run_path) if swept else shown(run_path)
    _report_notes(saved)
    wanted = list(dict.fromkeys(what or []))
    try:
        for name in () if swept else (one for one in wanted if one != ALL):
            check_name(name)
    except ValueError as error:
        raise RigidsimError(f"--what: {error}, {ALL}") from None
    several = len(wanted) > 1 or ALL in wanted
    if several and out is not None and not out.is_dir():
        raise RigidsimError(f"{out}: several figures need a folder that is there; give one as --out, or none")
    with saved.dataset as dataset:
        if ALL in wanted:
            wanted = [*(drawable(dataset) if swept else available(dataset))]
        for name in wanted or [OVERVIEW]:
            own = "" if name == OVERVIEW else "_" + name.replace("[", "_").replace("]", "")
            own += "" if for_slides is None else "_slide"
            file = f"figure{own}.png"
            usual = _in_folder_of(saved, file) if isinstance(saved, ShownRun) else saved.folder.path / file
            target = usual if out is None else out / usual.name if several else out
            try:
                kind = figure_format(target)
                refuse_loss([target], saved.files)
                with writing(target) as new:
                    if isinstance(saved, SavedSweep):
                        sweep_figure(dataset, None if name == OVERVIEW else name).savefig(new, format=kind)
                    elif name == SPECTRUM:
                        analysing.analyse(saved).figure().savefig(new, format=kind)
                    else:
                        save_figure(dataset, new, name, file_format=kind, slides=for_slides)
            except ValueError as error:
                raise RigidsimError(f"plot: {error}" if swept else str(error)) from None
            print(target)


def view(
    run_paths: list[Path], web: bool, png: Path | None, gif: Path | None, mp4: Path | None,
    seconds: float | None, member: list[int] | None, at: str | None, part: str | None,
) -> int:  # fmt: skip
    """Open the viewer, or draw to files."""
    targets = {".png": png, ".gif": gif, ".mp4": mp4}
    asked = {suffix: target for suffix, target in targets.items() if target is not None}
    for suffix, target in asked.items():
        if target.suffix.lower() != suffix:
            raise RigidsimError(f"--{suffix[1:]}: given {target}; a name that ends in {suffix} is allowed")
    if asked:
        refuse_options("opens the viewer, but --png, --gif and --mp4 draw to a file", web=web)
    else:
        refuse_options("is for pictures and films (--png, --gif, --mp4)", part=part)
    if not {".gif", ".mp4"} & set(asked):
        refuse_options("is for films (--gif, --mp4)", seconds=seconds)
    if set(asked) != {".png"}:
        refuse_options("is the moment of a picture (--png alone)", at=at)
    refuse_loss(asked.values(), run_paths)
    named = runs_of(run_paths, member or ())
    refuse_loss(asked.values(), [path for _, one in named for path in one.files])
    for _, one in named:
        _report_notes(one)
    for target in asked.values():
        progress = _report_frames if sys.stderr.isatty() else None
        render(named, target, seconds=seconds, progress=progress, at=at, part=part or "page")
        print(target)
    return 0 if asked else show(named, web=web)


def _in_folder_of(shown: ShownRun, name: str) -> Path:
    """Where what is made of another tool's file goes if nothing else is asked for."""
    return shown.path.with_name(f"{shown.path.stem}_{name}")


def _report_notes(opened: object) -> None:
    """Say how the file of another tool was read."""
    for text in opened.notes if isinstance(opened, ShownRun) else ():
        print(f"note: {text}", file=sys.stderr)


def _report_frames(done: int, count: int) -> None:
    end = "\n" if done == count else ""
    print(f"\r{done} of {count} frames", end=end, file=sys.stderr, flush=True)
