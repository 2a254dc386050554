"""Words of messages: a value as the user would write it, and what a name that isn't allowed may mean."""

import difflib
from collections.abc import Iterable, Mapping
from decimal import Decimal
from typing import Any

_MEANT = {
    "box": "cuboid", "brick": "cuboid", "ball": "sphere", "disc": "disk", "hoop": "ring", "bar": "rod",
    "stick": "rod", "pipe": "tube", "rectangle": "plate", "square": "plate", "donut": "torus",
    "friction": "viscous_torque torque", "thruster": "torque force",
    "cassini": "cassini_1 cassini_2 cassini_3 cassini_4", "filter": "states", "slosh": "states",
    "speed": "rate",
    "planet": "gravity_gradient central_gravity", "sun": "gravity_gradient", "moon": "gravity_gradient",
    "spin": "angular_velocity rate", "omega": "angular_velocity", "w": "angular_velocity",
    "rates": "angular_velocity", "attitude": "quaternion euler_angles", "inertia": "inertia_tensor moment",
    "moments": "principal_moments", "orientation": "quaternion euler_angles", "duration": "end",
    "stop": "end", "dt": "every", "step": "every", "dimensions": "size", "side": "size",
    "float": "single", "float32": "single", "float64": "double", "quad": "quadruple",
}  # fmt: skip
"""Common names of things that have another name here."""
_LONGEST_NAME = 60
LONGEST_INTEGER = 10_000  # bits; Python refuses to write out integers not much longer


def shown(value: Any) -> str:
    """A TOML value as the user would write it, shortened, for messages."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        inside = ", ".join(shown(x) for x in value[:4])
        return f"[{inside}{', ...' if len(value) > 4 else ''}]"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= 60 else f'"{value[:57]}..."'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 200:
        if value.bit_length() > LONGEST_INTEGER:
            return f"a whole number of {value.bit_length()} bits"
        value = Decimal(value).normalize()
    text = str(value)
    if isinstance(value, float | Decimal):
        text = text.lower().replace("infinity", "inf")
    elif text.startswith("<"):
        text = f"an object of type {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(given: str, allowed: Iterable[str]) -> str:
    """``; did you mean "x"?`` if something similar is allowed, otherwise empty."""
    if len(given) > _LONGEST_NAME:  # comparing takes time, and nothing allowed is near
        return ""
    names = list(allowed)
    known = [name for name in _MEANT.get(given.lower(), "").split() if name in names]
    close = known or difflib.get_close_matches(given, names, n=1, cutoff=0.6)
    quoted = " or ".join(f'"{name}"' for name in close)
    return f"; did you mean {quoted}?" if close else ""


def meant(given: str, allowed: Iterable[str], *, effect: bool = False) -> str:
    """What a name that isn't allowed may mean: a similar one, or something that isn't modelled; of an
    ``effect`` on the body or a frame of its start also what has another name here.
    """
    from rigidsim.scene.scope import other_name, scope_answer  # of no use until something is refused

    return (effect and other_name(given)) or f"{nearest(given, allowed)}{scope_answer(given)}"
