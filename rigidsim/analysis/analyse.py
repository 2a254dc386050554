"""Decomposition of a dataset's signals into secular rates and labelled lines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray

from rigidsim.analysis.decomposition import Decomposition, amplitude_spectrum, at_nyquist, decompose
from rigidsim.analysis.labels import Known, label, reversed_label, settled
from rigidsim.analysis.result import Analysis, SignalAnalysis, SpectralLine
from rigidsim.analysis.signals import EquidistantTimes, Signal, clock_of, signals_of
from rigidsim.errors import RigidsimError
from rigidsim.scene.parts_of_values import in_time_order

SPECTRUM_POINTS = 4000
_BLEND = 0.05  # bins by which a line can be off that has absorbed closer ones
_SECULAR = "node_longitude.figure"


@dataclass(frozen=True)
class _Raw:
    """A signal before its lines are labelled, with frequencies in rad/s."""

    signal: Signal
    found: Decomposition
    frequencies: tuple[Any, ...]
    errors: tuple[float, ...]
    spectrum: tuple[Any, Any]
    bits: int

    def finest(self, line: SpectralLine) -> float:
        """Frequency error of a line as it was found, rad/s."""
        distance = [abs(abs(float(f)) - abs(float(line.observed))) for f in self.frequencies]
        return self.errors[distance.index(min(distance))]

    @property
    def factor(self) -> int:
        """Ratio of a cosine's amplitude to its exponential's: 2 for real signals, otherwise 1."""
        return 2 if self.signal.real else 1


def analyse_dataset(
    dataset: xarray.Dataset,
    variables: Sequence[str] = (),
    *,
    lines: int = 20,
    floor: float = 1e-12,
    known: Sequence[Known] = (),
    order: int | None = None,
    attitude_error: float | None = None,
    fastest: float = 0.0,
) -> Analysis:
    """Secular rates and lines of a dataset's signals; arguments and errors as of
    ``rigidsim.workflows.analyse.analyse``. Residuals ``_lo``, ``_lo2`` are taken into account.

    Args:
        fastest: rate of the fastest motion (rad/s), as of the rotation; by itself, of what is known and of
            rates that were recorded the largest counts.
    """
    if not 1 <= lines <= 500:
        raise RigidsimError(f"given lines = {lines}; 1 to 500 are allowed")
    if not 0 < floor < 1:
        raise RigidsimError(
            f"given floor = {floor:g}; a share of the strongest line, between 0 and 1, is allowed"
        )
    if order is not None and not 1 <= order <= 20:
        raise RigidsimError(f"given a window of order {order}; 1 to 20 are allowed")
    dataset = in_time_order(dataset)
    clock = clock_of(dataset)
    raws = [_raw(signal, clock, lines, floor, order) for signal in signals_of(dataset, variables)]
    sizes = [[raw.factor * abs(complex(a)) for a in raw.found.sum.amplitudes] for raw in raws]
    measured = [
        list(zip(raw.frequencies, raw.errors, size, strict=True))
        for raw, size in zip(raws, sizes, strict=True)
    ]
    fastest = max([fastest, *(abs(float(k.value)) for k in known), _largest_rate(dataset)])
    # twice, since a body of three moments moves at twice its own rate, too
    faster = not fastest or 2 * fastest > clock.nyquist
    names = _with_precession(known, raws, clock)
    in_body = [raw.signal.in_body for raw in raws]
    names = settled([k for k in names if float(k.value) != 0], measured, in_body)
    return Analysis(
        signals=tuple(_named(raw, clock, names, faster) for raw in raws),
        known=tuple(names),
        start=float(clock.start),
        spacing=float(clock.spacing),
        length=float(clock.length),
        attitude_error=attitude_error,
        title=str(dataset.attrs.get("title", "")),
    )


def _raw(signal: Signal, clock: EquidistantTimes, lines: int, floor: float, order: int | None) -> _Raw:
    samples = signal.samples(clock)
    found = decompose(samples, lines, signal.degree, floor, order)
    per_sample = 2 * clock.context.pi / clock.spacing
    finest = 2.0**-clock.bits  # of the spacing
    errors = [
        math.hypot(float(per_sample) * e, finest * abs(float(per_sample * f)))
        for f, e in zip(found.sum.frequencies, found.frequency_errors, strict=True)
    ]
    curve = amplitude_spectrum(samples, found, SPECTRUM_POINTS)
    return _Raw(
        signal,
        found,
        tuple(per_sample * f for f in found.sum.frequencies),
        tuple(errors),
        (curve[0] * float(per_sample), curve[1]),
        samples.bits,
    )


def _with_precession(known: Sequence[Known], raws: Sequence[_Raw], clock: EquidistantTimes) -> list[Known]:
    """The known frequencies with the equinox's, unless known: it moves back with the measured precession.

    Where an axis follows the node of an orbit, its rate is that node's. Of samples that don't span 1.5
    turns of the slowest known frequency no precession is reported: its rate is partly theirs.
    """
    names = list(known)
    if not known or any(k.name == "precession" for k in known) or _slow(known, clock):
        return names
    for raw in raws:
        if raw.signal.name in (_SECULAR, "node_longitude"):
            rate, error = _rate(raw, clock)
            same = any(abs(float(rate - k.value)) <= 5 * math.hypot(error, k.error) for k in known)
            if abs(float(rate)) > 5 * error and not same:
                names.append(Known("precession", rate, 0.0, f"secular rate of {raw.signal.name}", error))
    return names


def _rate(raw: _Raw, clock: EquidistantTimes) -> tuple[Any, float]:
    slope = raw.found.sum.polynomial[1].real
    per_second = 2 / clock.length
    return slope * per_second, raw.found.polynomial_errors[1] * float(per_second)


def _largest_rate(dataset: xarray.Dataset) -> float:
    """Largest size of a recorded angular velocity, rad/s; 0 without one."""
    if "angular_velocity" not in dataset or "time" not in dataset["angular_velocity"].dims:
        return 0.0
    rates = dataset["angular_velocity"].transpose("time", ...).values
    return float(np.nanmax(np.linalg.norm(rates.reshape(len(rates), -1), axis=1), initial=0.0))


def _named(raw: _Raw, clock: EquidistantTimes, known: Sequence[Known], faster: bool) -> SignalAnalysis:
    found, signal = raw.found, raw.signal
    lines = [
        replace(_line(raw, clock, known, n), faster=faster)
        for n in sorted(range(len(raw.frequencies)), key=lambda n: -abs(complex(found.sum.amplitudes[n])))
    ]
    rate, rate_error = _rate(raw, clock) if signal.degree > 0 else (None, math.nan)
    value = found.sum.polynomial[0] if signal.degree >= 0 else None
    per_sample = 2 * math.pi / float(clock.spacing)
    return SignalAnalysis(
        name=signal.name,
        units=signal.units,
        real=signal.real,
        value=value,
        value_error=found.polynomial_errors[0] if signal.degree >= 0 else math.nan,
        rate=rate,
        rate_error=rate_error,
        lines=tuple(lines),
        order=found.order,
        bits=raw.bits,
        left=found.left,
        level=raw.factor * found.level,
        close=tuple(f * per_sample for f in found.close),
        exhausted=found.exhausted,
        notes=tuple(_notes(raw, clock, known, lines)),
        spectrum=raw.spectrum,
    )


def _line(raw: _Raw, clock: EquidistantTimes, known: Sequence[Known], n: int) -> SpectralLine:
    context = clock.context
    observed, error = raw.frequencies[n], raw.errors[n]
    amplitude = raw.found.sum.amplitudes[n]
    real = raw.signal.real
    if real and observed < 0:
        observed, amplitude = -observed, context.conj(amplitude)
    resolution = 2 * math.pi / float(clock.length)
    place = float(observed), error, known, clock.nyquist
    blend, in_body = _BLEND * resolution, raw.signal.in_body
    name = label(*place, real=real, in_body=in_body, blend=blend, resolution=resolution)
    frequency = observed + 2 * name.folds * context.pi / clock.spacing
    phase = context.arg(amplitude) - frequency * clock.middle
    # turning it by whole turns a sample changes nothing at the samples, but at the middle between two it does
    if name.folds and clock.count % 2 == 0:
        phase += context.pi * name.folds
    if real and frequency < 0:
        frequency, phase, name = -frequency, -phase, reversed_label(name, known)
    mismatch = math.nan
    if name.multipliers:
        combined = sum(
            (m * context.mpf(k.value) for m, k in zip(name.multipliers, known, strict=True)), context.zero
        )
        turn = 2 * context.pi / clock.spacing
        off = frequency - combined
        mismatch = float(off - turn * context.nint(off / turn))
        if not name.doubtful:
            error = max(error, abs(mismatch))  # a blend of lines that are too close to be separated
    size = abs(complex(amplitude))
    held = at_nyquist(raw.found.sum, real)[n]
    amplitude_error = raw.found.amplitude_errors[n]
    return SpectralLine(
        frequency=frequency,
        observed=observed,
        frequency_error=error,
        amplitude=raw.factor * abs(amplitude),
        amplitude_error=raw.factor * amplitude_error,
        phase=_wrapped(context, phase),
        phase_error=amplitude_error / size if size and not held else math.inf,
        label=name,
        mismatch=mismatch,
    )


def _wrapped(context: Any, angle: Any) -> Any:
    """The angle within +-pi; pi rather than a -pi caused by rounding."""
    angle = angle - 2 * context.pi * context.nint(angle / (2 * context.pi))
    return -angle if angle + context.pi < 1e-6 else angle


def _slow(known: Sequence[Known], clock: EquidistantTimes) -> list[Known]:
    """Known frequencies of which the samples span less than 1.5 turns."""
    most = 2 * math.pi * 1.5 / float(clock.length)
    return [k for k in known if k.name != "precession" and 0 < abs(float(k.value)) < most]


def _notes(
    raw: _Raw, clock: EquidistantTimes, known: Sequence[Known], lines: Sequence[SpectralLine]
) -> list[str]:
    notes = []
    if raw.found.close:
        notes.append(
            "a residual is closer than a bin to a line or to the secular part: errors include its size, "
            "a longer run separates it"
        )
    slow = _slow(known, clock)
    if slow and raw.signal.degree > 0:
        names = ", ".join(k.name for k in slow)
        notes.append(
            f"the samples span less than 1.5 turns of {names}: the secular rate may contain part of it"
        )
    if any(at_nyquist(raw.found.sum, raw.signal.real)):
        notes.append(
            "a line within a third of a bin of Nyquist's frequency: samples show its amplitude times the "
            "cosine of its phase, and no more; sample more often to separate these"
        )
    unfolded = [line for line in lines if line.unfolded]
    if unfolded:
        notes.append(
            f"{len(unfolded)} frequencies lie beyond Nyquist's, and are unfolded through the known ones"
        )
    blends = [line for line in lines if abs(line.mismatch) >= 10 * raw.finest(line)]
    if blends:
        notes.append(
            f"{len(blends)} lines lie off their labels by more than the residual explains: blends of lines "
            "closer than a bin; their errors are those distances"
        )
    aliases = sum(line.can_be_alias for line in lines)
    if aliases:
        notes.append(
            f"{aliases} lines without a label can be aliases of motions faster than Nyquist's frequency: "
            "sample more often, or at another spacing, to see whether their frequencies stay"
        )
    doubtful = [line for line in lines if line.ambiguous]
    if doubtful:
        notes.append(
            f"{len(doubtful)} lines fit several combinations: they have the observed frequency, "
            "unfolded by none"
        )
    return notes
