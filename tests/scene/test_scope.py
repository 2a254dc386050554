"""What isn't modelled is said so, with what to use instead, wherever someone asks for it by its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigidsim import parse
from rigidsim.errors import ConfigError
from rigidsim.scene.schema import Config
from rigidsim.scene.scope import OUT_OF_SCOPE, PAGE, scope_answer
from rigidsim.workflows.ready_scenes import ready_scenes

TEXT = (Path(__file__).parents[2] / PAGE).read_text(encoding="utf-8")
SCENE = """
name = "a"
[body]
principal_moments = [1, 2, 2.5]
{body}
[initial]
angular_velocity = [0, 0, 1]
[time]
end = 1
[integrator]
precision = "double"
{more}
"""


def refused(body: str = "", more: str = "") -> str:
    with pytest.raises(ConfigError) as caught:
        parse(SCENE.format(body=body, more=more))
    return str(caught.value)


@pytest.mark.parametrize("item", OUT_OF_SCOPE, ids=lambda item: item.names[0])
def test_each_name_is_answered_as_load_key_and_table(item: object) -> None:
    assert isinstance(item, type(OUT_OF_SCOPE[0]))
    answer = f"; {item.said}: {item.instead} ({PAGE}); allowed: "
    for name in item.names:
        assert answer in refused(more=f'[[loads]]\nkind = "{name}"')
    first = item.names[0]
    assert answer in refused(body=f"{first} = true")
    assert answer in refused(more=f'[[loads]]\nkind = "torque"\ncomponents = [0, 0, 1]\n{first} = 1')
    assert answer in refused(more=f"[{first}s]\nx = 1")
    assert answer in refused(more=f'formulation = "{first}"')


def test_names_have_one_meaning_and_are_no_keys() -> None:
    names = [name for item in OUT_OF_SCOPE for name in item.names]
    assert len(names) == len(set(names))
    allowed: set[str] = set(Config.model_fields)
    for field in Config.model_fields.values():
        allowed |= set(getattr(field.annotation, "model_fields", {}))
    assert not allowed & set(names)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("Contact", "contact isn't"), ("contact_stiffness", "contact isn't"), ("joints", "joined together"),
        ("fuel-mass", "flow of liquids"), ("n-body", "close encounters"), ("flexible_panels", "bend"),
    ],
)  # fmt: skip
def test_names_are_recognised_in_other_forms(given: str, said: str) -> None:
    assert said in scope_answer(given)


@pytest.mark.parametrize("given", ["", "angular_velocty", "masss", "x" * 10_000, "torqe", "drag", "0"])
def test_other_names_are_left_alone(given: str) -> None:
    assert scope_answer(given) == ""


def test_the_page_has_a_row_for_each_and_what_it_names_is_there() -> None:
    rows = [line for line in TEXT.splitlines() if line.startswith("| **")]
    assert len(rows) == len(OUT_OF_SCOPE)
    told = " ".join(item.instead for item in OUT_OF_SCOPE)
    for scene in ("slosh", "thrusters"):
        assert scene in ready_scenes()
        assert f"rigidsim new {scene}" in told
        assert f"rigidsim new {scene}" in TEXT
