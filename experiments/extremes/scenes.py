"""The extreme scenes: each differs from something singular, huge or tiny by a power of ten."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations, product

SEQUENCES = (*("".join(p) for p in permutations("xyz")), "xyx", "xzx", "yxy", "yzy", "zxz", "zyz")
ANY = ("rates", "quaternion", "euler_angles", "rotation_matrix", "canonical", "closed_form")
EULER = ("euler_angles", "canonical")
TILTED = (4, 3, 2, 1)
UPRIGHT = (1, 0, 0, 0)
_BITS = 16  # of an end: a sample at a quarter of it is a number of every precision


@dataclass(frozen=True)
class Way:
    """How a scene is run.

    Attributes:
        column: of the table: a formulation, or "closed_form".
        hold: whether invariants are held.
    """

    column: str
    precision: str | int = "double"
    hold: bool = False

    @property
    def title(self) -> str:
        """In words."""
        more = ", held" if self.hold else f", {self.precision}" if self.precision != "double" else ""
        return self.column.replace("_", " ") + more


@dataclass(frozen=True)
class Extreme:
    """A scene and where it stands in the table.

    Attributes:
        row: of the table.
        name: within the row.
        body: lines of ``[body]``.
        rates: body axes, rad/s: numbers, or texts where a double would round.
        end: seconds.
        gravity: downwards, m/s^2; 0 for none.
        tolerance: None for "auto".
        angles: instead of the quaternion.
        columns: formulations that the scene is of interest for.
    """

    row: str
    name: str
    body: str
    rates: tuple[object, ...]
    end: float
    quaternion: tuple[object, ...] = TILTED
    gravity: float = 0.0
    tolerance: float | None = None
    sequence: str = "zxz"
    angles: tuple[str, ...] | None = None
    columns: Sequence[str] = ANY

    def text(self, way: Way) -> str:
        """The config of this scene; five samples."""
        closed = way.column == "closed_form"
        record = "angular_velocity" if way.column == "rates" else "quaternion"
        attitude = f"quaternion = {written(self.quaternion)}"
        if self.angles is not None:
            attitude = f"euler_angles = {written(self.angles)}"
        load = f'[[loads]]\nkind = "uniform_gravity"\nacceleration = [0, 0, {-self.gravity!r}]\n'
        times = [f"{k * self.end!r}/4" if k % 4 else repr(k * self.end / 4) for k in range(5)]
        return (
            f'name = "extreme"\n[body]\n{self.body}\n[initial]\nangular_velocity = {written(self.rates)}\n'
            f"{attitude}\n{load if self.gravity else ''}[time]\ntimes = {written(times)}\n[integrator]\n"
            f"precision = {way.precision!r}\n"
            f"tolerance = {self.tolerance or 'auto'!r}\n"
            f"formulation = '{'auto' if closed else way.column}'\n"
            f"method = '{'closed_form' if closed else 'taylor'}'\n"
            f"euler_sequence = '{self.sequence}'\nhold_invariants = {str(way.hold).lower()}\n"
            f'[output]\nrecord = ["{record}"]\ntimeline = false\n'
        )


def written(numbers: Sequence[object]) -> str:
    """As a TOML array of texts, so that no reader rounds."""
    return "[" + ", ".join(f'"{x}"' if isinstance(x, str) else repr(x) for x in numbers) + "]"


def principal(*moments: object) -> str:
    """A body by its principal moments."""
    return f"principal_moments = {written(moments)}"


def top(along: object, height: object = 1) -> str:
    """A symmetric top with moment 1 across, of unit mass."""
    return f'{principal(1, 1, along)}\nmass = 1\ncenter_of_mass = [0, 0, "{height}"]'


def lasting(radians: float, fastest: float) -> float:
    """Seconds for this many radians at a rate, rounded to a few bits."""
    seconds = radians / fastest
    unit = math.ldexp(1.0, math.frexp(seconds)[1] - _BITS)
    return round(seconds / unit) * unit if unit else seconds


def beside(digits: int, sign: int = 1, whole: int = 1) -> str:
    """``whole`` plus or minus 10^-digits, exactly."""
    return f"{whole * 10**digits + sign}/{10**digits}"


def all_scenes(full: bool) -> list[Extreme]:
    """Every extreme of the table.

    Args:
        full: horizons to 1e8 radians for steps, where 1e6 else.
    """
    free = [*separatrix(), *moments(), *sizes(), *horizons(full), *euler_singularities(), *spins()]
    return [*free, *denormals(), *tolerances(), *tops()]


ASYMMETRIC = principal(3, 6, 8)


def separatrix() -> Iterator[Extreme]:
    """2 E I2 - L^2 next to zero: the body lingers about its middle axis, the longer the nearer."""
    for digits in (3, 6, 9, 12, 15):
        for side, sign in (("outside", 1), ("inside", -1)):
            rates = (4, 10, beside(digits, sign, 3))
            yield Extreme("separatrix", f"{side} by 1e-{digits}", ASYMMETRIC, rates, lasting(200, 10))
        beside_it = (f"1e-{digits}", 1, f"1e-{digits}")
        yield Extreme("middle axis", f"off by 1e-{digits}", ASYMMETRIC, beside_it, lasting(200, 1))
    yield Extreme("separatrix", "on it", ASYMMETRIC, (4, 10, 3), lasting(200, 10))


def moments() -> Iterator[Extreme]:
    """Ratios and differences of the principal moments."""
    for digits in (3, 6, 9, 12, 15):
        thin, more, less = f"1e-{digits}", beside(digits), beside(digits, 2)
        fast = 10.0**digits
        row = f"moment ratio 1e-{digits}"
        yield Extreme(row, "fast spin", principal(thin, 1, more), (fast, 1, 0.1), lasting(100, fast))
        yield Extreme(row, "slow spin", principal(1, thin, 1), (0.5, 1, 0.3), lasting(100, 1))
        yield Extreme(row, "tumbling", principal(thin, 1, more), (0.1, 1, 0.5), lasting(100, 1))
        row = f"moments that differ by 1e-{digits}"
        yield Extreme(row, "oblate", principal(1, more, 2), (0.5, 1, -0.3), lasting(100, 1))
        yield Extreme(row, "prolate", principal("1/2", 1, more), (0.3, 1, 0.5), lasting(100, 1))
        yield Extreme(row, "nearly a sphere", principal(1, more, less), (0.5, 1, -0.3), lasting(100, 1))
        thick = f"{2 * 10**digits - 1}/{10**digits}"
        yield Extreme(row, "nearly a plate", principal(1, thick, beside(digits, -2, 3)), (0.3, 1, 0.2), 100.0)
    yield Extreme("rod, plate, sphere", "rod", principal(2, 0, 2), (0.3, 0, 0.2), lasting(100, 0.3))
    yield Extreme("rod, plate, sphere", "plate", principal(1, 2, 3), (0.3, 1, 0.2), lasting(100, 1))
    yield Extreme("rod, plate, sphere", "sphere", principal(2, 2, 2), (0.3, 1, 0.2), lasting(100, 1))


def sizes() -> Iterator[Extreme]:
    """Rates and inertia far from 1."""
    for power in (-300, -150, -15, 15, 150, 300):
        row = f"rates 1e{abs(power)} and 1e-{abs(power)}"
        size = Fraction(10) ** power
        rates = tuple(str(Fraction(x) * size) for x in ("0.3", "1", "0.2"))
        if abs(power) > 15:
            rates = tuple(f"{x}e{power}" for x in ("0.3", "1", "0.2"))
        yield Extreme(row, f"1e{power}", ASYMMETRIC, rates, lasting(100, float(f"1e{power}")))
    for power in (-300, -200, 200, 300):
        row = f"inertia 1e{abs(power)} and 1e-{abs(power)}"
        body = principal(*(f"{m}e{power}" for m in (3, 6, 8)))
        yield Extreme(row, f"1e{power}", body, (0.3, 1, 0.2), lasting(100, 1))
    for a, b in ((200, 100), (-200, -100), (200, -100), (-200, 100), (200, 15), (-200, -15)):
        body = principal(*(f"{m}e{a}" for m in (3, 6, 8)))
        rates = tuple(f"{x}e{b}" for x in ("0.3", "1", "0.2"))
        row = "inertia and rates both far from 1"
        yield Extreme(row, f"1e{a}, 1e{b}", body, rates, lasting(100, float(f"1e{b}")))


def horizons(full: bool) -> Iterator[Extreme]:
    """From a thousandth of a radian on."""
    longest = 8 if full else 6
    for power in (-3, 0, 3, 6, 7, 8, 9):
        columns = ANY if power <= 3 else [c for c in ANY if c == "closed_form" or power <= longest]
        end = lasting(10.0**power, 1)
        yield Extreme(f"1e{power} rad", "", principal(1, 2, 3), (0.5, 0.25, 1), end, columns=columns)


def euler_singularities() -> Iterator[Extreme]:
    """Starts in, beside and on the way through the singularity of every sequence."""
    for sequence in SEQUENCES:
        proper = sequence[0] == sequence[2]
        axis = "xyz".index(sequence[1])
        spin = tuple(1.0 if i == axis else 0.0 for i in range(3))
        general = tuple(1.0 if i == axis else 0.3 for i in range(3))
        for end in (0, 1):
            if proper:
                exact = "0" if not end else "180 deg"
                before = "-1 rad" if not end else "2.141592653589793238462643383279502884197 rad"
            else:
                exact = "90 deg" if end else "-90 deg"
                turn = "0.570796326794896619231321691639751442099 rad"
                before = turn if end else "-2.570796326794896619231321691639751442099 rad"
            for name, angles, rates in (
                ("starts in it", ("0.3", exact, "0.4"), general),
                ("spins through it", ("0", before, "0"), spin),
                ("passes it", ("0.01", before, "1e-8"), general),
            ):
                yield Extreme(
                    f"singularity: {name}", f"{sequence}, {exact}", ASYMMETRIC, rates, lasting(50, 1.0),
                    sequence=sequence, angles=angles, columns=EULER,
                )  # fmt: skip


def spins() -> Iterator[Extreme]:
    """Rest, and spin about each axis."""
    yield Extreme("zero spin", "at rest", ASYMMETRIC, (0, 0, 0), 100.0)
    yield Extreme("zero spin", "at rest, short", ASYMMETRIC, (0, 0, 0), 2.0**-60)
    for i, axis in enumerate(("least", "middle", "largest")):
        for size in (1, -1):
            rates = tuple(size if i == j else 0 for j in range(3))
            yield Extreme("spin about one axis", f"{size:+d} {axis}", ASYMMETRIC, rates, lasting(200, 1))


def denormals() -> Iterator[Extreme]:
    """Numbers below 2^-1022, alone and beside normal ones."""
    row = "denormal inputs"
    tiny = "5e-324"
    yield Extreme(row, "all rates", ASYMMETRIC, (tiny, tiny, tiny), 1e300)
    yield Extreme(row, "all moments", principal("3e-310", "6e-310", "8e-310"), (0.3, 1, 0.2), 100.0)
    yield Extreme(row, "one rate", ASYMMETRIC, (tiny, 1, 0.2), 100.0)
    yield Extreme(row, "beside the middle axis", ASYMMETRIC, (tiny, 1, tiny), 100.0)
    yield Extreme(row, "beside the largest axis", ASYMMETRIC, (tiny, tiny, 1), 100.0)
    yield Extreme(row, "one moment", principal(tiny, 1, 1), (0, 1, 0.2), 100.0)
    yield Extreme(row, "one moment, spinning", principal("1e-310", 1, 1), (0.3, 1, 0.2), 100.0)
    yield Extreme(row, "below denormal", ASYMMETRIC, ("1e-400", 1, 0.2), 100.0)
    yield Extreme(row, "quaternion", ASYMMETRIC, (0.3, 1, 0.2), 100.0, quaternion=("1e-310", 0, tiny, 0))
    yield Extreme(row, "end", ASYMMETRIC, (0.3, 1, 0.2), 2.0**-1060)
    yield Extreme(row, "past the largest double", ASYMMETRIC, ("1e400", 1, 1), 1e-300)
    yield Extreme(row, "gravity", top("1/2"), (0.1, 0.8, 3), 20.0, gravity=5e-324)


def tolerances() -> Iterator[Extreme]:
    """From 1 to far below eps."""
    columns = [c for c in ANY if c != "closed_form"]
    for row, powers in (
        ("1 and 0.1", (0, -1)), ("1e-2 to 1e-9", (-2, -3, -6, -9)),
        ("1e-12 to 1e-16", (-12, -15, -16)), ("1e-17 to 1e-300", (-17, -20, -30, -100, -300)),
    ):  # fmt: skip
        for power, radians in product(powers, (10.0, 1000.0)):
            yield Extreme(
                f"tolerance {row}", f"1e{power}, {radians:g} rad", ASYMMETRIC, (0.3, 1, 0.2),
                lasting(radians, 1), tolerance=float(f"1e{power}"), columns=columns,
            )  # fmt: skip


def tops() -> Iterator[Extreme]:
    """Heavy symmetric tops next to what is singular for them."""
    for digits in (3, 9, 15):
        d = f"1e-{digits}"
        for name, body, rates, start in (
            ("upright, unstable", top("1/2"), (d, 0, 1), UPRIGHT),
            ("upright, stable", top("1/2"), (d, 0, 5), UPRIGHT),
            ("pendulum short of the top", top("1/2", -1), (2, 0, d), UPRIGHT),
            ("hanging", top("1/2", -1), (d, d, 1), UPRIGHT),
            ("weak gravity", top("1/2", d), (0.1, 0.8, 3), TILTED),
            ("rod as a top", top(d), (0.1, 0.8, f"1e{min(digits, 6)}"), TILTED),
        ):
            end = 1e-4 if name == "rod as a top" and digits > 3 else 20.0
            yield Extreme(f"heavy top, {name}", f"1e-{digits}", body, rates, end, start, gravity=1.0)
    for name, rates, start in (
        ("asleep", (0, 0, -1), UPRIGHT), ("cusps", (0, 0, 3), TILTED),
        ("released from rest", (0, 0, 0), TILTED), ("pendulum to the top", (2, 0, 0), UPRIGHT),
    ):  # fmt: skip
        height = -1 if "pendulum" in name else 1
        yield Extreme("heavy top, other", name, top("1/2", height), rates, 20.0, start, gravity=1.0)


Uniform = Callable[[float, float], float]
"""A number between two others: of a generator, or drawn by hypothesis."""


def random_case(uniform: Uniform) -> tuple[Extreme, Way]:
    """A free body, and how to run it."""

    def one_of(choices: Sequence[str]) -> str:
        return choices[min(int(uniform(0, len(choices))), len(choices) - 1)]

    column = one_of(ANY)
    precision = one_of(("double", "double", "single", "extended"))
    rates = [_signed(uniform) * 10 ** uniform(-15, 0) for _ in range(3)]
    rates[min(int(uniform(0, 3)), 2)] = 1.0
    size = Fraction(10) ** round(uniform(-15, 15))
    written = tuple(str(Fraction(w) * size) for w in rates)
    # steps beyond double cost ten times as much
    longest = 9.0 if column == "closed_form" else 3.0 if precision == "extended" else 4.0
    sequence = one_of(SEQUENCES)
    middle = 10 ** uniform(-15, 0.2) + (0 if sequence[0] == sequence[2] else math.pi / 2)
    tolerance = None if uniform(0, 1) < 0.75 or column == "closed_form" else 10 ** uniform(-18, 0)
    scene = Extreme(
        "random", "", _body(uniform), written, lasting(10 ** uniform(-3, longest), float(size)),
        tolerance=tolerance, sequence=sequence,
        angles=(repr(uniform(-3, 3)), repr(middle), repr(uniform(-3, 3))),
    )  # fmt: skip
    return scene, Way(column, precision, column in ("rates", "quaternion") and uniform(0, 1) < 0.2)


def _signed(uniform: Uniform) -> float:
    return 1.0 if uniform(0, 1) < 0.5 else -1.0


def _body(uniform: Uniform) -> str:
    """Moments that a body can have, to the last digit: a, b and between abs(a - b) and a + b."""
    smaller = Fraction(10 ** uniform(-15, 0))
    share = Fraction(10 ** uniform(-15, 0))
    if uniform(0, 1) < 0.5:
        share = 1 - share
    moments = [Fraction(1), smaller, (1 - smaller) + share * 2 * smaller]
    turn = min(int(uniform(0, 3)), 2)
    size = round(uniform(-200, 200))
    return principal(*(_written(m, size) for m in moments[turn:] + moments[:turn]))


def _written(value: Fraction, power: int) -> str:
    """To 45 decimals, enough for 1e-15 of 1e-15 in the precisions that are tried."""
    return f"{value.numerator * 10**45 // value.denominator}e{power - 45}"
