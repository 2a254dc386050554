"""Versions, machine and settings of a run, as far as they can change bits, among the root attributes of its
segments and dataset.
"""

import hashlib
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import heyoka as hy
import mpmath
import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.store import netcdf


def cpu_model() -> str:
    """The processor's name, from the operating system's kernel if known."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def versions() -> dict[str, str]:
    """Versions of everything that affects the numbers."""
    parts = {"heyoka": hy, "numpy": np, "mpmath": mpmath, "h5py": h5py}
    found = {name: str(module.__version__) for name, module in parts.items()}
    return {"python": platform.python_version(), "rigidsim": sys.modules["rigidsim"].__version__, **found}


def code_target(code: Any) -> dict[str, str]:
    """What LLVM compiled for, since bits depend on the CPU's features. The wheel's LLVM can't be asked for
    its version, which heyoka's version determines.
    """
    states = code.llvm_states  # one for all in compact mode
    first = states[0] if isinstance(states, tuple) else states
    lines = dict(line.split(":", 1) for line in str(first).splitlines() if ":" in line)
    lines = {key.strip(): value.strip() for key, value in lines.items()}
    features = lines.get("Target features", "")
    return {
        "llvm": f"as built into heyoka {hy.__version__}",
        "target_cpu": lines.get("Target CPU", "unknown"),
        "target_features_sha256": hashlib.sha256(features.encode()).hexdigest(),
        "optimisation_level": lines.get("Optimisation level", "unknown"),
        "fast_math": lines.get("Fast math", "unknown"),
        "slp_vectorize": lines.get("SLP vectorization", "unknown"),
    }


def now() -> str:
    """Current time, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


KERNELS = ("ephemeris_sha256", "orientation_sha256")
"""SHA-256 of the files that place bodies, and of a published orientation's file."""
SYSTEM = (
    *("formulation", "euler_sequence", "states", "precision_bits", "tolerance", "method", "hold_invariants"),
    *("hold_from_step", "taylor_order", "compact_mode", "unit_exponents", *KERNELS),
)
"""Root attributes that must be the same for a run to be resumed."""
SETTING = (
    *("status", "formulation", "states", "precision", "tolerance", "taylor_order", "compact_mode"),
    *("high_accuracy", "batch_size", "unit_exponents", *KERNELS, "steps"),
)
"""Those that must be the same when a dataset is verified."""
_REPEATED = (
    *("config_sha256", "taylor_order", "compact_mode", "unit_exponents", "ephemeris_kernel"),
    *("ephemeris_span", "orientation_kernel", "orientation_of", *KERNELS, "cpu_model", "started_at"),
)
_TEXTS = ("title", "source", "status", "config", "config_sha256", "config_given", "config_set", "states")
_PLATFORM = ("version_", "code_")
Attributes = Mapping[str, Any]
"""Root attributes of segments and datasets, as ``session.dataset.root_attributes`` makes them."""


def platform_of(attributes: Attributes) -> dict[str, Any]:
    """Versions and machine features that bits can depend on."""
    return {name: value for name, value in attributes.items() if name.startswith(_PLATFORM)}


def repeated(attributes: Attributes) -> dict[str, Any]:
    """What stands in the summary, too."""
    found = {name: attributes[name] for name in _REPEATED if attributes.get(name) is not None}
    return found | platform_of(attributes)


def changed(names: Iterable[str], then: Attributes, now: Attributes) -> Iterator[tuple[str, Any, Any]]:
    """Name and both values of those that differ; what wasn't known then counts as unchanged."""
    for name in names:
        if then.get(name) not in (None, now.get(name)):
            yield name, then[name], now.get(name)


def read_attributes(path: Path) -> Attributes:
    """The root attributes of a dataset or segment."""
    found = netcdf.root_attributes(path)
    netcdf.check_version(found.get("schema_version"), path)
    for name in _TEXTS:
        if not isinstance(found.get(name), str):
            raise RunFolderError(f"{path}: is no dataset of rigidsim (attribute {name!a} is missing)")
    return found
