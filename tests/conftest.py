"""Shared fixtures."""

import gc
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import pytest

# What collection makes lives as long as the tests do; searching it for garbage took 3.5 of 16 s.
gc.disable()
# Workers, and the processes that tests start, find the package compiled.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.setdefault("CI", "1")  # rerun's viewer collects no statistics then
sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1]))  # the studies are no installed package

from rigidsim import SavedRun, parse  # noqa: E402, F401  (tests that read configs below need every kind of load)

TERMINAL = shutil.get_terminal_size().columns
# Whatever terminal the tests are started from, and however long the path of their temporary folder: no line
# of a screen is broken, but where a test is about that and gives a width.
os.environ.update(COLUMNS="1000", TERM="xterm-256color", FORCE_COLOR="", TTY_COMPATIBLE="", NO_COLOR="")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Function) -> Iterator[object]:
    """Tests run in code that compiles fast and rounds otherwise than that of real runs, since their
    statements hold whatever the last bit is; those marked ``optimised`` in the code of real runs, and long
    ones, which step long, but for those marked ``unoptimised``. A further parameter of a short test runs as
    the others do.
    """
    from support import unoptimised_code

    whole = [*getattr(item.function, "pytestmark", ()), *item.parent.iter_markers()]
    optimised = any(mark.name in ("optimised", "slow", "campaign") for mark in whole)
    optimised = optimised and not item.get_closest_marker("unoptimised")
    with nullcontext() if optimised else unoptimised_code():
        return (yield)


def pytest_configure(config: pytest.Config) -> None:
    import support

    given = config.option.markexpr
    support.campaigns_asked = not given or "campaign" in given.replace("not campaign", "")


def pytest_collection_finish(session: pytest.Session) -> None:
    """From here on garbage is searched for among what the tests themselves make."""
    gc.freeze()
    gc.enable()


def pytest_sessionstart(session: pytest.Session) -> None:
    """The progress of the tests themselves fits the terminal that they are started from."""
    session.config.get_terminal_writer().fullwidth = TERMINAL


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that say how many seconds they take (``slow(seconds)``) begin first, the longest of them at once:
    no worker is left alone with one at the end.
    """

    def seconds(item: pytest.Item) -> float:
        marker = item.get_closest_marker("slow")
        return marker.args[0] if marker and marker.args else 0.0

    items.sort(key=seconds, reverse=True)  # stable: the others in their files' order


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """An empty folder for run folders."""
    return tmp_path / "runs"


@pytest.fixture
def ready(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., SavedRun]:
    """Runs of ready scenes, by path or name and overrides: each is integrated once for all tests and workers,
    and mustn't be written to. Kept apart are runs in optimised code, which rounds otherwise.
    """
    from support import shared_run

    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    return partial(shared_run, shared / "ready")


@pytest.fixture(scope="session")
def free_body() -> Callable[..., str]:
    """Text of an asymmetric free body; a table given by keyword is appended as it stands."""

    from support import config

    def text(
        time: str = "end = 3\nsamples = 49",
        *,
        precision: str = '"double"',
        formulation: str = "auto",
        output: str = "",
        name: str = "free",
    ) -> str:
        integrator = f'precision = {precision}\nformulation = "{formulation}"'
        return config(time=time, integrator=integrator, output=output, name=name)

    return text
