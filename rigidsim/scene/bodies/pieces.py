"""The pieces of a body: points, a shape, or parts placed and rotated, each with its own tensor.

Positions are in the coordinates in which the body is described (a shape's origin is its centre of mass).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, diagonal, dot, multiply, transpose
from rigidsim.scene.bodies import table as body_table
from rigidsim.scene.bodies.shapes import DIMENSIONS, SHAPES
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.tracing.numbers import plain
from rigidsim.scene.validation_messages import shown


@dataclass
class Piece:
    """Something with mass: tensor about its own centre of mass, along the body axes."""

    mass: Any
    position: Vector
    inertia: Matrix
    drawing: dict[str, Any]


def pieces_of(table: body_table.Body, source: str, context: Any, sequence: str) -> list[Piece]:
    """The pieces of ``points``, ``shape`` or ``parts``, whichever is the ``source``."""
    if source == "shape":
        return [_solid(table, table.mass, [context.zero] * 3, None, "", context)]
    pieces = []
    if source == "parts":
        for number, part in enumerate(table.parts or []):
            position = [x.at(context) for x in part.position]
            place = f"parts[{number}]."
            turn = _attitude_of(part, sequence, place, context)
            pieces.append(_solid(part, part.mass, position, turn, place, context))
    else:
        for number, point in enumerate(table.points or []):
            mass = positive(point.mass, f"points[{number}].mass", "mass", context)
            position = [x.at(context) for x in point.position]
            pieces.append(Piece(mass, position, diagonal([context.zero] * 3), {"solid": "point"}))
    return pieces


def reference_point(table: body_table.Body, source: str, center: Vector, context: Any) -> Vector:
    """Reference point in the coordinates in which the body is described."""
    if table.reference is None or table.reference == "center_of_mass":
        return center
    if isinstance(table.reference, str):
        shape = SHAPES[str(table.shape)] if source == "shape" else None
        landmarks = shape.landmarks if shape else {}
        if table.reference not in landmarks:
            allowed = ", ".join(["center_of_mass", *landmarks])
            raise refusal(
                "reference", f"given {shown(table.reference)}; allowed here: {allowed}, or a point [x, y, z]"
            )
        lengths = {key: [x.at(context) for x in _lengths(table, key)] for key in shape.dimensions}  # type: ignore
        return landmarks[table.reference](context, lengths)
    return [x.at(context) for x in table.reference]


def _lengths(table: body_table.Solid, key: str) -> list[Any]:
    value = getattr(table, key)
    return value if isinstance(value, list) else [value]


def parallel_axis(inertia: Matrix, mass: Any, arm: Vector) -> Matrix:
    """Tensor (kg m^2) about a point an ``arm`` (m) from the centre of mass (Steiner's theorem)."""
    square = dot(arm, arm)
    return [
        [inertia[i][j] + mass * ((square if i == j else 0) - arm[i] * arm[j]) for j in range(3)]
        for i in range(3)
    ]


def _solid(
    table: body_table.Solid,
    mass: ExactNumber | None,
    position: Vector,
    quaternion: Vector | None,
    place: str,
    context: Any,
) -> Piece:
    name = str(table.shape)
    shape = SHAPES[name]
    refuse_dimensions(table, tuple(shape.dimensions), f"that a {name} doesn't have", place)
    dimensions = {}
    for key, count in shape.dimensions.items():
        values = _lengths(table, key)
        if values == [None]:
            lengths = "a positive length" if count == 1 else f"{count} positive lengths"
            raise refusal(f"{place}{key}", f"missing; a {name} needs it: {lengths}")
        if len(values) != count:
            raise refusal(f"{place}{key}", f"given {len(values)} lengths; a {name} has {count}")
        places = [f"{place}{key}" + (f"[{n}]" if count > 1 else "") for n in range(count)]
        dimensions[key] = [
            positive(v, where, "length", context) for v, where in zip(values, places, strict=True)
        ]
    if shape.at_most is not None:
        small, large = shape.at_most
        if dimensions[small][0] > dimensions[large][0]:
            given, limit = (context.nstr(dimensions[key][0], 12) for key in shape.at_most)
            raise refusal(f"{place}{small}", f"given {given} m; at most {large} ({limit} m) is allowed")
    heavy = positive(mass, f"{place}mass", "mass", context)
    inertia = diagonal([heavy * m for m in shape.moments(context, dimensions)])
    plainly = {k: [float(plain(x)) for x in v] for k, v in dimensions.items()}
    sizes = {k: (v if shape.dimensions[k] > 1 else v[0]) for k, v in plainly.items()}
    drawing = drawn(name, sizes, position)
    if quaternion is not None:
        turn = attitude.rotation_matrix(quaternion)
        inertia = multiply(multiply(turn, inertia), transpose(turn))
        drawing["quaternion"] = [float(plain(x)) for x in quaternion]
    return Piece(heavy, position, inertia, drawing)


def _attitude_of(part: body_table.Part, sequence: str, place: str, context: Any) -> Vector | None:
    """Unit quaternion from the part's own axes to the body's; None if it isn't rotated."""
    if part.euler_sequence is not None and part.euler_angles is None:
        raise refusal(f"{place}euler_sequence", "given without euler_angles; give them, or remove it")
    turned = attitude.given_attitude(
        context, part, part.euler_sequence or sequence, lambda key, text: refusal(f"{place}{key}", text)
    )
    return None if turned is None else turned[0]


def drawn(solid: str, dimensions: dict[str, Any], position: Vector) -> dict[str, Any]:
    """A solid for pictures, not rotated, as plain JSON values (see ``rigidsim.look.solids``)."""
    return {
        "solid": solid,
        "dimensions": dimensions,
        "position": [float(plain(x)) for x in position],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
    }


def positive(number: ExactNumber | None, key: str, what: str, context: Any) -> Any:
    """A mass or length of the config as mpf."""
    if number is None:
        raise refusal(key, f"missing; this body needs a {what}, a positive number")
    if number.sign <= 0:
        raise refusal(key, f"given {float(number):g}; a positive {what} is allowed")
    return number.at(context)


def refuse_dimensions(table: body_table.Solid, allowed: tuple[str, ...], why: str, place: str) -> None:
    """Raise ``ConfigError`` if a dimension is given that isn't among the allowed ones."""
    for key in DIMENSIONS:
        if getattr(table, key) is not None and key not in allowed:
            suffix = f"; allowed: {', '.join(allowed)}" if allowed else ""
            raise refusal(f"{place}{key}", f"given a dimension {why}{suffix}; remove it")


def refusal(key: str, text: str) -> ConfigError:
    """The error that names a key of ``[body]``."""
    return ConfigError(Problem(f"[body] {key}".strip(), text))
