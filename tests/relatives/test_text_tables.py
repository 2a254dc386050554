"""Tables of text as people's tools write them: names, units, separators, decimal commas and dates.

The truth is a spin about one axis in closed form: q = (cos(w t/2), 0, 0, sin(w t/2)).
"""

import random
import re
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support import seeds

import rigidsim
from rigidsim.errors import RigidsimError
from rigidsim.scene.scene import build_scene

RATE = 0.49
SPIN = f"""
name = "spin"
[body]
principal_moments = [1, 1, 1]
[initial]
angular_velocity = [0, 0, {RATE}]
[time]
end = 11
epoch = "2024-03-01T00:00:00 UTC"
"""
FIT = """
[fit]
parameters = ["initial.angular_velocity[2]"]
[[fit.data]]
file = "seen.csv"
observable = "angular_velocity"
columns = ["x", "y", "z"]
sigma = "1e-3 rad/s"
"""
UNITS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "day": 86400.0}
START = datetime(2024, 3, 1, tzinfo=UTC)


def table(chance: random.Random, path: Path, names: dict[str, np.ndarray], times: np.ndarray) -> str:
    """Write a table in a drawn style: header, separator, decimals, unit or dates, comments among the rows."""
    separator = chance.choice([",", ";", "\t", " "])
    comma = separator != "," and chance.random() < 0.5
    dated = separator != " " and chance.random() < 0.3
    unit = chance.choice(list(UNITS))
    form = chance.choice(["{} [{}]", "{} ({})", "{}_{}"])
    head = ["time" if dated else form.format("time", unit), *names]
    header = separator.join(head)
    bom = chance.choice(["", "\ufeff"])
    lines = [bom + chance.choice(["", "# "]) + header]
    for n, time in enumerate(times):
        if chance.random() < 0.1:
            lines.append(chance.choice(["", "# a comment"]))
        shown = (START + timedelta(seconds=time)).strftime("%Y-%m-%dT%H:%M:%S.%f")
        cells = [repr(float(values[n])) for values in names.values()]
        first = shown + chance.choice(["", "Z"]) if dated else repr(float(time / UNITS[unit]))
        row = [first if dated else first.replace(".", ",") if comma else first]
        row += [cell.replace(".", ",") if comma else cell for cell in cells]
        lines.append(separator.join(row))
    path.write_text(chance.choice(["\n", "\r\n"]).join(lines) + "\n", encoding="utf-8", newline="")
    return "\n".join(lines)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_any_style_is_read(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    times = np.round(np.cumsum([0.0, *(chance.uniform(0.1, 1) for _ in range(10))]), 6)
    half = RATE * times / 2
    quaternion = {"qw": np.cos(half), "qx": 0 * half, "qy": 0 * half, "qz": np.sin(half)}
    text = table(chance, tmp_path / "theirs.csv", quaternion, times)
    found = rigidsim.compare(rigidsim.parse(SPIN), tmp_path / "theirs.csv")
    assert found.attitude_error.largest < 1e-9, text
    assert found.rows == len(times)


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_a_fit_reads_any_style(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    times = np.arange(6.0)
    rate = {"x": 0 * times, "y": 0 * times, "z": RATE + 1e-4 * np.cos(times)}
    text = table(chance, tmp_path / "seen.csv", rate, times)
    (tmp_path / "config.toml").write_text(SPIN + FIT)
    found = rigidsim.fit(tmp_path / "config.toml")
    assert found.parameters[0].value == pytest.approx(np.mean(rate["z"]), abs=1e-9), text


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_sample_times_of_any_style(seed: int, tmp_path: Path) -> None:
    """Each is the number that is written, digit by digit; dates need a time scale here."""
    chance = random.Random(seed)
    times = np.round(np.cumsum([0.0, *(chance.uniform(0.1, 1) for _ in range(10))]), 6)
    text = table(chance, tmp_path / "theirs.csv", {"x": times, "y": 2 * times}, times)
    (tmp_path / "config.toml").write_text(SPIN.replace("end = 11", 'times = "theirs.csv"'))
    experiment = rigidsim.load(tmp_path / "config.toml")
    if "-03-01T" in text:
        with pytest.raises(rigidsim.ConfigError, match="without its time scale"):
            build_scene(experiment)
        return
    head, *rows = (line for line in text.splitlines() if line.strip() and line != "# a comment")
    separator = next((c for c in ";\t," if c in head), " ")
    cells = [row.split(separator)[0].replace(",", ".") for row in rows]
    unit = next(
        unit for unit in sorted(UNITS, key=len, reverse=True) if re.search(rf"time\W*_?{unit}\b", head)
    )
    exact = [Fraction(cell) * Fraction(str(UNITS[unit])) for cell in cells]
    assert list(build_scene(experiment).samples.times or ()) == exact, text
    alone = rigidsim.parse(experiment.text)  # without the file, of which only times are taken
    assert list(build_scene(alone).samples.times or ()) == exact
    assert not re.search(r"\by\b", alone.config.tables["theirs.csv"].text)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("qw,qx\n1,0\n", "names no column t or time"),
        ("t,wx\n0,1\n0,2\n", "times must increase"),
        ("wx,t\n0,1\n2\n", "line 3 has 1 values, where the line of names has 2"),
        ("", "without files next to it"),
    ],
)
def test_tables_that_hold_no_times_are_refused(rows: str, words: str, tmp_path: Path) -> None:
    text = SPIN.replace("end = 11", 'times = "theirs.csv"')
    (tmp_path / "theirs.csv").write_text(rows)
    (tmp_path / "config.toml").write_text(text)
    with pytest.raises(rigidsim.ConfigError, match=words):
        build_scene(rigidsim.load(tmp_path / "config.toml") if rows else rigidsim.parse(text))


BAD = {
    "huge": ("1e300", r"line 4: 1e\+300 is more than 1e\+150 sigmas"),
    "negative": ("-3e200", r"line 4: 3e\+200 is more than"),
    "nan": ("nan", 'line 4: z is no finite number \\("nan"\\)'),
    "inf": ("-inf", "line 4: z is no finite number"),
    "overflow": ("1e999", "line 4: z is no finite number"),
    "word": ("missing", "line 4: z is no finite number"),
    "empty": ("", "line 4: z is no finite number"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_fit_refuses_what_is_no_number_by_its_line(kind: str, tmp_path: Path) -> None:
    value, words = BAD[kind]
    rows = [f"{n},0,0,{value if n == 2 else RATE}" for n in range(5)]
    (tmp_path / "seen.csv").write_text("\n".join(["time,x,y,z", *rows]) + "\n")
    (tmp_path / "config.toml").write_text(SPIN + FIT)
    with pytest.raises(RigidsimError, match=words):
        rigidsim.fit(tmp_path / "config.toml", out=tmp_path / "fit")


QUATERNION = "t;qw;qx;qy;qz\n"
REFUSED = {
    "t,qw,qx,qy,qz\n0,0,1,0,0,0,0,0,0,0\n": "line 2 has 10 values.* need columns separated by semicolons",
    QUATERNION + "0;1;0;0;0\n0,5;0.9;0;0;0,1\n": "line 3 has decimal commas and decimal points",
    "t,qw,qx,qy,qz\n0,1,0,0,0\n1,1,0,0\n": "line 3 has 4 values, where the line of names has 5",
    "0 1 0 0 0\n1 1 0 0 0\n": "line 1 holds numbers; put a line of names above",
    QUATERNION + "2024-03-01;1;0;0;0\n2024-13-01;1;0;0;0\n2024-03-02;1;0;0;0\n": 'line 3: given "2024-13-01',
}


@pytest.mark.parametrize("text", REFUSED)
def test_other_tables_are_refused_by_their_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv"
    path.write_text(text)
    with pytest.raises(RigidsimError, match=REFUSED[text]):
        rigidsim.compare(rigidsim.parse(SPIN), path)
