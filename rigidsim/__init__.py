"""High-precision experiments on rotating rigid bodies: one TOML file is one experiment.

``load`` reads a config, ``run`` integrates it and saves a run folder, ``open_run`` opens one again.
Importing this package loads neither the integrator nor any plotting or file library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigidsim.archive import Run, open_run
    from rigidsim.errors import ConfigError, RigidsimError, RunFolderError
    from rigidsim.planner import plan
    from rigidsim.resuming import resume
    from rigidsim.runner import run
    from rigidsim.scene.reading import Experiment, load, parse
    from rigidsim.verification import verify

__version__ = "0.1.0"

_PLACES = {
    "ConfigError": "rigidsim.errors",
    "RigidsimError": "rigidsim.errors",
    "RunFolderError": "rigidsim.errors",
    "Experiment": "rigidsim.scene.reading",
    "load": "rigidsim.scene.reading",
    "parse": "rigidsim.scene.reading",
    "Run": "rigidsim.archive",
    "open_run": "rigidsim.archive",
    "run": "rigidsim.runner",
    "resume": "rigidsim.resuming",
    "verify": "rigidsim.verification",
    "plan": "rigidsim.planner",
}

__all__ = [
    "ConfigError",
    "Experiment",
    "RigidsimError",
    "Run",
    "RunFolderError",
    "load",
    "open_run",
    "parse",
    "plan",
    "resume",
    "run",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'rigidsim' has no attribute {name!r}")
    value = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value
