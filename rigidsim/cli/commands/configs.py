"""Commands on configs: ``new``, ``check``, ``plan``, ``tradeoff``, ``schema``."""

import sys
from pathlib import Path

import rigidsim.workflows.check as validation
import rigidsim.workflows.plan as planning
import rigidsim.workflows.tradeoff as measuring
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import Page, Styled, answer, print_json, reporting
from rigidsim.cli.screens.plan import print_physics, print_plan, print_tradeoff
from rigidsim.cli.screens.summary import print_understood
from rigidsim.cli.screens.sweeps import print_sweep_plan
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.editor_schema import editor_schema
from rigidsim.scene.sweep import Sweep
from rigidsim.workflows.physics import required_physics
from rigidsim.workflows.read import load
from rigidsim.workflows.ready_scenes import by_subject, write_new
from rigidsim.workflows.sweeps.plan import plan_sweep


def new(scene: str | None, name: str | None) -> None:
    """Write a ready scene, or list them by subject."""
    if scene is None:
        on = Page()
        rows: list[tuple[Styled, Styled]] = []
        for subject, scenes in by_subject():
            rows += [("", ""), ("", (subject, "bold")), *scenes.items()]
        on.table(["scene", "what it is"], rows[1:])
        on.say("rigidsim new SCENE [NAME] writes NAME.toml, and next to it the tables that it reads")
        return
    path, *beside = write_new(scene, name)
    for other in beside:
        print(f"{other}: read by {path}")
    print(f"{path}: edit it, then: rigidsim check {path}; rigidsim {_verb_of(path)} {path}")


def _verb_of(path: Path) -> str:
    return "sweep" if load(path).config.sweep is not None else "run"


def check(configs: list[Path], overrides: list[str] | None, as_json: bool) -> int:
    """Validate configs, and show what was understood of them."""
    valid = True
    for path in configs:
        found = validation.check(path, overrides=overrides or [])
        valid = valid and found.valid
        answer(as_json, found.as_dict(), _print_checked, found)
    return 0 if valid else 2


def _print_checked(found: validation.Checked) -> None:
    """Print the result of a check; errors go to stderr, as for all commands."""
    if not found.valid:
        print(f"rigidsim: {ConfigError(found.problems, found.source)}", file=sys.stderr)
        return
    on = Page()
    on.say((found.source, "bold"), "  ", ("valid", "bold green"))
    print_understood(found, found.loads, on)
    on.lines("warning", found.warnings, "bold red")


def plan(
    config: Path, overrides: list[str] | None, out: Path, physics: str | None, write: Path | None,
    force: bool, as_json: bool,
) -> None:  # fmt: skip
    """Say what would be integrated, of a sweep what one member of it would; or what the scene requires."""
    experiment = load(config, overrides=overrides or [])
    if physics is not None:
        report = reporting(experiment.config.name)
        found = required_physics(experiment, physics, out=out, write=write, force=force, told=report)
        answer(as_json, found.as_dict(), print_physics, found)
        return
    refuse_options('is for --physics ERROR, such as --physics "0.1 arcsec"', write=write, force=force)
    swept = None if experiment.config.sweep is None else plan_sweep(Sweep.of(experiment), out=out)
    made = planning.plan(experiment, out=out) if swept is None else swept.member
    if as_json:
        print_json((swept or made).as_dict())
        return
    if swept is not None:
        print_sweep_plan(swept)
    print_plan(made)


def tradeoff(
    config: Path, overrides: list[str] | None, out: Path, budget: float, repeats: int, full: bool,
    files: list[str] | None, force: bool, as_json: bool,
) -> None:  # fmt: skip
    """Measure speed against accuracy of a scene."""
    experiment = load(config, overrides=overrides or [])
    report = reporting(experiment.config.name)
    result = measuring.tradeoff(
        experiment, others=[_file_and_seconds(text) for text in files or ()],
        out=out, budget=budget, repeats=repeats, full=full, force=force, told=report,
    ).as_dict()  # fmt: skip
    answer(as_json, result, print_tradeoff, result)


def _file_and_seconds(text: str) -> tuple[Path, float]:
    file, _, seconds = text.rpartition(",")
    try:
        return Path(file), float(seconds)
    except ValueError:
        raise RigidsimError(
            f"--with: given {text}; a file and its CPU time in s are allowed: theirs.csv,1.7"
        ) from None


def schema() -> None:
    """Print the config's JSON schema; ``rigidsim.workflows.read`` registers every kind of load."""
    print_json(editor_schema(), indent=2)
