"""From ``[body]`` to mass, centre of mass, inertia tensor and principal axes about the reference point.

The reference point is the one that the body turns about: the centre of mass, unless the config names
another. Positions in the result are body axes, metres, from the reference point.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import attitude, schema
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    diagonal,
    dot,
    eigen,
    multiply,
    transpose,
)
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.presets import PRESETS
from rigidsim.scene.records import dataclass
from rigidsim.scene.shapes import DIMENSIONS, SHAPES
from rigidsim.scene.validation_messages import nearest, shown

SOURCES = ("principal_moments", "inertia_tensor", "points", "shape", "parts", "preset")
# A tensor that was printed by a double-precision program obeys the triangle inequality to about this.
_ROUNDING_OF_INPUT = 1e-14


@dataclass(frozen=True)
class RigidBody:
    """What mechanics needs of a body; numbers are mpf of the scene's context.

    Attributes:
        mass: kg, or None where the config gives none.
        center_of_mass: body axes, from the reference point, m.
        inertia: 3x3 tensor about the reference point, body axes, kg m^2.
        principal_moments: its eigenvalues (a diagonal tensor keeps the order of its axes).
        principal_axes: the matching unit axes as rows, body axes, right-handed.
        drawing: solids for the pictures (see ``rigidsim.look.solids``), as plain JSON values.
        source: which key the inertia came from, with the preset's reference where there is one.
    """

    mass: Any | None
    center_of_mass: Vector
    inertia: Matrix
    principal_moments: Vector
    principal_axes: Matrix
    source: str
    drawing: list[dict[str, Any]] = field(default_factory=list)


@dataclass
class _Piece:
    """Something with mass: tensor about its own centre of mass, along the body axes."""

    mass: Any
    position: Vector
    inertia: Matrix
    drawing: dict[str, Any]


def _fail(key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[body] {key}".strip(), text))


def build_body(table: schema.Body, context: Any, sequence: str = "zxz") -> RigidBody:
    """Work out the body that ``[body]`` describes, in the context's precision.

    Args:
        sequence: of Euler angles of parts that name none.

    Raises:
        ConfigError: not exactly one source of inertia, a dimension missing or foreign, a tensor that no
            body has (asymmetric, negative, against the triangle inequality), a contradiction.
    """
    given = [name for name in SOURCES if getattr(table, name) is not None]
    if len(given) != 1:
        found = " and ".join(given) if given else "no source of inertia"
        raise _fail("", f"given {found}; exactly one of {', '.join(SOURCES)} is needed")
    source = given[0]
    if source != "shape":
        _refuse_foreign(table, (), "which only a shape has", "")
    if source in ("principal_moments", "inertia_tensor", "preset"):
        return _from_tensor(table, source, context)
    if table.center_of_mass is not None:
        raise _fail(
            "center_of_mass",
            f"it follows from {source}; remove it, and say with reference what the body turns about",
        )
    if source != "shape" and table.mass is not None:
        raise _fail("mass", f"it follows from {source}; remove it")
    return _from_pieces(table, source, context, sequence)


def _refuse_foreign(table: schema.Solid, allowed: tuple[str, ...], why: str, place: str) -> None:
    for key in DIMENSIONS:
        if getattr(table, key) is not None and key not in allowed:
            suffix = f"; allowed: {', '.join(allowed)}" if allowed else ""
            raise _fail(f"{place}{key}", f"given a dimension {why}{suffix}; remove it")


def _from_tensor(table: schema.Body, source: str, context: Any) -> RigidBody:
    if table.reference is not None:
        raise _fail(
            "reference",
            f"only shape, points and parts take it; {source} is taken about the point that the body "
            "turns about already: remove it",
        )
    zero = [context.zero] * 3
    center = [x.at(context) for x in table.center_of_mass] if table.center_of_mass else zero
    mass = _positive(table.mass, "mass", "mass", context) if table.mass is not None else None
    drawing: list[dict[str, Any]] = []
    described = source
    if source == "preset":
        preset = PRESETS.get(str(table.preset))
        if preset is None:
            near = nearest(str(table.preset), PRESETS)
            raise _fail("preset", f"given {shown(table.preset)}{near}; allowed: {', '.join(PRESETS)}")
        if table.mass is not None:
            raise _fail("mass", "it follows from preset; remove it")
        inertia = diagonal(preset.moments(context))
        mass = parse_number(preset.mass, "kg").at(context)
        described = f"preset {table.preset} ({preset.source})"
        axes = [float(parse_number(a, "m").at(context)) for a in preset.semi_axes]
        drawing = [_drawn("ellipsoid", {"semi_axes": axes}, center)]
    elif source == "principal_moments":
        assert table.principal_moments is not None
        inertia = diagonal([x.at(context) for x in table.principal_moments])
    else:
        assert table.inertia_tensor is not None
        _check_symmetric(table.inertia_tensor)
        inertia = [[x.at(context) for x in row] for row in table.inertia_tensor]
    return _finish(context, source, described, mass, center, inertia, drawing)


def _check_symmetric(tensor: list[list[ExactNumber]]) -> None:
    for i in range(3):
        for j in range(i):
            if tensor[i][j] != tensor[j][i]:
                raise _fail(
                    f"inertia_tensor[{i}][{j}]",
                    f"given {float(tensor[i][j])!r}, but [{j}][{i}] is {float(tensor[j][i])!r}; "
                    "the tensor must be symmetric: write the same number twice",
                )


def _from_pieces(table: schema.Body, source: str, context: Any, sequence: str) -> RigidBody:
    if source == "shape":
        pieces = [_solid(table, table.mass, [context.zero] * 3, None, "", context)]
    elif source == "parts":
        pieces = []
        for number, part in enumerate(table.parts or []):
            position = [x.at(context) for x in part.position]
            place = f"parts[{number}]."
            turn = _attitude_of(part, sequence, place, context)
            pieces.append(_solid(part, part.mass, position, turn, place, context))
    else:
        pieces = []
        for number, point in enumerate(table.points or []):
            mass = _positive(point.mass, f"points[{number}].mass", "mass", context)
            position = [x.at(context) for x in point.position]
            pieces.append(_Piece(mass, position, diagonal([context.zero] * 3), {"solid": "point"}))
    total = sum((piece.mass for piece in pieces), context.zero)
    center = [sum((p.mass * p.position[i] for p in pieces), context.zero) / total for i in range(3)]
    reference = _reference_point(table, source, center, context)
    inertia = diagonal([context.zero] * 3)
    drawing = []
    for piece in pieces:
        arm = [x - r for x, r in zip(piece.position, reference, strict=True)]
        shifted = parallel_axis(piece.inertia, piece.mass, arm)
        inertia = [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(inertia, shifted, strict=True)]
        drawing.append({**piece.drawing, "position": [float(x) for x in arm]})
        if piece.drawing["solid"] == "point":
            drawing[-1]["dimensions"] = {"mass_fraction": float(piece.mass / total)}
    center = [c - r for c, r in zip(center, reference, strict=True)]
    return _finish(context, source, source, total, center, inertia, drawing)


def parallel_axis(inertia: Matrix, mass: Any, arm: Vector) -> Matrix:
    """Tensor about a point from the tensor about the centre of mass (Steiner's theorem).

    Args:
        inertia: 3x3, about the centre of mass, kg m^2.
        mass: kg.
        arm: from the point to the centre of mass, m.
    """
    square = dot(arm, arm)
    return [
        [inertia[i][j] + mass * ((square if i == j else 0) - arm[i] * arm[j]) for j in range(3)]
        for i in range(3)
    ]


def _positive(number: ExactNumber | None, key: str, what: str, context: Any) -> Any:
    if number is None:
        raise _fail(key, f"missing; this body needs a {what}, a positive number")
    if number.sign <= 0:
        raise _fail(key, f"given {float(number):g}; a positive {what} is allowed")
    return number.at(context)


def _solid(
    table: schema.Solid,
    mass: ExactNumber | None,
    position: Vector,
    quaternion: Vector | None,
    place: str,
    context: Any,
) -> _Piece:
    name = str(table.shape)
    shape = SHAPES[name]
    _refuse_foreign(table, tuple(shape.dimensions), f"that a {name} doesn't have", place)
    dimensions = {}
    for key, count in shape.dimensions.items():
        value = getattr(table, key)
        values = value if isinstance(value, list) else [value]
        if value is None:
            lengths = "a positive length" if count == 1 else f"{count} positive lengths"
            raise _fail(f"{place}{key}", f"missing; a {name} needs it: {lengths}")
        if len(values) != count:
            raise _fail(f"{place}{key}", f"given {len(values)} lengths; a {name} has {count}")
        places = [f"{place}{key}" + (f"[{n}]" if count > 1 else "") for n in range(count)]
        dimensions[key] = [
            _positive(v, where, "length", context) for v, where in zip(values, places, strict=True)
        ]
    if shape.at_most is not None:
        small, large = shape.at_most
        if dimensions[small][0] > dimensions[large][0]:
            given, limit = (context.nstr(dimensions[key][0], 12) for key in shape.at_most)
            raise _fail(f"{place}{small}", f"given {given} m; at most {large} ({limit} m) is allowed")
    heavy = _positive(mass, f"{place}mass", "mass", context)
    inertia = diagonal([heavy * m for m in shape.moments(context, dimensions)])
    plain = {k: [float(x) for x in v] for k, v in dimensions.items()}
    sizes = {k: (v if shape.dimensions[k] > 1 else v[0]) for k, v in plain.items()}
    drawing = _drawn(name, sizes, position)
    if quaternion is not None:
        turn = attitude.rotation_matrix(quaternion)
        inertia = multiply(multiply(turn, inertia), transpose(turn))
        drawing["quaternion"] = [float(x) for x in quaternion]
    return _Piece(heavy, position, inertia, drawing)


def _attitude_of(part: schema.Part, sequence: str, place: str, context: Any) -> Vector | None:
    """Unit quaternion from the part's own axes to the body's; None where it isn't turned."""
    if part.quaternion is not None and part.euler_angles is not None:
        what = "given beside quaternion; only one attitude is allowed: remove one of them"
        raise _fail(f"{place}euler_angles", what)
    if part.euler_sequence is not None and part.euler_angles is None:
        raise _fail(f"{place}euler_sequence", "given without euler_angles; give them, or remove it")
    if part.euler_angles is not None:
        angles = [x.at(context) for x in part.euler_angles]
        return attitude.quaternion_from_euler(context, angles, part.euler_sequence or sequence)
    if part.quaternion is None:
        return None
    q = [x.at(context) for x in part.quaternion]
    if all(x == 0 for x in q):
        raise _fail(f"{place}quaternion", "given zero; a quaternion w x y z that is not zero is allowed")
    return attitude.unit_quaternion(context, q)


def _drawn(solid: str, dimensions: dict[str, Any], position: Vector) -> dict[str, Any]:
    return {
        "solid": solid,
        "dimensions": dimensions,
        "position": [float(x) for x in position],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
    }


def _reference_point(table: schema.Body, source: str, center: Vector, context: Any) -> Vector:
    """In the coordinates in which the body is described (a shape's origin is its centre of mass)."""
    if table.reference is None or table.reference == "center_of_mass":
        return center
    if isinstance(table.reference, str):
        shape = SHAPES[str(table.shape)] if source == "shape" else None
        landmarks = shape.landmarks if shape else {}
        if table.reference not in landmarks:
            allowed = ", ".join(["center_of_mass", *landmarks])
            raise _fail(
                "reference",
                f"given {shown(table.reference)}; allowed here: {allowed}, or a point [x, y, z]",
            )
        assert shape is not None
        dimensions = {}
        for key in shape.dimensions:
            value = getattr(table, key)
            values = value if isinstance(value, list) else [value]
            dimensions[key] = [v.at(context) for v in values]
        return landmarks[table.reference](context, dimensions)
    return [x.at(context) for x in table.reference]


def _finish(
    context: Any,
    source: str,
    described: str,
    mass: Any,
    center: Vector,
    inertia: Matrix,
    drawing: list[dict[str, Any]],
) -> RigidBody:
    moments, axes = eigen(context, inertia)
    largest = max(abs(m) for m in moments)
    if largest == 0:
        raise _fail(source, "all moments are zero; a body that turns needs inertia about some axis")
    slack = largest * context.mpf(_ROUNDING_OF_INPUT)
    tiny = largest * context.mpf(2) ** (16 - context.prec)
    moments = [context.zero if abs(m) < tiny else m for m in moments]
    listed = ", ".join(context.nstr(m, 12) for m in moments)
    if min(moments) < 0:
        raise _fail(source, f"principal moments {listed}: a moment of inertia can't be negative")
    if sorted(moments)[1] == 0:
        raise _fail(source, f"principal moments {listed}: at most one can be zero (a rod's)")
    small, middle, large = sorted(moments)
    if small + middle < large - slack:
        raise _fail(
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
    """The homogeneous cuboid that has these moments (of unit mass where none is known)."""
    heavy = mass if mass else context.one
    total = sum(moments) / 2
    edges = [context.sqrt(max(12 * (total - m), context.zero) / heavy) for m in moments]
    longest = max(edges)
    drawn = [float(max(edge, longest / 40)) for edge in edges]  # a plate stays visible edge on
    drawing = _drawn("cuboid", {"size": drawn}, center)
    q = attitude.quaternion_from_matrix(context, transpose(axes))
    drawing["quaternion"] = [float(x) for x in q]
    return drawing


def inverse_inertia(context: Any, body: RigidBody) -> Matrix:
    """Inverse of the tensor; a rod's axis without inertia gets no angular acceleration (pseudo-inverse)."""
    inverse = [context.zero if m == 0 else 1 / m for m in body.principal_moments]
    return multiply(multiply(transpose(body.principal_axes), diagonal(inverse)), body.principal_axes)


def momentum(body: RigidBody, angular_velocity: Vector) -> Vector:
    """Angular momentum about the reference point, body axes."""
    return apply(body.inertia, angular_velocity)
