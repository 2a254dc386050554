"""``--set KEY=VALUE``: the same config as if it had been written so, and a text that says so."""

from pathlib import Path

import pytest

from rigidsim import ConfigError, load, parse

BASE = """\
name = "base"
[body]
principal_moments = [1, 2, 2.5]
mass = 1
[initial]
angular_velocity = [0.1, 1, 0.05]
[[loads]]
kind = "uniform_gravity"
acceleration = [0, 0, -9.8]
[time]
end = 10
"""

# override, (text to replace, by)
EDITS = {
    "top key": ("name=other", ('name = "base"', 'name = "other"')),
    "decimal as written": ("time.end=0.1", ("end = 10", "end = 0.1")),
    "number with a unit": ("time.end=430 day", ("end = 10", 'end = "430 day"')),
    "array": ("body.principal_moments=[2, 2, 3]", ("[1, 2, 2.5]", "[2, 2, 3]")),
    "index of a table": ("loads[0].acceleration[2]=-1.62", ("-9.8", "-1.62")),
    "bool": ("output.timeline=false", ("end = 10", "end = 10\n[output]\ntimeline = false")),
    "new table": (
        "integrator.precision=quadruple",
        ("end = 10", 'end = 10\n[integrator]\nprecision = "quadruple"'),
    ),
    "new key": ("initial.quaternion=[0,1,0,0]", ("0.05]", "0.05]\nquaternion = [0, 1, 0, 0]")),
    "inline table": ("limits={max_steps = 5}", ("end = 10", "end = 10\n[limits]\nmax_steps = 5")),
    "value with an equals sign": ("description=a=b", ('"base"', '"base"\ndescription = "a=b"')),
}


@pytest.mark.parametrize("case", EDITS)
def test_an_override_is_the_edit_and_stands_in_the_text_that_is_run(case: str) -> None:
    """One value per key, where the key stands; the text and the settings as given are kept, too."""
    override, (old, new) = EDITS[case]
    assert BASE.count(old) == 1
    experiment = parse(BASE, overrides=[override])
    assert experiment.config == parse(BASE.replace(old, new)).config != parse(BASE).config
    assert parse(experiment.text).config == experiment.config
    assert experiment.given == BASE
    assert experiment.settings == (override.strip(),)
    changed = [line for line in BASE.splitlines() if line not in experiment.text.splitlines()]
    assert len(changed) <= 1


def test_comments_and_order_stay() -> None:
    text = BASE.replace("end = 10", "end  =  10   # as long as it takes\n# and no longer")
    text = text.replace("[1, 2, 2.5]", "[1, # small\n  2, # middle\n  2.5, # large\n]")
    experiment = parse(text, overrides=["time.end=7 h", "body.principal_moments[1]=2.25"])
    expected = text.replace("end  =  10 ", 'end  =  "7 h" ').replace("  2, # middle", "  2.25, # middle")
    assert experiment.text == expected


@pytest.mark.parametrize(
    "text",
    [
        BASE + "#:set time.end=20\n",
        BASE.replace('"base"', '"base"\ndescription = """\n#:set time.end=20\n"""'),
    ],
)
def test_no_comment_is_executed(text: str, tmp_path: Path) -> None:
    """Nor a line of a string that looks like one which an earlier version wrote."""
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    for experiment in (parse(text), load(path), load(path, overrides=["time.start=1"])):
        assert experiment.config.time.end is not None
        assert experiment.config.time.end.rational == 10
        assert "#:set time.end=20" in experiment.text


@pytest.mark.parametrize(
    ("override", "where", "phrase"),
    [
        ("time.end", "--set time.end", "write KEY=VALUE on one line, such as time.end=10"),
        ('name="""a\nb"""', '--set name="""a\nb"""', "on one line"),
        ("body.principal_moments[x]=1", "--set body.principal_moments[x]=1", "an index counted from 0"),
        (
            "body.principal_moments[0=1",
            "--set body.principal_moments[0=1",
            '"principal_moments[0" is not a key',
        ),
        (
            "body.principal_moments[9]=1",
            "--set body.principal_moments[9]=1",
            'there is nothing at "9" to set',
        ),
        ("time.end.value=1", "--set time.end.value=1", 'there is nothing at "value" to set'),
        ("tiem.end=1", "tiem", 'did you mean "time"?'),
        ("time.ned=1", "[time] ned", 'did you mean "end"?'),
        ("time.end=true", "[time] end", "given true"),
    ],
)
def test_bad_overrides(override: str, where: str, phrase: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(BASE, source="scene.toml", overrides=[override])
    (problem,) = caught.value.problems
    assert problem.where == where
    assert phrase in problem.what
    assert str(caught.value).startswith("scene.toml: 1 problem")
