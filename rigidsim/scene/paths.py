"""The address of a value in a config, in TOML's tables or validated ones: ``initial.angular_velocity[0]``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Self, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import Beside, Exactly, InUnit, OneOf, OrWord, Range
from rigidsim.scene.validation_messages import nearest, shown

ARRAYS_OF_TABLES = ("loads", "bodies", "rigid_bodies", "rotors", "states", "events", "fit.data")
_TABLES = (
    "body", "initial", "ephemeris", "frame", "time", "model", "integrator", "output", "limits", "parameters",
    "sweep", "fit", "tables", "tides",
)  # fmt: skip
_PART = re.compile(r"""\s*(?:"([^"\n]+)"|'([^'\n]+)'|([^\[\].\"']+))((?:\[\d{1,9}\])*)\s*(\.|$)""")


@dataclass(frozen=True)
class Taken:
    """What a key takes: the SI unit of its numbers ("1" for none), their count (0 for a plain one), the
    ranges that each is in, words, and what is kept of a file of that name (see ``Beside``).
    """

    unit: str
    length: int
    ranges: list[Range]
    words: list[str]
    beside: str


@dataclass(frozen=True)
class Path:
    """Keys and indices from 0; the empty path is the config itself."""

    steps: tuple[str | int, ...] = ()

    @classmethod
    def of(cls, text: str) -> Self:
        """Read a dotted key with indices, a part with dots in quotes; ValueError says what is none."""
        steps: list[str | int] = []
        begin = 0
        while True:
            match = _PART.match(text, begin)
            if match is None:
                part = text[begin:].split(".")[0]
                raise ValueError(
                    f'"{part}" is not a key, or a key with an index counted from 0, such as times[0]'
                )
            steps.append(match[1] or match[2] or match[3].strip())
            steps.extend(int(index) for index in re.findall(r"\d+", match[4]))
            if not match[5]:
                return cls(tuple(steps))
            begin = match.end()

    def __str__(self) -> str:
        text = ""
        for step in self.steps:
            if isinstance(step, int):
                text += f"[{step}]"
            else:
                plain = step.replace("_", "").replace("-", "").isalnum()
                text += ("." if text else "") + (step if plain else f'"{step}"')
        return text

    @property
    def where(self) -> str:
        """As it stands in the file: ``[body] principal_moments[1]``, ``[[loads]] number 2 components[0]``."""
        steps = list(self.steps)
        if not steps:
            return "config"
        names = [".".join(map(str, steps[:count])) for count in (1, 2)]
        if array := [name for name in names if name in ARRAYS_OF_TABLES]:
            head, rest = f"[[{array[0]}]]", steps[names.index(array[0]) + 1 :]
            if rest and isinstance(rest[0], int):
                head, rest = f"{head} number {rest[0] + 1}", rest[1:]
        else:
            head, rest = (f"[{steps[0]}]", steps[1:]) if steps[0] in _TABLES else ("", steps)
        key = "".join(f"[{step}]" if isinstance(step, int) else f".{_visible(step)}" for step in rest)
        return f"{head} {key.removeprefix('.')}".strip()

    def __truediv__(self, step: str | int) -> Path:
        return Path((*self.steps, step))

    @property
    def parent(self) -> Path:
        """The table or array that its last step is in."""
        return Path(self.steps[:-1])

    # --- values -----------------------------------------------------------------------------------------

    def get(self, tree: Any) -> Any:
        """What stands there; None for nothing."""
        for step in self.steps:
            try:
                tree = _entry(tree, step)
            except LookupError:
                return None
        return tree

    def set(self, tree: Any, value: Any) -> None:
        """Put a value there, in tables of TOML, and create the tables around it; None removes what is there.

        Raises:
            ValueError: there is no such place.
        """
        *outer, last = self.steps
        for n, step in enumerate(outer):
            if value is not None and isinstance(tree, dict) and isinstance(step, str) and step not in tree:
                tree[step] = [] if isinstance(self.steps[n + 1], int) else {}
            try:
                tree = _entry(tree, step)
            except LookupError:
                raise ValueError(_nothing(tree, step, "set")) from None
        try:
            if value is None:
                del tree[last]
            elif isinstance(tree, list) == isinstance(last, str):
                raise TypeError
            else:
                tree[last] = value
        except (TypeError, LookupError):
            raise ValueError(_nothing(tree, last, "remove" if value is None else "set")) from None

    def replaced(self, tree: Any, value: Any) -> Any:
        """A copy of validated tables with another value there, where there is one."""
        if not self.steps:
            return value
        first, rest = self.steps[0], Path(self.steps[1:])
        inner = rest.replaced(_entry(tree, first), value)
        if isinstance(tree, BaseModel):
            return tree.model_copy(update={str(first): inner})
        if isinstance(tree, Mapping):
            return {**tree, str(first): inner}
        return type(tree)(inner if n == first else entry for n, entry in enumerate(tree))

    def with_number(self, config: BaseModel, number: ExactNumber, context: Any) -> Any:
        """A validated config with another number there; ValueError if the key allows none such."""
        for one in self.taken(type(config), config).ranges:
            one.checked(number, context)
        return self.replaced(config, number)

    # --- what a config takes there --------------------------------------------------------------------------

    def taken(self, model: type[BaseModel], tables: Mapping[str, Any] | BaseModel) -> Taken:
        """What the key takes in a config of these tables, validated or not, since a load's keys depend on its
        kind; ValueError names the keys that there are if there is no such key.
        """
        kinds, table = self._kinds(model, tables)
        fields = [x for _, about in kinds for x in about if isinstance(x, FieldInfo)]
        extra = [x.json_schema_extra for x in fields if isinstance(x.json_schema_extra, dict)]
        beside = [table.get(x.get("x-unit-key")) for x in extra if isinstance(table, Mapping)]
        unit = next((unit for unit in beside if isinstance(unit, str)), None)  # written next to the number
        counts = [x.count for _, about in kinds for x in about if isinstance(x, Exactly)]
        counts += [n for x in extra if isinstance(n := x.get("minItems"), int) and n == x.get("maxItems")]
        ranges = [x for _, about in kinds for x in about if isinstance(x, Range)]
        words = [word for kind, _ in kinds for word in _words(kind)]
        named = (x for _, about in kinds for x in about if isinstance(x, OneOf | OrWord))
        words += [word for x in named for word in x.words]
        files = (x.kind for _, about in kinds for x in about if isinstance(x, Beside))
        return Taken(unit or _unit(kinds), next(iter(counts), 0), ranges, words, next(files, ""))

    def keys(self, model: type[BaseModel], tables: Mapping[str, Any]) -> list[str]:
        """The keys of the table there; none where there is no table."""
        return _keys(self._kinds(model, tables)[0])

    def _kinds(self, model: type[BaseModel], tables: Any) -> tuple[list[_Kind], Any]:
        """Types of what may stand there, and the table or array that it is in."""
        kinds: list[_Kind] = [(model, ())]
        around, value = None, tables
        for step in self.steps:
            found = [inner for kind, _ in kinds for inner in _inside(kind, step)]
            if not found and isinstance(step, str) and (allowed := _keys(kinds)):
                near = nearest(step, allowed)
                raise ValueError(f'unknown key "{step[:60]}"{near}; allowed: {", ".join(allowed)}')
            around, value = value, Path((step,)).get(value)
            kinds = [one for kind in found for one in _alternatives(*kind, value)]
        return kinds, around


_Kind = tuple[Any, tuple[Any, ...]]
"""A type, and what its annotations say of it."""


def _alternatives(annotation: Any, about: tuple[Any, ...], value: Any) -> Iterator[_Kind]:
    """What an annotation stands for, without tables of another kind than the value's."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _alternatives(inner[0], (*about, *inner[1:]), value)
    elif origin in (Union, UnionType):
        for one in inner:
            yield from _alternatives(one, about, value)
    elif annotation is not NoneType and not (_is_table(annotation) and _is_other_kind(annotation, value)):
        yield annotation, about


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _is_other_kind(model: type[BaseModel], value: Any) -> bool:
    if isinstance(value, BaseModel):
        return not isinstance(value, model)
    kind = model.model_fields.get("kind")
    known = isinstance(value, Mapping) and "kind" in value
    return kind is not None and known and value["kind"] not in get_args(kind.annotation)


def _inside(annotation: Any, step: str | int) -> Iterator[_Kind]:
    """What an array or table holds at a step."""
    if isinstance(step, int):
        if get_origin(annotation) is list:
            yield get_args(annotation)[0], ()
    elif get_origin(annotation) is dict:
        yield get_args(annotation)[1], ()
    elif _is_table(annotation) and step in annotation.model_fields:
        field = annotation.model_fields[step]
        yield field.annotation, (*field.metadata, field)


def _keys(kinds: list[_Kind]) -> list[str]:
    return sorted(
        {key for annotation, _ in kinds if _is_table(annotation) for key in annotation.model_fields}
    )


def _unit(kinds: list[_Kind]) -> str:
    """SI unit of numbers, or of those in an array; "1" for none."""
    for annotation, about in kinds:
        if unit := next((x.unit for x in about if isinstance(x, InUnit)), ""):
            return unit
        if get_origin(annotation) is list:
            inner = _unit([*_alternatives(get_args(annotation)[0], (), None)])
            if inner != "1":
                return inner
    return "1"


def _words(kind: Any) -> tuple[str, ...]:
    """Words that a type consists of."""
    return ("true", "false") if kind is bool else get_args(kind) if get_origin(kind) is Literal else ()


def _entry(tree: Any, step: str | int) -> Any:
    """What a table or an array has at a step; LookupError for nothing."""
    if isinstance(tree, BaseModel) and step in type(tree).model_fields:
        return getattr(tree, str(step))
    if isinstance(tree, Mapping) and isinstance(step, str):
        return tree[step]
    if isinstance(tree, list | tuple) and isinstance(step, int):
        return tree[step]
    raise LookupError(step)


def _nothing(tree: Any, step: str | int, purpose: str) -> str:
    """What to say of a place that doesn't exist."""
    there = ""
    if isinstance(tree, list) and isinstance(step, int):
        entries = f"entries 0 to {len(tree) - 1}" if tree else "no entries"
        there = f"; the array there has {entries}"
    return f'there is nothing at "{step}" to {purpose}{there}'


def _visible(key: str) -> str:
    """A key as it is, or quoted if it contains points, and shortened if it is empty, long or invisible."""
    plain = 0 < len(key) <= 60 and key.isprintable() and key.strip() and "." not in key
    return key if plain else shown(key)


def leaves(tree: Any, path: Path = Path()) -> Iterator[tuple[Path, Any]]:
    """Every value of tables that is no table and no array, with its place."""
    if isinstance(tree, BaseModel):
        inner: Any = tree
    elif isinstance(tree, Mapping):
        inner = tree.items()
    elif isinstance(tree, list | tuple):
        inner = enumerate(tree)
    else:
        yield path, tree
        return
    for step, value in inner:
        yield from leaves(value, path / step)


def numbers(tree: Any) -> Iterator[tuple[Path, list[ExactNumber]]]:
    """Every number, and every array of numbers, with its place."""

    def place(one: tuple[Path, ExactNumber]) -> Path:
        return one[0] if isinstance(one[0].steps[-1], str) else one[0].parent

    found = ((path, value) for path, value in leaves(tree) if isinstance(value, ExactNumber))
    for path, group in groupby(found, place):
        yield path, [number for _, number in group]
