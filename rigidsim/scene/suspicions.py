"""Config values that are allowed, but probably mean something else."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rigidsim.errors import Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Constant, Expression, Name, Operation, operations
from rigidsim.scene.paths import numbers
from rigidsim.scene.scene import Event, Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.units import time_unit

_TURN = 2 * math.pi


def suspicious_angles(config: Config) -> list[Problem]:
    """Angles beyond a full turn that were given without a unit: taken as radians, meant as degrees?

    So are whole numbers beyond pi of an angle that only goes to pi: inclination, or the middle Euler angle.
    A multiple of pi is meant in radians, and a value with a unit is unambiguous.
    """
    found = []
    for path, given in numbers(config):
        bare = [x for x in given if x.assumed == "rad" and not x.pi_power]
        key = path.steps[-1]
        half = given[1:2] if key == "euler_angles" else given if key == "inclination" else []
        beyond = [
            x
            for x in bare
            if abs(x.rational) > _TURN
            or (x.rational.denominator == 1 and abs(x.rational) > math.pi and any(x is one for one in half))
        ]
        if beyond:
            bare_text, degrees = (
                ", ".join(f"{value:.6g}" for value in values)
                for values in (map(float, beyond), (math.degrees(float(x)) for x in beyond))
            )
            first = f"{float(beyond[0]):.6g}"
            found.append(
                Problem(
                    path.where,
                    f"given {bare_text} without a unit, which is taken as radians: {degrees} deg; write "
                    f'"{first} deg" if degrees are meant, "{first} rad" if not',
                )
            )
    return found


def suspicious_expressions(scene: Scene) -> list[Problem]:
    """Sines, cosines and tangents of whole numbers beyond a full turn: of degrees?"""
    found = []
    for expression in scene.formulas():
        for name, value in _constant_arguments(expression):
            number, degrees = f"{float(value):.6g}", f"{math.degrees(float(value)):.6g}"
            found.append(
                Problem(
                    expression.where,
                    f"given {name}({number}), whose argument is taken as radians: {degrees} deg; write "
                    f"{name}({number} deg) if degrees are meant, {name}({number} rad) if not",
                )
            )
    return found


def _constant_arguments(expression: Expression) -> list[tuple[str, ExactNumber]]:
    """Trigonometric functions of whole numbers of radians beyond a full turn, as written."""
    found = []
    for node in reversed([*operations(expression)]):  # in the order of the text
        if node.operator in ("sin", "cos", "tan"):
            (argument,) = node.operands
            value = argument.value if isinstance(argument, Constant) else None
            whole = value is not None and not value.pi_power and value.rational.denominator == 1
            literal = argument.text.lstrip("+- ").replace(".", "").isdigit()
            if value is not None and whole and literal and abs(value.rational) > _TURN:
                found.append((node.operator, value))
    return found


def suspicious_end(config: Config) -> list[Problem]:
    """A bare number, in seconds, as end of a run whose times are shown in a longer unit: meant in that?"""
    end, unit = config.time.end, config.time.unit
    if end is None or unit is None or end.assumed != "s" or end.pi_power:
        return []
    size = time_unit(unit)
    if size < 60 or not 0 < end.rational < size:
        return []
    given, converted = f"{float(end):.6g}", f"{float(end.rational / size):.3g} {unit}"
    return [
        Problem(
            "[time] end",
            f"given {given} without a unit, which is taken as seconds: {converted}; write "
            f'"{given} {unit}" if that is meant, "{given} s" if not',
        )
    ]


def unreachable_events(events: Sequence[Event]) -> list[Problem]:
    """Events that compare the middle Euler angle with what it never is: meant in degrees?"""
    found = []
    for event in events:
        root = event.expression
        parts = root.operands if isinstance(root, Operation) and root.operator == "sum" else ()
        constants = [float(part.value) for part in parts if isinstance(part, Constant)]
        names = [part.name for part in parts if isinstance(part, Name)]
        if len(parts) == 2 and names == ["theta"] and constants and abs(constants[0]) > math.pi:
            what = (
                f'given "{root.text}", which is never zero: theta is from 0 to pi rad, or from '
                f'-pi/2 to pi/2; write "{abs(constants[0]):.6g} deg" if degrees are meant'
            )
            found.append(Problem(root.where, what))
    return found
