"""Torques that act late and within a short while: pulses, steps and ramps, and smooth spikes and switches.

A body about one axis, of which everything is known: with u = (t - late)/width, a torque k g(u) and h1, h2 the
first and second integrals of g,

    I (angle - w0 t) = k width^2 (h2(u) - h2(u0) - h1(u0) (u - u0)),    u0 = -late/width.

A better integration by the same code could share its faults; this is exact, with the digits of the config.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath

from experiments.random_scenes import Draw
from rigidsim.solve.problem import InitialValueProblem

DIGITS = 80
"""Of the truth: late over width, squared, is lost, and double precision's digits are to be left."""


@dataclass(frozen=True)
class Shape:
    """A torque of unit height.

    Attributes:
        text: expression of t, ``late`` and ``width``.
        impulse: its integral over its width, or up to one width after it has begun.
        first, second: integrals of it as a function of u.
        lasts: whether it stays on.
    """

    text: str
    impulse: float
    first: Callable[[Any], Any]
    second: Callable[[Any], Any]
    lasts: bool = False


def _power(u: Any, n: int) -> Any:
    """u^n / n! of what is positive."""
    return u**n / mpmath.factorial(n) if u > 0 else mpmath.mpf(0)


def _log_cosh(u: Any) -> Any:
    return abs(u) + mpmath.log1p(mpmath.exp(-2 * abs(u))) - mpmath.log(2)


def _of_atan(u: Any) -> Any:
    return u * mpmath.atan(u) - mpmath.log1p(u * u) / 2


def _softplus(u: Any) -> Any:
    return max(u, mpmath.mpf(0)) + mpmath.log1p(mpmath.exp(-abs(u)))


def _broken(
    text: str, impulse: float, order: int, *breaks: tuple[float, float], lasts: bool = False
) -> Shape:
    """A torque made of powers that begin at places u, times factors; its first integral has the order."""

    def integral(u: Any, n: int) -> Any:
        return sum(factor * _power(u - place, n) for place, factor in breaks)

    return Shape(text, impulse, lambda u: integral(u, order), lambda u: integral(u, order + 1), lasts)


_U = "((t - late)/width)"
SWITCHES: dict[str, Shape] = {
    "pulse": _broken("pulse(t, late, late + width)", 1.0, 1, (0, 1), (1, -1)),
    "step": _broken("step(t - late)", 1.0, 1, (0, 1), lasts=True),
    "sign": _broken("(sign(t - late) - sign(t - late - width))/2", 1.0, 1, (0, 1), (1, -1)),
    "ramp": _broken(f"min(max({_U}, 0), 1)", 1.0, 2, (0, 1), (1, -1), lasts=True),
    "triangle": _broken(f"max(0, 1 - abs({_U} - 1))", 1.0, 2, (0, 1), (1, -2), (2, 1)),
    "two pulses": _broken(
        "pulse(t, late, late + width) - pulse(t, late + 2*width, late + 5*width/2)", 0.5, 1,
        (0, 1), (1, -1), (2, -1), (2.5, 1),
    ),
}  # fmt: skip
SPIKES: dict[str, Shape] = {
    "exp": Shape(
        f"exp(-{_U}^2)",
        1.77,
        lambda u: mpmath.sqrt(mpmath.pi) / 2 * mpmath.erf(u),
        lambda u: mpmath.sqrt(mpmath.pi) / 2 * u * mpmath.erf(u) + mpmath.exp(-u * u) / 2,
    ),
    "cosh": Shape(f"1/cosh({_U})^2", 2.0, mpmath.tanh, _log_cosh),
    "tanh": Shape(f"1 - tanh({_U})^2", 2.0, mpmath.tanh, _log_cosh),
    "1/(1 + u^2)": Shape(f"1/(1 + {_U}^2)", 3.14, mpmath.atan, _of_atan),
    "width^2/(...)": Shape("width^2/(width^2 + (t - late)^2)", 3.14, mpmath.atan, _of_atan),
    "sigmoid": Shape(f"sigmoid({_U})*sigmoid(-{_U})", 1.0, lambda u: 1 / (1 + mpmath.exp(-u)), _softplus),
    "erf": Shape(
        f"erf({_U})",
        1.0,
        lambda u: u * mpmath.erf(u) + mpmath.exp(-u * u) / mpmath.sqrt(mpmath.pi),
        lambda u: (
            (u * u / 2 + mpmath.mpf(1) / 4) * mpmath.erf(u)
            + u * mpmath.exp(-u * u) / (2 * mpmath.sqrt(mpmath.pi))
        ),
        lasts=True,
    ),
    "root": Shape(
        f"1/sqrt(1 + {_U}^2)^3", 2.0, lambda u: u / mpmath.sqrt(1 + u * u), lambda u: mpmath.sqrt(1 + u * u)
    ),
}
_SHAPES = {shape.text: shape for shape in (*SWITCHES.values(), *SPIKES.values())}


def switch(draw: Draw) -> None:
    """A pulse, a step or a ramp."""
    _body(draw, SWITCHES)


def spike(draw: Draw) -> None:
    """A smooth spike, or a smooth switch."""
    _body(draw, SPIKES)


def _body(draw: Draw, shapes: dict[str, Shape]) -> None:
    draw.body([1.0, 1.0, 1.0])
    draw.start([0.0, 0.0, draw.between(-1, 1)])
    shape = shapes[list(shapes)[int(draw.random.integers(len(shapes)))]]
    draw.load("torque", f'components = ["0", "0", "k*({shape.text})"]')


def put_late(draw: Draw, end: float) -> None:
    """Choose the moment, the width, and a height that changes the rate by order one."""
    late = end * draw.between(0.2, 0.95)
    shape = _shape("\n".join(draw.more))
    width = late * draw.decades(-9, -2)
    acts = end - late if shape.lasts else width * shape.impulse
    size = draw.mass * draw.length**2 / draw.time * draw.between(0.2, 2) / acts
    draw.parameters += [f"late = {late!r}", f"width = {width!r}", f"k = {size!r}"]


def _shape(text: str) -> Shape:
    return next(shape for known, shape in _SHAPES.items() if f'"k*({known})"' in text)


def turned(prepared: InitialValueProblem, text: str, end: Any) -> Any:
    """The angle (mpf, rad) about the third axis by which the body has turned until a time (mpf, s)."""
    scene, shape = prepared.scene, _shape(text)
    given = {k: mpmath.mpf(v.at(scene.context)) for k, v in scene.config.parameters.items()}
    late, width = given["late"], given["width"]
    u, begun = (end - late) / width, -late / width
    kicked = shape.second(u) - shape.second(begun) - shape.first(begun) * (u - begun)
    moment = mpmath.mpf(scene.body.principal_moments[2])
    return mpmath.mpf(scene.angular_velocity[2]) * end + given["k"] * width**2 / moment * kicked
