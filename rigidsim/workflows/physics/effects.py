"""Effects that a scene can be without: each load and rotor, what ``[body]`` brings, and parts of these.

Loads list their parts themselves (``SceneLoad.effect_parts``); a load without parts lists none.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rigidsim.scene.config import Experiment
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.registry import LOADS, names_of
from rigidsim.scene.schema import Config
from rigidsim.scene.toml_text import assignments_of

_TITLES = {"loads": "", "rotors": "rotor ", "bodies": "attraction by the point mass "}
"""What tables of arrays are called before their names."""


@dataclass(frozen=True)
class PhysicalEffect:
    """Something that acts in a scene, and can be left out.

    Attributes:
        code: its name, short and without spaces.
        words: what it is.
        values: new values by dotted key; None removes a key.
        gone: array of tables and place of the one that is removed; None for none.
        parts_of: codes of wider effects, without which this one isn't there either.
        missing: why a scene has none of it, if so.
    """

    code: str
    words: str
    values: Mapping[str, Any] = field(default_factory=dict)
    gone: tuple[str, int] | None = None
    parts_of: tuple[str, ...] = ()
    missing: str = ""


def load_codes(config: Config) -> list[str]:
    """A code for each load: its name, or its source's, or its kind; numbered if others share it."""
    plain = [(names_of(x) or [x.kind])[0] for x in config.loads]  # type: ignore[attr-defined]
    shared = Counter(plain)
    return [name if shared[name] == 1 else f"{name}-{n}" for n, name in enumerate(plain, 1)]


def effects_of(config: Config) -> dict[str, PhysicalEffect]:
    """All effects of a config by code, wider ones after their parts."""
    return {effect.code: effect for effect in _all(config) if not effect.missing}


def missing_from(config: Config) -> list[tuple[str, str]]:
    """What a config has no constants for, and why it is missing; the same of several loads in one row."""
    rows: dict[tuple[str, str], list[str]] = {}
    for effect in _all(config):
        if effect.missing:
            rows.setdefault((effect.words, effect.missing), []).extend(effect.parts_of[:1])
    loads = set(load_codes(config))
    named = {row: ", ".join(code for code in codes if code in loads) for row, codes in rows.items()}
    return [(f"{words} ({of})" if of else words, why) for (words, why), of in named.items()]


def _all(config: Config) -> Iterator[PhysicalEffect]:
    codes = load_codes(config)
    for n, (code, fields) in enumerate(zip(codes, config.loads, strict=True)):
        parts = [*LOADS["kind"][fields.kind].effect_parts(fields)]  # type: ignore[attr-defined]
        for key, kind in LOADS["beside"].items():
            parts += kind.effect_parts(fields) if key in type(fields).model_fields else []
        yield from _parts(code, f"loads[{n}]", parts)
        yield PhysicalEffect(code, fields.kind.replace("_", " "), gone=("loads", n))  # type: ignore[attr-defined]
    for key, load in LOADS["body"].items():
        if not load.brought_by(config) or _is_nothing(config, key, load.nothing):
            yield PhysicalEffect(key, load.title, missing=f"the config gives none ([body] {key})")
            continue
        yield from _parts(key, f"body.{key}", load.effect_parts(config))
        if load.nothing:
            preset = config.body.preset is not None
            given = {f"{key}.{x}": value for x, value in load.nothing.items()} if preset else {key: None}
            yield PhysicalEffect(key, load.title, {f"body.{x}": value for x, value in given.items()})
        else:
            yield PhysicalEffect(key, load.title, missing="no single key leaves it out")
    for array in ("bodies", *LOADS["table"]):
        for n, table in enumerate(getattr(config, array)):
            words = f"{_TITLES.get(array, '')}{table.name}"
            yield PhysicalEffect(f"{array[:-1]}-{table.name}", words, gone=(array, n))
        if array in LOADS["table"] and not getattr(config, array):
            yield PhysicalEffect(array, array, missing=f"the config has no [[{array}]]")
    if {fields.kind for fields in config.loads} < set(LOADS["kind"]):  # type: ignore[attr-defined]
        yield PhysicalEffect("others", "loads of other kinds", missing="none is given")


def _parts(
    code: str, table: str, parts: Sequence[EffectPart] | Iterator[EffectPart]
) -> Iterator[PhysicalEffect]:
    for part in parts:
        yield PhysicalEffect(
            f"{code}-{part.name}",
            part.words,
            {f"{table}.{key}": value for key, value in part.without.items()},
            parts_of=(code, *(f"{code}-{name}" for name in part.wider)),
            missing=part.missing,
        )


def _is_nothing(config: Config, key: str, nothing: Mapping[str, Any]) -> bool:
    return bool(nothing) and all(getattr(getattr(config.body, key), x).sign == 0 for x in nothing)


def outermost(effects: Mapping[str, PhysicalEffect], codes: Collection[str]) -> list[str]:
    """The codes without those that are parts of others among them, in the order of the effects."""
    return [c for c in effects if c in codes and not set(effects[c].parts_of) & set(codes)]


def settings_without(experiment: Experiment, codes: Sequence[str]) -> list[str]:
    """The changes, as ``KEY=VALUE``, to a config that leave out some of its effects: values first, then what
    is removed, so that places stay true.
    """
    config, known = experiment.config, effects_of(experiment.config)
    left_out = [known[code] for code in outermost(known, codes)]
    values = {key: value for effect in left_out for key, value in effect.values.items()}
    gone = sorted(effect.gone for effect in left_out if effect.gone)
    names = {name for array, n in gone if array == "loads" for name in names_of(config.loads[n])}
    for key, kind in LOADS["body"].items():
        if kind.brought_by(config) and key not in codes:
            values = {f"body.{key}.{x}": y for x, y in kind.without_loads(config, names).items()} | values
    counts = Counter(array for array, _ in gone)
    removed = dict.fromkeys(
        array if counts[array] == len(getattr(config, array)) else f"{array}[{n}]"
        for array, n in reversed(gone)
    )
    return [*assignments_of(values), *(f"{key}=" for key in removed)]


def without(experiment: Experiment, codes: Sequence[str]) -> Experiment:
    """The experiment without some of its effects."""
    settings = settings_without(experiment, codes)
    return experiment.having(settings) if settings else experiment
