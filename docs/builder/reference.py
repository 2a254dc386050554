"""The reference, from the code itself: config keys, commands, the dataset, figures, Python, statuses."""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

PAGES = ("config", "commands", "dataset", "figures", "python", "codes")
"""Names of the pages, each made by the function ``NAME_page``."""
_FEW = 16  # values that are listed in a cell

Rows = list[list[str]]


def write(folder: Path) -> None:
    """Write every page."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in PAGES:
        text = getattr(sys.modules[__name__], f"{name}_page")()
        (folder / f"{name}.md").write_text(text + "\n", encoding="utf-8")


def table(columns: list[str], rows: Rows) -> str:
    """Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def code(value: str) -> str:
    """As code."""
    return f"`{value}`" if value else ""


# --- config keys --------------------------------------------------------------------------------------------


def config_page() -> str:
    """Every key of every table."""
    import rigidsim.workflows.read  # noqa: F401  (every kind of load is registered)
    from rigidsim.scene.schema import editor_schema

    schema = editor_schema()
    parts = [
        "# Config keys\n\nEvery key of every table, generated from the schema that validates configs "
        "(`rigidsim schema` prints it for editors). Numbers are TOML numbers in the unit given, or "
        "strings with any unit "
        '(`"430 day"`), a ratio (`"1/3"`), a power (`"2^-20"`) or a multiple of pi (`"pi/4"`); bare '
        "numbers are in SI. Keys in bold are required. For how keys work together see [writing a "
        "config](../config.md)."
    ]
    for heading, node in _tables(schema):
        parts.append(f"## {heading}\n\n{_sentence(node['description'])}\n\n{_keys(node, schema)}")
    return "\n\n".join(parts)


def _tables(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Headings and tables, in the order in which a config is written, then those within tables."""
    defined = schema["$defs"]
    yield from _named(schema)
    shown = {id(node) for _, node in _named(schema)}
    for name, node in defined.items():
        if id(node) not in shown:
            yield _INNER.get(name, re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).capitalize()), node


def _named(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables that a config names, each load by its kind."""
    yield "The whole file", {**schema, "description": "The keys above all tables, and the tables."}
    for name, key in schema["properties"].items():
        target = _target(key, schema)
        if name == "loads":
            for fields in _alternatives(key["items"], schema):
                yield f"[[loads]] {fields['properties']['kind']['const']}", fields
        elif target is not None:
            named = isinstance(key.get("additionalProperties"), Mapping)
            plain = f'[{name}."NAME"]' if named else f"[{name}]"
            yield (f"[[{name}]]" if key.get("type") == "array" else plain), target


_INNER = {
    "PointMass": "An entry of [body] points",
    "Part": "An entry of [body] parts",
    "Orbit": "orbit of a load",
    "SatelliteOrbit": "satellite_orbit of a load",
    "AxisTable": "An axis of [sweep] axes",
}
"""Headings of tables within tables; others are called by their class."""


def _target(key: Mapping[str, Any], schema: Mapping[str, Any]) -> dict[str, Any] | None:
    """The table that a key holds."""
    for node in (key, key.get("items"), key.get("additionalProperties"), *key.get("allOf", [])):
        if isinstance(node, Mapping) and "$ref" in node:
            return schema["$defs"][node["$ref"].rpartition("/")[2]]
    return None


def _alternatives(node: Mapping[str, Any], schema: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for one in node.get("oneOf", [node]):
        yield schema["$defs"][one["$ref"].rpartition("/")[2]]


def _keys(node: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    rows = []
    for name, key in node["properties"].items():
        shown = f"**`{name}`**" if name in node.get("required", []) else f"`{name}`"
        unit = key.get("x-unit", "")
        said = key["description"].removesuffix(f"[{unit}]").removesuffix("[SI, or any unit]").strip()
        default = code(_toml(key["default"])) if "default" in key else ""
        examples = ", ".join(code(_toml(value)) for value in key.get("examples", []))
        rows.append([shown, _type(key, schema), code(unit) if unit != "1" else "", default, examples, said])
    return table(["key", "type", "unit", "default", "example", "meaning"], rows)


def _type(key: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """What may stand there, in words."""
    if "const" in key:
        return code(_toml(key["const"]))
    if "enum" in key:
        values = key["enum"]
        return " ".join(code(_toml(value)) for value in values) if len(values) <= _FEW else "a name"
    if _is_number(key):
        return _within("number", key["anyOf"][0])
    kinds = [*key.get("anyOf", []), *key.get("oneOf", [])]
    if kinds:
        return " or ".join(dict.fromkeys(_type(kind, schema) for kind in kinds))
    if "$ref" in key or "allOf" in key:
        return "table"
    kind = key.get("type")
    if kind == "array":
        least, most = key.get("minItems"), key.get("maxItems")
        many = f"{least} " if least == most and least else f"{least} to {most} " if least and most else ""
        return f"list of {many}{_plural(_type(key.get('items', {}), schema))}"
    words = {"string": "text", "boolean": "`true` `false`", "object": "table"}
    return _within("whole number", key) if kind == "integer" else words.get(str(kind), "any value")


def _is_number(key: Mapping[str, Any]) -> bool:
    return [kind.get("type") for kind in key.get("anyOf", [])] == ["number", "string"]


def _within(what: str, node: Mapping[str, Any]) -> str:
    limits = {
        "exclusiveMinimum": "above {}",
        "minimum": "from {}",
        "exclusiveMaximum": "below {}",
        "maximum": "to {}",
    }
    return " ".join([what, *(words.format(node[name]) for name, words in limits.items() if name in node)])


def _plural(words: str) -> str:
    return {"number": "numbers", "text": "texts", "table": "tables", "whole number": "whole numbers"}.get(
        words, words.replace("list of", "lists of")
    )


def _toml(value: Any) -> str:
    """A value as it stands in a config."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name} = {_toml(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)


def _sentence(text: str) -> str:
    """A docstring that begins with the table's own name, without it."""
    begun = text.partition("]: ")[2] if text.startswith("[") and "]: " in text else text
    return begun[:1].upper() + begun[1:]


# --- commands -----------------------------------------------------------------------------------------------


def commands_page() -> str:
    """Every command with its options, from the program itself."""
    import typer

    from rigidsim.cli.app import app

    whole: Any = typer.main.get_command(app)
    parts = [
        "# Commands\n\n`rigidsim COMMAND -h` shows the same in a terminal. Progress goes to stderr, results "
        "to stdout. Exit codes: 0 done; 1 the check asked for failed (`verify`); 2 bad usage or bad "
        "config; 3 the run stopped (guard, non-finite state, a folder that can't be written any more), "
        "and everything integrated so far is kept; 130 interrupted, can be resumed."
    ]
    for name, command in whole.commands.items():
        parts.append(f"## rigidsim {name}\n\n{_help(command)}\n\n{_options(command)}")
    return "\n\n".join(parts)


def _help(command: Any) -> str:
    lines = inspect.cleandoc(command.help or "").splitlines()
    return "\n".join(
        f"Example: `{line.removeprefix('Example: ')}`" if line.startswith("Example: ") else line
        for line in lines
    )


def _options(command: Any) -> str:
    rows = []
    for parameter in command.params:
        names = [*parameter.opts, *parameter.secondary_opts]
        argument = parameter.param_type_name == "argument"
        shown = parameter.metavar or names[0].upper() if argument else ", ".join(names)
        value = "" if argument or parameter.is_flag else f" {parameter.metavar or 'VALUE'}"
        default = parameter.default
        told = "" if default is None or default is False or callable(default) else code(str(default))
        rows.append([code(shown + value), getattr(parameter, "help", "") or "", told])
    return table(["argument or option", "meaning", "default"], rows)


# --- dataset ------------------------------------------------------------------------------------------------


def dataset_page() -> str:
    """Variables, from the registry of observables, and their coordinates."""
    import rigidsim.workflows.read  # noqa: F401  (everything that can be recorded is registered)
    from rigidsim.model.observables import always, only_when_named
    from rigidsim.scene.registry import OBSERVABLES
    from rigidsim.store.variables import LABELS

    words = {always: "if the scene has it", only_when_named: "when named"}
    rows = []
    for item in OBSERVABLES.values():
        dims = ", ".join(("time", *item.dims))
        by_default = words.get(item.by_default, "if it suits the scene")
        needs = ", ".join(need.replace("_", " ") for need in item.needs)
        rows.append([code(item.name), dims, code(item.units), item.long_name, item.frame, needs, by_default])
    return "\n\n".join(
        [
            "# Dataset\n\n`dataset.h5` is a netCDF-4 file that `xarray.open_dataset` opens with no other "
            "argument. Variables lie along `time`, in seconds since the scene's time 0. What each means: "
            "[observables](../observables.md), [invariants](../invariants.md), "
            "[conventions](../conventions.md).",
            "## Variables\n\n"
            + table(["variable", "dimensions", "unit", "what", "frame", "needs", "recorded"], rows),
            "Every invariant of the scene has a `NAME_drift`, (value - initial) / scale, whose "
            "attributes name the scale; where invariants are held, `NAME_put_back` is the correction "
            "accumulated so far. Events have `NAME_time` and, at that time, `NAME_VARIABLE` for all that is "
            "recorded. "
            "With an epoch there are `year`, `julian_date` and `date` along time ([epochs and "
            "axes](../epochs_and_axes.md)).",
            "Beyond double precision a variable `v` has residuals `v_lo`, `v_lo2`, ...: the sum, smallest "
            "first, is the exact value.",
            "## Coordinates\n\n"
            + table(
                ["coordinate", "labels"],
                [[code(name), ", ".join(map(code, labels))] for name, labels in LABELS.items()],
            ),
        ]
    )


# --- figures ------------------------------------------------------------------------------------------------


def figures_page() -> str:
    """Figures of runs, from their registry."""
    from rigidsim.look.figure_names import FIGURES
    from rigidsim.look.figures.catalogue import KINDS

    rows = [
        [code(name), shows, KINDS[name].needs if name in KINDS else ""] for name, shows in FIGURES.items()
    ]
    return (
        "# Names of figures\n\nFor `rigidsim plot RUN --what NAME`. Usage: [figures](../figures.md)."
        "\n\n" + table(["figure", "shows", "needs"], rows)
    )


# --- Python -------------------------------------------------------------------------------------------------


def python_page() -> str:
    """What is imported from ``rigidsim`` itself, and what loads and observables are made of."""
    import rigidsim

    functions = [name for name in rigidsim.__all__ if inspect.isfunction(getattr(rigidsim, name))]
    classes = [name for name in rigidsim.__all__ if name not in functions]
    parts = [
        "# Python\n\nWhat `import rigidsim` offers, and the parts of user-defined loads and observables. "
        "How they are used: [from Python](../howto/python.md), [a load](../howto/own_load.md), "
        "[a carrier of momentum](../howto/own_carrier.md), "
        "[an observable](../howto/own_observable.md), [a solver](../howto/own_solver.md), "
        "[a formulation](../howto/own_formulation.md).",
        "## Functions\n\n"
        + "\n\n".join(_directive("autofunction", f"rigidsim.{name}") for name in functions),
        "## Runs, experiments and errors\n\n"
        + "\n\n".join(_directive("autoclass", f"rigidsim.{name}", members=True) for name in classes),
        "## Loads and observables\n\n"
        + "\n\n".join(
            [
                _directive("autoclass", "rigidsim.model.load.Load", members=True),
                _directive("autoclass", "rigidsim.model.mechanics.Carrier", members=True),
                _directive("autoclass", "rigidsim.model.observables.observable.Observable"),
                _directive("autofunction", "rigidsim.model.observables.observable.continuous_angles"),
                _directive("autoclass", "rigidsim.solve.effects.effect.Effect", members=True),
                _directive("autofunction", "rigidsim.scene.registry.register_load"),
                _directive("autofunction", "rigidsim.scene.registry.register_observable"),
            ]
        ),
    ]
    return "\n\n".join(parts)


def _directive(kind: str, name: str, *, members: bool = False) -> str:
    options = "   :members:\n" if members else ""
    if kind == "automodule":  # of protocols, which tell about their members themselves
        options += "   :undoc-members:\n"
    return f"```{{eval-rst}}\n.. {kind}:: {name}\n{options}```"


# --- what a run can say -------------------------------------------------------------------------------------


def codes_page() -> str:
    """Statuses of runs and codes of warnings."""
    from rigidsim.scene.cautions import WarningCode
    from rigidsim.solve.status import Status

    statuses = [[code(found.value), found.message, str(found.exit_code)] for found in Status]
    warnings = [[code(found.value), _why(found.value)] for found in WarningCode]
    return "\n\n".join(
        [
            "# Statuses and warnings\n\nWhat to do about them: [troubleshooting](../troubleshooting.md).",
            "## Statuses\n\nAttribute `status` of the dataset, key `status` of `summary.json`.\n\n"
            + table(["status", "what happened", "exit code"], statuses),
            "## Warnings\n\nKey `warning_codes` of `summary.json`, with the texts in `warnings`.\n\n"
            + table(["code", "about"], warnings),
        ]
    )


def _why(value: str) -> str:
    """Where the troubleshooting has a section on it, the way there."""
    words = value.replace("_", " ")
    page = Path(__file__).parents[1] / "troubleshooting.md"
    told = f"\n### {words}\n" in page.read_text(encoding="utf-8")
    return f"[{words}](../troubleshooting.md#{value.replace('_', '-')})" if told else words
