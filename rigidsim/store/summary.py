"""Contents of ``summary.json``: one definition by which it is written, read with distrust, and shown.

A field that isn't given isn't written.
"""

import json
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationError,
    field_validator,
)

from rigidsim.errors import RunFolderError, run_again
from rigidsim.scene.cautions import Caution
from rigidsim.scene.choices import DEFAULT_METHOD

FiniteNumber = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Text = Annotated[StrictStr, Field(max_length=20_000)]
Three = tuple[FiniteNumber, FiniteNumber, FiniteNumber]
Four = tuple[FiniteNumber, FiniteNumber, FiniteNumber, FiniteNumber]


class SummaryPart(BaseModel):
    """Immutable part of a summary; unknown fields, written by a newer version, are kept."""

    model_config = ConfigDict(extra="allow", frozen=True, ser_json_inf_nan="constants", defer_build=True)

    def having(self, **known: Any) -> Self:
        """A copy with the given fields set, validated as on reading."""
        given = {name: value for name, value in self if name in self.model_fields_set}
        return type(self).model_validate({**given, **known})

    def as_dict(self) -> dict[str, Any]:
        """Fields for JSON, without those that weren't given."""
        return self.model_dump(mode="json", exclude_unset=True)


def first_of(error: ValidationError) -> str:
    """The first thing that is wrong, and where."""
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(str(step)[:40] for step in first['loc'])!a}: {first['msg']}"


ENGINE = "engine"
"""Key next to the phases in ``Cost.seconds``: the engine's share of integrating and recording."""


class UnmeasuredCode(Enum):
    """Why the error of an averaged model isn't known; ``value`` stands in summaries."""

    NOT_ASKED = "not_asked"
    NOT_ENDED = "not_ended"
    INTERRUPTED = "interrupted"
    FULL_REFUSED = "full_refused"
    FULL_STOPPED = "full_stopped"
    AVERAGED_REFUSED = "averaged_refused"
    AVERAGED_STOPPED = "averaged_stopped"


class AdviceCode(Enum):
    """Which setting would do better nearly free; ``value`` stands in summaries; a method's is its name."""

    HOLD_INVARIANTS = "hold_invariants"
    CLOSED_FORM = "closed_form"
    AVERAGED = "averaged"


Digest = Annotated[StrictStr, Field(pattern=r"^[0-9a-f]{64}$")]


class Cost(SummaryPart):
    """What a run cost: CPU and wall seconds of all sessions, and of this one by phase.

    Attributes:
        smallest_step, largest_step: seconds; None if no step was taken, or none was finite.
    """

    steps: StrictInt
    steps_redone: StrictInt
    smallest_step: FiniteNumber | None
    largest_step: FiniteNumber | None
    seconds: dict[Text, FiniteNumber]
    cpu_seconds: FiniteNumber
    cpu_by_phase: dict[Text, FiniteNumber] = Field(default_factory=dict)
    sessions: StrictInt = 1
    wall_seconds: FiniteNumber | None = None

    @field_validator("seconds")
    @classmethod
    def _has_engine(cls, seconds: dict[str, float]) -> dict[str, float]:
        if ENGINE not in seconds:
            raise ValueError(f'"{ENGINE}" is missing')
        return seconds


class InvariantDrift(SummaryPart):
    """How well an invariant was kept.

    Attributes:
        scale: size that drifts are relative to, in ``units``.
        largest_drift, final_drift: relative drifts; None without samples, or if one isn't finite.
        bound: relative drift that rounding alone explains.
        put_back: for a projected invariant, the drift that would have been.
    """

    initial: FiniteNumber | tuple[FiniteNumber, ...] | None
    units: Text
    scale: FiniteNumber
    scale_name: Text
    largest_drift: FiniteNumber | None
    final_drift: FiniteNumber | None
    bound: FiniteNumber
    put_back: FiniteNumber | None = None
    why: Text
    numerical: StrictBool


class Accuracy(SummaryPart):
    """Attitude error at the end, rad: requested, estimated, and certified against a reference.

    Attributes:
        estimated_position_error, estimated_velocity_error: at the end, m and m/s.
        amplification: factor by which the motion amplifies rounding errors; None if not estimated.
        error_growth_rate: 1/s; 0 where errors don't grow exponentially.
        predictable_seconds: time from the start after which no digit is left; None if never.
        examined_share: share of the run over which error growth was followed without a gap from its start; 1
            for all of it.
    """

    requested: FiniteNumber | None
    requested_position: FiniteNumber | None = None
    certified_position: FiniteNumber | None = None
    estimated_attitude_error: FiniteNumber | None
    estimated_position_error: FiniteNumber | None = None
    estimated_velocity_error: FiniteNumber | None = None
    estimated_how: Text
    amplification: FiniteNumber | None = 1.0
    error_growth_rate: FiniteNumber | None = None
    predictable_seconds: FiniteNumber | None = None
    amplification_seconds: FiniteNumber | None = None
    examined_share: FiniteNumber | None = None
    amplification_how: Text = ""
    certified: FiniteNumber | None
    how: Text
    difference_at_end: FiniteNumber | None = None
    times_compared: StrictInt = 0
    chosen: Text = ""
    chosen_why: Text = ""
    forecast: FiniteNumber | None = None


class TableErrors(SummaryPart):
    """Interpolation errors between the rows of an orbit's table.

    Attributes:
        direction, distance: largest errors with every other row left out, rad and relative.
        expected: factor by which both shrink with all rows present, if the rows follow smooth functions.
    """

    direction: FiniteNumber
    distance: FiniteNumber
    expected: FiniteNumber


class ModellingWindow(SummaryPart):
    """A window in which the full model ran with a reduced one; see ``rigidsim.accuracy.modelling``.

    Attributes:
        momentum_axis, figure_axis: largest distances between both models' directions, with what averaging
            removed added back, rad; None if the figure axis has no mean direction.
        growth_along, growth_across, doubt: growth of the former along and across the precession, and its
            difference between the window's parts, rad/s.
    """

    start: FiniteNumber
    end: FiniteNumber
    steps: StrictInt
    momentum_axis: FiniteNumber
    figure_axis: FiniteNumber | None
    growth_along: FiniteNumber
    growth_across: FiniteNumber
    doubt: FiniteNumber


class Modelling(SummaryPart):
    """Error of a reduced model against the full one, apart from numerical errors.

    Attributes:
        short_period: whether what averaging removed is added back in what is recorded.
        resonance: spin-orbit resonance whose angle is kept, such as "3:2"; empty for none.
        momentum_axis, figure_axis: largest distances of the directions recorded from the full model's, until
            the end of the run, rad; None if not measured, or if the figure axis has no mean direction.
        angular_momentum_norm, energy: largest errors of the momentum's size and the energy of rotation,
            relative to their values; None where averaging keeps them.
        growth, oscillation: secular growth of the distance, rad/s, and its oscillating part, rad.
        requested: largest error that was asked for, rad.
        unmeasured: an ``UnmeasuredCode``, why it wasn't found; empty where it was.
    """

    level: Text
    short_period: StrictBool
    resonance: Text = ""
    momentum_axis: FiniteNumber | None = None
    figure_axis: FiniteNumber | None = None
    angular_momentum_norm: FiniteNumber | None = None
    energy: FiniteNumber | None = None
    growth: FiniteNumber | None = None
    oscillation: FiniteNumber | None = None
    whole: StrictBool = False
    requested: FiniteNumber | None = None
    how: Text = ""
    unmeasured: Text = ""
    cpu_seconds: FiniteNumber | None = None
    windows: tuple[ModellingWindow, ...] = ()

    @property
    def worst(self) -> float | None:
        """The larger of both directions' errors, rad; None if not measured."""
        known = [x for x in (self.momentum_axis, self.figure_axis) if x is not None]
        return max(known, default=None)


class Lyapunov(SummaryPart):
    """The motion's Lyapunov spectrum, 1/s, and what it implies for the run's digits."""

    chaotic: StrictBool
    largest_exponent: FiniteNumber
    moved_over_second_half: FiniteNumber
    e_folding_seconds: FiniteNumber | None = None
    predictable_seconds: FiniteNumber | None = None
    exponents: tuple[FiniteNumber, ...] = ()
    states: tuple[Text, ...] = ()
    units: Text = "s-1"


class EventTimes(SummaryPart):
    """Times at which an event happened, s: the first, at most ``EARLY`` of the first ones, and the last."""

    EARLY: ClassVar[int] = 5
    first: FiniteNumber
    last: FiniteNumber
    early: tuple[FiniteNumber, ...] = ()


class Advice(SummaryPart):
    """A setting that would do better.

    Attributes:
        now, then: attitude error at the end (of an averaged model, error of the recorded axes) as it is, and
            as it would be, rad.
        share: largest share of the steps that it would take; None if unchanged.
    """

    code: Text
    now: FiniteNumber
    then: FiniteNumber
    level: Text = ""
    share: FiniteNumber | None = None


class ChartChanges(SummaryPart):
    """How often a run in Euler angles changed from its sequence to the partner or back."""

    count: StrictInt
    sequence: Text
    partner: Text


class BitForBit(SummaryPart):
    """Whether repeating the run gives the same bits, and on what condition."""

    claim: StrictBool
    holds_for: StrictStr


_LARGEST_FILE = 16_000_000  # bytes; a summary has some kilobytes


class UnderstoodBody(SummaryPart):
    """Where the inertia came from; principal moments (kg m^2) and axes (rows, body axes), mass (kg), and the
    centre of mass from the point that the body turns about (body axes, m), which is at ``reference`` in the
    coordinates that describe its pieces.
    """

    source: Text
    principal_moments: tuple[FiniteNumber, ...]
    principal_axes: tuple[tuple[FiniteNumber, ...], ...]
    mass: FiniteNumber | None
    center_of_mass: Three | None = None
    reference: Three | None = None


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
        relative_to: local frame that it was given against, if any, with the angles there.
    """

    euler_sequence: Text
    euler_angles_deg: Three
    quaternion: Four
    angular_velocity: Three
    position: Three | None = None
    velocity: Three | None = None
    equilibrium: FoundStart | None = None
    relative_to: Text | None = None
    relative_euler_angles_deg: Three | None = None


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

    name: Text = ""
    description: StrictStr = ""
    status: Annotated[StrictStr, Field(pattern=r"^[a-z_: -]{1,40}$")]
    message: Text = ""
    exit_code: StrictInt = 0

    @property
    def dataset_digest(self) -> str | None:
        """SHA-256 of the complete dataset; None if there is none yet."""
        return None


class Understood(SummaryPart):
    """How a config was understood, and what in it is suspicious.

    Attributes:
        body, start, time: None where the config can't be run, or an older version didn't say.
        loads: what acts on the body, in a reader's terms.
        warnings, warning_codes: texts, and a ``WarningCode`` for each.
    """

    body: UnderstoodBody | None = None
    start: Start | None = None
    time: Span | None = None
    loads: tuple[Text, ...] = ()
    warnings: tuple[Text, ...] = ()
    warning_codes: tuple[Text, ...] = ()


class Summary(Brief, Understood):
    """Summary of a run that ended.

    Attributes:
        time_reached: time of the last sample, or of the event that ended the run, s.
        engine_time: time that the integration reached, s; its own steps go past the last sample.
        unwatched: invariants of the scene that weren't monitored, and why.
        advice: settings that would do better at about the same cost, the best last.
        tides: the tidal model, and what the other one would change.
        undefined_samples: number of NaN samples of each recorded variable that has any.
        dataset_sha256, timeline_sha256: SHA-256 of the files, once there are any.
    """

    samples: StrictInt
    samples_planned: StrictInt
    time_reached: FiniteNumber
    engine_time: FiniteNumber | None = None
    formulation: Text
    states: tuple[Text, ...]
    precision: Text
    tolerance: FiniteNumber
    cost: Cost
    method: Text = DEFAULT_METHOD
    hold_invariants: StrictBool = False
    hold_from_step: StrictInt | None = None
    invariants: dict[Text, InvariantDrift]
    unwatched: dict[Text, Text] = Field(default_factory=dict)
    accuracy: Accuracy
    modelling: Modelling | None = None
    tables: dict[Text, TableErrors] = Field(default_factory=dict)
    tides: Text | None = None
    lyapunov: Lyapunov | None = None
    bit_for_bit: BitForBit
    provenance: dict[Text, StrictStr | StrictInt]
    events: dict[Text, StrictInt] = Field(default_factory=dict)
    event_times: dict[Text, EventTimes] = Field(default_factory=dict)
    chart_changes: ChartChanges | None = None
    advice: tuple[Advice, ...] = ()
    undefined_samples: dict[Text, StrictInt] = Field(default_factory=dict)
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
        """A copy with these warnings in place of the old ones."""
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
