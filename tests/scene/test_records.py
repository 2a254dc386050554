"""Records behave as the standard library's dataclasses do, whose methods they replace."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import field
from typing import Any, ClassVar

import pytest

from rigidsim.scene import records


def twins(**options: bool) -> list[Any]:
    """The same classes, a base and what extends it, by both decorators."""
    made = []
    for decorate in (dataclasses.dataclass(**options), records.dataclass(**options)):

        @decorate
        class Base:
            a: int
            b: float = 2.0
            kind: ClassVar[str] = "base"

            def doubled(self) -> float:
                return 2 * self.b

        @decorate
        class Record(Base):
            c: list[int] = field(default_factory=list)
            d: str = field(default="d", compare=False)
            e: str = field(default="e", repr=False)

        made.append((Base, Record))
    return made


@pytest.mark.parametrize("frozen", [False, True])
def test_everything_that_can_be_seen_is_as_of_the_standard_library(frozen: bool) -> None:
    seen = []
    for base, record in twins(frozen=frozen):
        one, other = record(1), record(1, 2.0, [], "other")
        assert one.c is not other.c
        changed = dataclasses.replace(one, b=3.0)
        seen.append(
            (
                repr(one).rpartition(".")[2],
                one == other,
                one == changed,
                one == base(1),
                base(1) == base(1, 2.0),
                one.doubled(),
                changed.doubled(),
                dataclasses.asdict(changed),
                copy.deepcopy(changed) == changed,
                [(f.name, f.type) for f in dataclasses.fields(record)],
                list(inspect.signature(record).parameters),
                record.__match_args__,
                hash(base(1)) == hash(base(1, 2.0)) if frozen else base.__hash__,
            )
        )
    assert seen[0] == seen[1]


@pytest.mark.parametrize("wrong", [{}, {"a": 1, "z": 2}])
def test_wrong_arguments_are_refused(wrong: dict[str, int]) -> None:
    for base, _ in twins():
        with pytest.raises(TypeError, match=r"__init__\(\)"):
            base(**wrong)


def test_what_is_frozen_stays_so() -> None:
    for base, record in twins(frozen=True):
        for made in (base(1), record(1)):
            with pytest.raises(dataclasses.FrozenInstanceError):
                made.a = 2
            with pytest.raises(dataclasses.FrozenInstanceError):
                del made.a
            assert made.a == 1


def test_methods_of_its_own_are_kept() -> None:
    @records.dataclass(frozen=True)
    class Own:
        a: int

        def __eq__(self, other: object) -> bool:
            return True

        def __hash__(self) -> int:
            return 7

        def __repr__(self) -> str:
            return "own"

    assert Own(1) == Own(2)
    assert hash(Own(1)) == 7
    assert repr(Own(1)) == "own"


@records.dataclass(frozen=True)
class Sent:
    """At the top of a module, where pickle finds it."""

    a: int


def test_records_travel_between_processes() -> None:
    assert pickle.loads(pickle.dumps(Sent(3))) == Sent(3)


def test_what_these_records_lack_is_refused_where_a_class_is_defined() -> None:
    with pytest.raises(TypeError, match="__post_init__"):

        @records.dataclass
        class Checked:
            a: int

            def __post_init__(self) -> None:
                raise AssertionError

    with pytest.raises(TypeError, match=r"Named\.a"):

        @records.dataclass
        class Named:
            a: int = field(kw_only=True)
