"""The keys of ``[body] elasticity`` as numbers, and whose tides are raised; nonsense is refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load_words import length_text, span_words
from rigidsim.scene.kernels.kernel import Sight
from rigidsim.scene.registry import Surroundings
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing.numbers import plain
from rigidsim.scene.validation_messages import nearest
from rigidsim.store.summary_parts import Caution, WarningCode

WHERE = "[body] elasticity"
_FLUID = "1.5"  # Love number of a homogeneous fluid, the largest that there is
_LATE, _TOO_LATE = 0.3, 1.0
"""Radians by which body and source together may turn within the delay: at the first, what the expansion
leaves out is some percent of what the delay does, which is told, and at the second about as much.
"""
_RAISING = "gravity_gradient"
_DERIVATIVES = 2  # of the place


def fault(key: str, text: str) -> ConfigError:
    """The error that names a key."""
    return ConfigError(Problem(f"{WHERE} {key}".rstrip(), text))


Sights = tuple[tuple[Sight, int], ...]


def elastic_values(
    config: Config, around: Surroundings
) -> tuple[Any, Any, Any, Any | None, tuple[int, ...], Sights]:
    """Love number, radius, delay, mean rate (mpf, SI), places in ``[[loads]]`` of what raises tides, and what
    that takes of a kernel.

    Raises:
        ConfigError: a value out of range, or beside something that an elastic body can't have.
    """
    table, context = config.body.elasticity, around.context
    assert table is not None
    love, radius, delay = (x.at(context) for x in (table.love_number, table.radius, table.delay))
    if not 0 <= love <= context.mpf(_FLUID):
        what = f"given {context.nstr(plain(love), 8)}; 0 (rigid) to {_FLUID} (a fluid) is allowed"
        raise fault("love_number", what)
    if not radius > 0:
        raise fault("radius", f"given {context.nstr(plain(radius), 8)} m; a positive length is allowed")
    if not delay >= 0:
        what = f"given {context.nstr(plain(delay), 8)} s; a time of at least 0 is allowed: an effect "
        raise fault("delay", what + "comes after its cause")
    if around.free_flight:
        what = "given for a body with a position or velocity, whose flight is that of a rigid one; leave "
        raise fault("", what + "out [initial] position and velocity, and give the source's orbit")
    if any(isinstance(x, str) for x in config.body.principal_moments or []):
        what = "given beside principal_moments that vary; only one of them can change the tensor"
        raise fault("", what)
    if config.initial.angular_momentum is not None:
        what = "given beside [body] elasticity, on which it depends what the rates are then; give "
        raise ConfigError(Problem("[initial] angular_momentum", what + "angular_velocity"))
    rate = None if table.mean_rate is None else table.mean_rate.at(context)
    raising = _raising(config, table.raised_by)
    named = [source for n in raising if (source := getattr(config.loads[n], "source", None)) is not None]
    seen = around.ephemeris
    sights = () if seen is None else tuple((seen.sight(x, around.host), _DERIVATIVES) for x in named)
    return love, radius, delay, rate, raising, sights


def _raising(config: Config, names: list[str] | None) -> tuple[int, ...]:
    """Places of the named loads, or of all gravity gradients."""
    kinds = [fields.kind for fields in config.loads]  # type: ignore[attr-defined]
    if names is None:
        return tuple(n for n, kind in enumerate(kinds) if kind == _RAISING)
    known = {name: n for n, fields in enumerate(config.loads) for name in _names(fields)}
    for name in names:
        if name not in known:
            allowed = ", ".join(known) or f"none, since no {_RAISING} has a name"
            raise fault("raised_by", f'given "{name}"{nearest(name, known)}; allowed: {allowed}')
        if kinds[known[name]] != _RAISING:
            what = f'given "{name}", a load of kind {kinds[known[name]]}; the source of a {_RAISING} raises '
            raise fault("raised_by", what + "tides: name that, or add one")
    found = tuple(known[name] for name in names)
    if len(set(found)) < len(found):
        raise fault("raised_by", "the same source is named twice; name each once")
    return found


def _names(fields: Any) -> list[str]:
    """Names that a load is known by: its own, and that of the body that is its source."""
    orbit = getattr(fields, "orbit", None)
    given = fields.name, getattr(fields, "source", None), None if orbit is None else orbit.body
    return [name for name in given if name]


def told_elasticity(what: str, love: Any, radius: Any) -> str:
    """What it does, and its numbers, in a reader's terms."""
    size = length_text(float(plain(radius)))
    return f"elasticity: {what}; Love number {float(plain(love)):.6g}, radius {size}"


def refuse_delay(delay: Any, turned: float) -> None:
    """Refuse a delay (s) in which body and source turn by so many radians, if the expansion says nothing."""
    if turned > _TOO_LATE:
        what = f"given {span_words(delay)}, in which body and source turn by {turned:.3g} rad; "
        raise fault("delay", what + f"up to {_TOO_LATE:g} is allowed, since what it does is a series in it")


def about_delay(delay: Any, turned: float) -> Iterator[Caution]:
    """A delay whose expansion leaves out a part of what it does."""
    if turned > _LATE:
        text = (
            f"{WHERE} delay: in {span_words(delay)} body and source turn by {turned:.2g} rad, of which the "
        )
        text += f"expansion to second order leaves out some {turned**2 / 6:.1%} of what the delay does"
        yield Caution(WarningCode.DELAY_TOO_LONG, text)
