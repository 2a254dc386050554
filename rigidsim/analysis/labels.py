"""Labels of lines: integer combinations of known frequencies, also for lines folded by sampling.

A line that is sampled too rarely appears at its frequency less a whole number of turns per sample. It is
unfolded only if one combination of known frequencies beyond Nyquist's fits it, and no other that is
nearly as simple.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

_ORDERS = {1: 60, 2: 40, 3: 16, 4: 10, 5: 8, 6: 7}
"""Largest sum of abs(multipliers), by the number of known frequencies; 6 beyond."""
_ARGUMENTS = ("l", "lp", "F", "D", "Om")  # of nutation, in the order of the tables (IERS Conventions 2010)
_ALONE = re.compile(r"([+-])1(?=[A-Za-z])")
_SIGMAS = 5.0
_EXPECTED = 3.0  # sigmas of a line that theory expects
_ROUNDING = 1e-13  # of a combination, relative to its largest term
_CHANCE = 0.05  # labels that as many combinations would fit by chance aren't given
_RIVALS = 2  # orders more that another combination may have and still make a label doubtful


@dataclass(frozen=True)
class Known:
    """A frequency known for a scene, rad/s, whose sign counts. The strongest line within its relative
    tolerance takes its place; 0 if the value is exact, or was measured with an error, rad/s.

    ``where`` is "body" or "space" if only signals in body axes, or only those in space, can have it: how far
    a symmetric body has turned about its axis is to be seen in body axes alone.

    ``frames`` are rates (rad/s) of other frames in which its line may be seen, at its value plus such a rate.

    ``kind`` of a secular frequency: g of a perihelion, s of a node, k of the equinox. Their combinations are
    so many that only combinations in ``SECULAR`` are labels; of several that fit, the first ones known.
    """

    name: str
    value: Any
    tolerance: float = 0.0
    source: str = ""
    error: float = 0.0
    where: str = ""
    frames: tuple[float, ...] = ()
    kind: str = ""


Pairs = Sequence[tuple[str, str]]
_KS, _KG, _GG = ("k", "s"), ("k", "g"), ("g", "g")
SECULAR: Mapping[str, Pairs] = {
    "obliquity": [_KS], "precession": [_KS], "climatic_precession": [_KG], "orbit_eccentricity": [_GG],
    "insolation": [_KG, _KS],
}  # fmt: skip
"""First-order terms of variables, by the kinds of both frequencies: sums of k and another, differences of two
g (Laskar et al. 2004, A&A 428, 261, equations 35 to 40).
"""


@dataclass(frozen=True)
class Label:
    """The label of a line, such as ``2 orbit - node``, empty if nothing fits: multipliers of the known
    frequencies; whole turns per sample that were added to the observed frequency; other combinations that
    fit as well, in which case a folded line is not unfolded.
    """

    multipliers: tuple[int, ...] = ()
    text: str = ""
    folds: int = 0
    doubtful: tuple[str, ...] = ()


def named(multipliers: Sequence[int], known: Sequence[Known]) -> str:
    """A combination as text, the positive terms first; of the arguments of nutation as tables write it,
    ``2F-2D+2Om``.
    """
    if not any(multipliers):
        return "0"
    terms = [(m, k.name) for m, k in zip(multipliers, known, strict=True) if m]
    if all(name in _ARGUMENTS for _, name in terms):
        ordered = sorted(terms, key=lambda term: _ARGUMENTS.index(term[1]))
        text = "".join(f"{m:+d}{name}" for m, name in ordered)
        return _ALONE.sub(r"\1", text).lstrip("+")
    words = [
        f"{'-' if m < 0 else '+'} {'' if abs(m) == 1 else f'{abs(m)} '}{name}"
        for m, name in sorted(terms, key=lambda term: term[0] < 0)
    ]
    return re.sub("^- ", "-", " ".join(words).removeprefix("+ "))


@lru_cache(maxsize=8)
def combinations(count: int) -> NDArray[np.int64]:
    """All integer vectors (n, count) up to the largest order, the simplest first."""
    most = _ORDERS.get(count, 6)
    found: list[tuple[tuple[int, ...], int]] = [((), 0)]
    for _ in range(count):
        found = [
            ((*vector, m), order + abs(m))
            for vector, order in found
            for m in range(-(most - order), most - order + 1)
        ]
    vectors = np.array([vector for vector, _ in found], dtype=np.int64).reshape(len(found), count)
    order = np.abs(vectors).sum(axis=1)
    # of two that differ in sign the one that begins with a positive multiplier
    return vectors[np.lexsort((-vectors.sum(axis=1), order))]


def label(
    frequency: float,
    error: float,
    known: Sequence[Known],
    nyquist: float,
    *,
    real: bool,
    in_body: bool = False,
    blend: float = 0.0,
    resolution: float = math.inf,
    secular: Pairs = (),
) -> Label:
    """Find the combination that a line represents, observed within +-nyquist, rad/s.

    Where nothing fits within the error, combinations within ``blend``, far less than a bin, do: a line can
    have absorbed others that are too close to be separated. One whose error is about a bin gets no label.
    Where chance would fit as many combinations of all known frequencies, only frequencies below Nyquist's are
    combined. ``secular`` are the kinds of terms that theory expects, whatever chance would fit.
    """
    if (pairs := _pairs(known, secular)) is not None and _EXPECTED * error <= resolution:
        return _fitting(pairs, frequency, error, known, nyquist, real, 0.0, expected=True)
    if _SIGMAS * error > resolution:
        return Label()
    if not known:
        return Label((), "0", 0) if abs(frequency) <= _SIGMAS * error else Label()
    place = "body" if in_body else "space"
    seen = [n for n, k in enumerate(known) if k.where in ("", place) and not k.kind]
    slow = [n for n in seen if abs(float(known[n].value)) < nyquist]
    given = frequency, error, known, nyquist, real, blend
    found = _fitting(_vectors(seen, len(known)), *given)
    if found.multipliers or len(slow) in (0, len(seen)):
        return found
    return _fitting(_vectors(slow, len(known)), *given)


def _vectors(seen: Sequence[int], count: int) -> NDArray[np.int64]:
    """Combinations of the known frequencies of these numbers, among so many."""
    vectors = np.zeros((len(combinations(len(seen))), count), dtype=np.int64)
    vectors[:, seen] = combinations(len(seen))
    return vectors


def _pairs(known: Sequence[Known], secular: Pairs) -> NDArray[np.int64] | None:
    """Combinations of two secular frequencies of these kinds; None if there are none."""
    unit = np.eye(len(known), dtype=np.int64)
    found = [
        unit[i] + (-unit[j] if first == second else unit[j])
        for first, second in secular
        for i, one in enumerate(known)
        for j, other in enumerate(known)
        if (one.kind, other.kind) == (first, second) and i != j
    ]
    return np.array(found) if found else None


def _fitting(
    vectors: NDArray[np.int64],
    frequency: float,
    error: float,
    known: Sequence[Known],
    nyquist: float,
    real: bool,
    blend: float,
    *,
    expected: bool = False,
) -> Label:
    """Which of these combinations a line represents; chance counts unless they are expected."""
    values = np.array([float(k.value) for k in known])
    errors = np.array([math.hypot(k.error, abs(float(k.value)) * 2.0**-52) for k in known])
    true = vectors @ values
    turns = np.round(true / (2 * nyquist))
    observed = true - turns * 2 * nyquist
    allowed: Reals = (_EXPECTED if expected else _SIGMAS) * np.sqrt(
        error**2 + (vectors**2) @ errors**2
    ) + _ROUNDING * np.max(np.abs(vectors * values), axis=1)

    def simplest(allowed: Reals, *, blended: bool) -> Label:
        """The simplest combination that fits; others of nearly the same simplicity make it doubtful."""
        fits = np.abs(observed - frequency) <= allowed
        if real:
            # the mirror image has the opposite combination, which is in the list too
            fits &= (turns != 0) | (true >= 0)
        if blended:  # what doesn't fit within its error is too weak a reason to unfold a line
            fits &= turns == 0
        found = np.flatnonzero(fits)
        if not len(found):
            return Label()
        cost = np.abs(vectors[found]).sum(axis=1) + (turns[found] != 0)
        ranking = np.argsort(cost, kind="stable")
        found, cost = found[ranking], cost[ranking]
        best = found[0]
        if blended:  # a blend lies next to the strongest of its lines
            simple = found[cost <= cost[0] + _RIVALS]
            best = simple[np.argmin(np.abs(observed[simple] - frequency))]
        # as many equally simple combinations fit by chance, given their density here
        width: float = max(200 * float(allowed[best]), nyquist / 500)
        near = (np.abs(observed - frequency) <= width) & (np.abs(vectors).sum(axis=1) <= cost[0])
        if not expected and max(int(np.count_nonzero(near)) - 1, 0) * float(allowed[best]) / width > _CHANCE:
            return Label()
        rivals = [
            n
            for n, c in zip(found, cost, strict=True)
            if n != best
            and not np.array_equal(vectors[n], vectors[best])
            and not (real and np.array_equal(vectors[n], -vectors[best]))
            and (c <= cost[0] + _RIVALS if turns[n] != turns[best] else c == cost[0] and not blended)
        ]
        others = tuple(named(vectors[n].tolist(), known) for n in rivals[:4])
        # which of several frequencies it is stays open
        folds = 0 if any(turns[n] != turns[best] for n in rivals) else int(turns[best])
        multipliers = tuple(vectors[best].tolist())
        return Label(multipliers, named(multipliers, known), folds, others)

    found = simplest(allowed, blended=False)
    if not found.multipliers and blend:
        found = simplest(np.maximum(allowed, blend), blended=True)
    return found


def reversed_label(name: Label, known: Sequence[Known]) -> Label:
    """The label of a real line's mirror image."""
    multipliers = tuple(-m for m in name.multipliers)
    return Label(multipliers, named(multipliers, known), -name.folds, name.doubtful)


def settled(
    known: Sequence[Known],
    signals: Sequence[Sequence[tuple[Any, float, float]]],
    in_body: Sequence[bool] | None = None,
) -> list[Known]:
    """Roughly known frequencies, replaced by the strongest line near them, or left out.

    Of each signal's lines are given frequency (rad/s), its error, and amplitude; ``in_body`` says which
    signals are in body axes.
    """
    found = []
    for one in known:
        value = float(one.value)
        if not one.tolerance:
            found.append(one)
            continue
        seen = [
            signal
            for n, signal in enumerate(signals)
            if not one.where or in_body is None or in_body[n] == (one.where == "body")
        ]
        near = [
            (amplitude / largest, frequency, error, frame)
            for signal in seen
            if (largest := max((a for _, _, a in signal), default=0.0))
            for frequency, error, amplitude in signal
            for frame in (0.0, *one.frames)
            if abs(abs(float(frequency)) - abs(value + frame)) <= one.tolerance * abs(value)
        ]
        strength, frequency, error, frame = max(near, key=lambda line: line[0], default=(0.0, 0.0, 0.0, 0.0))
        if strength > 0:
            measured = abs(frequency) if value + frame > 0 else -abs(frequency)
            measured = measured - frame if frame else measured
            found.append(replace(one, value=measured, error=error, source=f"{one.source}; measured"))
    return found
