"""What can't be run is refused before any step; the message says what was given, where and what to do."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import heyoka
import pytest

from rigidsim import ConfigError, load, parse
from rigidsim.scene.schema import editor_schema
from rigidsim.solve.problem import prepare

GOOD = {
    "top": 'name = "box"',
    "body": "principal_moments = [1, 2, 2.5]",
    "initial": "angular_velocity = [0.1, 1, 0.05]",
    "loads": "",
    "time": "end = 10\nsamples = 11",
    "integrator": "",
    "output": "",
    "limits": "",
    "more": "",
}


def config(**tables: str | None) -> str:
    """The good config with some tables replaced; one given as None is left out."""
    parts = {**GOOD, **tables}
    lines = [parts["top"] or ""]
    for name in ("body", "initial", "time", "integrator", "output", "limits"):
        if parts[name] is not None:
            lines.append(f"[{name}]\n{parts[name]}")
    if parts["loads"]:
        lines.append(f"[[loads]]\n{parts['loads']}")
    return "\n".join([*lines, parts["more"] or ""]) + "\n"


SOURCE = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
# group: (table, what stands around the text of a case, where its problems begin)
GROUPS = {
    "moment": ("body", "principal_moments = [1, {}, 2]", "[body] principal_moments[1]"),
    "part": ("body", 'parts = [{{shape = "sphere", mass = 1, radius = 1, {}}}]', "[body] parts[0]."),
    "ball": ("body", 'shape = "sphere"\nradius = 1\nmass = 1\n{}', "[body] "),
    "box": ("body", 'shape = "cuboid"\nmass = 1\n{}', "[body] "),
    "body": ("body", "{}", "[body] "),
    "rate": ("initial", "angular_velocity = [{}, 0, 0]", "[initial] angular_velocity[0]"),
    "spin": ("initial", "angular_velocity = [1, 0, 0]\n{}", "[initial] "),
    "initial": ("initial", "{}", "[initial] "),
    "name": ("top", "name = {}", "name"),
    "top": ("top", 'name = "x"\n{}', ""),
    "until 10": ("time", "end = 10\n{}", "[time] "),
    "until 1": ("time", "end = 1\n{}", "[time] "),
    "time": ("time", "{}", "[time] "),
    "integrator": ("integrator", "{}", "[integrator] "),
    "output": ("output", "{}", "[output] "),
    "limits": ("limits", "{}", "[limits] "),
    "source": ("loads", SOURCE + "{}", "[[loads]] number 1 "),
    "torque": ("loads", 'kind = "torque"\n{}', "[[loads]] number 1 "),
    "load": ("loads", "{}", "[[loads]] number 1 "),
    "more": ("more", "{}", ""),
}
WHOLE = ("moment", "rate", "name")  # whose problems are of the value itself
# by group: text, where (but for what the group begins with), phrases of the message
IN_ONE_TABLE: dict[str, list[tuple[str, ...]]] = {
    "moment": [
        ("true", "given true", 'a number (in kg m^2), or a string such as "8.008e37 kg m^2", is allowed'),
        ("nan", "given nan; finite numbers are allowed"),
        ('"2 kg m"', 'given "2 kg m"', 'a value in "kg m", where "kg m^2" is needed'),
    ],
    "part": [
        ('colour = "red"', "colour", "unknown key", "euler_angles, euler_sequence"),
        ("quaternion = [1, 0, 0, 0], euler_angles = [0, 0, 0]", "euler_angles", "given with quaternion"),
    ],
    "ball": [
        ("reference = [1, 2]", "reference", "given 2 entries; exactly 3 are needed"),
        ("center_of_mass = [0, 0, 1]", "center_of_mass", "it follows from shape; remove it"),
    ],
    "box": [
        ("", "size", "missing; a cuboid needs it: 3 positive lengths"),
        ("size = [1, 2, -3]", "size[2]", "given -3; a positive length"),
    ],
    "body": [
        ('shape = "spere"\nmass = 1\nradius = 1', "shape", 'given "spere"', 'did you mean "sphere"?'),
        ("inertia_tensor = [[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]]", "inertia_tensor[1][0]", "given 0.2, but"),
        ("principal_moments = [1, 2, 3.25]", "principal_moments", "1.0, 2.0, 3.25", "I1 + I2 >= I3"),
        ('shape = "sphere"\nmass = 1', "radius", "missing; a sphere needs it: a positive length"),
    ],
    "rate": [
        (
            '"1 fortnight"',
            'given "1 fortnight"',
            'unknown unit "fortnight"',
            "units for rad/s: rpm; for rad: rad deg",
        ),
        ('"2 Hz"', '"Hz" may count turns or radians; write "turn/s"'),
    ],
    "spin": [
        ('euler_angles = ["1 s", 0, 0]', "euler_angles[0]", "which is rad"),
        ("angular_momentum = [1, 0, 0]", "angular_momentum", "given with angular_velocity"),
    ],
    "initial": [
        ("angular_velocty = [1, 0, 0]", "angular_velocty", 'did you mean "angular_velocity"?'),
        ("", "angular_velocity", "missing", "exactly one of angular_velocity, angular_momentum"),
    ],
    "name": [
        ('"a/b"', 'given "a/b"', "allowed: 1 to 100 letters, digits, dots, underscores and hyphens"),
        ('".."', 'given ".."', "not dots alone"),
    ],
    "top": [
        ('nmae = "y"', "nmae", "unknown key", 'did you mean "name"?'),
        ('[states]\nname = "s"', "[[states]]", "write [[states]] in double brackets"),
    ],
    "until 10": [
        ("samples = 5\nevery = 1", "", "given samples and every; give one of them"),
        ("samples = 10_000_000_000_000", "samples", "makes 1.0e+13 samples"),
        ("every = 11", "every", "makes 1.0 samples of the run; 2 (at start and end)"),
    ],
    "until 1": [
        ('epoch = "2029-04-13T21:46:00"', "epoch", 'given "2029-04-13T21:46:00", without its time scale'),
        ('epoch = "2999-01-01 UTC"', "epoch", "UTC is known from 1960-01-01 to"),
        ("samples = 11.0", "samples", "given 11.0", "a whole number, without point or exponent, is allowed"),
    ],
    "time": [
        ("samples = 3", "end", "missing; it must be given, unless times are"),
        ("times = [1, 2, 2]", "times[2]", "given 2.0 s after 2.0 s; times must increase"),
    ],
    "integrator": [
        ('method = "rk4"', "method", 'given "rk4"', "allowed: taylor"),
        ("tolerance = 0", "tolerance", "allowed: auto, or a number above 0 and at most 1"),
        ('formulation = "canonical"', "formulation", "singularity of the sequence zxz"),
    ],
    "output": [
        ('record = ["angular_velocity", "enegry"]', "record[1]", 'given "enegry"', 'did you mean "energy"?'),
        ('record = ["position"]', "record", 'given "position"', "no position", "leave it out"),
    ],
    "limits": [
        ("wal_time = 1", "wal_time", 'did you mean "wall_time"?'),
        ("max_steps = 1e9", "max_steps", "given 1e+9"),
    ],
    "source": [
        ("position = [1, 0, 0]\norbit = {semi_major_axis = 1}", "", "given orbit and position"),
        ("position = [0, 0, 0]", "position", "given the origin", "another point is allowed"),
    ],
    "torque": [
        ('components = ["0", "2*vx", "1"]', "components[1]", 'column 3: unknown name "vx"'),
        ('components = ["().__class__", "0", "1"]', "components[0]", "column"),
    ],
    "load": [
        ('kind = "uniform_gravty"', "kind", 'given "uniform_gravty"', 'did you mean "uniform_gravity"?'),
        ('kind = "gravity_gradient"\ngravitational_parameter = 1', "", "given none"),
        ('kind = "central_gravity"\ngravitational_parameter = 1', "kind", 'given "central_gravity" for a'),
    ],
    "more": [
        ('[integratr]\nprecision = "double"', "integratr", "unknown key", 'did you mean "integrator"?'),
        ("[time]\nend = 2", "TOML", 'Cannot declare "time" twice', "line"),
        ("[fit.data]\nsigma = 1", "[[fit.data]]", "write [[fit.data]] in double brackets"),
    ],
}
FLYING = "angular_velocity = [1, 0, 0]\nvelocity = [0, 0, 0]"
ROD = {"body": 'shape = "rod"\nmass = 1\nlength = 1'}
ASKEW = {"body": "principal_moments = [1, 2, 2]\nmass = 1\ncenter_of_mass = [0, 0, 1]"}
SUN = SOURCE + 'ephemeris = "sun"'
RATES, SINGLE = {"integrator": 'formulation = "rates"'}, {"integrator": 'precision = "single"'}
# tables, where, phrases
IN_SEVERAL: list[tuple[Any, ...]] = [
    ({"top": ""}, "name", "missing; it must be given"),
    ({"loads": SUN, "more": '[frame]\naxes = "ICRF"'}, "[frame] axes", 'is in "ecliptic J2000"; write that'),
    ({"body": "mass = 1"}, "[body]", "given no source of inertia", "exactly one of principal_moments, "),
    ({"top": "name = box"}, "TOML", "at line 1", 'need quotes: "box"'),
    ({"time": "end = 10 s"}, "TOML", 'numbers with units, need quotes: "10 s"'),
    (ROD | {"initial": "angular_velocity = [1, 0, 0.5]"}, "[initial] angular_velocity", "a spin about"),
    ({"initial": FLYING} | ASKEW, "[body] center_of_mass", "turns about its centre of mass"),
    ({"output": 'record = ["quaternion"]'} | RATES, "[output] record", "choose another formulation"),
    ({"body": "principal_moments = [1e4000, 1e4000, 1e4000]"}, "[body] principal_moments", "given 1.0e+4000"),
    ({"time": "end = 1\nsamples = 100_000_000"} | SINGLE, "[time]", "than single precision"),
    ({"time": "start = 1e9\nend = 1_000_000_001"} | SINGLE, "[time]", "samples 0 and 1 are closer together"),
]


def _cases() -> Iterator[tuple[dict[str, str | None], str, tuple[str, ...]]]:
    for group, entries in IN_ONE_TABLE.items():
        table, around, begins = GROUPS[group]
        for text, *rest in entries:
            where, phrases = ("", rest) if group in WHOLE else (rest[0], rest[1:])
            yield {table: around.format(text)}, (begins + where).rstrip(), tuple(phrases)
    yield from ((tables, where, tuple(phrases)) for tables, where, *phrases in IN_SEVERAL)


CASES = list(_cases())


@pytest.fixture(autouse=True)
def no_integrator(monkeypatch: pytest.MonkeyPatch) -> None:
    def reached(*_: Any, **__: Any) -> None:
        raise AssertionError("a bad config reached the integrator")

    monkeypatch.setattr(heyoka, "taylor_adaptive", reached)


def refused(attempt: Callable[[], Any]) -> list[Any]:
    with pytest.raises(ConfigError) as caught:
        attempt()
    return caught.value.problems


@pytest.mark.parametrize(("tables", "where", "phrases"), CASES)
def test_refused_with_a_message_that_helps(
    tables: dict[str, str | None], where: str, phrases: tuple[str, ...]
) -> None:
    problems = refused(lambda: prepare(parse(config(**tables))))
    assert where in [problem.where for problem in problems]
    text = next(problem.what for problem in problems if problem.where == where)
    assert [phrase for phrase in phrases if phrase not in text] == []
    for foreign in ("Decimal", "Fraction", "True", "False", "None", "NoneType", "tuple", "Input should"):
        assert foreign not in text  # no Python but the user's own


@pytest.mark.parametrize(
    ("tables", "places"),
    [
        (
            {
                "top": 'name = "a/b"',
                "body": "principal_moments = [1, true, 2]\nmas = 3",
                "loads": 'kind = "torque"',
                "output": "record = []",
                "limits": "wall_time = 0",
            },
            [
                "[[loads]] number 1 components",
                "[body] mas",
                "[body] principal_moments[1]",
                "[limits] wall_time",
                "[output] record",
                "name",
            ],
        ),
        (
            {
                "body": "principal_moments = [1, 2, 4]",
                "initial": "angular_velocity = [1, 0, 0]\nprime_meridian = 1",
                "time": "end = 0",
            },
            ["[body] principal_moments", "[initial] prime_meridian", "[time] end"],
        ),
    ],
    ids=["text", "mechanics"],
)
def test_all_problems_are_reported_at_once(tables: dict[str, str | None], places: list[str]) -> None:
    problems = refused(lambda: prepare(parse(config(**tables))))
    assert sorted(problem.where for problem in problems) == places


def test_the_text_counts_the_problems_and_names_the_file() -> None:
    with pytest.raises(ConfigError) as caught:
        parse(config(time="end = true\nsamples = 1.5"), source="top.toml")
    lines = str(caught.value).splitlines()
    assert lines[0] == "top.toml: 2 problems in the config"
    assert lines[1].startswith("  [time] end: given true")
    assert lines[2].startswith("  [time] samples: given 1.5")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path, why in ((tmp_path / "none.toml", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(ConfigError) as caught:
            load(path)
        assert str(path) in str(caught.value)
        assert f"file: can't be read: {why}" in str(caught.value)


def test_every_table_is_named_in_brackets() -> None:
    """An unknown key, or a missing one, in each table that the schema of editors shows."""
    schema = editor_schema()
    for name, field in schema["properties"].items():
        text = str(field)
        if "$ref" not in text or name in (*GOOD, "parameters", "tables"):  # there already, or open to any key
            continue
        array = "'array'" in text
        written = f"[[{name}]]" if array else f"[{name}]"
        with pytest.raises(ConfigError) as refused:
            parse(config(more=f"{written}\nno_such_key = 1"))
        where = f"{written} number 1 no_such_key" if array else f"{written} no_such_key"
        assert where in [problem.where for problem in refused.value.problems]
