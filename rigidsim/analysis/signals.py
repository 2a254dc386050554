"""Signals of a dataset: its variables along time as real and complex signals, with every digit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
import xarray
from numpy.typing import NDArray

from rigidsim.analysis.exponentials import SignalSamples
from rigidsim.errors import RigidsimError
from rigidsim.scene.parts_of_values import parts_in

Reals = NDArray[np.float64]

LEAST_SAMPLES = 32
MOST_SAMPLES = 20_000_000
_SPARE_BITS = 100  # of sums and products beyond the precision of the samples
_BITS = {1: 53, 2: 64, 3: 113}  # by number of parts, where the dataset doesn't say
_PAIRS = {
    "polar_motion": [("m1", "m2")],
    "body_axis": [("x", "y")],
    "space_axis": [("X", "Y")],
    "quaternion_component": [("w", "z"), ("x", "y")],
}
"""Components, by variable or dimension, that form the real and imaginary part of a complex signal."""
_IN_BODY = (
    "polar_motion", "andoyer_angles", "rotation_angle", "spin_angle", "quaternion", "euler_angles",
    "roll_pitch_yaw", "nadir",
)  # fmt: skip
FIRST = (
    "polar_motion", "obliquity", "climatic_precession", "orbit_eccentricity", "precession", "node_longitude",
    "libration", "yaw", "rigid_body_libration", "separation", "roll_pitch_yaw", "tilt", "precession_angle",
    "spin_angle", "figure_axis", "momentum_axis", "andoyer_angles", "wobble_angle", "nutation_angle",
)  # fmt: skip
"""Variables analysed by default; failing these the angular velocity, failing that all."""


@dataclass(frozen=True)
class EquidistantTimes:
    """Equidistant times of samples, in mpf, s; their rounding makes them late by so many spacings, (n,),
    which is None beyond double precision.
    """

    start: Any
    spacing: Any
    count: int
    bits: int
    context: Any
    late: Reals | None = None

    @property
    def middle(self) -> Any:
        """Middle between the first and the last time, s."""
        return self.start + self.spacing * (self.count - 1) / 2

    @property
    def length(self) -> Any:
        """Number of samples times the spacing, s; one turn over it is a bin."""
        return self.spacing * self.count

    @property
    def nyquist(self) -> float:
        """Nyquist's angular frequency, one turn in two samples, rad/s."""
        return float(math.pi / self.spacing)


def clock_of(dataset: xarray.Dataset) -> EquidistantTimes:
    """The times of a dataset. Raises ``RigidsimError`` if they are missing, too few, or not equidistant."""
    if "time" not in dataset.coords or dataset["time"].dims != ("time",):
        raise RigidsimError("the dataset has no coordinate time along a dimension time; analyse needs one")
    count = dataset.sizes["time"]
    if count < LEAST_SAMPLES:
        raise RigidsimError(f"the dataset has {count} samples; analyse needs at least {LEAST_SAMPLES}")
    if count > MOST_SAMPLES:
        raise RigidsimError(
            f"the dataset has {count:,} samples, analyse takes up to {MOST_SAMPLES:,}: give it fewer, for "
            "instance dataset.isel(time=slice(None, None, 10))"
        )
    if not np.issubdtype(dataset["time"].dtype, np.number):
        raise RigidsimError("time is given as dates; analyse needs seconds as numbers")
    parts = [np.asarray(dataset[name].values, dtype=np.float64) for name in parts_in(dataset, "time")]
    bits = bits_of(dataset, len(parts))
    context = mpmath.MPContext()
    context.prec = bits + _SPARE_BITS
    first, last = (sum((context.mpf(float(p[n])) for p in parts), context.zero) for n in (0, -1))
    spacing = (last - first) / (count - 1)
    _refuse_uneven(parts[0], float(first), float(spacing))
    late = _late(parts[0], first, spacing) if len(parts) == 1 else None
    return EquidistantTimes(first, spacing, count, bits, context, late)


def _late(times: Reals, first: Any, spacing: Any) -> Reals:
    """By how much of a spacing each time is later than ``first + n spacing``, to some digits."""
    # of the spacing's 53 bits the first 28 times any number of samples are exact, the others are small
    exponent = 28 - math.frexp(float(spacing))[1]
    head = math.ldexp(round(math.ldexp(float(spacing), exponent)), -exponent)
    number = np.arange(len(times), dtype=np.float64)
    elapsed = times - float(first)
    # what the subtraction rounds off (Moller & Knuth)
    back = elapsed - times
    lost = (times - (elapsed - back)) - (float(first) + back)
    return ((elapsed - number * head) + lost - number * float(spacing - head)) / float(spacing)


def _refuse_uneven(times: Reals, first: float, spacing: float) -> None:
    """Refuse uneven times; rounded ones lie within half a unit in the last place of equidistant ones."""
    finest = 4 * np.finfo(float).eps * float(np.max(np.abs(times)))
    gaps = np.diff(times)
    if not spacing > 0 or not np.all(np.isfinite(times)):
        raise RigidsimError("sample times don't increase; analyse needs equidistant ones")
    if float(np.max(np.abs(times - (first + spacing * np.arange(len(times)))))) > finest:
        raise RigidsimError(
            f"samples aren't equidistant: {gaps.min():.9g} to {gaps.max():.9g} s apart; lines are found in "
            "equidistant ones: run again with every or samples in [time] instead of times, or give "
            "rigidsim.analyse a part that is equidistant"
        )


def bits_of(dataset: xarray.Dataset, parts: int) -> int:
    """Bits of the precision of values kept in so many parts."""
    if parts == 1:
        return 53
    given: Any = dataset.attrs.get("precision_bits")
    given = given.item() if hasattr(given, "item") else given
    known = (
        given if isinstance(given, int) and 53 < given <= 53 * parts else _BITS.get(parts, 53 * parts - 12)
    )
    return int(known)


@dataclass(frozen=True)
class Signal:
    """A sampled real or complex function of time, named by its variable and components, such as
    ``polar_motion.m1+i.m2``, with the degree of its secular polynomial (-1: none).
    """

    name: str
    variable: str
    units: str
    real: bool
    degree: int
    dataset: xarray.Dataset
    components: tuple[dict[str, Any], ...]

    def samples(self, clock: EquidistantTimes) -> SignalSamples:
        """All samples of the signal. Raises ``RigidsimError`` if some aren't finite."""
        columns = [
            [np.asarray(self.dataset[name].isel(chosen).values, np.float64) for chosen in self.components]
            for name in parts_in(self.dataset, self.variable)
        ]
        if not np.isfinite(columns).all():
            raise RigidsimError(
                f"{self.name}: not all samples are finite; analyse needs a part without gaps, for instance "
                "dataset.isel(time=slice(0, 1000))"
            )
        parts = tuple((found[0], found[1] if len(found) > 1 else 0.0 * found[0]) for found in columns)
        return SignalSamples(parts, self.real, bits_of(self.dataset, len(parts)), clock.context, clock.late)

    @property
    def in_body(self) -> bool:
        """Whether it is seen from the body, so that the body's own turning is part of it."""
        return self.variable in _IN_BODY or "body_axis" in self.dataset[self.variable].dims


def signals_of(dataset: xarray.Dataset, chosen: Sequence[str] = ()) -> list[Signal]:
    """The signals of a dataset, by names of variables (all their signals) or of signals; by default those of
    ``FIRST`` that it has, of axes the figure axis, else the angular velocity, else every variable.
    """
    offered = [signal for name in _variables(dataset) for signal in _signals(dataset, name)]
    if not offered:
        raise RigidsimError("the dataset has no variable along time that could be analysed")
    found = list[Signal]()
    for name in chosen:
        matching = [s for s in offered if name in (s.name, s.variable)]
        if not matching:
            raise RigidsimError(
                f"no signal {name!r}; there are {', '.join(s.name for s in offered)}; the name of a "
                "variable stands for all of its signals"
            )
        found += [s for s in matching if s not in found]
    by_default = [s for s in offered if s.variable in FIRST and not s.name.endswith((".spin", ".momentum"))]
    rates = [s for s in offered if s.variable == "angular_velocity"]
    return found or sorted(by_default, key=lambda s: FIRST.index(s.variable)) or rates or offered


def _variables(dataset: xarray.Dataset) -> list[str]:
    """Numeric variables along time, without residuals and drifts."""
    return [
        str(name)
        for name, data in dataset.data_vars.items()
        if "time" in data.dims and len(data.dims) <= 2 and np.issubdtype(data.dtype, np.floating)
        if "residual_of" not in data.attrs and not str(name).endswith(("_drift", "_put_back"))
    ]


def _signals(dataset: xarray.Dataset, name: str) -> list[Signal]:
    data = dataset[name].transpose("time", ...)
    units = str(data.attrs.get("units", ""))
    degree = 1 if units == "rad" else 0
    if data.ndim == 1:
        return [Signal(name, name, units, True, degree, dataset, ({},))]
    dim = str(data.dims[1])
    labels = list(map(str, data[dim].values if dim in data.coords else range(data.shape[1])))

    def at(label: str) -> dict[str, Any]:
        return {dim: labels.index(label)}

    pairs = [pair for pair in _PAIRS.get(name) or _PAIRS.get(dim, []) if {*pair} <= {*labels}]
    turning = [Signal(f"{name}.{x}+i{y}", name, units, False, -1, dataset, (at(x), at(y))) for x, y in pairs]
    alone = [(n, label) for n, label in enumerate(labels) if all(label not in pair for pair in pairs)]
    plain = [Signal(f"{name}.{label}", name, units, True, degree, dataset, ({dim: n},)) for n, label in alone]
    return [*turning, *plain]
