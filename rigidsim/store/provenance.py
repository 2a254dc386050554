"""Provenance of a dataset: versions, machine and settings, as far as they can change bits."""

from __future__ import annotations

import hashlib
import platform
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import heyoka as hy
import mpmath
import numpy as np


def cpu_model() -> str:
    """The processor's name, from the kernel if it tells."""
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
