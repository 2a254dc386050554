"""Two charts of one attitude: the requested Euler sequence, and a partner whose singularity is far from its
own.

A sequence ijk is singular where body axis k lies along space axis i: its factor is f = sqrt(1 - R_ik^2),
|sin| of the middle angle for proper sequences (k = i) and |cos| for the others. The partner keeps i and j and
ends with another axis k': its factor is f' = sqrt(1 - R_ik'^2), and since the rows of R are unit vectors,
f^2 + f'^2 >= 1. Where one chart breaks down, the other is at its best. A proper sequence's partner is a
Tait-Bryan one (zxz: zxy), and the other way round (xyz: xyx).

Both begin with the same two turns, so that the way across depends on the second and third angle alone:
R_j(b) R_k(c) = R_i(d) R_j(b') R_k'(c') and a' = a + d.
"""

from __future__ import annotations

from typing import Any

from rigidsim.scene.attitude import AXES, parity


def is_proper(sequence: str) -> bool:
    """Whether a sequence is proper, that is, whether its outer axes are the same."""
    return sequence[0] == sequence[2]


def partner_sequence(sequence: str) -> str:
    """The sequence that a run changes to near the singularity of ``sequence``; the relation is mutual."""
    first, second = sequence[0], sequence[1]
    last = (set(AXES) - {first, second}).pop() if is_proper(sequence) else first
    return first + second + last


def across(sequence: str, angles: list[Any], functions: Any, branch: Any = 1.0) -> list[Any]:
    """The same attitude in the partner's angles; the first isn't reduced to one turn.

    No digits are lost anywhere: small sines come from small sines. Every attitude has two triples of angles;
    exactly in the partner's singularity the outer ones are those that atan2(0, 0) = 0 gives.

    Args:
        angles: angles of ``sequence``, radians.
        functions: module that provides ``sin``, ``cos``, ``sqrt`` and ``atan2``: ``math`` or ``heyoka``.
        branch: +1 for a middle angle in [0, pi] or [-pi/2, pi/2], -1 for the other triple.
    """
    first, middle, last = angles
    sine, cosine, atan2 = functions.sin, functions.cos, functions.atan2
    sb, cb, sc, cc = sine(middle), cosine(middle), sine(last), cosine(last)
    signed = float(parity(AXES.index(sequence[0]), AXES.index(sequence[1]))) * branch
    if is_proper(sequence):
        size = functions.sqrt(cb * cb + (sb * sc) * (sb * sc))
        return [
            first + atan2(branch * sc, branch * (cb * cc)),
            atan2(sb * cc, branch * size),
            atan2(-(signed * (sb * sc)), branch * cb),
        ]
    size = functions.sqrt(sb * sb + (cb * sc) * (cb * sc))
    return [
        first + atan2(signed * sc, branch * (sb * cc)),
        atan2(branch * size, cb * cc),
        atan2(-(signed * (cb * sc)), branch * sb),
    ]


def pole_of_partner(sequence: str, angles: list[float], functions: Any) -> float:
    """R_ik' at these angles of ``sequence``, which is +1 or -1 in the partner's singularity, where only the
    sum (+1) or the difference (-1) of the partner's outer angles is defined.
    """
    _, middle, last = angles
    if not is_proper(sequence):
        return float(functions.cos(middle) * functions.cos(last))
    sign = parity(AXES.index(sequence[0]), AXES.index(sequence[1]))
    return float(sign * (functions.sin(middle) * functions.cos(last)))


def singular_factor(sequence: str, middle: float, functions: Any) -> float:
    """Factor that vanishes in the singularity; negative on the branch of the other triple."""
    return float(functions.sin(middle) if is_proper(sequence) else functions.cos(middle))
