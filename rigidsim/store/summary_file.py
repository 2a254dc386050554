"""``summary.json`` read with distrust: its shape is checked before anything is printed from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictInt, StrictStr, ValidationError

from rigidsim.errors import RunFolderError

_LARGEST_FILE = 16_000_000  # bytes; a summary has some kilobytes
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Text = Annotated[StrictStr, Field(max_length=20_000)]


class _Shape(BaseModel):
    """Fields that are read somewhere; others may stand beside them."""

    model_config = ConfigDict(extra="allow")


class _Seconds(_Shape):
    __pydantic_extra__: dict[str, Number] = Field(init=False)
    engine: Number


class _Cost(_Shape):
    steps: StrictInt
    seconds: _Seconds
    cpu_seconds: Number
    cpu_by_phase: dict[Text, Number] = Field(default_factory=dict)


class _Invariant(_Shape):
    initial: Number | list[Number] | None
    largest_drift: Number | None
    final_drift: Number | None
    put_back: Number | None = None
    bound: Number
    scale_name: Text


class _Accuracy(_Shape):
    estimated_attitude_error: Number | None
    amplification: Number | None = 1.0
    requested: Number | None = None
    certified: Number | None = None
    how: Text = ""
    times_compared: StrictInt = 0
    chosen: Text = ""
    chosen_why: Text = ""


class _Lyapunov(_Shape):
    chaotic: StrictBool
    largest_exponent: Number
    moved_over_second_half: Number


class _Brief(_Shape):
    """Of a run that is under way."""

    status: Annotated[StrictStr, Field(pattern=r"^[a-z_: -]{1,40}$")]
    message: Text = ""
    name: Text = ""
    description: StrictStr = ""
    exit_code: StrictInt = 0
    dataset_sha256: Annotated[StrictStr, Field(pattern=r"^[0-9a-f]{64}$")] | None = None
    timeline_sha256: Annotated[StrictStr, Field(pattern=r"^[0-9a-f]{64}$")] | None = None


class _Full(_Brief):
    """Of a run that ended."""

    cost: _Cost
    formulation: Text
    states: list[Text]
    precision: Text
    tolerance: Number
    samples: StrictInt
    samples_planned: StrictInt
    method: Text = "taylor"
    hold_invariants: StrictBool = False
    invariants: dict[Text, _Invariant]
    accuracy: _Accuracy
    warnings: list[Text]
    events: dict[Text, StrictInt] = Field(default_factory=dict)
    lyapunov: _Lyapunov | None = None


def read_summary(path: Path) -> dict[str, Any]:
    """The content of a ``summary.json``.

    Raises:
        RunFolderError: it can't be read, or isn't what a run writes; the text names the first thing wrong.
    """
    try:
        size = path.stat().st_size
        if path.is_symlink() or size > _LARGEST_FILE:
            raise ValueError("a symbolic link" if path.is_symlink() else f"{size} bytes long")
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ValueError("no JSON object")
        (_Full if "cost" in content else _Brief).model_validate(content)
        return {key: _visible(value) for key, value in content.items()}
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(step)[:40] for step in first["loc"])
        raise RunFolderError(
            f"{path}: is damaged or no summary of rigidsim ({where!a}: {first['msg']})"
        ) from None
    except RecursionError:
        raise RunFolderError(f"{path}: is damaged or no summary of rigidsim (nested too deeply)") from None
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{path}: is damaged or no summary of rigidsim ({str(error)[:200]})") from None


def _visible(value: Any) -> Any:
    """Without characters that a terminal would obey."""
    if isinstance(value, str):
        return "".join(
            c if c in "\n\t" or c.isprintable() or ord(c) > 0xA0 else ascii(c)[1:-1] for c in value
        )
    if isinstance(value, list):
        return [_visible(item) for item in value]
    if isinstance(value, dict):
        return {str(_visible(key)): _visible(item) for key, item in value.items()}
    return value
