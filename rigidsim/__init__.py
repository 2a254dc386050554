"""High-precision experiments on rotating rigid bodies: one TOML file is one experiment.

``load`` reads a config, ``run`` integrates it and saves a run folder, ``open_run`` opens one again.
Importing this package loads neither the integrator nor any plotting or file library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigidsim.errors import ConfigError, RigidsimError, RunFolderError
    from rigidsim.store.run import MemoryRun, Run, SavedRun, open_run
    from rigidsim.store.sweeps.run import SavedSweep, open_sweep
    from rigidsim.workflows.analyse import analyse
    from rigidsim.workflows.plan import plan
    from rigidsim.workflows.read import Experiment, load, parse
    from rigidsim.workflows.resume import resume
    from rigidsim.workflows.run import run
    from rigidsim.workflows.sweeps.sweep import sweep
    from rigidsim.workflows.verify import verify

__version__ = "0.1.0"

_PLACES = {
    "ConfigError": "rigidsim.errors",
    "RigidsimError": "rigidsim.errors",
    "RunFolderError": "rigidsim.errors",
    "Experiment": "rigidsim.workflows.read",
    "load": "rigidsim.workflows.read",
    "parse": "rigidsim.workflows.read",
    "MemoryRun": "rigidsim.store.run",
    "Run": "rigidsim.store.run",
    "SavedRun": "rigidsim.store.run",
    "open_run": "rigidsim.store.run",
    "run": "rigidsim.workflows.run",
    "resume": "rigidsim.workflows.resume",
    "SavedSweep": "rigidsim.store.sweeps.run",
    "open_sweep": "rigidsim.store.sweeps.run",
    "sweep": "rigidsim.workflows.sweeps.sweep",
    "verify": "rigidsim.workflows.verify",
    "plan": "rigidsim.workflows.plan",
    "analyse": "rigidsim.workflows.analyse",
}

__all__ = [
    "ConfigError",
    "Experiment",
    "MemoryRun",
    "RigidsimError",
    "Run",
    "RunFolderError",
    "SavedRun",
    "SavedSweep",
    "analyse",
    "load",
    "open_run",
    "open_sweep",
    "parse",
    "plan",
    "resume",
    "run",
    "sweep",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'rigidsim' has no attribute {name!r}")
    value = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All public names, loaded or not, for tab completion."""
    return sorted({*globals(), *__all__})
