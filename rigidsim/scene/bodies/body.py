"""Working out ``[body]``: mass, centre of mass, inertia tensor and principal axes about the reference point.

The reference point is the one that the body turns about: the centre of mass, unless the config names
another. Positions in the result are body axes, metres, from the reference point.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from pydantic import BaseModel

from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, diagonal, eigen, multiply, transpose
from rigidsim.scene.bodies import table as body_table
from rigidsim.scene.bodies.gravity_field import GravityField
from rigidsim.scene.bodies.outside import OuterSurface
from rigidsim.scene.bodies.pieces import (
    drawn,
    parallel_axis,
    pieces_of,
    positive,
    reference_point,
    refusal,
    refuse_dimensions,
)
from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.exact import ExactNumber, exact_decimal, parse_number
from rigidsim.scene.paths import numbers
from rigidsim.scene.tracing.numbers import plain

SOURCES = ("principal_moments", "inertia_tensor", "points", "shape", "parts", "preset")
# A tensor that was printed by a double-precision program obeys the triangle inequality to about this.
_ROUNDING_OF_INPUT = 1e-14

_DIGITS_OF_DOUBLES = range(15, 18)
_DOUBLE = Fraction(1, 2**52)
_ROUNDINGS = 16
"""Spacings of the largest moment by which equal moments may differ. An element of R I R^T that was worked out
in the precision in which it was written is off by some three half spacings (sums of three products), a moment
by the spectral norm of these errors, at most three times the largest, and the difference of two by twice
that: nine spacings. The rest is for an R that isn't quite orthogonal.
"""


@dataclass(frozen=True)
class RigidBody:
    """The rigid body as mechanics needs it; numbers are mpf of the scene's context.

    Attributes:
        mass: kg, or None if the config gives none.
        center_of_mass: body axes, from the reference point, m.
        inertia: 3x3 tensor about the reference point, body axes, kg m^2.
        principal_moments: its eigenvalues (a diagonal tensor keeps the order of its axes).
        principal_axes: the matching unit axes as rows, body axes, right-handed.
        drawing: solids for the pictures (see ``rigidsim.look.solids``), as plain JSON values.
        source: key that the inertia came from, with the preset's reference if there is one.
        gravity: its gravity beyond the inertia tensor; None if the config gives none.
        surfaces: its outside, as light and air meet it.
    """

    mass: Any | None
    center_of_mass: Vector
    inertia: Matrix
    principal_moments: Vector
    principal_axes: Matrix
    source: str
    drawing: list[dict[str, Any]] = field(default_factory=list)
    gravity: GravityField | None = None
    surfaces: tuple[OuterSurface, ...] = ()


def build_body(
    table: body_table.Body, context: Any, sequence: str = "zxz", moments: Vector | None = None
) -> RigidBody:
    """Work out the body of ``[body]``.

    Args:
        sequence: of Euler angles for parts that name none.
        moments: principal moments at the start, if some are expressions (mpf).
    """
    given = [name for name in SOURCES if getattr(table, name) is not None]
    preset = PRESETS[str(table.preset)] if table.preset is not None else None
    own = [name for name in given if name != "preset"]  # they take the place of a preset's moments
    if len(own) > 1 or not given:
        found = " and ".join(own) if own else "no source of inertia"
        beside = ", with a preset at most one of the others" if preset else ""
        raise refusal("", f"given {found}; exactly one of {', '.join(SOURCES)} is needed{beside}")
    source = own[0] if own else "preset"
    if source != "shape":
        refuse_dimensions(table, (), "which only a shape has", "")
    if source in ("principal_moments", "inertia_tensor") or (
        source == "preset" and preset and not preset.parts
    ):
        return _from_tensor(table, source, context, moments)
    if table.center_of_mass is not None:
        what = f"it follows from {source}; remove it, and say with reference what the body turns about"
        raise refusal("center_of_mass", what)
    if source in ("points", "parts") and table.mass is not None:
        raise refusal("mass", f"it follows from {source}; remove it")
    return _from_pieces(table, source, context, sequence)


def _from_tensor(
    table: body_table.Body, source: str, context: Any, moments: Vector | None = None
) -> RigidBody:
    if table.reference is not None:
        what = f"only shape, points and parts take it; {source} is taken about the point that the body turns "
        raise refusal("reference", what + "about already: remove it")
    zero = [context.zero] * 3
    center = [x.at(context) for x in table.center_of_mass] if table.center_of_mass else zero
    mass = positive(table.mass, "mass", "mass", context) if table.mass is not None else None
    drawing: list[dict[str, Any]] = []
    preset = PRESETS[str(table.preset)] if table.preset is not None else None
    if source == "preset" and preset:
        inertia = preset.inertia(context, mass)
    elif source == "principal_moments":
        assert table.principal_moments is not None
        numbers = [x for x in table.principal_moments if isinstance(x, ExactNumber)]
        inertia = diagonal(moments or [x.at(context) for x in numbers])
    else:
        assert table.inertia_tensor is not None
        _check_symmetric(table.inertia_tensor)
        inertia = [[x.at(context) for x in row] for row in table.inertia_tensor]
    if preset and preset.parts:
        whole = build_body(body_table.Body.model_validate({"preset": table.preset}), context)
        mass, drawing = whole.mass if mass is None else mass, whole.drawing
    elif preset:
        mass = preset.own_mass(context) if mass is None else mass
        if preset.semi_axes:
            axes = [float(parse_number(a, "m").at(context)) for a in preset.semi_axes]
            name = preset.drawn_as or str(table.preset)
            drawing = [{**drawn("ellipsoid", {"semi_axes": axes}, center), "name": name}]
    return _finish(context, table, source, _told(table, source), mass, center, inertia, drawing)


def _told(table: body_table.Body, source: str) -> str:
    """Where the inertia comes from, with a preset's reference and what else stands in its place."""
    if table.preset is None:
        return source
    told = f"preset {table.preset} ({PRESETS[str(table.preset)].source})"
    if source != "preset":
        return f"{source} beside {told}"
    return f"{told}, with the mass of the config" if table.mass is not None else told


def _check_symmetric(tensor: list[list[ExactNumber]]) -> None:
    for i in range(3):
        for j in range(i):
            if tensor[i][j] != tensor[j][i]:
                raise refusal(
                    f"inertia_tensor[{i}][{j}]",
                    f"given {float(tensor[i][j])!r}, but [{j}][{i}] is {float(tensor[j][i])!r}; "
                    "the tensor must be symmetric: write the same number twice",
                )


def _from_pieces(table: body_table.Body, source: str, context: Any, sequence: str) -> RigidBody:
    pieces = pieces_of(
        _with_parts(table, source), "parts" if source == "preset" else source, context, sequence
    )
    total = sum((piece.mass for piece in pieces), context.zero)
    if source == "preset" and table.mass is not None:  # of the same shape
        mass = positive(table.mass, "mass", "mass", context)
        for piece in pieces:
            piece.mass *= mass / total
            piece.inertia = [[x * mass / total for x in row] for row in piece.inertia]
        total = sum((piece.mass for piece in pieces), context.zero)
    center = [sum((p.mass * p.position[i] for p in pieces), context.zero) / total for i in range(3)]
    reference = reference_point(table, source, center, context)
    inertia = diagonal([context.zero] * 3)
    drawing = []
    for piece in pieces:
        arm = [x - r for x, r in zip(piece.position, reference, strict=True)]
        shifted = parallel_axis(piece.inertia, piece.mass, arm)
        inertia = [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(inertia, shifted, strict=True)]
        drawing.append({**piece.drawing, "position": [float(plain(x)) for x in arm]})
        if piece.drawing["solid"] == "point":
            drawing[-1]["dimensions"] = {"mass_fraction": float(plain(piece.mass / total))}
    center = [c - r for c, r in zip(center, reference, strict=True)]
    return _finish(context, table, source, _told(table, source), total, center, inertia, drawing)


def _with_parts(table: body_table.Body, source: str) -> body_table.Body:
    """The table with what its preset lends it: parts, or the mass of a shape."""
    preset = PRESETS[str(table.preset)] if table.preset is not None else None
    if preset and source == "preset":
        parts = [body_table.Part.model_validate(dict(part)) for part in preset.parts]
        return table.model_copy(update={"parts": parts})
    if preset and source == "shape" and table.mass is None and preset.mass:
        return table.model_copy(update={"mass": parse_number(preset.mass, "kg")})
    return table


def _finish(
    context: Any,
    table: body_table.Body,
    source: str,
    described: str,
    mass: Any,
    center: Vector,
    inertia: Matrix,
    drawing: list[dict[str, Any]],
) -> RigidBody:
    moments, axes = eigen(context, inertia)
    if any(inertia[i][j] != 0 for i in range(3) for j in range(i)):  # axes that follow from the numbers
        inertia, moments, axes = merged(context, inertia, moments, axes, rounding_of(table))
    largest = max(abs(m) for m in moments)
    if largest == 0:
        raise refusal(source, "all moments are zero; a body that turns needs inertia about some axis")
    slack = largest * context.mpf(_ROUNDING_OF_INPUT)
    tiny = largest * context.mpf(2) ** (16 - context.prec)
    moments = [context.zero if abs(m) < tiny else m for m in moments]
    listed = ", ".join(context.nstr(m, 12) for m in moments)
    if min(moments) < 0:
        raise refusal(source, f"principal moments {listed}: a moment of inertia can't be negative")
    if sorted(moments)[1] == 0:
        raise refusal(source, f"principal moments {listed}: at most one can be zero (a rod's)")
    small, middle, large = sorted(moments)
    if small + middle < large - slack:
        raise refusal(
            source,
            f"principal moments {listed}: the largest is more than the sum of the other two "
            f"by {context.nstr(large - small - middle, 6)}, which no mass distribution allows "
            "(I1 + I2 >= I3)",
        )
    if not drawing:
        drawing = [_equivalent_cuboid(context, mass, center, moments, axes)]
    return RigidBody(mass, center, inertia, moments, axes, described, drawing)


def _equivalent_cuboid(
    context: Any, mass: Any, center: Vector, moments: Vector, axes: Matrix
) -> dict[str, Any]:
    """The homogeneous cuboid with these moments (of unit mass if no mass is known)."""
    mass, center, moments = plain(mass), [plain(x) for x in center], [plain(m) for m in moments]
    axes = [[plain(x) for x in row] for row in axes]
    heavy = mass if mass else context.one
    total = sum(moments) / 2
    edges = [context.sqrt(max(12 * (total - m), context.zero) / heavy) for m in moments]
    longest = max(edges)
    visible = [float(max(edge, longest / 40)) for edge in edges]  # a plate stays visible edge on
    drawing = drawn("cuboid", {"size": visible}, center)
    q = attitude.quaternion_from_matrix(context, transpose(axes))
    drawing["quaternion"] = [float(x) for x in q]
    drawing["equivalent"] = True  # only its moments are known, not its shape
    return drawing


def inverse_inertia(context: Any, body: RigidBody) -> Matrix:
    """Pseudo-inverse of the tensor: about an axis without inertia (a rod's) nothing is accelerated."""
    inverse = [context.zero if m == 0 else 1 / m for m in body.principal_moments]
    return multiply(multiply(transpose(body.principal_axes), diagonal(inverse)), body.principal_axes)


def momentum(body: RigidBody, angular_velocity: Vector) -> Vector:
    """Angular momentum about the reference point, body axes."""
    return apply(body.inertia, angular_velocity)


def rounding_of(table: BaseModel) -> Fraction:
    """Relative rounding of the coarsest number of a table that looks rounded; 0 if none does."""
    given = [x for path, found in numbers(table) for x in found if path.steps[0] != "gravity_field"]
    return max(map(_rounding, given), default=Fraction(0))


def merged(
    context: Any, inertia: Matrix, moments: Vector, axes: Matrix, rounding: Fraction
) -> tuple[Matrix, Vector, Matrix]:
    """A tensor with its moments and axes (rows); moments equal to a relative ``rounding`` are made equal."""
    tiny = _ROUNDINGS * context.mpf(rounding.numerator) / rounding.denominator * max(moments)
    low, middle, high = sorted(range(3), key=lambda i: moments[i])
    if moments[high] - moments[low] <= tiny:
        mean = sum(moments, context.zero) / 3
        one = context.one
        return diagonal([mean] * 3), [mean] * 3, diagonal([one] * 3)
    lower, upper = moments[middle] - moments[low], moments[high] - moments[middle]
    if min(lower, upper) > tiny or min(lower, upper) == 0:
        return inertia, moments, axes
    single, pair = (high, (low, middle)) if lower < upper else (low, (middle, high))
    mean = (moments[pair[0]] + moments[pair[1]]) / 2
    equal = [moments[i] if i == single else mean for i in range(3)]
    axis, more = axes[single], moments[single] - mean
    return (
        [[(mean if i == j else context.zero) + more * axis[i] * axis[j] for j in range(3)] for i in range(3)],
        equal,
        axes,
    )


def _rounding(number: ExactNumber) -> Fraction:
    written = None if number.swept else exact_decimal(number.rational)
    digits = len(written.as_tuple().digits) if written else 0  # a fraction that is no decimal is exact
    if digits in _DIGITS_OF_DOUBLES:
        return _DOUBLE
    return Fraction(1, 10 ** (digits - 1)) if digits >= _DIGITS_OF_DOUBLES.stop else Fraction(0)
