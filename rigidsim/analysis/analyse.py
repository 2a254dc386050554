"""Decomposition of a dataset's signals into secular rates and labelled lines."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray

from rigidsim.analysis.decomposition import amplitude_spectrum, at_nyquist, decompose
from rigidsim.analysis.labels import SECULAR, Known, Label, Pairs, label, reversed_label, settled
from rigidsim.analysis.result import Analysis, SignalAnalysis, SpectralLine
from rigidsim.analysis.signals import EquidistantTimes, Signal, clock_of, signals_of
from rigidsim.errors import RigidsimError
from rigidsim.scene.parts_of_values import in_time_order

SPECTRUM_POINTS = 4000
_BLEND = 0.05  # bins by which a line can be off that has absorbed closer ones
_SECULAR = "node_longitude.figure"
_EQUINOX = "precession"
_FIRST_ORDER = 0.03  # of the strongest line: weaker ones may as well be of second order in secular theory


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
    clock, signals = clock_of(dataset), signals_of(dataset, variables)
    found = [_decomposed(signal, clock, lines, floor, order) for signal in signals]
    fastest = max([fastest, *(abs(float(k.value)) for k in known), _largest_rate(dataset)])
    # twice, since a body of three moments moves at twice its own rate, too
    faster = not fastest or 2 * fastest > clock.nyquist
    known = _with_equinox(known, dataset, clock)
    names = [k for k in _with_precession(known, found, clock) if float(k.value) != 0]
    measured = [[(x.frequency, x.frequency_error, float(x.amplitude)) for x in one.lines] for one in found]
    in_body = [signal.in_body for signal in signals]
    names = settled(names, measured, in_body)
    return Analysis(
        signals=tuple(
            _labelled(one, clock, names, faster, inside, SECULAR.get(signal.variable, ()))
            for one, inside, signal in zip(found, in_body, signals, strict=True)
        ),
        known=tuple(names),
        start=float(clock.start),
        spacing=float(clock.spacing),
        length=float(clock.length),
        attitude_error=attitude_error,
        title=str(dataset.attrs.get("title", "")),
    )


def _decomposed(
    signal: Signal, clock: EquidistantTimes, lines: int, floor: float, order: int | None
) -> SignalAnalysis:
    """A signal's analysis with lines that have no labels yet."""
    samples, context, real = signal.samples(clock), clock.context, signal.real
    found = decompose(samples, lines, signal.degree, floor, order)
    per_sample, factor = 2 * context.pi / clock.spacing, 2 if real else 1  # of a cosine to its exponential
    finest = 2.0**-clock.bits  # of the spacing
    total, listed = found.sum, []
    for n, (frequency, amplitude) in enumerate(total.lines):
        observed, size = per_sample * frequency, abs(complex(amplitude))
        if real and frequency < 0:
            observed, amplitude = -observed, context.conj(amplitude)
        error, held = found.amplitude_errors[n], at_nyquist(total, real)[n]
        line = SpectralLine(
            frequency=observed,
            observed=observed,
            frequency_error=math.hypot(
                float(per_sample) * found.frequency_errors[n], finest * float(abs(observed))
            ),
            amplitude=factor * abs(amplitude),
            amplitude_error=factor * error,
            phase=_wrapped(context, context.arg(amplitude) - observed * clock.middle),
            phase_error=error / size if size and not held else math.inf,
            label=Label(),
            mismatch=math.nan,
        )
        listed.append(line)
    degree, errors, per_second = signal.degree, found.polynomial_errors, 2 / clock.length
    frequencies, sizes = amplitude_spectrum(samples, found, SPECTRUM_POINTS)
    return SignalAnalysis(
        name=signal.name,
        units=signal.units,
        real=real,
        value=total.polynomial[0] if degree >= 0 else None,
        value_error=errors[0] if degree >= 0 else math.nan,
        rate=total.polynomial[1].real * per_second if degree > 0 else None,
        rate_error=errors[1] * float(per_second) if degree > 0 else math.nan,
        lines=tuple(sorted(listed, key=lambda line: -line.amplitude)),
        order=found.order,
        bits=samples.bits,
        left=found.left,
        level=factor * found.level,
        close=tuple(f * float(per_sample) for f in found.close),
        exhausted=found.exhausted,
        notes=(),
        spectrum=(frequencies * float(per_sample), sizes),
    )


def _with_equinox(known: Sequence[Known], dataset: xarray.Dataset, clock: EquidistantTimes) -> list[Known]:
    """The known frequencies with ``k``, at which the equinox moves back along the moving orbit, where secular
    ones are known and ``precession`` was recorded. Two lines are taken off: more make the rate uncertain.
    """
    if _EQUINOX not in dataset or not any(k.kind for k in known):
        return list(known)
    [equinox] = [_decomposed(one, clock, 2, 1e-3, None) for one in signals_of(dataset, [_EQUINOX])]
    if equinox.rate is None:
        return list(known)
    return [Known("k", -equinox.rate, 0.0, "rate of precession", equinox.rate_error, kind="k"), *known]


def _with_precession(
    known: Sequence[Known], signals: Sequence[SignalAnalysis], clock: EquidistantTimes
) -> list[Known]:
    """The known frequencies with the equinox's, unless known: it moves back with the measured precession.

    Where an axis follows the node of an orbit, its rate is that node's. Of samples that don't span 1.5
    turns of the slowest known frequency no precession is reported: its rate is partly theirs.
    """
    names = list(known)
    if not known or any(k.kind or k.name == "precession" for k in known) or _slow(known, clock):
        return names
    for one in signals:
        if one.name in (_SECULAR, "node_longitude"):
            rate, error = one.rate, one.rate_error
            same = any(abs(float(rate - k.value)) <= 5 * math.hypot(error, k.error) for k in known)
            if abs(float(rate)) > 5 * error and not same:
                names.append(Known("precession", rate, 0.0, f"secular rate of {one.name}", error))
    return names


def _largest_rate(dataset: xarray.Dataset) -> float:
    """Largest size of a recorded angular velocity, rad/s; 0 without one."""
    if "angular_velocity" not in dataset or "time" not in dataset["angular_velocity"].dims:
        return 0.0
    rates = dataset["angular_velocity"].transpose("time", ...).values
    return float(np.nanmax(np.linalg.norm(rates.reshape(len(rates), -1), axis=1), initial=0.0))


def _labelled(
    found: SignalAnalysis,
    clock: EquidistantTimes,
    known: Sequence[Known],
    faster: bool,
    in_body: bool,
    secular: Pairs,
) -> SignalAnalysis:
    """The analysis with labels of its lines, and notes."""
    weakest = _FIRST_ORDER * max((line.amplitude for line in found.lines), default=0.0)
    lines = [
        replace(
            _named(x, found.real, clock, known, in_body, secular if x.amplitude >= weakest else ()),
            faster=faster,
        )
        for x in found.lines
    ]
    blends = sum(
        abs(line.mismatch) >= 10 * plain.frequency_error
        for line, plain in zip(lines, found.lines, strict=True)
    )
    slow = [] if found.rate is None else _slow(known, clock)
    unfolded = sum(line.unfolded for line in lines)
    aliases = sum(line.can_be_alias for line in lines)
    doubtful = sum(line.ambiguous for line in lines)
    notes = (
        (
            found.close,
            "a residual is closer than a bin to a line or to the secular part: errors include its size, "
            "a longer run separates it",
        ),
        (
            slow,
            f"the samples span less than 1.5 turns of {', '.join(k.name for k in slow)}: the secular rate "
            "may contain part of it",
        ),
        (
            any(math.isinf(line.phase_error) for line in lines),
            "a line within a third of a bin of Nyquist's frequency: samples show its amplitude times the "
            "cosine of its phase, and no more; sample more often to separate these",
        ),
        (
            unfolded,
            f"{unfolded} frequencies lie beyond Nyquist's, and are unfolded through the known ones",
        ),
        (
            blends,
            f"{blends} lines lie off their labels by more than the residual explains: blends of lines "
            "closer than a bin; their errors are those distances",
        ),
        (
            aliases,
            f"{aliases} lines without a label can be aliases of motions faster than Nyquist's frequency: "
            "sample more often, or at another spacing, to see whether their frequencies stay",
        ),
        (
            doubtful,
            f"{doubtful} lines fit several combinations: they have the observed frequency, unfolded by none",
        ),
    )
    return replace(found, lines=tuple(lines), notes=tuple(text for holds, text in notes if holds))


def _named(
    line: SpectralLine,
    real: bool,
    clock: EquidistantTimes,
    known: Sequence[Known],
    in_body: bool,
    secular: Pairs,
) -> SpectralLine:
    """A line with its label, unfolded through that."""
    context, error, resolution = clock.context, line.frequency_error, 2 * math.pi / float(clock.length)
    place, blend = (float(line.observed), error, known, clock.nyquist), _BLEND * resolution
    name = label(*place, real=real, in_body=in_body, blend=blend, resolution=resolution, secular=secular)
    turn = 2 * context.pi / clock.spacing
    frequency = line.observed + name.folds * turn
    # turning it by whole turns a sample changes nothing at the samples, but at the middle between two it does
    half = context.pi * name.folds if clock.count % 2 == 0 else 0
    phase = line.phase - name.folds * turn * clock.middle + half
    if real and frequency < 0:
        frequency, phase, name = -frequency, -phase, reversed_label(name, known)
    mismatch = math.nan
    if name.multipliers:
        terms = (m * context.mpf(k.value) for m, k in zip(name.multipliers, known, strict=True))
        off = frequency - sum(terms, context.zero)
        mismatch = float(off - turn * context.nint(off / turn))
        if not name.doubtful:
            error = max(error, abs(mismatch))  # a blend of lines that are too close to be separated
    phase = _wrapped(context, phase)
    return replace(
        line, frequency=frequency, frequency_error=error, phase=phase, label=name, mismatch=mismatch
    )


def _wrapped(context: Any, angle: Any) -> Any:
    """The angle within +-pi; pi rather than a -pi caused by rounding."""
    angle = angle - 2 * context.pi * context.nint(angle / (2 * context.pi))
    return -angle if angle + context.pi < 1e-6 else angle


def _slow(known: Sequence[Known], clock: EquidistantTimes) -> list[Known]:
    """Known frequencies of which the samples span less than 1.5 turns."""
    most = 2 * math.pi * 1.5 / float(clock.length)
    return [k for k in known if k.name != "precession" and not k.kind and 0 < abs(float(k.value)) < most]
