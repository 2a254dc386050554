"""What isn't modelled is answered with what to use instead, wherever a config asks for it by its name."""

from pathlib import Path

import pytest

from rigidsim import parse
from rigidsim.errors import ConfigError
from rigidsim.scene.scope import OUT_OF_SCOPE, PAGE
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
{more}
"""


def refused(body: str = "", more: str = "") -> str:
    with pytest.raises(ConfigError) as caught:
        parse(SCENE.format(body=body, more=more))
    return str(caught.value)


def test_each_name_is_answered_as_load_key_and_table() -> None:
    for item in OUT_OF_SCOPE:
        answer = f"; {item.said}: {item.instead} ({PAGE}); allowed: "
        for name in item.names:
            assert answer in refused(more=f'[[loads]]\nkind = "{name}"')
        first = item.names[0]
        assert answer in refused(body=f"{first} = true")
        assert answer in refused(more=f"[{first}s]\nx = 1")
    for given, said in (("contact_stiffness", "contact isn't"), ("fuel-mass", "flow of liquids")):
        assert said in refused(more=f'[[loads]]\nkind = "{given}"')


@pytest.mark.parametrize("given", ["masss", "x" * 10_000])
def test_other_names_are_left_alone(given: str) -> None:
    assert PAGE not in refused(body=f"{given} = 1")


def test_the_page_has_a_row_for_each_and_its_scenes_exist() -> None:
    assert sum(line.startswith("| **") for line in TEXT.splitlines()) == len(OUT_OF_SCOPE)
    for scene in ("slosh", "thrusters"):
        assert scene in ready_scenes()
        assert f"rigidsim new {scene}" in TEXT
