"""Numbers of a config that are varied, one by one: what keys such as those of ``[output] sensitivity`` stand
for, and the same scene with other numbers there.

``initial.attitude`` stands for a rotation vector (body axes, rad) by which the config's own start is turned;
its value is zero. The angular velocity that the config gives is kept thereby, or the momentum in space. A
tensor of inertia stays symmetric: an off-diagonal entry stands for both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import norm
from rigidsim.scene.attitude import product
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.paths import Path, leaves
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.schema import config_model
from rigidsim.scene.starts import rotation_of

ATTITUDE = "initial.attitude"
_TABLES = ("body", "initial", "loads", "rotors", "parameters", "states", "bodies", "rigid_bodies", "events")
_WHERE = "[output] sensitivity"
_TENSOR = ("body", "inertia_tensor")


@dataclass(frozen=True)
class VariedKey:
    """A single number of a config.

    Attributes:
        name: its key with indices from 0, as ``initial.angular_velocity[0]``.
        unit: its SI unit; "1" for none or one that the config doesn't give.
        places: where it stands in the config; empty for a component of ``initial.attitude``.
        number: its value, SI.
        size: of numbers next to it, for what is small against it where it is zero.
        component: of ``initial.attitude``.
    """

    name: str
    unit: str
    places: tuple[Path, ...]
    number: ExactNumber
    size: ExactNumber
    component: int = 0

    def value(self, context: Any) -> Fraction:
        """Its value to the context's digits."""
        return fraction_of(self.number.at(context))

    def scale(self, context: Any) -> Fraction:
        """A positive size against which changes of it are small or not."""
        found = self.number if self.number.sign else self.size
        return abs(fraction_of(found.at(context))) or Fraction(1)


def varied_keys(
    experiment: Experiment, keys: Sequence[str], where: str = _WHERE, also: str = ""
) -> tuple[VariedKey, ...]:
    """The numbers that keys stand for, vectors and tensors component by component, in the order given.

    Args:
        also: a further key that is allowed, with N for any index.

    Raises:
        ConfigError: a key that there isn't, that has no number, or that is given twice; every problem.
    """
    problems: list[Problem] = []
    found: dict[str, VariedKey] = {}
    for key in keys:
        try:
            for one in _numbers_of(experiment, key, also):
                double = next((x for x in found.values() if x.places == one.places and x.places), None)
                if one.name in found or double is not None:
                    name = one.name if double is None or double.name == one.name else double.name
                    raise ValueError(f'stands for "{name}", which another key stands for, too; remove one')
                found[one.name] = one
        except ValueError as error:
            problems.append(Problem(where, f'"{key[:60]}" {error}'))
    if problems:
        raise ConfigError(problems, experiment.source)
    return tuple(found.values())


def scene_of(
    experiment: Experiment, keys: Sequence[VariedKey], values: Sequence[Fraction], context: Any
) -> Scene:
    """The scene in which keys have these values (SI), worked out in a context.

    Raises:
        ConfigError: no scene has such values.
    """
    config: Any = experiment.config
    vector = [context.zero] * 3
    for key, value in zip(keys, values, strict=True):
        for place in key.places:
            try:
                config = place.with_number(config, replace(key.number, rational=value, pi_power=0), context)
            except ValueError as error:
                raise ConfigError(Problem(place.where, str(error)), experiment.source) from None
        if not key.places:
            vector[key.component] = context.mpf(value.numerator) / context.mpf(value.denominator)
    scene = build_scene(replace(experiment, config=config), context)
    return scene if all(x == 0 for x in vector) else _turned(scene, vector)


def _turned(scene: Scene, vector: Sequence[Any]) -> Scene:
    """The scene that starts turned by a rotation vector, body axes (rad)."""
    context = scene.context
    angle = norm(context, list(vector))
    factor = context.sin(angle / 2) / angle
    turn = [context.cos(angle / 2), *(factor * x for x in vector)]
    turned = replace(scene, quaternion=list(product(scene.quaternion, turn)), euler_angles=None)
    return turned.started(rotation_of(turned))


# --- from texts to numbers ----------------------------------------------------------------------------------


def _numbers_of(experiment: Experiment, key: str, also: str) -> list[VariedKey]:
    """The numbers of one key; ValueError, to be read after the key, if there are none."""
    try:
        path = Path.of(key)
    except ValueError as error:
        raise ValueError(f"isn't a key: {error}") from None
    if path.steps[:2] == ("initial", "attitude"):
        return _of_attitude(experiment, path)
    if path.steps[0] not in _TABLES and "".join("N" if x.isdigit() else x for x in str(path)) != also:
        more = f" and {also}" * bool(also)
        raise ValueError(f"is no number of the motion; keys of {', '.join(_TABLES)}{more} are allowed")
    unit = path.taken(config_model(), experiment.to_dict()).unit
    value = path.get(experiment.config)
    named = _numbers_in(value, path)
    if value is None or not named:
        what = "isn't given in the config" if value is None else "has no number there"
        raise ValueError(
            f"{what}; name a number that the config gives, for a coefficient in an expression one of "
            "[parameters]"
        )
    found = []
    for place, number in named.items():
        places = _places(place)
        if place != places[0] and len(named) > 1:
            continue
        size = number if number.sign else _largest_beside(experiment.config, place)
        found.append(VariedKey(str(place), unit, places, number, size))
    return found


def _of_attitude(experiment: Experiment, path: Path) -> list[VariedKey]:
    if experiment.config.initial.equilibrium is not None:
        raise ValueError("turns a start that is found; give attitude and rates instead of equilibrium")
    chosen = path.steps[2:]
    if len(chosen) > 1 or (chosen and chosen[0] not in (0, 1, 2)):
        raise ValueError(f'has no such part; "{ATTITUDE}" is a rotation vector, with the indices 0, 1 and 2')
    one = ExactNumber(Fraction(1))
    return [
        VariedKey(f"{ATTITUDE}[{i}]", "rad", (), ExactNumber(Fraction(0)), one, i)
        for i in (chosen or (0, 1, 2))
        if isinstance(i, int)
    ]


def _numbers_in(value: Any, path: Path) -> dict[Path, ExactNumber]:
    """A number with its place, or those in an array and in arrays within it."""
    if not isinstance(value, ExactNumber | list | tuple):
        return {}
    return {place: one for place, one in leaves(value, path) if isinstance(one, ExactNumber)}


def _places(place: Path) -> tuple[Path, ...]:
    """Where the number stands: of an entry of a symmetric tensor first the place above the diagonal."""
    *table, row, column = place.steps
    if tuple(table) != _TENSOR or row == column:
        return (place,)
    low, high = sorted((int(row), int(column)))
    return (Path((*_TENSOR, low, high)), Path((*_TENSOR, high, low)))


def _largest_beside(config: Any, place: Path) -> ExactNumber:
    """The largest number in the array that a place is in; 1 without one."""
    depth = next((n for n, x in enumerate(place.steps) if isinstance(x, int) and n > 1), len(place.steps))
    array = Path(place.steps[:depth])
    beside = [x for x in _numbers_in(array.get(config), array).values() if x.sign]
    return max(beside, key=lambda x: abs(float(x)), default=ExactNumber(Fraction(1)))
