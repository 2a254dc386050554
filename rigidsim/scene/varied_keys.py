"""Numbers of a config that are varied, one by one: what keys such as those of ``[output] sensitivity`` stand
for, and the same scene with other numbers there.

``initial.attitude`` stands for a rotation vector (body axes, rad) by which the config's own start is turned;
its value is zero. The angular velocity in body axes is kept thereby, unless the config gives the momentum in
space. A tensor of inertia stays symmetric: an entry beside the diagonal stands for both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import norm
from rigidsim.scene.attitude import product
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.starts import RATES
from rigidsim.scene.sweeps.axes import unit_and_length
from rigidsim.scene.toml_text import key_steps, parse_toml

ATTITUDE = "initial.attitude"
_TABLES = ("body", "initial", "loads", "rotors", "parameters", "states", "bodies")
_WHERE = "[output] sensitivity"
_TENSOR = ("body", "inertia_tensor")

Steps = tuple[str | int, ...]


@dataclass(frozen=True)
class VariedKey:
    """A single number of a config.

    Attributes:
        name: its key with indices from 0, as ``initial.angular_velocity[0]``.
        unit: its SI unit; "1" for none or one that the config doesn't tell.
        places: where it stands, as steps into the config; empty for a component of ``initial.attitude``.
        number: its value, SI.
        size: of numbers beside it, for what is small against it where it is zero.
        component: of ``initial.attitude``.
    """

    name: str
    unit: str
    places: tuple[Steps, ...]
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


def varied_keys(experiment: Experiment, keys: Sequence[str], where: str = _WHERE) -> tuple[VariedKey, ...]:
    """The numbers that keys stand for, vectors and tensors component by component, in the order given.

    Raises:
        ConfigError: a key that there isn't, that has no number, or that is given twice; every problem.
    """
    problems: list[Problem] = []
    found: dict[str, VariedKey] = {}
    for key in keys:
        try:
            for one in _numbers_of(experiment, key, where):
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
            config = replaced(config, place, replace(value_at(config, place), rational=value, pi_power=0))
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
    if scene.config.initial.angular_momentum is None:
        return turned
    return replace(turned, angular_velocity=RATES["angular_momentum"].resolve(turned))


# --- from texts to numbers ----------------------------------------------------------------------------------


def _numbers_of(experiment: Experiment, key: str, where: str) -> list[VariedKey]:
    """The numbers of one key; ValueError, to be read after the key, if there are none."""
    try:
        steps = tuple(key_steps(key, where))
    except ConfigError as error:
        raise ValueError(f"isn't a key: {error.problems[0].what}") from None
    if steps[:2] == ("initial", "attitude"):
        return _of_attitude(experiment, steps)
    if steps[0] not in _TABLES:
        raise ValueError(f"is no number of the motion; keys of {', '.join(_TABLES)} are allowed")
    unit, _ = unit_and_length(key, parse_toml(experiment.text, experiment.source))
    value = value_at(experiment.config, steps)
    named = {steps: value} if isinstance(value, ExactNumber) else dict(_entries(value, steps))
    if value is None or not named:
        what = "isn't given in the config" if value is None else "has no number there"
        raise ValueError(
            f"{what}; name a number that the config gives, for a coefficient in an expression one of "
            "[parameters]"
        )
    found = []
    for place, number in named.items():
        if place[:2] == _TENSOR and len(place) == 4 and int(place[2]) > int(place[3]) and len(named) > 1:
            continue
        size = number if number.sign else _largest_beside(experiment.config, place)
        found.append(VariedKey(_name(place), unit, _places(place), number.alone, size.alone))
    return found


def _of_attitude(experiment: Experiment, steps: Steps) -> list[VariedKey]:
    if experiment.config.initial.equilibrium is not None:
        raise ValueError("turns a start that is found; give attitude and rates instead of equilibrium")
    chosen = steps[2:]
    if len(chosen) > 1 or (chosen and chosen[0] not in (0, 1, 2)):
        raise ValueError(f'has no such part; "{ATTITUDE}" is a rotation vector, with the indices 0, 1 and 2')
    one = ExactNumber(Fraction(1))
    return [
        VariedKey(f"{ATTITUDE}[{i}]", "rad", (), ExactNumber(Fraction(0)), one, i)
        for i in (chosen or (0, 1, 2))
        if isinstance(i, int)
    ]


def value_at(value: Any, steps: Sequence[str | int]) -> Any:
    """What stands at a place; None for nothing."""
    for step in steps:
        if isinstance(step, int):
            value = value[step] if isinstance(value, list | tuple) and step < len(value) else None
        else:
            value = value.get(step) if isinstance(value, Mapping) else getattr(value, step, None)
    return value


def _entries(value: Any, steps: Steps) -> list[tuple[Steps, ExactNumber]]:
    """The numbers in an array and in arrays within it."""
    if isinstance(value, ExactNumber):
        return [(steps, value)]
    if not isinstance(value, list | tuple):
        return []
    return [found for i, entry in enumerate(value) for found in _entries(entry, (*steps, i))]


def _places(place: Steps) -> tuple[Steps, ...]:
    if place[:2] == _TENSOR and len(place) == 4 and place[2] != place[3]:
        row, column = sorted(int(i) for i in place[2:])
        return ((*_TENSOR, row, column), (*_TENSOR, column, row))
    return (place,)


def _largest_beside(config: Any, place: Steps) -> ExactNumber:
    """The largest number in the array that a place is in; 1 without one."""
    depth = next((n for n, step in enumerate(place) if isinstance(step, int) and n > 1), len(place))
    beside = [x for _, x in _entries(value_at(config, place[:depth]), place[:depth]) if x.sign]
    return max(beside, key=lambda x: abs(float(x)), default=ExactNumber(Fraction(1)))


def _name(steps: Steps) -> str:
    """A key of such steps."""
    text = ""
    for step in steps:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            plain = step.replace("_", "").replace("-", "").isalnum()
            text += ("." if text else "") + (step if plain else f'"{step}"')
    return text


def replaced(value: Any, steps: Sequence[str | int], number: ExactNumber) -> Any:
    """A copy of a table with another number in one place, where one stands."""
    if not steps:
        return number
    first, *rest = steps
    if isinstance(value, Mapping):
        return {**value, first: replaced(value[first], rest, number)}
    if isinstance(first, int):
        changed = [*value[:first], replaced(value[first], rest, number), *value[first + 1 :]]
        return tuple(changed) if isinstance(value, tuple) else changed
    return value.model_copy(update={first: replaced(getattr(value, first), rest, number)})
