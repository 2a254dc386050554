"""A run that was cut, however often and by whatever, gives the bits of one in one go."""

import os
import resource
from pathlib import Path
from typing import Any

import pytest
from support import EAGER, IMPATIENT, cases, config, loaded, same_bits

import rigidsim
from rigidsim import RunFolderError
from rigidsim.solve import driver
from rigidsim.store import atomic, provenance

EVENTS = '[[events]]\nname = "flip"\nexpression = "wz"\n'
FRICTION = 'kind = "torque"\ncomponents = ["0", "-0.05*wy", "-0.2*sign(wz)"]'


def text_with(time: str, limits: str = "", **tables: str) -> str:
    return config(**tables, time=time, more=f"[limits]\n{limits}", name="cut")


def resumed_to_the_end(run: rigidsim.Run) -> rigidsim.Run:
    for _ in range(400):
        if run.status.startswith("finished"):
            break
        run = rigidsim.resume(run.folder.path, tuning=IMPATIENT)
    return run


# --- what can end a session -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, rigidsim.Run]:
    """A config, and its run in one go."""
    text = text_with("end = 5\nsamples = 11")
    return text, rigidsim.run(rigidsim.parse(text), out=tmp_path_factory.mktemp("whole"))


class Cut(BaseException):
    """As sudden as a kill: nothing is saved after it."""


CRASHES = [
    ("before the name", "dataset.h5"),
    ("after the name", "00000003.h5"),
    ("after the name", "dataset.h5"),
    ("folder not synced", "checkpoint.h5"),
    ("before the name", "summary.json"),
]


@pytest.mark.parametrize("crash", cases(CRASHES, CRASHES[:1]))
def test_a_crash_at_any_file(
    crash: tuple[str, str], short: tuple[str, rigidsim.Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files of a run come into being one by one; between any two a process can die."""
    (moment, target), (text, whole) = crash, short
    replace, sync = os.replace, atomic.sync_folder
    named = []

    def crashing(source: Any, to: Any) -> None:
        if Path(to).name == target and moment == "before the name":
            raise Cut
        replace(source, to)
        named.append(Path(to).name)
        if Path(to).name == target and moment == "after the name":
            raise Cut

    def not_synced(folder: Path) -> None:
        if moment == "folder not synced" and named and named[-1] == target:
            raise Cut
        sync(folder)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", crashing)
        patch.setattr(atomic, "sync_folder", not_synced)
        with pytest.raises(Cut):
            rigidsim.run(rigidsim.parse(text), out=tmp_path / "cut", tuning=EAGER)
    partial = rigidsim.open_run(tmp_path / "cut" / "cut")
    if partial.saved:
        first = loaded(partial)
        same_bits(first, loaded(whole).isel(time=slice(first.sizes["time"])))
    done = rigidsim.resume(partial.folder.path, tuning=EAGER)
    assert done.status == "finished"
    same_bits(whole, done)
    assert sorted(p.name for p in done.folder.path.iterdir()) == sorted(
        p.name for p in whole.folder.path.iterdir()
    )


def test_a_full_disk_while_the_dataset_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 would crash the process if it saw the error."""
    from rigidsim.store.atomic import Sink

    text = text_with("end = 60\nsamples = 4001")
    whole = rigidsim.run(rigidsim.parse(text), out=tmp_path / "whole")
    size = whole.folder.dataset.stat().st_size
    write = Sink.write
    for room in (0, size // 2):

        def small(self: Sink, content: Any) -> int:
            before = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))  # noqa: B023
            try:
                return write(self, content)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)

        out = tmp_path / str(room)
        with monkeypatch.context() as patch:
            patch.setattr(Sink, "write", small)
            with pytest.raises(RunFolderError, match=r"File too large.*\.resume.* continues"):
                rigidsim.run(rigidsim.parse(text), out=out)
        assert not (out / "cut" / "dataset.h5").exists()
        same_bits(whole, rigidsim.resume(out / "cut"))


@pytest.mark.parametrize(
    ("load", "integrator", "end", "steps"),
    [
        pytest.param(
            'kind = "torque"\ncomponents = ["0", "0", "0.1*sin(0.3*t)"]',
            'precision = "extended"',
            3000,
            4000,
            marks=pytest.mark.slow,
        ),
        ("", 'method = "taylor"', 4000, 4000),  # held against its closed form
    ],
)
def test_its_announced_errors_are_those_of_the_run_in_one_go(
    load: str, integrator: str, end: int, steps: int, tmp_path: Path
) -> None:
    """They are told from boundaries and samples all along it, of which a later session knew its own."""
    text = config(loads=load, integrator=integrator, time=f"end = {end}\nsamples = 200", estimate=True)
    whole = rigidsim.run(rigidsim.parse(text), out=None)
    cut = rigidsim.run(rigidsim.parse(text + f"[limits]\nmax_steps = {steps}\n"), out=tmp_path)
    assert steps < whole.summary["cost"]["steps"] < 10000
    done = rigidsim.resume(cut.folder.path, overrides=["limits.max_steps=10000"])
    assert done.summary["accuracy"] == whole.summary["accuracy"]


# --- a later end ------------------------------------------------------------------------------------


LATER: dict[str, tuple[int, str, dict[str, str]]] = {  # first end, what guards it, tables
    "events": (60, "", {}),
    "50 digits, angles": (6, "max_steps = 5", {"integrator": 'precision = 50\nformulation = "euler_angles"'}),
    "extended, sliding": (20, "max_steps = 5", {"loads": FRICTION, "integrator": 'precision = "extended"'}),
}


@pytest.mark.parametrize("case", cases(LATER, ["events"]))
def test_a_later_end(case: str, tmp_path: Path) -> None:
    """A finished run goes on, and an unfinished one, with the bits of a run that was as long at once."""
    first, guard, tables = LATER[case]
    end = first * 3 // 2
    text, longer = (
        text_with(f"end = {x}\nevery = 0.5", f"{guard}\n{EVENTS}", **tables) for x in (first, end)
    )
    more = ["limits.max_steps=1000000"]
    whole = rigidsim.run(rigidsim.parse(longer, overrides=more), out=tmp_path / "whole", tuning=IMPATIENT)
    run = rigidsim.run(rigidsim.parse(text), out=tmp_path / "cut", tuning=IMPATIENT)
    assert run.status == ("stopped: max_steps" if guard else "finished")
    done = rigidsim.resume(run.folder.path, until=str(end), overrides=more, tuning=IMPATIENT)
    assert done.status == "finished"
    same_bits(whole, done)
    # and the run folder is one of a longer run: verified, and prolonged again
    assert rigidsim.verify(done.folder.path).identical


# --- what can't be resumed --------------------------------------------------------------------------


def test_what_a_ctrl_c_left_out_after_the_dataset_is_made_up_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run is finished then, and a script that resumes until the exit code is 0 comes to an end."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    experiment = rigidsim.parse(text_with("end = 3\nsamples = 7"), overrides=["output.timeline=true"])
    with monkeypatch.context() as patch:
        patch.setattr("rigidsim.look.timeline.write_timeline", interrupted)
        run = rigidsim.run(experiment, out=tmp_path)
    assert run.status == "interrupted"
    assert run.folder.dataset.exists()
    content = run.folder.dataset.read_bytes()
    for _ in range(2):
        again = rigidsim.resume(run.folder.path)
        assert (again.status, again.summary["exit_code"]) == ("finished", 0)
        assert again.summary["message"] == "the run reached its last sample"
        assert again.summary["timeline_sha256"] == provenance.file_sha256(run.folder.timeline)
        assert run.folder.dataset.read_bytes() == content


def test_nothing_saved_begins_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = text_with("end = 30\nsamples = 61")
    whole = rigidsim.run(rigidsim.parse(text), out=tmp_path / "whole")
    with monkeypatch.context() as patch:
        patch.setattr(driver.Driver, "run", lambda self: (_ for _ in ()).throw(Cut))
        with pytest.raises(Cut):
            rigidsim.run(rigidsim.parse(text), out=tmp_path / "cut")
    done = rigidsim.resume(tmp_path / "cut" / "cut")
    assert "nothing had been saved, so the run started again" in done.summary["warnings"]
    same_bits(whole, done)


CHANGES = {
    "a value": (lambda t: t.replace("0.3, 1.0", "0.3, 1.1"), r"line 5 is .*1\.1, 0\.5.*it was .*1\.0, 0\.5"),
    "a comment": (lambda t: "# mine\n" + t, 'line 1 is "# mine"'),
}


def test_a_changed_config_is_refused(tmp_path: Path) -> None:
    text = text_with("end = 60\nsamples = 121", "max_steps = 20")
    run = rigidsim.run(rigidsim.parse(text), out=tmp_path, tuning=IMPATIENT)
    for edit, says in CHANGES.values():
        run.folder.config.write_text(edit(text))
        with pytest.raises(
            RunFolderError, match=rf"config\.toml: was changed since the run began \(.*{says}"
        ):
            rigidsim.resume(run.folder.path, tuning=IMPATIENT)
    run.folder.config.write_text(text)
    assert rigidsim.resume(run.folder.path, overrides=["limits.max_steps=100000"]).status == "finished"


@pytest.mark.slow
def test_another_process_or_a_link_is_not_disturbed(tmp_path: Path) -> None:
    text = text_with("end = 300\nevery = 1", "max_steps = 150")
    run = rigidsim.run(rigidsim.parse(text), out=tmp_path, tuning=IMPATIENT)
    before = sorted((p.name, p.read_bytes()) for p in run.folder.segments.iterdir())
    with run.folder.locked():
        with pytest.raises(RunFolderError, match="another process is at work there"):
            rigidsim.resume(run.folder.path, tuning=IMPATIENT)
        with pytest.raises(RunFolderError, match="another process is at work there"):
            rigidsim.run(rigidsim.parse(text), out=tmp_path, force=True, tuning=IMPATIENT)
    elsewhere = tmp_path / "elsewhere"
    for what in ("segments", "segments/00000000.h5", "config.toml", ".dataset.h5.partial"):
        place = run.folder.path / what
        there = place.exists()
        if there:
            place.rename(elsewhere)
        else:
            elsewhere.write_text("mine")
        place.symlink_to(elsewhere)
        with pytest.raises(RunFolderError, match=r"is a symbolic link, which no run writes"):
            rigidsim.resume(run.folder.path, tuning=IMPATIENT)
        place.unlink()
        if there:
            elsewhere.rename(place)
        else:
            assert elsewhere.read_text() == "mine"
    assert sorted((p.name, p.read_bytes()) for p in run.folder.segments.iterdir()) == before
    assert resumed_to_the_end(run).status == "finished"
