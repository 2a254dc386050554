"""Results of an analysis, as typed values and as a Dataset."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mpmath
import numpy as np
import xarray
from numpy.typing import NDArray

from rigidsim.analysis.labels import Known, Label
from rigidsim.scene.parts_of_values import part_name

TURN = 2 * np.pi


@dataclass(frozen=True)
class SpectralLine:
    """One line: A cos(w t + phase) in a real signal, A exp(i (w t + phase)) in a complex one.

    Attributes:
        frequency: w, rad/s (mpf with the digits of the samples), unfolded if ``label.folds`` says so.
        observed: frequency before unfolding.
        frequency_error: one standard deviation, from the residual next to the line.
        amplitude: A, in the signal's unit; mpf.
        phase: at time zero of the scene, rad within +-pi; mpf.
        phase_error: error of the phase in the middle of the samples, rad.
        label, mismatch: its label, and the distance from the labelled frequency, rad/s.
        faster: whether motions beyond Nyquist's frequency are in the scene, or can't be ruled out.
    """

    frequency: Any
    observed: Any
    frequency_error: float
    amplitude: Any
    amplitude_error: float
    phase: Any
    phase_error: float
    label: Label
    mismatch: float
    faster: bool = False

    @property
    def period(self) -> float:
        """Period in s, positive; infinite for a constant."""
        return float(TURN / abs(self.frequency)) if self.frequency else float("inf")

    @property
    def can_be_alias(self) -> bool:
        """Whether it may stand for a motion beyond Nyquist's frequency: nothing known explains the line, and
        something is, or may be, as fast.
        """
        return self.faster and not self.label.text

    @property
    def unfolded(self) -> bool:
        """Whether the frequency lies beyond Nyquist's."""
        return self.label.folds != 0

    @property
    def ambiguous(self) -> bool:
        """Whether several combinations fit the line."""
        return bool(self.label.doubtful)


@dataclass(frozen=True)
class SignalAnalysis:
    """One signal: a secular part and lines, the largest first.

    Attributes:
        value, rate: secular part in the middle of the samples, and its rate per s; None without one.
        order, spectrum: order of the Hann window; frequencies (rad/s) and sizes, for a picture.
        left, level: rms of the remainder; amplitude below which lines aren't seen.
        close: frequencies (rad/s) where something is left that is too close to a line to be separated.
        exhausted: whether there are more lines than were asked for.
    """

    name: str
    units: str
    real: bool
    value: Any
    value_error: float
    rate: Any
    rate_error: float
    lines: tuple[SpectralLine, ...]
    order: int
    bits: int
    left: float
    level: float
    close: tuple[float, ...]
    exhausted: bool
    notes: tuple[str, ...]
    spectrum: tuple[NDArray[np.float64], NDArray[np.float64]] = field(repr=False)


@dataclass(frozen=True)
class Analysis:
    """All signals that were analysed; start, spacing and length of the samples, s; the known frequencies, in
    the order of multipliers; the run's attitude error at its end, rad, if known.
    """

    signals: tuple[SignalAnalysis, ...]
    known: tuple[Known, ...]
    start: float
    spacing: float
    length: float
    attitude_error: float | None
    title: str

    def __getitem__(self, name: str) -> SignalAnalysis:
        """The analysis of a signal by its name, or by the name of a variable with just one signal."""
        found = [s for s in self.signals if name in (s.name, s.name.split(".")[0])]
        if len(found) != 1:
            raise KeyError(f"{name!r}; there are {', '.join(s.name for s in self.signals)}")
        return found[0]

    def __repr__(self) -> str:
        counts = ", ".join(f"{s.name}: {len(s.lines)} lines" for s in self.signals)
        return f"<Analysis of {self.title or 'a dataset'}: {counts}>"

    @property
    def nyquist(self) -> float:
        """Nyquist's angular frequency, rad/s."""
        return float(np.pi / self.spacing)

    @property
    def rounding(self) -> float | None:
        """Error of frequencies from the run's own error, rad/s: a phase that is wrong by it at the end."""
        return None if self.attitude_error is None else self.attitude_error / self.length

    @property
    def dataset(self) -> xarray.Dataset:
        """Everything, with dimensions ``signal``, ``line`` and ``known``; frequencies beyond double precision
        have residuals ``_lo``, ``_lo2``, as runs have them.
        """
        return _dataset(self)

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
        return {
            "title": self.title,
            "start_seconds": self.start,
            "spacing_seconds": self.spacing,
            "length_seconds": self.length,
            "nyquist_rad_per_s": self.nyquist,
            "attitude_error_rad": self.attitude_error,
            "rounding_rad_per_s": self.rounding,
            "known": [
                {
                    "name": k.name,
                    "rad_per_s": float(k.value),
                    "digits": digits(k.value, 113),
                    "source": k.source,
                }
                for k in self.known
            ],
            "signals": [_signal_dict(s, self.known) for s in self.signals],
        }


def digits(value: Any, bits: int) -> str:
    """A number with as many digits as a precision has."""
    return str(mpmath.nstr(mpmath.mpf(value), max(int(bits * 0.30103), 17)))


def _signal_dict(signal: SignalAnalysis, known: Sequence[Known]) -> dict[str, Any]:
    secular: dict[str, Any] | None = None
    if signal.value is not None:  # complex signals have lines alone
        secular = {"value": _number(signal.value), "value_error": signal.value_error}
        if signal.rate is not None:
            secular |= {"rate_per_s": _number(signal.rate), "rate_error_per_s": signal.rate_error}
    return {
        "name": signal.name,
        "units": signal.units,
        "real": signal.real,
        "secular": secular,
        "window_order": signal.order,
        "left_rms": signal.left,
        "noise_level": signal.level,
        "more_lines": signal.exhausted,
        "unresolved_rad_per_s": list(signal.close),
        "notes": list(signal.notes),
        "lines": [
            {
                "frequency_rad_per_s": float(line.frequency),
                "frequency_digits": digits(line.frequency, signal.bits),
                "frequency_error_rad_per_s": line.frequency_error,
                "observed_rad_per_s": float(line.observed),
                "period_seconds": line.period if line.frequency else None,
                "amplitude": float(line.amplitude),
                "amplitude_error": line.amplitude_error,
                "phase_rad": float(line.phase),
                "phase_error_rad": line.phase_error if math.isfinite(line.phase_error) else None,
                "label": line.label.text,
                "multipliers": {
                    k.name: m for k, m in zip(known, line.label.multipliers or (), strict=False) if m
                },
                "unfolded": line.unfolded,
                "can_be_alias": line.can_be_alias,
                "ambiguous_with": list(line.label.doubtful),
                "mismatch_rad_per_s": None if math.isnan(line.mismatch) else line.mismatch,
                "null_because": _null_because(line),
            }
            for line in signal.lines
        ],
    }


def _null_because(line: SpectralLine) -> dict[str, str]:
    """Why numbers of a line are null, by their keys."""
    unseen = "samples don't show the phase of a line at Nyquist's frequency"
    no_label = "no combination of known frequencies fits the line: it has no label"
    reasons = (
        ("phase_error_rad", unseen, not math.isfinite(line.phase_error)),
        ("mismatch_rad_per_s", no_label, math.isnan(line.mismatch)),
        ("period_seconds", "the frequency is zero", not line.frequency),
    )
    return {key: why for key, why, holds in reasons if holds}


def _number(value: Any) -> Any:
    value = complex(value)
    return value.real if value.imag == 0 else [value.real, value.imag]


_NUMBER, _WORDS, _FLAG = (np.float64, np.nan), (object, ""), (np.int8, 0)  # type, and what pads a table
_OF_LINES = (
    ("frequency", "frequency", "rad s-1", "angular frequency", _NUMBER),
    ("frequency_error", "frequency_error", "rad s-1", "one standard deviation of the frequency", _NUMBER),
    ("observed_frequency", "observed", "rad s-1", "frequency before it was unfolded", _NUMBER),
    ("amplitude", "amplitude", "", "amplitude, in the signal's unit", _NUMBER),
    ("amplitude_error", "amplitude_error", "", "one standard deviation of the amplitude", _NUMBER),
    ("phase", "phase", "rad", "phase at time zero", _NUMBER),
    ("phase_error", "phase_error", "rad", "one standard deviation of the phase at mid-span", _NUMBER),
    ("mismatch", "mismatch", "rad s-1", "frequency less the frequency of its label", _NUMBER),
    ("label", "label.text", "", "combination of known frequencies", _WORDS),
    ("unfolded", "unfolded", "1", "1 where the frequency lies beyond Nyquist's", _FLAG),
    ("can_be_alias", "can_be_alias", "1", "1 where a line can be an alias of a faster motion", _FLAG),
    ("ambiguous", "ambiguous", "1", "1 where several combinations fit", _FLAG),
)
"""Variables by signal and line: name, attribute, unit, words, kind."""
_OF_SIGNALS = (
    ("signal_units", "units", "", "unit of the signal", object),
    ("real", "real", "1", "1 of a real signal", np.int8),
    ("secular_value", "value.real", "", "secular part at mid-span", np.float64),
    ("secular_rate", "rate.real", "", "rate of the secular part, per s", np.float64),
    ("secular_rate_error", "rate_error", "", "one standard deviation of the rate, per s", np.float64),
    ("left", "left", "", "rms of the residual without lines and secular part", np.float64),
    ("noise_level", "level", "", "amplitude below which lines aren't seen", np.float64),
    ("window_order", "order", "1", "order of the Hann window", np.int64),
)


def _attribute(of: Any, path: str) -> Any:
    """A value by the names that lead to it; nan where one of them is None."""
    for name in path.split("."):
        of = None if of is None else getattr(of, name)
    return np.nan if of is None else of


def _remainder(value: Any, part: int) -> float:
    return float(value) if part == 0 else _remainder(value - float(value), part - 1)


def _dataset(analysis: Analysis) -> xarray.Dataset:
    signals, known = analysis.signals, analysis.known
    longest = max((len(s.lines) for s in signals), default=0)
    data: dict[str, tuple[Any, ...]] = {}

    def put(name: str, rows: list[list[Any]], kind: tuple[Any, Any], attrs: dict[str, str]) -> None:
        padded = [row + [kind[1]] * (longest - len(row)) for row in rows]
        table = np.array(padded, dtype=kind[0]).reshape(len(signals), longest)
        data[name] = (("signal", "line"), table, attrs)

    for name, path, units, words, kind in _OF_LINES:
        rows = [[_attribute(line, path) for line in s.lines] for s in signals]
        put(name, rows, kind, {"units": units, "long_name": words})
    for part in range(1, 1 if all(s.bits <= 53 for s in signals) else 3):
        rows = [[_remainder(line.frequency, part) for line in s.lines] for s in signals]
        attrs = {"units": "rad s-1", "long_name": "angular frequency", "residual_of": "frequency"}
        put(part_name("frequency", part), rows, _NUMBER, attrs)
    for name, path, units, words, dtype in _OF_SIGNALS:
        values = np.array([_attribute(s, path) for s in signals], dtype=dtype)
        data[name] = (("signal",), values, {"units": units, "long_name": words})
    multipliers = np.zeros((len(signals), longest, len(known)), dtype=np.int64)
    curves = np.full((2, len(signals), max((len(s.spectrum[0]) for s in signals), default=0)), np.nan)
    for row, signal in enumerate(signals):
        for column, line in enumerate(signal.lines):
            multipliers[row, column] = line.label.multipliers or 0
        curves[:, row, : len(signal.spectrum[0])] = signal.spectrum
    rad_s, made = {"units": "rad s-1"}, {"long_name": "what labels are made of"}
    along = ("signal", "spectrum")
    data |= {
        "multipliers": (
            ("signal", "line", "known"), multipliers, {"units": "1", "long_name": "of known frequencies"}
        ),
        "known_frequency": (("known",), [float(k.value) for k in known], rad_s | made),
        "known_source": (("known",), np.array([k.source for k in known], dtype=object), {"units": ""}),
        "spectrum_frequency": (along, curves[0], rad_s),
        "spectrum_amplitude": (along, curves[1], {"long_name": "windowed amplitude"}),
    }  # fmt: skip
    attributes = {
        "title": analysis.title,
        "source": "rigidsim analyse",
        "sample_spacing": analysis.spacing,
        "length": analysis.length,
        "start": analysis.start,
        "nyquist_frequency": analysis.nyquist,
        "notes": json.dumps({s.name: list(s.notes) for s in signals}),
    }
    if analysis.attitude_error is not None:
        attributes["attitude_error"] = analysis.attitude_error
    coords = {
        "signal": np.array([s.name for s in signals], dtype=object),
        "known": np.array([k.name for k in known], dtype=object),
        "line": np.arange(1, longest + 1),
    }
    return xarray.Dataset(data, coords=coords, attrs=attributes)
