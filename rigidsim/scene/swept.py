"""Numbers of many members of a sweep at once, with which one scene is worked out for all that share it.

A swept number is an array, with a value for each member. Scene and model are worked out with it as with any
other number. Whatever they decide by it (a comparison, a value taken as a float) is decided by the first
member: the others that decide otherwise are left out (``agree``), and are worked out apart. Numbers remember
how they were made, so that later members go through the same operations and decisions alone.

heyoka's arrays of multiprecision numbers (MPFR) round sums, products, quotients and roots as mpmath does, so
that each member's numbers equal its own build's in every bit. Other functions are mpmath's own, once for
each of the values that they are taken of.
"""

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import partial, reduce
from typing import Any

import numpy as np
from mpmath.libmp import from_man_exp

from rigidsim.scene.exact import ExactNumber

_FAILURES = (ZeroDivisionError, ValueError, OverflowError, TypeError)
"""Errors of mpmath for numbers outside the range of an operation (of complex numbers none is the larger); the
member's own build reports them.
"""


class Untraceable(Exception):
    """Raised if something is asked of a swept number that arrays can't give: its members are run one by
    one.
    """


class Swept:
    """A number of each member, in a context that knows which members decide as the first one does.

    Attributes:
        opposite: the number with the other sign, where there is one already.
        base: the number whose square it is.
    """

    __slots__ = ("_work", "_worked_out", "base", "context", "opposite")

    def __init__(self, context: "SweptContext", work: Callable[[], Any]) -> None:
        self.context, self._work, self._worked_out = context, work, None
        self.opposite: Swept | None = None
        self.base: Swept | None = None

    @property
    def values(self) -> Any:
        """heyoka's reals, (members,), worked out when something needs them."""
        if self._worked_out is None:
            with np.errstate(all="ignore"):
                self._worked_out = self._work()
        return self._worked_out

    def forget(self) -> None:
        """Have it worked out again, for other members."""
        self._worked_out = None

    @property
    def first(self) -> Any:
        """The first member's value, an mpf."""
        try:
            return self.context.mpf_of(self.values[0])
        except _FAILURES:
            raise self.context.out_of_range() from None

    def decided(self) -> Any:
        """The first member's value, which leaves out the members that don't share it."""
        self.context.decide(operator.eq, self, self.first)
        return self.first

    def __add__(self, other: Any) -> Any:
        other = self.context.convert(other)
        if other is self.opposite:
            return self.context.zero
        return self if _is(other, 0) else self.context.made(operator.add, self, other)

    __radd__ = __add__

    def __neg__(self) -> Any:
        if self.opposite is None:
            self.opposite = self.context.made(operator.neg, self)
            self.opposite.opposite = self
        return self.opposite

    def __pos__(self) -> Any:
        return self

    def __sub__(self, other: Any) -> Any:
        other = self.context.convert(other)
        if other is self:
            return self.context.zero
        return self if _is(other, 0) else self.context.made(operator.sub, self, other)

    def __rsub__(self, other: Any) -> Any:
        other = self.context.convert(other)
        return -self if other == 0 else self.context.made(operator.sub, other, self)

    def __mul__(self, other: Any) -> Any:
        other = self.context.convert(other)
        if _is(other, 0):
            return self.context.zero
        if _is(other, 1):
            return self
        if _is(other, -1):
            return -self
        found = self.context.made(operator.mul, self, other)
        if other is self:
            found.base = self
        return found

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        other = self.context.convert(other)
        if _is(other, 1):
            return self
        if (other is self or other is self.opposite) and self != 0:
            return self.context.mpf(1 if other is self else -1)
        return self.context.made(_quotient, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        other = self.context.convert(other)
        return self.context.zero if other == 0 and self != 0 else self.context.made(_quotient, other, self)

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, Swept):
            exponent = exponent.decided()
        if exponent == 0.5:
            return self.context.sqrt(self)
        if exponent != int(exponent):
            raise Untraceable("a fractional power")
        if exponent < 0:
            return 1 / self ** (-exponent)
        return self * self if exponent == 2 else self.context.each(operator.pow, self, exponent)

    def __rpow__(self, base: Any) -> Any:
        raise Untraceable("a swept power")

    def __abs__(self) -> Any:
        return self.context.made(np.abs, self)

    def __float__(self) -> float:
        return float(self.decided())

    def __int__(self) -> int:
        return int(self.decided())

    def __hash__(self) -> int:
        return 0  # whether two are equal is always decided

    def __eq__(self, other: object) -> bool:
        if other is None or isinstance(other, str):
            return False
        return other is self or self.context.decide(operator.eq, self, other)

    def __lt__(self, other: Any) -> bool:
        return self.context.decide(operator.lt, self, other)

    def __gt__(self, other: Any) -> bool:
        return self.context.decide(operator.lt, other, self)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __bool__(self) -> bool:
        return self != 0

    def __getattr__(self, name: str) -> Any:
        """What numbers have besides; dunder names are asked for by way of trial."""
        if name.startswith("_"):
            raise AttributeError(name)
        raise Untraceable(name)

    def _refused(self, *_: Any) -> Any:
        raise Untraceable("an operation that arrays don't know")

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _refused
    __round__ = __trunc__ = __floor__ = __ceil__ = __index__ = __complex__ = __format__ = _refused


def _is(value: Any, number: int) -> bool:
    """Whether a value is a certain number for all members, whatever they decide."""
    return not isinstance(value, Swept) and value == number


def _quotient(a: Any, b: Any) -> Any:
    found = a / b
    found[np.broadcast_to(b == b - b, found.shape)] = np.nan
    return found


def plain(value: Any) -> Any:
    """The plain number of one that may be swept, for pictures and messages: the first member's."""
    return value.first if isinstance(value, Swept) else value


def called(function: Callable[..., Any], context: Any, *values: Any) -> Any:
    """``function(context, *values)`` as one operation, within which nothing is decided for other members."""
    if not any(isinstance(x, Swept) for x in values):
        return function(context, *values)
    return context.each(function, *values, given=(context.plain,))


class SweptContext:
    """An mpmath context (``plain``) whose functions take swept numbers as well.

    Attributes:
        agree: mask of the members that have decided everything so far as the first one does.
    """

    def __init__(self, context: Any, columns: Sequence[np.ndarray], members: int) -> None:
        from heyoka import real  # which few configs need

        self.plain, self._real = context, real
        self._known: dict[Any, Swept] = {}
        self._decided: dict[int, tuple[Swept, tuple[Any, Any], bool]] = {}
        self.begin(columns, members)

    def begin(self, columns: Sequence[np.ndarray], members: int) -> None:
        """Take other members, and find those that decide everything as the first one of all did."""
        self._columns, self.agree = columns, np.ones(members, dtype=bool)
        for decision in self._decided.values():
            if self.agree.any():
                self._follow(*decision)

    def forget(self) -> None:
        """Keep no number of these members; the next ones are worked out anew."""
        for number in self._known.values():
            number.forget()

    def column(self, place: int) -> Swept:
        """The swept number of a column."""
        return self._known.setdefault(("column", place), Swept(self, lambda: self._columns[place]))

    # --- arrays -----------------------------------------------------------------------------------------

    def real_of(self, value: Any) -> Any:
        """A number as one of heyoka's; nan if it isn't a finite real number."""
        if not hasattr(value, "_mpf_"):  # complex
            return self._real(math.nan, self.plain.prec)
        sign, mantissa, exponent, _ = value._mpf_
        if not mantissa and exponent:  # mpmath's codes of infinities and nan
            return self._real(math.nan, self.plain.prec)
        whole = self._real(int(-mantissa if sign else mantissa), self.plain.prec)
        return whole * self._real(2.0, self.plain.prec) ** int(exponent)

    def mpf_of(self, value: Any) -> Any:
        """One of heyoka's numbers as an mpf; ValueError or OverflowError far outside a double's range."""
        places = self.plain.prec - math.frexp(float(value))[1]
        whole = int(value * self._real(math.ldexp(1.0, places), self.plain.prec))
        return self.plain.make_mpf(from_man_exp(whole, -places))

    def reals(self, values: np.ndarray) -> Any:
        """Doubles as an array of heyoka's numbers."""
        return values.astype(self._real) * self._real(1.0, self.plain.prec)

    def doubles(self, value: Any) -> np.ndarray:
        """A number rounded once, (members,); nan if it is outside a double's range."""
        if not isinstance(value, Swept):
            return np.full(len(self.agree), float(value))
        with np.errstate(all="ignore"):
            found = value.values.astype(np.float64) + 0.0  # zero without a sign
            tiny = (np.abs(found) < np.finfo(float).tiny) & (value.values != value.values - value.values)
        found[tiny | np.isinf(found)] = np.nan
        return found

    def made(self, function: Callable[..., Any], *operands: Any, of_arrays: Any = None) -> Swept:
        """An operation on swept and plain numbers, done once, by default by numpy's function of arrays."""
        key = (function, *(id(x) if isinstance(x, Swept) else x for x in operands))

        def work() -> Any:
            arrays = (x.values if isinstance(x, Swept) else self.real_of(x) for x in operands)
            return (of_arrays or function)(*arrays)

        return self._known.setdefault(key, Swept(self, work))

    def each(self, function: Callable[..., Any], *operands: Any, given: Sequence[Any] = ()) -> Swept:
        """An operation that arrays lack, once for each of the values that there are, after ``given`` ones."""
        one = partial(self._one_by_one, partial(function, *given))
        return self.made(function, *map(self.convert, operands), of_arrays=one)

    def _one_by_one(self, function: Callable[..., Any], *operands: Any) -> Any:
        codes: np.ndarray = np.zeros(1, dtype=np.int64)
        for numbers in operands:
            distinct, code = np.unique(numbers, return_inverse=True)
            codes = codes * len(distinct) + code
        _, first, places = np.unique(codes, return_index=True, return_inverse=True)
        found = []
        for numbers in zip(*(np.broadcast_to(x, codes.shape)[first] for x in operands), strict=True):
            try:
                found.append(self.real_of(function(*map(self.mpf_of, numbers))))
            except _FAILURES:
                found.append(self._real(math.nan, self.plain.prec))
        return np.array(found)[places]

    def decide(self, compare: Callable[[Any, Any], Any], left: Any, right: Any) -> bool:
        """Compare as the first member does, and leave out whoever does so with another outcome, or can't."""
        pair = self.convert(left), self.convert(right)
        outcomes = self.made(compare, *pair)
        if id(outcomes) not in self._decided:
            self._decided[id(outcomes)] = outcomes, pair, bool(outcomes.values[0])
            self._follow(*self._decided[id(outcomes)])
        return self._decided[id(outcomes)][2]

    def _follow(self, outcomes: Swept, pair: tuple[Any, Any], first: bool) -> None:
        self.agree &= outcomes.values == first
        for x in pair:
            self.agree &= np.isfinite(x.values if isinstance(x, Swept) else self.real_of(x))

    def out_of_range(self) -> Untraceable:
        """The error for a number of the first member alone, whatever the others have."""
        self.agree[:] = np.arange(len(self.agree)) == 0
        return Untraceable("a number outside the range of an operation, or of double precision")

    # --- as mpmath's contexts have them -----------------------------------------------------------------

    def convert(self, value: Any) -> Any:
        """A number, swept or plain."""
        if isinstance(value, Swept):
            return value
        if isinstance(value, Fraction):
            return self.plain.mpf(value.numerator) / self.plain.mpf(value.denominator)
        try:
            return +self.plain.convert(value)  # of pi, a number
        except TypeError:
            raise Untraceable(f"arithmetic with a {type(value).__name__}") from None

    mpf = convert

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.plain, name)
        if not callable(found) or name in ("zero", "one", "pi", "inf", "nan", "eps"):
            return found

        def function(*values: Any, **options: Any) -> Any:
            if not any(isinstance(v, Swept) for v in values):
                return found(*values, **options)
            return self.each(found, *values)

        return function

    def sqrt(self, value: Any) -> Any:
        """Square root; of a square it is exact."""
        if not isinstance(value, Swept):
            return self.plain.sqrt(value)
        if value.base is None:
            return self.made(np.sqrt, value)
        return value.base if value.base >= 0 else -value.base

    def maximum(self, values: Iterable[Any]) -> Any:
        """The largest number, without deciding which of them it is."""
        return reduce(partial(self._extreme, np.maximum, max), values)

    def minimum(self, values: Iterable[Any]) -> Any:
        """The smallest number, without deciding which of them it is."""
        return reduce(partial(self._extreme, np.minimum, min), values)

    def _extreme(self, of_arrays: Any, of_numbers: Any, a: Any, b: Any) -> Any:
        if not isinstance(a, Swept) and not isinstance(b, Swept):
            return of_numbers(a, b)
        return a if a is b else self.made(of_arrays, self.convert(a), self.convert(b))

    def nstr(self, value: Any, *arguments: Any, **options: Any) -> str:
        """The first member's number as text, for messages."""
        return str(self.plain.nstr(plain(value), *arguments, **options))

    def ldexp(self, value: Any, exponent: Any) -> Any:
        """``value * 2**exponent``."""
        if isinstance(exponent, Swept):
            return value * self.made(operator.pow, self.plain.mpf(2), exponent)
        if isinstance(value, Swept):
            return value * self.plain.ldexp(1, int(exponent))
        return self.plain.ldexp(value, int(exponent))

    def frexp(self, value: Any) -> tuple[Any, Any]:
        """``(m, e)`` of ``value = m * 2**e`` with m from 0.5 to below 1 in size; no zero is allowed."""
        if not isinstance(value, Swept):
            mantissa, whole = self.plain.frexp(value)
            return mantissa, whole
        exponent = self.made(np.frexp, value, of_arrays=self._exponent)
        return self.ldexp(value, -exponent), exponent

    def _exponent(self, value: Any) -> Any:
        """The smallest e with abs(value) < 2**e."""
        size = np.abs(value)
        doubles = size.astype(np.float64)
        exponents = np.frexp(doubles)[1]
        # a number just below a power of two is rounded to it
        exponents -= size < self.reals(np.ldexp(1.0, exponents - 1))
        return self.reals(np.where((doubles > 0) & np.isfinite(doubles), exponents, np.nan))

    def mag(self, value: Any) -> Any:
        """Binary magnitude; used only for limits, for which the first member's is taken."""
        return self.plain.mag(plain(value))

    def isint(self, value: Any) -> bool:
        """Whether a number is whole, decided by the first member."""
        return bool(self.plain.isint(value.decided() if isinstance(value, Swept) else value))


# --- swept numbers as written -------------------------------------------------------------------------------


class SweptExact(ExactNumber):
    """A swept number as written in a config; ``exact`` is the first member's."""

    def __init__(self, number: Swept, exact: ExactNumber) -> None:
        for name, value in (("number", number), ("exact", exact), ("assumed", exact.assumed)):
            object.__setattr__(self, name, value)

    number: Swept
    exact: ExactNumber

    @property
    def swept(self) -> bool:
        """True."""
        return True

    def at(self, context: Any) -> Any:
        """All members' numbers in their context, the first member's in any other."""
        return self.number if isinstance(context, SweptContext) else self.exact.at(context)

    @property
    def rational(self) -> Fraction:
        """The first member's value, which leaves out the members that don't share it."""
        self.number.decided()
        return self.exact.rational

    @property
    def pi_power(self) -> int:
        """Power of pi, the same for all members."""
        return self.exact.pi_power

    def fraction(self, context: Any) -> Fraction:
        """See ``rational``."""
        self.number.decided()
        return self.exact.fraction(context)

    def __float__(self) -> float:
        return float(self.exact)

    @property
    def alone(self) -> ExactNumber:
        """The number itself."""
        return self

    @property
    def sign(self) -> int:
        """Sign, decided by the first member."""
        return 0 if self.number == 0 else (1 if self.number > 0 else -1)

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ExactNumber) and self.number == other.at(self.number.context)


_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "negative": lambda x, _: -x,
    "sum": operator.add,
    "product": operator.mul,
    "quotient": operator.truediv,
    "power": operator.pow,
}


def exactly(name: str, numbers: Sequence[ExactNumber]) -> ExactNumber | None:
    """Result of an operation on numbers of which some are swept; None if it isn't a rational times a power of
    pi.
    """
    context = next(n.number.context for n in numbers if isinstance(n, SweptExact))
    a, b = numbers[0], numbers[-1]
    x, y = a.at(context), b.at(context)
    p, q = (n.exact.rational if isinstance(n, SweptExact) else n.rational for n in (a, b))
    if name == "power":
        whole = not isinstance(b, SweptExact) and q.denominator == 1 and not b.pi_power and abs(q) <= 64
        if not whole or (q < 0 and x == 0):
            return None
    elif (name == "sum" and a.pi_power != b.pi_power) or (name == "quotient" and y == 0):
        return None
    turns = {
        "product": a.pi_power + b.pi_power,
        "quotient": a.pi_power - b.pi_power,
        "power": a.pi_power * int(q),
    }
    combined = _OPERATORS.get(name)
    if combined is None:
        return None
    made, found = combined(x, y), ExactNumber(combined(p, q), turns.get(name, a.pi_power))
    return SweptExact(made, found) if isinstance(made, Swept) else found
