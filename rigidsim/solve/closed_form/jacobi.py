"""Jacobi's cn, sn and dn of an argument of any size, as quotients of theta functions (DLMF 22.2, 20.7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.solve.closed_form.arithmetic import Arithmetic
from rigidsim.solve.closed_form.theta import Lattice, theta
from rigidsim.solve.closed_form.theta_quotients import Quotient


@dataclass(frozen=True)
class Jacobi:
    """Jacobi's three functions on a lattice.

    Attributes:
        cn, sn, dn: within half a period 2K; cn and dn are the real part of theirs, sn the imaginary one.
    """

    cn: Quotient
    sn: Quotient
    dn: Quotient

    def at(self, arithmetic: Arithmetic, count: Any, rest: Any) -> tuple[Any, Any, Any]:
        """cn, sn and dn after ``count`` half periods (see ``Argument.reduced``)."""
        z = arithmetic.number(self.cn.above.per_turn) * rest
        cn, sn, dn = (f.at(arithmetic, z) for f in (self.cn, self.sn, self.dn))
        sign = 1 - 2 * (count - 2 * arithmetic.floor(count / 2))  # each half period reverses cn and sn
        return sign * cn[0], sign * sn[1], dn[0]


def jacobi(lattice: Lattice) -> Jacobi:
    """Jacobi's functions, normalised by cn = dn = d sn/du = 1 at u = 0."""
    zero = lattice.context.zero
    kinds, below = ((2, 1, 3), 4) if lattice.circular else ((4, 1, 3), 2)
    denominator = theta(lattice, below, zero)
    start = denominator.value(zero)[0].real
    functions = []
    for kind in kinds:
        above = theta(lattice, kind, zero)
        value, slope = above.value(zero)
        size = value.real
        if kind == 1:
            size = slope.imag * above.per_turn / (2 * lattice.quarter if lattice.periodic else 1)
        functions.append(Quotient(above, denominator, start / size))
    return Jacobi(*functions)
