"""Root attributes of segments and datasets: one definition for writing, reading and comparing them; versions,
machine and settings among them, as far as they can change bits.
"""

import hashlib
import platform
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Self

import h5py
import heyoka as hy
import mpmath
import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from rigidsim.errors import RunFolderError
from rigidsim.store import netcdf
from rigidsim.store.summary_parts import first_of


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


class Use(Enum):
    """What an attribute is used for, besides being read by people."""

    SYSTEM = "must be the same for a run to be resumed"
    SETTING = "must be the same when a dataset is verified"
    PLATFORM = "versions and machine features that bits can depend on"
    REPEATED = "stands in the summary, too"


class RootAttributes(BaseModel):
    """Root attributes; those that are None, as some are in segments, aren't written.

    Tables are JSON texts; wall and CPU seconds are sums over all sessions; times are UTC.

    Attributes:
        config: the TOML text of what was run, one visible value per key; its digest is config_sha256.
        config_given: the text as it was given, before settings replaced values in it.
        config_set: the settings (KEY=VALUE), one per line.
        modelling_error, attitude_error: largest error of an averaged model's directions until the end, and
            estimate for the end of the run, rad.
        principal_moments, inertia_tensor: kg m^2; center_of_mass: from the reference point, body axes, m.
        scene: what pictures are drawn from (see ``rigidsim.look.record``).
        ephemeris_kernel, ephemeris_span, ephemeris_sha256: name of the kernel that places bodies, dates
            between which it has them, and SHA-256 of its file, or of those read of a package in order.
        orientation_kernel, orientation_of, orientation_sha256: name of the kernel of a published orientation,
            what of it, and SHA-256 of its file.
        recorded: names of the variables along time, without drifts and residuals: if the config names none, a
            later version may record more by default.
        hold_from_step: natural steps after which invariants are projected; None if from the start.
        python_loads: class names of loads given from Python.
        mixed_provenance: what changed, if the run was resumed with other versions or on another machine.
        angles_wrapped_from: from this time on (s) Euler angles are within one turn, since nobody knows their
            turns; none where all are known.
    """

    model_config = ConfigDict(frozen=True, strict=True, defer_build=True)

    Conventions: str | None = None
    title: str
    comment: str
    source: str
    run_id: str | None = None
    schema_version: int
    status: Annotated[str, Use.SETTING]
    config: str
    config_sha256: Annotated[str, Use.REPEATED]
    config_given: str
    config_set: str
    formulation: Annotated[str, Use.SYSTEM, Use.SETTING]
    euler_sequence: Annotated[str, Use.SYSTEM]
    euler_partner_sequence: str | None = None
    states: Annotated[str, Use.SYSTEM, Use.SETTING]
    precision: Annotated[str, Use.SETTING]
    precision_bits: Annotated[int, Use.SYSTEM]
    tolerance: Annotated[float, Use.SYSTEM, Use.SETTING]
    integrator: str
    method: Annotated[str | None, Use.SYSTEM] = None
    hold_invariants: Annotated[int | None, Use.SYSTEM] = None
    hold_from_step: Annotated[int | None, Use.SYSTEM] = None
    taylor_order: Annotated[int | None, Use.SYSTEM, Use.SETTING, Use.REPEATED] = None
    compact_mode: Annotated[int, Use.SYSTEM, Use.SETTING, Use.REPEATED]
    high_accuracy: Annotated[int, Use.SETTING]
    batch_size: Annotated[int, Use.SETTING]
    unit_exponents: Annotated[str, Use.SYSTEM, Use.SETTING, Use.REPEATED]
    principal_moments: str
    principal_axes: str
    inertia_tensor: str
    body_source: str
    center_of_mass: str | None = None
    mass: float | None = None
    scene: str | None = None
    axes: str | None = None
    epoch: str | None = None
    ephemeris_kernel: Annotated[str | None, Use.REPEATED] = None
    ephemeris_span: Annotated[str | None, Use.REPEATED] = None
    ephemeris_sha256: Annotated[str | None, Use.SYSTEM, Use.SETTING, Use.REPEATED] = None
    orientation_kernel: Annotated[str | None, Use.REPEATED] = None
    orientation_of: Annotated[str | None, Use.REPEATED] = None
    orientation_sha256: Annotated[str | None, Use.SYSTEM, Use.SETTING, Use.REPEATED] = None
    time_unit: str | None = None
    recorded: str | None = None
    python_loads: str = ""
    cpu_model: Annotated[str, Use.REPEATED]
    started_at: Annotated[str, Use.REPEATED]
    version_python: Annotated[str, Use.PLATFORM, Use.REPEATED]
    version_heyoka: Annotated[str, Use.PLATFORM, Use.REPEATED]
    version_numpy: Annotated[str, Use.PLATFORM, Use.REPEATED]
    version_rigidsim: Annotated[str, Use.PLATFORM, Use.REPEATED]
    version_mpmath: Annotated[str, Use.PLATFORM, Use.REPEATED]
    version_h5py: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_llvm: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_target_cpu: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_target_features_sha256: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_optimisation_level: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_fast_math: Annotated[str, Use.PLATFORM, Use.REPEATED]
    code_slp_vectorize: Annotated[str, Use.PLATFORM, Use.REPEATED]
    mixed_provenance: str | None = None
    status_message: str | None = None
    warnings: str | None = None
    steps: Annotated[int | None, Use.SETTING] = None
    wall_seconds: float | None = None
    cpu_seconds: float | None = None
    finished_at: str | None = None
    put_back: str | None = None
    attitude_error: float | None = None
    modelling_error: float | None = None
    table_errors: str | None = None
    angles_wrapped_from: float | None = None

    def having(self, **known: Any) -> Self:
        """A copy with the given attributes set."""
        return type(self)(**{**dict(self), **known})

    def as_dict(self) -> dict[str, Any]:
        """The attributes that stand in the file."""
        return self.model_dump(exclude_none=True)

    def of_use(self, use: Use) -> dict[str, Any]:
        """The attributes that serve one use, as far as they are known."""
        found = {name: getattr(self, name) for name in _names(use)}
        return {name: value for name, value in found.items() if value is not None}

    def changed(self, use: Use, now: "RootAttributes") -> Iterator[tuple[str, Any, Any]]:
        """Name, value here and value now of those that differ; what isn't known here counts as unchanged."""
        others = now.of_use(use)
        for name, value in self.of_use(use).items():
            if value != others.get(name):
                yield name, value, others.get(name)


def _names(use: Use) -> list[str]:
    return [name for name, field in RootAttributes.model_fields.items() if use in field.metadata]


def read_attributes(path: Path) -> RootAttributes:
    """The root attributes of a dataset or segment."""
    found = netcdf.root_attributes(path)
    netcdf.check_version(found.get("schema_version"), path)
    try:
        return RootAttributes.model_validate(found)
    except ValidationError as error:
        raise RunFolderError(f"{path}: is no dataset of rigidsim (attribute {first_of(error)})") from None
