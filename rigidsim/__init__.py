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
    from rigidsim.store.sweeps.saved import SavedSweep, open_sweep
    from rigidsim.workflows.analyse import analyse
    from rigidsim.workflows.compare.compared import compare
    from rigidsim.workflows.export import export
    from rigidsim.workflows.fit.fitting import fit
    from rigidsim.workflows.physics import required_physics
    from rigidsim.workflows.plan import plan
    from rigidsim.workflows.read import Experiment, load, parse
    from rigidsim.workflows.run import resume, run
    from rigidsim.workflows.sweeps.sweep import sweep
    from rigidsim.workflows.tradeoff import tradeoff
    from rigidsim.workflows.verify import verify

__version__ = "2.0.0.dev0"

__all__ = [
    "ConfigError", "Experiment", "MemoryRun", "RigidsimError", "Run", "RunFolderError", "SavedRun",
    "SavedSweep", "analyse", "compare", "export", "fit", "load", "open_run", "open_sweep", "parse", "plan",
    "required_physics", "resume", "run", "sweep", "tradeoff", "verify",
]  # fmt: skip

_NAMES = {
    "errors": ("ConfigError", "RigidsimError", "RunFolderError"),
    "store.run": ("MemoryRun", "Run", "SavedRun", "open_run"),
    "store.sweeps.saved": ("SavedSweep", "open_sweep"),
    "workflows.analyse": ("analyse",),
    "workflows.compare.compared": ("compare",),
    "workflows.export": ("export",),
    "workflows.fit.fitting": ("fit",),
    "workflows.physics": ("required_physics",),
    "workflows.plan": ("plan",),
    "workflows.read": ("Experiment", "load", "parse"),
    "workflows.run": ("resume", "run"),
    "workflows.sweeps.sweep": ("sweep",),
    "workflows.tradeoff": ("tradeoff",),
    "workflows.verify": ("verify",),
}
_MODULES = {name: f"rigidsim.{module}" for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'rigidsim' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All public names, loaded or not, for tab completion."""
    return sorted({*globals(), *__all__})
