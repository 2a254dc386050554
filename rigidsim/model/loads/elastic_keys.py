"""The keys of ``[body] elasticity`` as numbers, and whose tides are raised; nonsense is refused."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load_words import span_words
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.registry import SceneLoad, Setting, names_of
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing.numbers import plain
from rigidsim.scene.validation_messages import nearest

WHERE = "[body] elasticity"
_FLUID = "1.5"  # Love number of a homogeneous fluid, the largest that there is
_LATE, _TOO_LATE = 0.3, 1.0
"""Radians by which body and source together may turn within the delay: at the first, what the expansion
leaves out is some percent of what the delay does, which is told, and at the second about as much.
"""
_WIDE = (0.05, 1.0)
"""C/(M R^2) of a body whose mean radius is R: 2/5 is a sphere's, 0.21 Saturn's."""
_SMALLEST_IN_KM = 0.01
"""Of a number that may have been meant in km: nobody gives less than ten metres so."""
_RAISING = "gravity_gradient"
_DERIVATIVES = 2  # of the place


def fault(key: str, text: str) -> ConfigError:
    """The error that names a key."""
    return ConfigError(Problem(f"{WHERE} {key}".rstrip(), text))


Sights = tuple[tuple[Sight, int], ...]


def elastic_values(
    config: Config, around: Setting
) -> tuple[Any, Any, Any, Any | None, tuple[int, ...], Sights, bool]:
    """Love number, radius, delay, mean rate (mpf, SI), places in ``[[loads]]`` of what raises tides, what
    that takes of a kernel, and whether the spin distorts, too.

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
        what = "given for a body with a position or velocity, whose flight treats it as rigid; leave "
        raise fault("", what + "out [initial] position and velocity, and give the source's orbit")
    if any(isinstance(x, str) for x in config.body.principal_moments or []):
        what = "given with principal_moments that vary; only one of them can change the tensor"
        raise fault("", what)
    if config.initial.angular_momentum is not None:
        what = "given with [body] elasticity, on which it depends what the rates are then; give "
        raise ConfigError(Problem("[initial] angular_momentum", what + "angular_velocity"))
    rate = None if table.mean_rate is None else table.mean_rate.at(context)
    raising = _raising(config, table.raised_by)
    named = [source for n in raising if (source := getattr(config.loads[n], "source", None)) is not None]
    seen = around.ephemeris
    sights = () if seen is None else tuple((seen.sight(x, around.host), _DERIVATIVES) for x in named)
    return love, radius, delay, rate, raising, sights, table.spin


def _raising(config: Config, names: list[str] | None) -> tuple[int, ...]:
    """Places of the named loads, or of all gravity gradients."""
    kinds = [fields.kind for fields in config.loads]  # type: ignore[attr-defined]
    if names is None:
        return tuple(n for n, kind in enumerate(kinds) if kind == _RAISING)
    known = {name: n for n, fields in enumerate(config.loads) for name in names_of(fields)}
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


class ElasticEffects(SceneLoad):
    """What a scene can be without of an elastic body."""

    nothing = {"love_number": 0}  # noqa: RUF012

    @staticmethod
    def effect_parts(fields: Config) -> Iterator[EffectPart]:
        """Its delay; tides and the spin's distortion, where there are both."""
        table = fields.body.elasticity
        assert table is not None
        missing = "" if table.delay.sign else "it is 0"
        yield EffectPart("delay", "delay of the distortion", {"delay": 0}, missing=missing)
        raising = _raising(fields, table.raised_by)
        both = bool(raising) and table.spin
        missing = "" if both else "no source raises any" if table.spin else "they are all that distorts"
        yield EffectPart("tides", _of_sources(fields, raising), {"raised_by": []}, missing=missing)
        missing = "" if both else "it is all that distorts" if table.spin else "spin is false"
        yield EffectPart("spin", "distortion by the spin", {"spin": False}, missing=missing)

    @staticmethod
    def without_loads(config: Config, names: Collection[str]) -> Mapping[str, Any]:
        """Sources that are gone raise no tides."""
        given = config.body.elasticity and config.body.elasticity.raised_by
        kept = [name for name in given or [] if name not in names]
        return {"raised_by": kept} if kept != (given or []) else {}


def _of_sources(config: Config, raising: tuple[int, ...]) -> str:
    names = [next(iter(names_of(config.loads[n])), f"[[loads]] number {n + 1}") for n in raising]
    return f"tides of {', '.join(names)}" if names else "tides"


def refuse_delay(delay: Any, turned: float) -> None:
    """Refuse a delay (s) in which body and source turn by so many radians, if the expansion says nothing."""
    if turned > _TOO_LATE:
        what = f"given {span_words(delay)}, in which body and source turn by {turned:.3g} rad; "
        raise fault("delay", what + f"up to {_TOO_LATE:g} is allowed, since what it does is a series in it")


def about_keys(body: Any, scene: Scene, delay: Any, turned: float) -> Iterator[Caution]:
    """Numbers that are allowed, but doubtful; ``body`` are the keys of ``[body]``."""
    yield from _about_radius(body, scene)
    yield from _about_delay(delay, turned)


def _about_delay(delay: Any, turned: float) -> Iterator[Caution]:
    """A delay whose expansion leaves out a part of what it does."""
    if turned > _LATE:
        text = (
            f"{WHERE} delay: in {span_words(delay)} body and source turn by {turned:.2g} rad, of which the "
        )
        text += f"expansion to second order leaves out some {turned**2 / 6:.1%} of what the delay does"
        yield Caution(WarningCode.DELAY_TOO_LONG, text)


def _about_radius(body: Any, scene: Scene) -> Iterator[Caution]:
    """A radius without a unit that suits the body's mass and moments in km; ``body`` are the keys."""
    given, mass = body.elasticity.radius, scene.body.mass
    if mass is None or not given.assumed or float(given) < _SMALLEST_IN_KM:
        return
    largest = float(plain(max(scene.body.principal_moments)))
    if _WIDE[0] < largest / (float(plain(mass)) * (1e3 * float(given)) ** 2) < _WIDE[1]:
        number = f"{float(given):.10g}"
        text = (
            f"{WHERE} radius: given {number} without a unit, which is taken as m, while the body's mass and "
        )
        text += f'moments suit as many km; write "{number} km" if that is meant, "{number} m" if not'
        yield Caution(WarningCode.LENGTH_WITHOUT_UNIT, text)
