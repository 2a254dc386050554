"""Lines and secular part of a quasi-periodic signal, found and refined together.

Frequency analysis after Laskar (1993, Physica D 67, 257) with the corrections of Sidlichovsky & Nesvorny
(1996, Celest. Mech. Dyn. Astron. 65, 137), which free each line of what all others do to it: here as a Newton
iteration of all frequencies, amplitudes and polynomial coefficients at once on the residual,
until the windowed remainder is orthogonal to every exp(i w t), to t exp(i w t) and to the polynomial. A
signal that is such a sum has it as its fixed point, whatever the distance of its lines. The steps are
computed in double precision, the remainder in the signal's own: each step gains digits, until there are no
more.

The Hann window of order p, (1 + cos(pi x))^p on -1 < x < 1 (section 2.2 of Laskar's), leaves of a line D bins
(of one turn over the whole length) away a share of p!^2 / (pi D^(2p+1)), at the price of a main lobe that is
p + 1 bins wide on either side.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rigidsim.analysis.exponentials import Complexes, Reals, SignalSamples, Sum, mirrored, products

_POINTS, _FINE = 1024, 1 << 17  # of the quadrature behind ``moments``
_REACH = 200.0  # bins beyond which lines don't feel each other while steps are computed
_ASIDE = 256  # spectral points to either side whose median is the noise next to a line


@lru_cache(maxsize=2)
def positions(count: int) -> Reals:
    """Positions of samples on -1 < x < 1."""
    x = (2.0 * np.arange(count) - (count - 1)) / count
    x.flags.writeable = False
    return np.asarray(x)


@lru_cache(maxsize=2)
def hann(count: int, order: int) -> Reals:
    """Hann window of an order at so many samples, with mean 1."""
    weights = (1 + np.cos(np.pi * positions(count))) ** order
    weights /= weights.mean()
    weights.flags.writeable = False
    return np.asarray(weights)


@lru_cache(maxsize=16)
def _table(order: int, power: int) -> Complexes:
    """Mean of the window times x^power exp(i pi D x), for D = 0, 1/128, 2/128, ... up to the reach."""
    x = positions(_POINTS)
    values = np.zeros(_FINE, dtype=np.complex128)
    values[:_POINTS] = hann(_POINTS, order) * x**power
    # with numpy's sign: conj(fft(real)) has exp(+i)
    found = np.conj(np.fft.fft(values))[: int(_REACH * _FINE / _POINTS) + 2] / _POINTS
    distance = np.arange(len(found)) * _POINTS / _FINE
    return np.asarray(found * np.exp(1j * np.pi * distance * x[0]))


def moments(order: int, power: int, distance: Reals) -> Complexes:
    """Mean of the window times x^power exp(i pi D x), to some 1e-5, D in bins: a line at another."""
    table = _table(order, power)
    place = np.abs(distance) * (_FINE / _POINTS)
    low = np.minimum(place.astype(np.int64), len(table) - 2)
    part = place - low
    value = table[low] * (1 - part) + table[low + 1] * part
    value = np.where(np.abs(distance) < _REACH, value, 0)
    return np.asarray(np.where(distance < 0, np.conj(value), value))


@dataclass(frozen=True)
class Spectrum:
    """Amplitude spectrum of so many windowed samples: frequencies in turns per sample, ascending; sizes, of
    which a line at such a frequency has exactly its own; the complex amplitudes at the first sample.
    """

    frequencies: Reals
    sizes: Reals
    turned: Complexes
    count: int

    def amplitude(self, at: int) -> complex:
        """Complex amplitude of one point, at the middle of the samples."""
        return complex(self.turned[at] * np.exp(1j * np.pi * self.frequencies[at] * (self.count - 1)))

    def around(self, frequency: float, reach: float) -> slice:
        """Points within ``reach`` bins of a frequency."""
        ends = frequency - reach / self.count, frequency + reach / self.count
        return slice(*np.searchsorted(self.frequencies, ends).tolist())

    def noise(self, at: int, reach: float) -> float:
        """Median size next to a point, without points within ``reach`` bins."""
        near = self.around(float(self.frequencies[at]), reach)
        beside = np.concatenate(
            [self.sizes[max(near.start - _ASIDE, 0) : near.start], self.sizes[near.stop : near.stop + _ASIDE]]
        )
        return float(np.median(beside)) if len(beside) > 8 else 0.0


def spectrum(values: Complexes, order: int, *, real: bool) -> Spectrum:
    """Spectrum with two points per bin; of a real signal the positive half, with amplitudes of exp(i w t)."""
    count = len(values)
    # the next number without prime factors above 5, which transforms fast
    size = next(n for n in itertools.count(2 * count) if pow(30, 64, n) == 0)
    weights = hann(count, order) / count
    if real:
        found = np.fft.rfft(values.real * weights, size)
        frequencies = np.arange(len(found)) / size
    else:
        found = np.fft.fftshift(np.fft.fft(values * weights, size))
        frequencies = (np.arange(size) - size // 2) / size
    return Spectrum(frequencies, np.abs(found), found, count)


def peak(found: Spectrum, at: int) -> float:
    """Frequency of the maximum next to a point, from the parabola through the logarithms of three sizes."""
    if not 0 < at < len(found.frequencies) - 1:
        return float(found.frequencies[at])
    with np.errstate(divide="ignore"):
        a, b, c = np.log(found.sizes[at - 1 : at + 2])
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if np.isfinite(bend) and bend < 0 else 0.0
    return float(
        found.frequencies[at] + np.clip(shift, -1, 1) * (found.frequencies[1] - found.frequencies[0])
    )


# --- decomposition ------------------------------------------------------------------------------------------


_FALSE_ALARM = 1e-5  # chance that noise alone shows a line
_SEARCH_ORDERS = (3, 1)  # of the window while lines are looked for; the second where some are close
_NEAREST = 1.0  # bins between lines that can be separated
_MOST_CANDIDATES = 40  # peaks that may be no lines, before there are none
# a line CLOSEST / 2 bins from Nyquist's frequency can be 1 / sin(0.3 pi) = 1.24 times the largest sample
_MOST_OF_SAMPLES = 1.5
_STEPS = 3  # of Newton's method after each new line
_HIGHEST_ORDER = 10
_MOST_STEPS = 25  # of Newton's method
CLOSEST = 0.6  # bins between lines below which Newton's method can't separate them
# of the error of a secular rate, see ``hidden_rate``
_DEGREE = 9  # of the polynomial in the slow part: a line of one turn in the samples to some 1e-4
_NEAR = 30.0  # bins from zero within which lines may be pieces of the slow part
_PIECE = 0.1  # of the residual, above which a line is separate; pieces were 1e-4 to 3e-2
_SURE = 4.0  # standard deviations above which something is there
_CELLS = 4096
_STRAIGHT = 1e-3  # k, in half lengths, below which rounding hides how exponentials differ from polynomials
_BENT = 1e-2  # k of an exponential that changes by a tenth of its logarithm in half the length
_LONGEST = 3.0  # half lengths that a slow part may take to change by e, where the samples don't say


@dataclass(frozen=True)
class Decomposition:
    """Components of a signal: polynomial, and lines (of a real signal with positive frequencies: twice
    their real part). Errors are one standard deviation, from the remainder next to the line, in turns per
    sample and the signal's unit; ``level`` is the median size of the remainder's windowed spectrum; the rest
    is as of ``result.SignalAnalysis``, in turns per sample.
    """

    sum: Sum
    order: int
    frequency_errors: tuple[float, ...]
    amplitude_errors: tuple[float, ...]
    polynomial_errors: tuple[float, ...]
    left: float
    level: float
    close: tuple[float, ...]
    exhausted: bool


def decompose(
    samples: SignalSamples, lines: int, degree: int, floor: float, order: int | None = None
) -> Decomposition:
    """Find so many of the strongest lines, down to a share of the strongest, and a polynomial (-1: none).

    The window's order is by default as high as the distance of the lines allows.
    """
    double = replace(samples, parts=samples.parts[:1], bits=min(samples.bits, 53))
    found = []
    for search_order in (order,) if order else _SEARCH_ORDERS:
        search = _Search(double, degree, search_order)
        search.look_for(lines, floor)
        crowded = bool(search.close)
        total, final = search.separated(order)
        left = spectrum(double.remainder(total), _SEARCH_ORDERS[0], real=samples.real).sizes
        found.append((float(np.mean(np.log(np.maximum(left, 1e-300)))), total, final, search))
        if not crowded:
            break
    # a narrower window may take one line for two, and see no other near them: the remainder of the better
    # search has the smaller spectrum, by its mean logarithm, to which all frequencies contribute
    _, total, final, search = min(found, key=lambda one: one[0])
    if samples.bits > 53:
        total = refined(samples, total, final)
    return _judged(samples, total, final, search)


def _final_order(total: Sum, real: bool) -> int:
    """Window order from the least distance of lines: half of it in bins, less one, keeps main lobes apart."""
    places = _places(total, real)
    if total.polynomial:
        places = np.append(places, 0.0)
    places = np.sort(places)
    gaps = np.diff(places, append=places[:1] + total.count)  # around the circle
    gaps = gaps[gaps > 0]  # a line at Nyquist's frequency is its own mirror image
    least = float(gaps.min()) if len(gaps) > 1 else math.inf
    return int(np.clip(math.floor(least / 2 - 1) if math.isfinite(least) else 3, 1, _HIGHEST_ORDER))


def _places(total: Sum, real: bool) -> Reals:
    """Frequencies in bins, mirror images among them."""
    own = np.array([float(f) for f in total.frequencies]) * total.count
    return np.concatenate([own, -own]) if real else own


def _merged(total: Sum, real: bool, limit: float) -> int | None:
    """Index of the weaker of two lines that have merged, of one that merged with the secular part, or of one
    above the limit, that several others cancel nearly everywhere; None if there is none.
    """
    lines = len(total.frequencies)
    places = _places(total, real)
    sizes = np.array([abs(complex(a)) for a in total.amplitudes] * (2 if real else 1))
    for n in np.argsort(sizes[:lines]).tolist():
        others = np.delete(places, [n, n + lines] if real else [n])
        if total.polynomial:
            others = np.append(others, 0.0)
        close = len(others) and np.abs(apart(others - places[n], total.count)).min() < CLOSEST
        if close or not sizes[n] <= limit:
            return int(n)
    return None


class _Search:
    """Search for lines one after the other, the strongest first, refining all after each."""

    def __init__(self, samples: SignalSamples, degree: int, order: int) -> None:
        self.samples, self.order = samples, order
        context = samples.context
        self.total = Sum(context, samples.count, (context.mpc(0),) * (degree + 1), (), ())
        self.close: list[float] = []
        self.exhausted = False
        self.limit = math.inf

    def look_for(self, lines: int, floor: float) -> None:
        if self.total.polynomial:
            self.total = refined(self.samples, self.total, self.order, steps=2)
        hidden: list[float] = []
        while True:
            left = self.samples.remainder(self.total)
            if not self.total.frequencies:
                self.limit = _MOST_OF_SAMPLES * float(np.max(np.abs(left))) / (2 if self.samples.real else 1)
            found = spectrum(left, self.order, real=self.samples.real)
            at = self._strongest(found, hidden, floor)
            if at is None:
                return
            frequency = peak(found, at)
            if self._near(frequency):
                self.close.append(frequency)
                hidden.append(frequency)
                continue
            if len(self.total.frequencies) == lines:
                self.exhausted = True
                return
            before = self.total
            self._add(frequency, found.amplitude(at))
            # two have moved together to fit what neither is
            if _merged(self.total, self.samples.real, self.limit) is not None:
                self.total = before
                self.close.append(frequency)
                hidden.append(frequency)

    def separated(self, order: int | None) -> tuple[Sum, int]:
        """The lines found, refined in a window of an order, without those that merged; and the order."""
        final = order or _final_order(self.total, self.samples.real)
        total = settled(self.samples, self.total, final)
        while (weaker := _merged(total, self.samples.real, self.limit)) is not None:
            self.close.append(float(total.frequencies[weaker]))
            kept = [line for n, line in enumerate(total.lines) if n != weaker]
            total = settled(self.samples, total.with_lines(kept), final)
        return total, final

    def _strongest(self, found: Spectrum, hidden: Sequence[float], floor: float) -> int | None:
        """Index of the largest point that stands out from its neighbourhood; None if there is none."""
        size = found.sizes.copy()
        reach = self.order + 2
        for frequency in hidden:
            size[found.around(frequency, reach)] = 0
        threshold = math.sqrt(math.log(len(size) / _FALSE_ALARM) / math.log(2))
        largest = max((abs(complex(a)) for a in self.total.amplitudes), default=0.0)
        least = max(floor * largest, 1e-300)
        for _ in range(_MOST_CANDIDATES):
            at = int(np.argmax(size))
            if size[at] <= least:
                return None
            if size[at] > threshold * found.noise(at, reach):
                return at
            size[found.around(float(found.frequencies[at]), reach)] = 0
        return None

    def _near(self, frequency: float) -> bool:
        count, total = self.samples.count, self.total
        here, places = frequency * count, _places(total, self.samples.real)
        others = np.append(places, 0.0) if total.polynomial else places
        gaps = np.abs(apart(here - others, count)).tolist()
        if self.samples.real and not total.polynomial:  # from its own mirror image
            gaps.append(2 * abs(here))
        return min(gaps, default=math.inf) < _NEAREST

    def _add(self, frequency: float, amplitude: complex) -> None:
        context = self.samples.context
        if self.samples.real:  # between a line at Nyquist's frequency and its mirror image nothing decides
            frequency = min(frequency, 0.5 - 0.5 / self.samples.count)
        grown = self.total.with_lines([*self.total.lines, (context.mpf(frequency), context.mpc(amplitude))])
        self.total = folded(refined(self.samples, grown, self.order, steps=_STEPS))


def _judged(samples: SignalSamples, total: Sum, order: int, search: _Search) -> Decomposition:
    """The decomposition, with errors from the remainder."""
    left = samples.remainder(total)
    found = spectrum(left, order, real=samples.real)
    x = positions(total.count)
    weights = hann(total.count, order)
    spread = math.sqrt(float(np.mean(weights**2 * x**2) / np.mean(weights**2)))
    second = float(np.mean(weights * x**2))
    finest = 2.0**-samples.bits

    def beside(frequency: float) -> float:
        near = found.sizes[found.around(abs(frequency) if samples.real else frequency, 3 * (order + 2))]
        return math.sqrt(float(np.mean(near**2))) if len(near) else float(found.sizes.max())

    # neighbours that are hard to separate make errors grow
    growth = error_growth(mirrored(total, samples.real), order)
    powers, lines = len(total.polynomial), len(total.frequencies) * (2 if samples.real else 1)
    held = at_nyquist(total, samples.real)
    frequency_errors, amplitude_errors = [], []
    for n, (frequency, amplitude) in enumerate(total.lines):
        level = beside(float(frequency)) * growth[powers + n]
        turned = beside(float(frequency)) * growth[powers + lines + n]
        strength = abs(complex(amplitude))
        own = turned / strength * spread / second / math.pi / total.count if strength else math.inf
        own = max(own, CLOSEST / 2 / total.count) if held[n] else own
        frequency_errors.append(math.hypot(own, finest * abs(float(frequency))))
        amplitude_errors.append(math.hypot(level, finest * strength))
    level = beside(0.0)
    noise = float(np.median(found.sizes))
    polynomial_errors = [level * growth[m] * spread**m / second**m for m in range(powers)]
    if samples.real and powers > 1:
        white = noise / math.sqrt(math.log(2) * float(np.mean(weights**2)))  # the median is a Rayleigh one
        polynomial_errors[1] = max(polynomial_errors[1], hidden_rate(total, left, white))
    return Decomposition(
        total,
        order,
        tuple(frequency_errors),
        tuple(amplitude_errors),
        tuple(polynomial_errors),
        math.sqrt(float(np.mean(np.abs(left) ** 2))),
        noise,
        tuple(search.close),
        search.exhausted,
    )


def amplitude_spectrum(samples: SignalSamples, found: Decomposition, points: int) -> tuple[Reals, Reals]:
    """Spectrum of a signal without its secular part: frequencies (turns per sample) and sizes; of a real one
    those of cosines. Of neighbouring points the largest is kept, so that no line is lost.
    """
    secular = found.sum.with_lines(())
    left = replace(samples, parts=samples.parts[:1], bits=53).remainder(secular)
    shown = spectrum(left, min(found.order, _SEARCH_ORDERS[0]), real=samples.real)
    size = shown.sizes * (2 if samples.real else 1)
    group = max(-(-len(size) // points), 1)
    padded = -(-len(size) // group) * group
    grouped = np.pad(size, (0, padded - len(size))).reshape(-1, group)
    best = grouped.argmax(axis=1) + group * np.arange(len(grouped))
    return shown.frequencies[best], size[best]


def apart(distance: Reals, count: int) -> Reals:
    """Distances of frequencies, in bins, on the circle of ``count`` bins."""
    return np.asarray(distance - count * np.round(distance / count))


def folded(total: Sum) -> Sum:
    """The sum with frequencies within half a turn per sample.

    A whole turn per sample changes nothing at whole numbers, but samples are counted from the middle: of an
    even count by halves, where each turn changes the sign.
    """
    lines = []
    for f, a in total.lines:
        turns = int(total.context.nint(f)) if abs(f) > 0.5 else 0
        lines.append((f - turns, -a if turns * (total.count - 1) % 2 else a))
    return total.with_lines(lines)


def settled(samples: SignalSamples, total: Sum, order: int) -> Sum:
    """The refined sum; lines that come too close to Nyquist's frequency are held there (``at_nyquist``)."""
    held = -1
    while (now := sum(at_nyquist(total, samples.real))) > held:
        held = now
        total = _held(folded(refined(samples, total, order)), samples.real)
    return total


def at_nyquist(total: Sum, real: bool) -> list[bool]:
    """Which lines stand for what is too near Nyquist's frequency to be separated from its mirror image.

    There a real signal only shows the line's amplitude times the cosine of its phase.
    """
    return [real and f == 0.5 for f in total.frequencies]


def _held(total: Sum, real: bool) -> Sum:
    """The sum with lines near Nyquist's frequency moved to it, with the amplitude that the samples show."""
    context, count, lines = total.context, total.count, []
    for f, a in total.lines:
        if real and 2 * abs(0.5 - abs(f)) * count < CLOSEST:
            # the exponential is real at samples counted by whole numbers, imaginary at those by halves
            part = -a.imag if f < 0 else a.imag
            f, a = context.mpf(0.5), context.mpc(a.real, 0) if count % 2 else context.mpc(0, part)
        lines.append((f, a))
    return total.with_lines(lines)


def refined(samples: SignalSamples, total: Sum, order: int, steps: int = _MOST_STEPS) -> Sum:
    """Apply Newton's method to a sum as long as it improves."""
    if not total.frequencies and not total.polynomial:
        return total
    last = math.inf
    for _ in range(steps):
        left = samples.remainder(total)
        change, moved, size = _step(samples, total, left, order)
        if not size < 0.7 * last and steps == _MOST_STEPS and last < 1e-3:
            break  # the last step was rounding already
        total, last = moved, size
        if change == 0:
            break
    return total


def _step(samples: SignalSamples, total: Sum, left: Complexes, order: int) -> tuple[float, Sum, float]:
    """The largest change of an amplitude, the sum after the step, and the step's size over the signal's."""
    context = total.context
    whole = mirrored(total, samples.real)
    found = np.linalg.lstsq(_gram(whole, order), _products(whole, left, order), rcond=1e-12)[0]
    powers, count = len(whole.polynomial), len(whole.frequencies)
    polynomial, change, turning = np.split(found, [powers, powers + count])
    held, lines = at_nyquist(total, samples.real), []
    for k, (frequency, amplitude) in enumerate(total.lines):
        size = complex(amplitude)
        # a exp(i pi D x), D in bins: the change with D is i pi x a exp(...)
        shift = (turning[k] / size).imag / math.pi if size and not held[k] else 0.0
        moved = frequency + context.mpf(float(np.clip(shift, -0.5, 0.5))) / total.count
        lines.append((moved, amplitude + context.mpc(complex(change[k]))))
    coefficients = [
        c + context.mpc(complex(x.real if samples.real else x))
        for c, x in zip(total.polynomial, polynomial, strict=True)
    ]
    largest = max([abs(complex(a)) for a in (*coefficients, *(a for _, a in lines))], default=0.0)
    step = float(np.max(np.abs(found), initial=0.0))
    after = replace(total, polynomial=tuple(coefficients)).with_lines(lines)
    return step, after, step / largest if largest else 0.0


def _products(total: Sum, left: Complexes, order: int) -> Complexes:
    """Windowed means of a remainder times powers of x, conj(exp(i w t)) and x conj(exp(i w t))."""
    x = positions(total.count)
    weighted = left * hann(total.count, order) / total.count
    powers = np.array([np.sum(weighted * x**m) for m in range(len(total.polynomial))], dtype=np.complex128)
    turned = [products(values, total.frequencies) for values in (weighted, weighted * x)]
    return np.concatenate([powers, *turned])


def _gram(total: Sum, order: int) -> Complexes:
    """Approximate windowed means of the products of all columns; the next step corrects the approximation."""
    count = total.count
    places = np.array([float(f) for f in total.frequencies]) * count
    powers, lines = len(total.polynomial), len(places)
    places = np.concatenate([np.zeros(powers), places, places])
    raised = np.concatenate([np.arange(powers), np.zeros(lines, int), np.ones(lines, int)])
    distance = places[None, :] - places[:, None]
    turns = np.round(distance / count)  # frequencies are on a circle: see ``apart`` and ``folded``
    power = raised[None, :] + raised[:, None]
    matrix = np.zeros(distance.shape, dtype=np.complex128)
    for m in np.unique(power):
        chosen = power == m
        matrix[chosen] = moments(order, int(m), (distance - turns * count)[chosen])
    return np.where(turns * (count - 1) % 2, -matrix, matrix)


def error_growth(total: Sum, order: int) -> Reals:
    """Factor by which the error of each column's coefficient exceeds a lone column's."""
    matrix = _gram(total, order)
    if not len(matrix):
        return np.empty(0)
    inverse = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
    return np.sqrt(np.maximum(np.diag(inverse).real * np.diag(matrix).real, 1.0))


def hidden_rate(total: Sum, left: Complexes, noise: float) -> float:
    """What a slow part, neither a line nor a polynomial, may have added to the rate of a real signal, per
    half length; 0 if nothing of it is left in the remainder (n,), whose mean has the standard deviation
    ``noise``, as if it were white.

    Of an exponential, or of a line that makes less than a turn within the samples, lines and polynomial
    absorb what they can: next to nothing may be left, while the rate contains the whole slope of it. What
    such parts have in common is f''' = k f' (k = 1 / tau^2, or -w^2): from the curvature in the middle and
    its derivatives follows the slope that the rate has taken over.
    """
    c, s = _polynomial(left.real, noise, 3)
    if not np.any(np.abs(c[2:]) > _SURE * s[2:]):
        return 0.0
    bent = float(np.max(np.abs(c[2:])))
    higher, spread = _polynomial(_with_pieces(total, left, bent), noise, _DEGREE)
    if np.any(np.abs(higher[2:4] - c[2:]) > bent + _SURE * spread[2:4]):  # what lines have left, nothing slow
        return abs(float(c[1]))
    return _absorbed(higher, spread)


def _with_pieces(total: Sum, left: Complexes, bent: float) -> Reals:
    """What is left together with lines that are pieces of the same: far less than it bends, (n,)."""
    lines = [
        (f, a)
        for f, a in total.lines
        if abs(float(f)) * total.count < _NEAR and 2 * abs(complex(a)) < _PIECE * bent
    ]
    values = left.real
    if lines:
        values = values + 2 * Sum(total.context, total.count, (), (), ()).with_lines(lines).values().real
    return np.asarray(values)


def _polynomial(values: Reals, noise: float, degree: int) -> tuple[Reals, Reals]:
    """Coefficients of the windowed least squares, and their standard deviations in white noise."""
    count = len(values)
    x, weights, means = (_cells(column) for column in (positions(count), hann(count, 1), values))
    columns = np.stack([x**m for m in range(degree + 1)], axis=1)
    weighted = columns * weights[:, None]
    inverse = np.linalg.inv(columns.T @ weighted / len(x))
    spread = inverse @ (weighted.T @ weighted / len(x)) @ inverse
    return inverse @ (weighted.T @ means) / len(x), noise * np.sqrt(np.diag(spread))


def _cells(values: Reals) -> Reals:
    """Means over neighbouring samples, of which few thousand are enough for what is slow."""
    width = max(len(values) // _CELLS, 1)
    return np.asarray(values[: len(values) // width * width].reshape(-1, width).mean(axis=1))


def _absorbed(c: Reals, s: Reals) -> float:
    """The part of the rate that belongs to a slow part with these coefficients and standard deviations."""
    cubic = max(abs(c[1]) - _SURE * s[1], 0.0)  # what a cubic drift adds to the rate in the middle
    size = 4 * c[2] ** 2 + 9 * c[3] ** 2
    if not size:
        return 0.0
    # f''' is 6 c3 + 24 c4 x + 60 c5 x^2, and k (c1 + 2 c2 x + 3 c3 x^2): least squares of the last two
    k = (48 * c[2] * c[4] + 180 * c[3] * c[5]) / size
    unsure = _SURE * math.hypot(24 * s[4], 60 * s[5]) / math.sqrt(size)
    if abs(k) > max(unsure, _STRAIGHT):
        return float(max(cubic, abs(6 * c[3] / k - c[1])))
    if unsure < _BENT:  # it is a polynomial
        return float(cubic)
    # all that is known is by how much the rate itself changes within half the length
    return float(max(cubic, _LONGEST * math.hypot(2 * c[2], 3 * c[3])))
