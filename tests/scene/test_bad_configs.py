"""What can't be run is refused before any step; the message says what was given, where and what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import heyoka
import pytest
from typer.testing import CliRunner

from rigidsim.cli.app import app
from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import load, parse
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


def moments(second: str) -> dict[str, str]:
    return {"body": f"principal_moments = [1, {second}, 2]"}


def spin(rest: str) -> dict[str, str]:
    return {"initial": f"angular_velocity = [1, 0, 0]\n{rest}"}


BALL = 'shape = "sphere"\nradius = 1\nmass = 1\n'
PART = 'shape = "sphere", mass = 1, radius = 1'
BOX = 'shape = "cuboid"\nmass = 1\n'
ROD = 'shape = "rod"\nmass = 1\nlength = 1'
GRAVITY = 'kind = "uniform_gravity"'
LONGEST = "a" * 101
DIGITS = "allowed: single, double, extended, quadruple, or a number of decimal digits from 1 to 250"
NAMES = "allowed: 1 to 100 letters, digits, dots, underscores and hyphens"
TEXT = 'a number, or a string of a number and a unit, is allowed, such as 1.5, "1/3", "2^-20"'
MOMENT = 'a number (in kg m^2), or a string such as "8.008e37 kg m^2", is allowed'
WHOLE = "a whole number, without point or exponent, is allowed"
SOURCES = "exactly one of principal_moments, inertia_tensor, points, shape, parts, preset is needed"
ONE_WAY = "only one of samples, every, times is allowed"

# name: (tables to replace, where the message points, phrases that it has)
CASES: dict[str, tuple[dict[str, str | None], str, list[str]]] = {
    # keys that don't exist
    "table misspelt": (
        {"more": '[integratr]\nprecision = "double"'},
        "integratr",
        [
            "unknown key",
            'did you mean "integrator"?',
            "allowed: bodies, body, description, events, frame, initial",
        ],
    ),
    "top key misspelt": ({"top": 'name = "x"\nnmae = "y"'}, "nmae", ["unknown key", 'did you mean "name"?']),
    "body key misspelt": (
        {"body": "principal_moment = [1, 2, 2]"},
        "[body] principal_moment",
        ["unknown key", 'did you mean "principal_moments"?'],
    ),
    "body key like a Python type": (
        {"body": BALL + "str = 1"},
        "[body] str",
        ["unknown key", "allowed: center"],
    ),
    "top key like a Python type": ({"top": 'name = "x"\nint = 1'}, "int", ["unknown key", "allowed: bodies"]),
    "body key with brackets": ({"body": BALL + '"a[0]" = 1'}, "[body] a[0]", ["unknown key"]),
    "initial key misspelt": (
        {"initial": "angular_velocty = [1, 0, 0]"},
        "[initial] angular_velocty",
        ['did you mean "angular_velocity"?'],
    ),
    "time key unknown": (
        {"time": "end = 1\nstop = 3"},
        "[time] stop",
        ["unknown key", "allowed: end, epoch, every"],
    ),
    "integrator key misspelt": (
        {"integrator": 'precison = "double"'},
        "[integrator] precison",
        [
            'did you mean "precision"?',
            "allowed: accuracy, accuracy_axis, accuracy_position, euler_sequence, formulation",
        ],
    ),
    "output key misspelt": (
        {"output": 'recrod = ["energy"]'},
        "[output] recrod",
        ['did you mean "record"?', "allowed: estimate, lyapunov, record"],
    ),
    "limits key misspelt": (
        {"limits": "wal_time = 1"},
        "[limits] wal_time",
        ['did you mean "wall_time"?', "allowed: max_drift, max_steps, wall_time"],
    ),
    "load key misspelt": (
        {"loads": GRAVITY + "\nacceleraton = [0, 0, -1]"},
        "[[loads]] number 1 acceleraton",
        ['did you mean "acceleration"?'],
    ),
    "load key called like a kind": (
        {"loads": 'kind = "torque"\ncomponents = [1, 0, 0]\ntorque = [1, 0, 0]'},
        "[[loads]] number 1 torque",
        ["unknown key", "allowed: components"],
    ),
    "point key unknown": (
        {"body": "points = [{mass = 1, position = [0, 0, 1], charge = 1}]"},
        "[body] points[0].charge",
        ["unknown key", "allowed: mass, position"],
    ),
    "part key unknown": (
        {"body": 'parts = [{shape = "sphere", mass = 1, radius = 1, colour = "red"}]'},
        "[body] parts[0].colour",
        ["unknown key", "allowed: euler_angles"],
    ),
    # names that don't exist
    "load misspelt": (
        {"loads": 'kind = "uniform_gravty"'},
        "[[loads]] number 1 kind",
        [
            'given "uniform_gravty"',
            'did you mean "uniform_gravity"?',
            "allowed: central_gravity, force, gravity_gradient",
        ],
    ),
    "shape misspelt": (
        {"body": 'shape = "spere"\nmass = 1\nradius = 1'},
        "[body] shape",
        ['given "spere"', 'did you mean "sphere"?', "allowed: cuboid, plate, ellipsoid"],
    ),
    "part's shape misspelt": (
        {"body": 'parts = [{shape = "spher", mass = 1, radius = 1}]'},
        "[body] parts[0].shape",
        ['given "spher"', 'did you mean "sphere"?'],
    ),
    "preset misspelt": (
        {"body": 'preset = "erth"'},
        "[body] preset",
        ['given "erth"', 'did you mean "earth"?', "allowed: earth"],
    ),
    "record misspelt": (
        {"output": 'record = ["angular_velocity", "enegry"]'},
        "[output] record",
        ['given "enegry"', 'did you mean "energy"?', "allowed: angular_velocity, quaternion"],
    ),
    "precision misspelt": (
        {"integrator": 'precision = "doubel"'},
        "[integrator] precision",
        ['given "doubel"', DIGITS],
    ),
    "formulation misspelt": (
        {"integrator": 'formulation = "quaternions"'},
        "[integrator] formulation",
        ['given "quaternions"', 'did you mean "quaternion"?', "allowed: auto, rates"],
    ),
    "method unknown": (
        {"integrator": 'method = "rk4"'},
        "[integrator] method",
        ['given "rk4"', "allowed: taylor"],
    ),
    "sequence repeats an axis": (
        {"integrator": 'euler_sequence = "zzx"'},
        "[integrator] euler_sequence",
        ['given "zzx"', "allowed: xyx, xyz", "zyz (intrinsic)"],
    ),
    "sequence in capitals": (
        {"integrator": 'euler_sequence = "ZXZ"'},
        "[integrator] euler_sequence",
        ['given "ZXZ"', "allowed: xyx"],
    ),
    # keys that are missing
    "name missing": ({"top": ""}, "name", ["missing; it must be given"]),
    "body missing": ({"body": None}, "[body]", ["missing; it must be given"]),
    "initial missing": ({"initial": None}, "[initial]", ["missing; it must be given"]),
    "time missing": ({"time": None}, "[time]", ["missing; it must be given"]),
    "end missing": ({"time": "samples = 3"}, "[time] end", ["missing; it must be given, unless times are"]),
    "kind of load missing": ({"loads": "acceleration = [0, 0, -1]"}, "[[loads]] number 1 kind", ["missing"]),
    "position of a point missing": (
        {"body": "points = [{mass = 1}]"},
        "[body] points[0].position",
        ["missing; it must be given"],
    ),
    "shape of a part missing": (
        {"body": "parts = [{mass = 1, radius = 1}]"},
        "[body] parts[0].shape",
        ["missing; it must be given"],
    ),
    # wrong types
    "name a number": ({"top": "name = 3"}, "name", ["given 3; a string is allowed"]),
    "description a number": ({"top": 'name = "x"\ndescription = 3'}, "description", ["given 3; a string"]),
    "body a number": (
        {"top": 'name = "x"\nbody = 3', "body": None},
        "[body]",
        ["given 3; a table is allowed"],
    ),
    "loads a number": ({"top": 'name = "x"\nloads = 3'}, "[[loads]]", ["given 3; an array is allowed"]),
    "load a string": (
        {"top": 'name = "x"\nloads = ["gravity"]'},
        "[[loads]] number 1",
        ['given "gravity"; a table is allowed'],
    ),
    "kind of load a number": (
        {"loads": "kind = 1"},
        "[[loads]] number 1 kind",
        ["given 1; allowed: central_gravity, force, gravity_gradient"],
    ),
    "moments a number": (
        {"body": "principal_moments = 3"},
        "[body] principal_moments",
        ["given 3; an array"],
    ),
    "moment a word": (moments('"two"'), "[body] principal_moments[1]", ['given "two"', TEXT]),
    "moment an empty string": (moments('""'), "[body] principal_moments[1]", ['given ""', TEXT]),
    "moment a program": (
        moments("\"__import__('os')\""),
        "[body] principal_moments[1]",
        ["given \"__import__('os')\"", TEXT],
    ),
    "moment a bool": (moments("true"), "[body] principal_moments[1]", ["given true", MOMENT]),
    "moment an array": (moments("[2]"), "[body] principal_moments[1]", ["given [2]", MOMENT]),
    "moment a table": (moments("{a = 1}"), "[body] principal_moments[1]", ["given a table", MOMENT]),
    "moment a date": (moments("1979-05-27"), "[body] principal_moments[1]", ["given 1979-05-27", MOMENT]),
    "moment nan": (moments("nan"), "[body] principal_moments[1]", ["given nan; finite numbers are allowed"]),
    "moment inf": (
        moments("-inf"),
        "[body] principal_moments[1]",
        ["given -inf; finite numbers are allowed"],
    ),
    "moment nan as text": (moments('"nan"'), "[body] principal_moments[1]", ['given "nan"', TEXT]),
    "tensor flat": (
        {"body": "inertia_tensor = [1, 2, 3]"},
        "[body] inertia_tensor[0]",
        ["given 1; an array is allowed"],
    ),
    "shape a number": ({"body": "shape = 3"}, "[body] shape", ["given 3; a string is allowed"]),
    "preset a number": ({"body": "preset = 3"}, "[body] preset", ["given 3; a string is allowed"]),
    "size a number": ({"body": BOX + "size = 1"}, "[body] size", ["given 1; an array is allowed"]),
    "radius an array": (
        {"body": 'shape = "sphere"\nmass = 1\nradius = [1]'},
        "[body] radius",
        ["given [1]; a number (in m)"],
    ),
    "reference a number": (
        {"body": BALL + "reference = 3"},
        "[body] reference",
        [
            "given 3",
            '"center_of_mass", a landmark of the shape such as "corner", or a point [x, y, z] is allowed',
        ],
    ),
    "reference with a word": (
        {"body": BALL + 'reference = ["a", 0, 0]'},
        "[body] reference[0]",
        ['given "a"', "6378 km"],
    ),
    "rate a bool": (
        spin("") | {"initial": "angular_velocity = [true, 0, 0]"},
        "[initial] angular_velocity[0]",
        ["given true; a number"],
    ),
    "rates a word": (
        {"initial": 'angular_velocity = "fast"'},
        "[initial] angular_velocity",
        ['given "fast"; an array of 3 is allowed'],
    ),
    "epoch without a scale": (
        {"time": 'end = 1\nepoch = "2029-04-13T21:46:00"'},
        "[time] epoch",
        ['given "2029-04-13T21:46:00"; a date and time with its scale (TDB, TT, UTC)'],
    ),
    "a unit of time that is none": (
        {"time": 'end = 1\nunit = "parsec"'},
        "[time] unit",
        ['given "parsec"', 'unknown unit "parsec"', "a unit of time is allowed"],
    ),
    "a unit of length for times": (
        {"time": 'end = 1\nunit = "km"'},
        "[time] unit",
        ['given "km"', "of the dimension asked for, which is s", 'such as "day"'],
    ),
    "a unit with a number": (
        {"time": 'end = 1\nunit = "30 day"'},
        "[time] unit",
        ['given "30 day"', "not the name of a unit of time"],
    ),
    "epoch a date": (
        {"time": "end = 1\nepoch = 2029-04-13"},
        "[time] epoch",
        ["given 2029-04-13; a string such as"],
    ),
    "epoch in UTC that nobody knows": (
        {"time": 'end = 1\nepoch = "2999-01-01 UTC"'},
        "[time] epoch",
        ["leap seconds of UTC are known from 1972-01-01 to", "write the epoch in TT or TDB"],
    ),
    "axes misspelt": (
        {"more": '[frame]\naxes = "EME200"'},
        "[frame] axes",
        ['given "EME200"; did you mean "EME2000"?; allowed: EME2000, ICRF, GCRF, ecliptic J2000'],
    ),
    "axes that aren't the ephemeris's": (
        {
            "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\nephemeris = "sun"',
            "more": '[frame]\naxes = "ICRF"',
        },
        "[frame] axes",
        ['given "ICRF", but the ephemeris of [[loads]] number 1 is in "ecliptic J2000"; write that'],
    ),
    "end a bool": ({"time": "end = true"}, "[time] end", ["given true; a number (in s)", '"430 day"']),
    "end a word": ({"time": 'end = "ten"'}, "[time] end", ['given "ten"', TEXT]),
    "end inf": ({"time": "end = inf"}, "[time] end", ["given inf; finite numbers are allowed"]),
    "samples with a point": ({"time": "end = 1\nsamples = 11.0"}, "[time] samples", ["given 11.0", WHOLE]),
    "samples a string": ({"time": 'end = 1\nsamples = "11"'}, "[time] samples", ['given "11"', WHOLE]),
    "samples a bool": ({"time": "end = 1\nsamples = true"}, "[time] samples", ["given true", WHOLE]),
    "times a number": ({"time": "times = 3"}, "[time] times", ["given 3; an array is allowed"]),
    "precision a fraction": (
        {"integrator": "precision = 1.5"},
        "[integrator] precision",
        ["given 1.5", DIGITS],
    ),
    "precision a bool": (
        {"integrator": "precision = true"},
        "[integrator] precision",
        ["given true", DIGITS],
    ),
    "precision digits as text": (
        {"integrator": 'precision = "50"'},
        "[integrator] precision",
        ['given "50"'],
    ),
    "tolerance a bool": (
        {"integrator": "tolerance = true"},
        "[integrator] tolerance",
        ['given true; a number, or a string such as "1/3", is allowed; or "auto"'],
    ),
    "tolerance a word": (
        {"integrator": 'tolerance = "fast"'},
        "[integrator] tolerance",
        ['given "fast"', '"auto"'],
    ),
    "tolerance nan": (
        {"integrator": "tolerance = nan"},
        "[integrator] tolerance",
        ["given nan; finite numbers"],
    ),
    "formulation a number": (
        {"integrator": "formulation = 3"},
        "[integrator] formulation",
        ["given 3; allowed: auto"],
    ),
    "sequence a number": (
        {"integrator": "euler_sequence = 3"},
        "[integrator] euler_sequence",
        ["given 3; a string"],
    ),
    "hold_invariants a word": (
        {"integrator": 'hold_invariants = "yes"'},
        "[integrator] hold_invariants",
        ['given "yes"; true, false or'],
    ),
    "hold_invariants one": (
        {"integrator": "hold_invariants = 1"},
        "[integrator] hold_invariants",
        ["given 1; true, false or"],
    ),
    "record a string": (
        {"output": 'record = "energy"'},
        "[output] record",
        ['given "energy"; an array is allowed'],
    ),
    "record of numbers": ({"output": "record = [1]"}, "[output] record[0]", ["given 1; a string is allowed"]),
    "timeline a number": (
        {"output": "timeline = 1"},
        "[output] timeline",
        ["given 1; true or false is allowed"],
    ),
    "timeline_rows with exponent": (
        {"output": "timeline_rows = 1e5"},
        "[output] timeline_rows",
        ["given 1e+5", WHOLE],
    ),
    "timeline_rows a bool": (
        {"output": "timeline_rows = true"},
        "[output] timeline_rows",
        ["given true", WHOLE],
    ),
    "max_steps with exponent": ({"limits": "max_steps = 1e9"}, "[limits] max_steps", ["given 1e+9", WHOLE]),
    # units and forms of numbers
    "unit of another dimension": (
        moments('"2 kg m"'),
        "[body] principal_moments[1]",
        ['given "2 kg m"', "is not a unit of the dimension asked for, which is kg m^2", "write for instance"],
    ),
    "angle for a rate": (
        {"initial": 'angular_velocity = ["1 deg", 0, 0]'},
        "[initial] angular_velocity[0]",
        ['"deg" is not a unit of the dimension asked for, which is rad/s', '"7.292115e-5 rad/s"'],
    ),
    "length for a time": (
        {"time": 'end = "10 km"'},
        "[time] end",
        ['"km" is not', "which is s", '"430 day"'],
    ),
    "seconds for an angle": (
        spin('euler_angles = ["1 s", 0, 0]'),
        "[initial] euler_angles[0]",
        ["which is rad"],
    ),
    "unit where none belongs": (
        spin('quaternion = ["1 m", 0, 0, 0]'),
        "[initial] quaternion[0]",
        ['"m" is a unit, where only a number without one is allowed'],
    ),
    "unknown unit": (
        {"initial": 'angular_velocity = ["1 fortnight", 0, 0]'},
        "[initial] angular_velocity[0]",
        ['given "1 fortnight"', 'unknown unit "fortnight"', "known units: m kg s", "with SI prefixes"],
    ),
    "unit run together": (moments('"2 kgm^2"'), "[body] principal_moments[1]", ['unknown unit "kgm"']),
    "unit malformed": (
        moments('"2 kg m^^2"'),
        "[body] principal_moments[1]",
        ['"kg m^^2" is not a unit; write'],
    ),
    "unit to a huge power": (
        moments('"2 kg m^99"'),
        "[body] principal_moments[1]",
        ['"kg m^99" is not a unit'],
    ),
    "division by zero": (moments('"1/0"'), "[body] principal_moments[1]", ['given "1/0"', "other than zero"]),
    "huge power": (
        moments('"10^99999"'),
        "[body] principal_moments[1]",
        ['given "10^99999"', "a whole exponent of at most 5000"],
    ),
    "broken power": (moments('"2^0.5"'), "[body] principal_moments[1]", ['given "2^0.5"', "as in 2^-20"]),
    "power of a huge base": (
        moments('"1e9^2"'),
        "[body] principal_moments[1]",
        ["base between 1e-6 and 1e6"],
    ),
    "huge exponent": (moments("1e99999"), "[body] principal_moments[1]", ["given 1e+99999", "at most 5000"]),
    "huge exponent as text": (
        moments('"1e99999"'),
        "[body] principal_moments[1]",
        ['given "1e99999"', "at most 5000"],
    ),
    "exponent beyond decimals": (
        moments("1e99999999999999999999"),
        "TOML",
        ["1e99999999999999999999", "out of range"],
    ),
    "exponent beyond decimals as text": (
        moments('"1e99999999999999999999"'),
        "[body] principal_moments[1]",
        ["at most 5000", "write fewer digits"],
    ),
    "endless number": (
        moments(f'"{"1" * 6000}"'),
        "[body] principal_moments[1]",
        ["given 6000 characters", "5000"],
    ),
    # sources of inertia
    "no inertia": ({"body": "mass = 1"}, "[body]", ["given no source of inertia", SOURCES]),
    "two inertias": (
        {"body": BALL + "principal_moments = [1, 1, 1]"},
        "[body]",
        ["given principal_moments and shape", SOURCES],
    ),
    "two moments": (
        {"body": "principal_moments = [1, 2]"},
        "[body] principal_moments",
        ["given 2 entries; exactly 3"],
    ),
    "four moments": (
        {"body": "principal_moments = [1, 2, 2, 2]"},
        "[body] principal_moments",
        ["given 4 entries; exactly 3"],
    ),
    "one moment": (
        {"body": "principal_moments = [1]"},
        "[body] principal_moments",
        ["given 1 entry; exactly 3"],
    ),
    "tensor of two rows": (
        {"body": "inertia_tensor = [[1, 0, 0], [0, 1, 0]]"},
        "[body] inertia_tensor",
        ["2 entries; exactly 3"],
    ),
    "tensor with a short row": (
        {"body": "inertia_tensor = [[1, 0, 0], [0, 1], [0, 0, 1]]"},
        "[body] inertia_tensor[1]",
        ["exactly 3 are needed"],
    ),
    "tensor asymmetric": (
        {"body": "inertia_tensor = [[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]]"},
        "[body] inertia_tensor[1][0]",
        ["given 0.2, but [0][1] is 0.1", "the tensor must be symmetric", "write the same number twice"],
    ),
    "tensor indefinite": (
        {"body": "inertia_tensor = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]"},
        "[body] inertia_tensor",
        ["principal moments -1.0, 1.0, 3.0", "can't be negative"],
    ),
    "moment negative": (
        {"body": "principal_moments = [-1, 2, 2]"},
        "[body] principal_moments",
        ["principal moments -1.0, 2.0, 2.0", "can't be negative"],
    ),
    "moments zero": (
        {"body": "principal_moments = [0, 0, 0]"},
        "[body] principal_moments",
        ["all moments are zero"],
    ),
    "two moments zero": (
        {"body": "principal_moments = [0, 0, 1]"},
        "[body] principal_moments",
        ["at most one can be zero (a rod's)"],
    ),
    "triangle inequality": (
        {"body": "principal_moments = [1, 2, 3.25]"},
        "[body] principal_moments",
        ["1.0, 2.0, 3.25", "more than the sum of the other two by 0.25", "I1 + I2 >= I3"],
    ),
    "triangle inequality of a tensor": (
        {"body": "inertia_tensor = [[4, 0, 0], [0, 1, 0.5], [0, 0.5, 1]]"},
        "[body] inertia_tensor",
        ["0.5, 1.5, 4.0", "by 2.0", "I1 + I2 >= I3"],
    ),
    "reference with moments": (
        {"body": "principal_moments = [1, 2, 2]\nreference = [0, 0, 1]"},
        "[body] reference",
        ["only shape, points and parts take it", "remove it"],
    ),
    # shapes, points, parts, presets
    "radius with moments": (
        {"body": "principal_moments = [1, 2, 2]\nradius = 2"},
        "[body] radius",
        ["which only a shape has; remove it"],
    ),
    "size missing": ({"body": BOX}, "[body] size", ["missing; a cuboid needs it: 3 positive lengths"]),
    "radius missing": (
        {"body": 'shape = "sphere"\nmass = 1'},
        "[body] radius",
        ["missing; a sphere needs it: a positive length"],
    ),
    "size of two": ({"body": BOX + "size = [1, 2]"}, "[body] size", ["given 2 lengths; a cuboid has 3"]),
    "size negative": ({"body": BOX + "size = [1, 2, -3]"}, "[body] size[2]", ["given -3; a positive length"]),
    "size zero": ({"body": BOX + "size = [1, 0, 3]"}, "[body] size[1]", ["given 0; a positive length"]),
    "radius of a cuboid": (
        {"body": BOX + "size = [1, 2, 3]\nradius = 1"},
        "[body] radius",
        ["given a dimension that a cuboid doesn't have", "allowed: size", "remove it"],
    ),
    "tube inside out": (
        {"body": 'shape = "tube"\nmass = 1\ninner_radius = 2\nouter_radius = 1\nheight = 1'},
        "[body] inner_radius",
        ["given 2.0 m; at most outer_radius (1.0 m) is allowed"],
    ),
    "torus through itself": (
        {"body": 'shape = "torus"\nmass = 1\nminor_radius = 2\nmajor_radius = 1'},
        "[body] minor_radius",
        ["given 2.0 m; at most major_radius (1.0 m) is allowed"],
    ),
    "mass missing": (
        {"body": 'shape = "sphere"\nradius = 1'},
        "[body] mass",
        ["missing; this body needs a mass"],
    ),
    "mass negative": (
        {"body": BALL.replace("mass = 1", "mass = -1")},
        "[body] mass",
        ["given -1; a positive mass"],
    ),
    "mass zero": (
        {"body": "principal_moments = [1, 2, 2]\nmass = 0"},
        "[body] mass",
        ["given 0; a positive mass"],
    ),
    "corner of a sphere": (
        {"body": BALL + 'reference = "corner"'},
        "[body] reference",
        ['given "corner"', "allowed here: center_of_mass, or a point [x, y, z]"],
    ),
    "corner of a cone": (
        {"body": 'shape = "cone"\nradius = 1\nheight = 1\nmass = 1\nreference = "corner"'},
        "[body] reference",
        ["allowed here: center_of_mass, apex, or a point [x, y, z]"],
    ),
    "reference in the plane": (
        {"body": BALL + "reference = [1, 2]"},
        "[body] reference",
        ["given 2 entries; exactly 3 are needed"],
    ),
    "center_of_mass of a shape": (
        {"body": BALL + "center_of_mass = [0, 0, 1]"},
        "[body] center_of_mass",
        ["it follows from shape; remove it", "say with reference what the body turns about"],
    ),
    "mass of points": (
        {"body": "points = [{mass = 1, position = [0, 0, 1]}, {mass = 1, position = [0, 1, 0]}]\nmass = 3"},
        "[body] mass",
        ["it follows from points; remove it"],
    ),
    "no points": (
        {"body": "points = []"},
        "[body] points",
        ["given an empty array; at least one entry is needed"],
    ),
    "no parts": (
        {"body": "parts = []"},
        "[body] parts",
        ["given an empty array; at least one entry is needed"],
    ),
    "a single point": (
        {"body": "points = [{mass = 1, position = [0, 0, 1]}]"},
        "[body] points",
        ["all moments are zero"],
    ),
    "point of negative mass": (
        {"body": "points = [{mass = -1, position = [0, 0, 1]}]"},
        "[body] points[0].mass",
        ["given -1; a positive mass"],
    ),
    "part without radius": (
        {"body": 'parts = [{shape = "sphere", mass = 1}]'},
        "[body] parts[0].radius",
        ["a sphere needs it"],
    ),
    "part with a foreign length": (
        {"body": 'parts = [{shape = "sphere", mass = 1, radius = 1, length = 2}]'},
        "[body] parts[0].length",
        ["that a sphere doesn't have", "allowed: radius"],
    ),
    "part turned by zero": (
        {"body": 'parts = [{shape = "sphere", mass = 1, radius = 1, quaternion = [0, 0, 0, 0]}]'},
        "[body] parts[0].quaternion",
        ["given zero", "a quaternion w x y z that is not zero is allowed"],
    ),
    "part turned twice": (
        {"body": f"parts = [{{{PART}, quaternion = [1, 0, 0, 0], euler_angles = [0, 0, 0]}}]"},
        "[body] parts[0].euler_angles",
        ["given beside quaternion", "remove one of them"],
    ),
    "part of an unknown sequence": (
        {"body": f'parts = [{{{PART}, euler_angles = [0, 0, 0], euler_sequence = "zzx"}}]'},
        "[body] parts[0].euler_sequence",
        ['given "zzx"', "allowed: xyx"],
    ),
    "part with a sequence alone": (
        {"body": f'parts = [{{{PART}, euler_sequence = "zyx"}}]'},
        "[body] parts[0].euler_sequence",
        ["given without euler_angles"],
    ),
    "shape by another name": (
        {"body": BOX.replace("cuboid", "box")},
        "[body] shape",
        ['did you mean "cuboid"?'],
    ),
    "load by another name": (
        {"loads": 'kind = "friction"'},
        "[[loads]] number 1 kind",
        ['given "friction"; did you mean "viscous_torque" or "torque"?'],
    ),
    "load by half its name": (
        {"loads": 'kind = "gravity"'},
        "[[loads]] number 1 kind",
        ['did you mean "uniform_gravity"?'],
    ),
    "key by another name": (
        {"initial": "omega = [1, 0, 0]"},
        "[initial] omega",
        ['did you mean "angular_velocity"?'],
    ),
    "hertz of what": (
        {"initial": 'angular_velocity = ["2 Hz", 0, 0]'},
        "[initial] angular_velocity[0]",
        ['"Hz" may count turns or radians; write "turn/s"'],
    ),
    "unit in other letters": (
        {"initial": 'angular_velocity = ["2 Radian/s", 0, 0]'},
        "[initial] angular_velocity[0]",
        ['unknown unit "Radian"; did you mean "radian"?'],
    ),
    "one number for three": (
        {"initial": "angular_velocity = 2"},
        "[initial] angular_velocity",
        ["given 2; an array of 3 is allowed"],
    ),
    "text without quotes": ({"top": "name = box"}, "TOML", ["at line 1", 'stand in quotes: "box"']),
    "unit without quotes": ({"time": "end = 10 s"}, "TOML", ['numbers with units, stand in quotes: "10 s"']),
    "mass of a preset": (
        {"body": 'preset = "earth"\nmass = 1'},
        "[body] mass",
        ["it follows from preset; remove it"],
    ),
    # the start
    "no rates": (
        {"initial": ""},
        "[initial] angular_velocity",
        ["given neither this nor angular_momentum", "exactly one"],
    ),
    "two rates": (
        spin("angular_momentum = [1, 0, 0]"),
        "[initial] angular_velocity",
        ["given both this and angular_momentum"],
    ),
    "two attitudes": (
        spin("quaternion = [1, 0, 0, 0]\neuler_angles = [0, 0, 0]"),
        "[initial] euler_angles",
        ["given beside quaternion", "only one attitude is allowed", "remove one"],
    ),
    "quaternion zero": (
        spin("quaternion = [0, 0, 0, 0]"),
        "[initial] quaternion",
        ["given zero", "[w, x, y, z]"],
    ),
    "quaternion of three": (
        spin("quaternion = [1, 0, 0]"),
        "[initial] quaternion",
        ["given 3 entries; exactly 4"],
    ),
    "spin of a rod": (
        {"body": ROD, "initial": "angular_velocity = [1, 0, 0.5]"},
        "[initial] angular_velocity",
        ["a spin about the axis that has no moment of inertia", "make that component zero"],
    ),
    "momentum along a rod": (
        {"body": ROD, "initial": "angular_momentum = [1, 0, 0.5]"},
        "[initial] angular_momentum",
        ["a part along the axis that has no moment of inertia", "make that part zero"],
    ),
    "flight without mass": (
        spin("position = [0, 0, 0]"),
        "[body] mass",
        ["missing; a body with a position or velocity needs it"],
    ),
    "flight about an apex": (
        spin("velocity = [0, 0, 0]")
        | {"body": 'shape = "cone"\nmass = 1\nradius = 1\nheight = 1\nreference = "apex"'},
        "[body] reference",
        ["turns about its centre of mass", "inertia is given about another point", "remove"],
    ),
    "flight off centre": (
        spin("velocity = [0, 0, 0]")
        | {"body": "principal_moments = [1, 2, 2]\nmass = 1\ncenter_of_mass = [0, 0, 1]"},
        "[body] center_of_mass",
        ["turns about its centre of mass", "inertia is given about another point"],
    ),
    "gravity without mass": (
        {"body": "principal_moments = [1, 2, 2]\ncenter_of_mass = [0, 0, 1]", "loads": GRAVITY},
        "[body] mass",
        ["missing; uniform_gravity needs it"],
    ),
    "numbers beyond the precision": (
        {"initial": "angular_velocity = [1e-4000, 1, 0]"},
        "config",
        ["1.0e-4000", "check the units"],
    ),
    "results beyond the dataset": (
        {"body": "principal_moments = [1e4000, 1e4000, 1e4000]"},
        "config",
        ["angular_momentum", "check the units"],
    ),
    # times
    "end before start": (
        {"time": "start = 5\nend = 4"},
        "[time] end",
        ["given 4.0 s; after start (5.0 s) is allowed"],
    ),
    "end at start": ({"time": "end = 0"}, "[time] end", ["given 0.0 s; after start (0.0 s) is allowed"]),
    "times equal": (
        {"time": "times = [1, 2, 2]"},
        "[time] times[2]",
        ["given 2.0 after 2.0; times must increase"],
    ),
    "times fall": (
        {"time": "times = [2, 1]"},
        "[time] times[1]",
        ["given 1.0 after 2.0; times must increase"],
    ),
    "times before start": (
        {"time": "times = [-1, 1]"},
        "[time] times[0]",
        ["given -1.0 s; start (0.0 s) or later is allowed"],
    ),
    "times after end": (
        {"time": "end = 3\ntimes = [1, 2, 4]"},
        "[time] times[2]",
        ["given 4.0 s; end (3.0 s) or earlier is allowed"],
    ),
    "no times": (
        {"time": "times = []"},
        "[time] times",
        ["given an empty array; at least one time is needed"],
    ),
    "samples and every": (
        {"time": "end = 10\nsamples = 5\nevery = 1"},
        "[time] every",
        ["given beside samples", ONE_WAY],
    ),
    "samples and times": (
        {"time": "samples = 5\ntimes = [1, 2]"},
        "[time] times",
        ["given beside samples", ONE_WAY],
    ),
    "one sample": ({"time": "end = 10\nsamples = 1"}, "[time] samples", ["given 1; 2 to 1e12 are allowed"]),
    "too many samples": (
        {"time": "end = 10\nsamples = 10_000_000_000_000"},
        "[time] samples",
        ["given 10000000000000; 2 to 1e12"],
    ),
    "samples of thousands of digits": (  # Python itself refuses to print such an integer
        {"time": f"end = 10\nsamples = 0x{'f' * 5000}"},
        "[time] samples",
        ["given a whole number of 20000 bits", "at most 10000 bits are allowed"],
    ),
    "every zero": (
        {"time": "end = 10\nevery = 0"},
        "[time] every",
        ["given 0.0 s; a positive time is allowed"],
    ),
    "every negative": (
        {"time": "end = 10\nevery = -1"},
        "[time] every",
        ["given -1.0 s; a positive time is allowed"],
    ),
    "every too long": (
        {"time": "end = 10\nevery = 11"},
        "[time] every",
        ["given 11.0 s, longer than the whole run", "at most end - start (10.0 s) is allowed"],
    ),
    "every too short": (
        {"time": "end = 10\nevery = 1e-15"},
        "[time] every",
        ["asks for 1.0e+16 samples; at most 1e12 are allowed"],
    ),
    "samples too dense": (
        {"time": "end = 1\nsamples = 100_000_000", "integrator": 'precision = "single"'},
        "[time]",
        [
            "are closer together than single precision resolves near 1 s",
            "sample less often",
            "higher precision",
        ],
    ),
    "start too late": (
        {"time": "start = 1e9\nend = 1_000_000_001", "integrator": 'precision = "single"'},
        "[time]",
        ["samples 0 and 1 are closer together", "near 1e+09 s"],
    ),
    # integrator
    "no digits": ({"integrator": "precision = 0"}, "[integrator] precision", ["given 0", DIGITS]),
    "too many digits": ({"integrator": "precision = 5000"}, "[integrator] precision", ["given 5000", DIGITS]),
    "tolerance zero": (
        {"integrator": "tolerance = 0"},
        "[integrator] tolerance",
        ["given 0; allowed: above 0 and at most 1"],
    ),
    "tolerance negative": (
        {"integrator": "tolerance = -1e-9"},
        "[integrator] tolerance",
        ["given -1e-9; allowed: above 0"],
    ),
    "tolerance above one": (
        {"integrator": "tolerance = 2"},
        "[integrator] tolerance",
        ["given 2;", "at most 1", '"auto"'],
    ),
    "start in the singularity of zxz": (
        {"integrator": 'formulation = "canonical"'},
        "[integrator] formulation",
        ["singularity of the sequence zxz", "middle angle 0.0 rad", 'choose formulation = "euler_angles"'],
    ),
    "start in the singularity of xyz": (
        spin('euler_angles = [0, "90 deg", 0]')
        | {"integrator": 'formulation = "canonical"\neuler_sequence = "xyz"'},
        "[integrator] formulation",
        ["singularity of the sequence xyz", "middle angle 1.5707963 rad", "another euler_sequence"],
    ),
    "rates for a flight": (
        spin("position = [0, 0, 0]")
        | {"body": "principal_moments = [1, 2, 2]\nmass = 1", "integrator": 'formulation = "rates"'},
        "[integrator] formulation",
        ['given "rates" for a scene with a position', 'choose "auto"'],
    ),
    # output and limits
    "nothing recorded": (
        {"output": "record = []"},
        "[output] record",
        ["given an empty array", "leave the key out"],
    ),
    "recorded twice": (
        {"output": 'record = ["energy", "energy"]'},
        "[output] record",
        ["named twice; name each once"],
    ),
    "position without one": (
        {"output": 'record = ["position"]'},
        "[output] record",
        ['given "position"', "no position", "leave it out"],
    ),
    "quaternion from rates": (
        {"output": 'record = ["quaternion"]', "integrator": 'formulation = "rates"'},
        "[output] record",
        ['given "quaternion": needs the attitude', 'choose another formulation than "rates"'],
    ),
    "potential energy without gravity": (
        {"output": 'record = ["potential_energy"]'},
        "[output] record",
        ['given "potential_energy"', "no load"],
    ),
    "vertical without gravity": (
        {"output": 'record = ["angular_momentum_vertical"]'},
        "[output] record",
        ["no load that marks a vertical", "record angular_momentum instead"],
    ),
    "axial momentum of an asymmetric body": (
        {"output": 'record = ["angular_momentum_axial"]'},
        "[output] record",
        ["this scene has none; leave it out"],
    ),
    "one row of timeline": (
        {"output": "timeline_rows = 1"},
        "[output] timeline_rows",
        ["given 1; at least 2"],
    ),
    "wall_time negative": (
        {"limits": "wall_time = -1"},
        "[limits] wall_time",
        ["given -1; a positive number"],
    ),
    "wall_time in metres": (
        {"limits": 'wall_time = "2 m"'},
        "[limits] wall_time",
        ['"m" is not', "which is s"],
    ),
    "no steps": ({"limits": "max_steps = 0"}, "[limits] max_steps", ["given 0; at least 1 is allowed"]),
    "max_drift negative": (
        {"limits": "max_drift = -1e-9"},
        "[limits] max_drift",
        ["given -1e-09; a positive number"],
    ),
    # names of run folders
    "name with a slash": ({"top": 'name = "a/b"'}, "name", ['given "a/b"', NAMES, "it names the run folder"]),
    "name empty": ({"top": 'name = ""'}, "name", ['given ""', NAMES]),
    "name of dots": ({"top": 'name = ".."'}, "name", ['given ".."', "not dots alone"]),
    "name too long": ({"top": f'name = "{LONGEST}"'}, "name", ['given "aaaa', NAMES]),
    "name with a newline": ({"top": 'name = "a\\n"'}, "name", [NAMES]),
    # TOML itself
    "string left open": ({"more": '[integrator2]\nprecision = "double'}, "TOML", ["can't be read", "line 1"]),
    "key twice": ({"top": 'name = "a"\nname = "b"'}, "TOML", ["can't be read", "at line 2, column"]),
    "table twice": ({"more": "[time]\nend = 2"}, "TOML", ['Cannot declare "time" twice', "line"]),
    # what the interface promises for later
    "event without an expression": (
        {"more": '[[events]]\nname = "flip"'},
        "[[events]] number 1 expression",
        ["missing"],
    ),
    "sweep without axes": ({"more": '[sweep]\nmode = "zip"'}, "[sweep] axes", ["missing"]),
    "sweep for a single run": (
        {"more": "[sweep.axes]\n'time.end' = {values = [1, 2]}"},
        "[sweep]",
        ["many members", "rigidsim.sweep(...)", "remove [sweep]"],
    ),
    "parameter named as a state": (
        {"more": "[parameters]\nwx = 1"},
        "[parameters]",
        ['given the name "wx"', "which expressions use already", "rename it"],
    ),
    "parameter named with a blank": (
        {"more": '[parameters]\n"a b" = 1'},
        "[parameters]",
        ['given the name "a b"', "allowed: letters, digits and underscores"],
    ),
    "parameter with an unknown unit": (
        {"more": '[parameters]\nk = "1 parsec"'},
        "[parameters] k",
        ['unknown unit "parsec"'],
    ),
    "lyapunov a number": (
        {"output": "lyapunov = 1"},
        "[output] lyapunov",
        ["given 1; true or false is allowed"],
    ),
    "accuracy zero": (
        {"integrator": "accuracy = 0"},
        "[integrator] accuracy",
        ["given 0", "an angle above 0 and below pi"],
    ),
    "accuracy negative": (
        {"integrator": 'accuracy = "-1e-9"'},
        "[integrator] accuracy",
        ["given", "an angle above 0 and below pi"],
    ),
    "accuracy a word": (
        {"integrator": 'accuracy = "high"'},
        "[integrator] accuracy",
        ['"high"'],
    ),
    "canonical from its singularity": (
        {"integrator": 'formulation = "canonical"'},
        "[integrator] formulation",
        ["singularity of the sequence zxz", '"quaternion", or another euler_sequence'],
    ),
    "gradient without a source": (
        {"loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1'},
        "[[loads]] number 1 orbit",
        ["given none", "exactly one of orbit, position and ephemeris is needed"],
    ),
    "gradient with two sources": (
        {
            "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\nposition = [1, 0, 0]\n'
            "orbit = {semi_major_axis = 1}"
        },
        "[[loads]] number 1 orbit",
        ["given orbit and position", "exactly one of"],
    ),
    "gradient from the body's own place": (
        {"loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\nposition = [0, 0, 0]'},
        "[[loads]] number 1 position",
        ["given the origin", "another point is allowed"],
    ),
    "negative gravitational parameter": (
        {"loads": 'kind = "gravity_gradient"\ngravitational_parameter = -1\nposition = [1, 0, 0]'},
        "[[loads]] number 1 gravitational_parameter",
        ["given -1", "a positive number is allowed"],
    ),
    "parabolic orbit": (
        {
            "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
            "orbit = {semi_major_axis = 1, eccentricity = 1}"
        },
        "[[loads]] number 1 orbit.eccentricity",
        ["given 1.0", "below 1 is allowed"],
    ),
    "orbit without a size": (
        {"loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {eccentricity = 0.1}'},
        "[[loads]] number 1 orbit.semi_major_axis",
        ["missing"],
    ),
    "orbit of negative size": (
        {"loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = -1}'},
        "[[loads]] number 1 orbit.semi_major_axis",
        ["given -1.0 m", "a positive length is allowed"],
    ),
    "orbital element misspelt": (
        {
            "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
            "orbit = {semi_major_axis = 1, eccentricty = 0.1}"
        },
        "[[loads]] number 1 orbit.eccentricty",
        ["unknown key", 'did you mean "eccentricity"?'],
    ),
    "central gravity without a position": (
        {"loads": 'kind = "central_gravity"\ngravitational_parameter = 1'},
        "[[loads]] number 1 kind",
        ['given "central_gravity" for a body without a position', "gravity_gradient"],
    ),
    "negative damping": (
        {"loads": 'kind = "viscous_torque"\ncoefficients = [1, -2, 3]'},
        "[[loads]] number 1 coefficients[1]",
        ["given -2", "zero or more is allowed"],
    ),
    "torque in an unknown frame": (
        {"loads": 'kind = "torque"\ncomponents = ["0", "0", "1"]\nframe = "bdy"'},
        "[[loads]] number 1 frame",
        ['given "bdy"', 'did you mean "body"?', "allowed: body, space"],
    ),
    "expression with an unknown name": (
        {"loads": 'kind = "torque"\ncomponents = ["0", "2*vx", "1"]'},
        "[[loads]] number 1 components[1]",
        ['column 3: unknown name "vx"', "allowed: t, wx"],
    ),
    "expression that would run code": (
        {"loads": """kind = "torque"\ncomponents = ["().__class__", "0", "1"]"""},
        "[[loads]] number 1 components[0]",
        ["column"],
    ),
    "rates alone where a load reads the attitude": (
        {
            "loads": 'kind = "gravity_gradient"\ngravitational_parameter = 1\nposition = [1, 0, 0]',
            "integrator": 'formulation = "rates"',
        },
        "[integrator] formulation",
        ['given "rates", but gravity_gradient reads the attitude', 'choose "auto"'],
    ),
}


@pytest.fixture(autouse=True)
def no_integrator(monkeypatch: pytest.MonkeyPatch) -> None:
    def reached(*_: Any, **__: Any) -> None:
        raise AssertionError("a bad config reached the integrator")

    monkeypatch.setattr(heyoka, "taylor_adaptive", reached)


def refused(attempt: Callable[[], Any]) -> list[Problem]:
    with pytest.raises(ConfigError) as caught:
        attempt()
    return caught.value.problems


@pytest.mark.parametrize("case", CASES)
def test_refused_with_a_message_that_helps(case: str) -> None:
    tables, where, phrases = CASES[case]
    problems = refused(lambda: prepare(parse(config(**tables))))
    assert where in [problem.where for problem in problems]
    text = next(problem.what for problem in problems if problem.where == where)
    for phrase in phrases:
        assert phrase in text


@pytest.mark.parametrize("case", CASES)
def test_messages_speak_no_python(case: str) -> None:
    tables, _, _ = CASES[case]
    for problem in refused(lambda: prepare(parse(config(**tables)))):
        if "__import__" in problem.what:  # the user's own words, given back
            continue
        for foreign in ("Decimal", "Fraction", "True", "False", "None", "NoneType", "tuple", "Input should"):
            assert foreign not in str(problem)


def test_there_are_enough_kinds_of_mistakes() -> None:
    assert len({where for _, where, _ in CASES.values()}) >= 55


GOOD_CASES: dict[str, dict[str, str | None]] = {
    "as it is": {},
    "plate: I1 + I2 = I3": {"body": "principal_moments = [1, 2, 3]"},
    "plate of decimals that aren't doubles": {"body": "principal_moments = [0.1, 0.2, 0.3]"},
    # 0.1 + 0.2 in double: a tensor printed by a program breaks the inequality by one rounding
    "plate printed by a double program": {"body": "principal_moments = [0.1, 0.2, 0.30000000000000004]"},
    "rod at rest along its axis": {"body": ROD, "initial": "angular_velocity = [1, 2, 0]"},
    "extended": {"integrator": 'precision = "extended"'},
    "250 digits": {"integrator": "precision = 250"},
    "one digit": {"integrator": "precision = 1"},
    "tolerance one": {"integrator": "tolerance = 1"},
    "longest name": {"top": f'name = "{"a" * 100}"'},
    "every as long as the run": {"time": "end = 10\nevery = 10"},
    "two samples": {"time": "end = 10\nsamples = 2"},
    "a single time": {"time": "times = [5]"},
    "zero gravity needs no mass": {"loads": GRAVITY},
    "false for what comes later": {"integrator": "hold_invariants = false", "output": "lyapunov = false"},
    "Euler start in another sequence": {"integrator": 'formulation = "euler_angles"\neuler_sequence = "xyz"'},
    "rates for a flight that records rates": spin("position = [0, 0, 0]")
    | {
        "body": "principal_moments = [1, 2, 2]\nmass = 1",
        "integrator": 'formulation = "rates"',
        "output": 'record = ["angular_velocity"]',
    },
}


@pytest.mark.parametrize("case", GOOD_CASES)
def test_accepted(case: str) -> None:
    experiment = parse(config(**GOOD_CASES[case]))
    assert prepare(experiment).scene.config == experiment.config


def test_all_problems_of_the_file_are_reported_at_once() -> None:
    text = config(
        top='name = "a/b"',
        body="principal_moments = [1, true, 2]\nmas = 3",
        loads='kind = "torque"',
        integrator='precision = "doubel"\nhold_invariants = true',
        output="record = []",
    )
    problems = refused(lambda: prepare(parse(text)))
    assert sorted(problem.where for problem in problems) == [
        "[[loads]] number 1 components",
        "[body] mas",
        "[body] principal_moments[1]",
        "[integrator] precision",
        "[output] record",
        "name",
    ]


def test_all_problems_of_the_mechanics_are_reported_at_once() -> None:
    text = config(
        body="principal_moments = [1, 2, 4]",
        initial="angular_velocity = [1, 0, 0]\nquaternion = [0, 0, 0, 0]",
        time="end = -1",
        limits="wall_time = 0",
    )
    problems = refused(lambda: prepare(parse(text)))
    assert [problem.where for problem in problems] == [
        "[body] principal_moments",
        "[initial] quaternion",
        "[time] end",
        "[limits] wall_time",
    ]


def test_the_text_counts_the_problems_and_names_the_file() -> None:
    with pytest.raises(ConfigError) as caught:
        parse(config(time="end = true\nsamples = 1.5"), source="top.toml")
    lines = str(caught.value).splitlines()
    assert lines[0] == "top.toml: 2 problems in the config"
    assert lines[1].startswith("  [time] end: given true")
    assert lines[2].startswith("  [time] samples: given 1.5")


@pytest.mark.parametrize(
    ("content", "phrases"),
    [
        (b"\xff\xfe\x00", ["file: not UTF-8 text (byte 0); save it as UTF-8"]),
        (b'name = "\xe9"', ["file: not UTF-8 text (byte 8)"]),
        (b"name = ", ["TOML: can't be read: Invalid value (at end of document)"]),
        (b"a = [" * 100_000, ["TOML: can't be read"]),
        (b"# " + b"x" * 4_000_000, ["file: 4000002 bytes; a config has at most 4000000"]),
        (b"", ["name: missing", "[body]: missing", "[initial]: missing", "[time]: missing"]),
    ],
)
def test_unreadable_files(tmp_path: Path, content: bytes, phrases: list[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    for phrase in phrases:
        assert phrase in str(caught.value)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path, why in ((tmp_path / "none.toml", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(ConfigError) as caught:
            load(path)
        assert str(path) in str(caught.value)
        assert f"file: can't be read: {why}" in str(caught.value)


@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize(
    "case", ["triangle inequality", "key twice", "samples too dense", "sweep without axes", "table misspelt"]
)
def test_the_command_line_says_it_and_leaves_no_folder(tmp_path: Path, command: str, case: str) -> None:
    tables, where, phrases = CASES[case]
    path, out = tmp_path / "bad.toml", tmp_path / "runs"
    path.write_text(config(**tables), encoding="utf-8")
    arguments = [command, str(path)] + (["--out", str(out)] if command == "run" else [])
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith(f"rigidsim: {path}: 1 problem in the config\n  {where}: ")
    for phrase in phrases:
        assert phrase in result.stderr
    assert "Traceback" not in result.stderr
    assert not out.exists()


def test_one_bad_config_among_good_ones_stops_the_command_before_any_run(tmp_path: Path) -> None:
    good, bad, out = tmp_path / "good.toml", tmp_path / "bad.toml", tmp_path / "runs"
    good.write_text(config(), encoding="utf-8")
    bad.write_text(config(time="end = true"), encoding="utf-8")
    result = CliRunner().invoke(app, ["run", str(good), str(bad), "--out", str(out)])
    assert result.exit_code == 2
    assert "bad.toml: 1 problem" in result.stderr
    assert not out.exists()


def test_the_command_line_names_a_missing_file(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["run", str(tmp_path / "none.toml"), "--out", str(tmp_path / "runs")])
    assert result.exit_code == 2
    assert "none.toml" in result.stderr
    assert "can't be read: No such file" in result.stderr
    assert not (tmp_path / "runs").exists()
