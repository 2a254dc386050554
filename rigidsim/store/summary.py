"""Contents of ``summary.json``: one definition by which it is written, read with distrust, and shown.

A field that isn't given isn't written.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, StrictBool, StrictInt, StrictStr, ValidationError

from rigidsim.errors import RunFolderError, run_again
from rigidsim.scene.cautions import Caution
from rigidsim.scene.choices import DEFAULT_METHOD
from rigidsim.store.summary_parts import (
    Accuracy,
    Advice,
    BitForBit,
    ChartChanges,
    Claim,
    Cost,
    Digest,
    EventTimes,
    FiniteNumber,
    Four,
    InvariantDrift,
    Lyapunov,
    Modelling,
    SummaryPart,
    TableErrors,
    Text,
    Three,
    first_of,
)

_LARGEST_FILE = 16_000_000  # bytes; a summary has some kilobytes


class UnderstoodBody(SummaryPart):
    """Where the inertia came from; principal moments (kg m^2) and axes (rows, body axes), mass (kg), and the
    centre of mass from the point that the body turns about (body axes, m).
    """

    source: Text
    principal_moments: tuple[FiniteNumber, ...]
    principal_axes: tuple[tuple[FiniteNumber, ...], ...]
    mass: FiniteNumber | None
    center_of_mass: Three | None = None


class FoundStart(SummaryPart):
    """An equilibrium that a motion starts from.

    Attributes:
        name: as in the config.
        described: which one it is, and where.
        how: how it was found, and to what order it is one.
        exponents: eigenvalues of the linearised equations about it, 1/s, as (real, imaginary) with the
            imaginary part positive or zero, the slowest first.
        stable: whether none of them grows.
    """

    name: Text
    described: Text
    how: Text
    exponents: tuple[tuple[FiniteNumber, FiniteNumber], ...]
    stable: StrictBool


class Start(SummaryPart):
    """The state that a motion starts from.

    Attributes:
        equilibrium: as it was found; None for a start that was given.
        quaternion: w x y z, body to space.
        angular_velocity: body axes, rad/s.
        position, velocity: of the centre of mass, space axes, m and m/s; None unless it moves freely.
    """

    euler_sequence: Text
    euler_angles_deg: Three
    quaternion: Four
    angular_velocity: Three
    position: Three | None = None
    velocity: Three | None = None
    equilibrium: FoundStart | None = None


class Span(SummaryPart):
    """Start and end of a motion, and its samples.

    Attributes:
        every_s: sampling interval; None if the times are listed.
        epoch: date of time 0; empty if unknown.
        unit: unit of times in the config; empty if it names none.
    """

    start_s: FiniteNumber
    end_s: FiniteNumber
    samples: StrictInt
    every_s: FiniteNumber | None
    epoch: Text = ""
    unit: Text = ""


class Brief(SummaryPart):
    """Fields that every summary has; a run that is under way or was killed has no others."""

    name: Annotated[Text, Claim()] = ""
    description: Annotated[StrictStr, Claim()] = ""
    status: Annotated[StrictStr, Field(pattern=r"^[a-z_: -]{1,40}$"), Claim(of_end=True)]
    message: Annotated[Text, Claim(of_end=True)] = ""
    exit_code: Annotated[StrictInt, Claim(of_end=True)] = 0

    @property
    def dataset_digest(self) -> str | None:
        """SHA-256 of the complete dataset; None if there is none yet."""
        return None


class Summary(Brief):
    """Summary of a run that ended.

    Attributes:
        warnings, warning_codes: texts, and a ``WarningCode`` for each.
        time_reached: time of the last sample, or of the event that ended the run, s.
        engine_time: time that the integration reached, s; its own steps go past the last sample.
        unwatched: invariants of the scene that weren't monitored, and why.
        loads: what acts on the body, in a reader's terms.
        advice: settings that would do better at about the same cost, the best last.
        undefined_samples: number of NaN samples of each recorded variable that has any.
        dataset_sha256, timeline_sha256: SHA-256 of the files, once there are any.
    """

    warnings: tuple[Text, ...]
    warning_codes: tuple[Text, ...] = ()
    samples: Annotated[StrictInt, Claim()]
    samples_planned: Annotated[StrictInt, Claim()]
    time_reached: Annotated[FiniteNumber, Claim()]
    engine_time: Annotated[FiniteNumber | None, Claim()] = None
    formulation: Annotated[Text, Claim()]
    states: Annotated[tuple[Text, ...], Claim()]
    precision: Annotated[Text, Claim()]
    tolerance: Annotated[FiniteNumber, Claim()]
    cost: Cost
    method: Annotated[Text, Claim()] = DEFAULT_METHOD
    hold_invariants: Annotated[StrictBool, Claim()] = False
    hold_from_step: Annotated[StrictInt | None, Claim()] = None
    invariants: dict[Text, InvariantDrift]
    unwatched: dict[Text, Text] = Field(default_factory=dict)
    accuracy: Accuracy
    modelling: Modelling | None = None
    tables: dict[Text, TableErrors] = Field(default_factory=dict)
    lyapunov: Lyapunov | None = None
    body: Annotated[UnderstoodBody, Claim()]
    start: Annotated[Start | None, Claim()] = None
    time: Annotated[Span | None, Claim()] = None
    loads: tuple[Text, ...] = ()
    bit_for_bit: BitForBit
    provenance: dict[Text, StrictStr | StrictInt]
    events: Annotated[dict[Text, StrictInt], Claim()] = Field(default_factory=dict)
    event_times: dict[Text, EventTimes] = Field(default_factory=dict)
    chart_changes: Annotated[ChartChanges | None, Claim()] = None
    advice: tuple[Advice, ...] = ()
    undefined_samples: Annotated[dict[Text, StrictInt], Claim()] = Field(default_factory=dict)
    dataset_sha256: Digest | None = None
    timeline_sha256: Digest | None = None

    @property
    def held(self) -> bool:
        """Whether invariants were projected, possibly only after a number of steps that the run did reach."""
        return self.hold_invariants and self.cost.steps > (self.hold_from_step or 0)

    @property
    def dataset_digest(self) -> str | None:
        """SHA-256 of the complete dataset; None if there is none yet."""
        return self.dataset_sha256

    @property
    def cautions(self) -> list[Caution]:
        """The warnings with their codes."""
        return [Caution(code, text) for code, text in zip(self.warning_codes, self.warnings, strict=True)]

    def warned(self, cautions: Iterable[Caution]) -> Self:
        """A copy with these warnings in place of its own."""
        return self.having(**as_fields(cautions))


def as_fields(cautions: Iterable[Caution]) -> dict[str, Any]:
    """The two fields of a summary that hold the warnings and their codes."""
    kept = list(cautions)
    return {
        "warnings": tuple(caution.text for caution in kept),
        "warning_codes": tuple(str(caution.code) for caution in kept),
    }


def read_summary(path: Path) -> Brief:
    """Read a ``summary.json``; a ``Summary`` if the run ended."""
    try:
        size = path.stat().st_size
        if path.is_symlink() or size > _LARGEST_FILE:
            raise ValueError("a symbolic link" if path.is_symlink() else f"{size} bytes long")
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ValueError("no JSON object")
        return (Summary if "cost" in content else Brief).model_validate(_visible(content))
    except (OSError, ValueError, RecursionError) as error:
        why = first_of(error) if isinstance(error, ValidationError) else str(error)[:200]
        raise RunFolderError(
            f"{path}: is damaged or no summary of rigidsim ({why}); {run_again(path.parent)}"
        ) from None


def _visible(value: Any) -> Any:
    """The value without characters that a terminal would obey."""
    if isinstance(value, str):
        return "".join(
            c if c in "\n\t" or c.isprintable() or ord(c) > 0xA0 else ascii(c)[1:-1] for c in value
        )
    if isinstance(value, list):
        return [_visible(item) for item in value]
    if isinstance(value, dict):
        return {str(_visible(key)): _visible(item) for key, item in value.items()}
    return value
