"""Hostile configs and damaged files, drawn from a seeded generator: material for tests and the campaign.

Everything is a function of a ``random.Random``, so that a number names a case and a case can be repeated.
"""

import datetime
import random
import tomllib
from pathlib import Path
from typing import Any

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
UNITS = [
    "kg", "m", "s", "rad", "deg", "day", "kg m^2", "km/s", "rpm", "µm", "°", "π", "u", "g0", "Å",
    "arcsec",
]  # fmt: skip
NAMES = ["t", "wx", "qw", "phi", "x", "vz", "pi", "e", "k", "sin", "atan2", "exp", "sqrt", "__import__", "ω"]
KEYS = [
    "name", "body", "initial", "loads", "time", "integrator", "output", "events", "limits",
    "parameters", "sweep", "kind", "mass", "samples", "every", "end", "times", "precision", "tolerance",
    "orbit", "components", "shape", "points", "parts", "preset", "quaternion", "euler_angles", "record",
    "expression", "position", "", "é", "a.b", "\u202e", "__class__", "model_config", "$ref", "0", "nan",
]  # fmt: skip
NUMBERS = [
    "0", "-0", "1", "-1", "0.1", "1e-18", "1e18", "1e400", "-1e-400", "1e4999", "1e5001", "1e999999999",
    "1e-999999999", "1e99999999999999999999", "nan", "inf", "-inf", "1/3", "1/0", "2^-20", "2^99999",
    "9^9^9", "0x10", "1_000", "1__0", "٣", "１", "1e", ".", "+-1", "1e400 kg", "1,5", "0.1.2", "1e308",
    "5e-324", "2.5 %",
]  # fmt: skip
STRINGS = [
    "", " ", "\t", "\n", "\x00", "é", "日本", "🪐", "\u202eabc", "..", "../../etc/passwd", "/etc/passwd",
    "C:\\x", ".", "a/b", "-rf", "~", "${HOME}", "{0}", "%s%n", "[bold]x[/]", "auto", "zxz", "quadruple",
    "as a name", "as a point", "__import__('os').system('true')", "sphere", "earth", "torque", "force",
    "uniform_gravity", "quaternion",
]  # fmt: skip


def expression(rng: random.Random, depth: int = 4) -> str:
    """A formula that may or may not be one."""
    if depth == 0 or rng.random() < 0.25:
        return rng.choice([rng.choice(NAMES), rng.choice(NUMBERS), str(rng.randint(-9, 99))])
    inner = expression(rng, depth - 1)
    shape = rng.randrange(7)
    if shape == 0:
        return f"({inner})"
    if shape == 1:
        return f"{rng.choice(['sin', 'log', 'exp', 'atan2', 'sqrt', 'tan', 'f', 'abs'])}({inner})"
    if shape == 2:
        return f"-{inner}"
    if shape == 3:
        return "(" * rng.randint(1, 90) + inner + ")" * rng.randint(1, 90)
    sign = rng.choice(["+", "-", "*", "/", "^", "**", ",", "==", ";", " "])
    return f"{inner}{sign}{expression(rng, depth - 1)}"


def value(rng: random.Random, depth: int = 3) -> Any:
    """A TOML value of any kind, most of them wrong wherever they are put."""
    kind = rng.randrange(14)
    if kind == 0:
        return rng.choice([0, 1, -1, 2, 3, 10**12, 10**18, -(10**18), 2**63, 10**400, 2**20_000])
    if kind == 1:
        return rng.choice([0.0, -0.0, 1.5, 1e-300, 1e300, float("nan"), float("inf"), -float("inf")])
    if kind == 2:
        return rng.random() < 0.5
    if kind == 3:
        return rng.choice(STRINGS)
    if kind == 4:
        return rng.choice(NUMBERS)
    if kind == 5:
        return f"{rng.choice(NUMBERS)} {unit(rng)}"
    if kind == 6:
        return expression(rng)
    if kind == 7:
        return "".join(
            chr(rng.choice([*range(32, 127), 0xE9, 0x3C9, 0x1FA90])) for _ in range(rng.randint(1, 30))
        )
    if kind == 8:
        return rng.choice("x1(é ") * rng.choice([10, 100, 3000, 20_000])
    if kind == 9:
        return datetime.date(1979, 5, 27)
    if kind == 10:
        return round(rng.uniform(-10, 10), 3)
    if kind == 11 and depth:
        return {rng.choice(KEYS): value(rng, depth - 1) for _ in range(rng.randint(0, 4))}
    if kind == 12:
        nested: Any = value(rng, 0)
        for _ in range(rng.choice([1, 2, 30])):
            nested = [nested]
        return nested
    return [value(rng, max(depth - 1, 0)) for _ in range(rng.randint(0, 5))] if depth else rng.randint(-5, 5)


def unit(rng: random.Random) -> str:
    """A unit, or what looks like one."""
    parts = [rng.choice([*UNITS, "parsec", "x", "1e9", "(", ")", ""]) for _ in range(rng.randint(1, 4))]
    powers = ["", "^2", "**-3", "^99", "^0.5", "^^2", "**1e9", "^-", "²"]
    return rng.choice([" ", "*", "/", "//", "·", "."]).join(part + rng.choice(powers) for part in parts)


def _text(item: Any) -> str:
    """A value as TOML."""
    if isinstance(item, bool):
        return str(item).lower()
    if isinstance(item, str):
        escaped = "".join(c if c >= " " and c not in '"\\\x7f' else f"\\u{ord(c):04X}" for c in item)
        return f'"{escaped}"'
    if isinstance(item, dict):
        return "{" + ", ".join(f"{_text(str(k))} = {_text(v)}" for k, v in item.items()) + "}"
    if isinstance(item, list):
        return "[" + ", ".join(map(_text, item)) + "]"
    if isinstance(item, int) and item.bit_length() > 10_000:
        return hex(item)  # decimal texts of this length are refused by Python itself
    return str(item)


def to_toml(table: dict[str, Any]) -> str:
    """A table as TOML text, inner tables inline."""
    return "".join(f"{_text(key)} = {_text(item)}\n" for key, item in table.items())


def _containers(node: Any) -> list[Any]:
    """All tables and arrays of a tree that can be changed."""
    found = [node] if isinstance(node, dict | list) and node else []
    for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        found += _containers(child)
    return found


def mutate(tree: dict[str, Any], other: dict[str, Any], rng: random.Random) -> None:
    """One change somewhere in the tree."""
    place = rng.choice(_containers(tree) or [tree])
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    if not keys:
        place[rng.choice(KEYS)] = value(rng)
        return
    key = rng.choice(keys)
    act = rng.randrange(8)
    if act == 0:
        del place[key]
    elif act == 1 and isinstance(place, dict):
        place[rng.choice([*KEYS, str(key) + "s", str(key)[:-1]])] = place.pop(key)
    elif act == 2:
        donor = rng.choice(_containers(other))
        place[key] = rng.choice(list(donor.values()) if isinstance(donor, dict) else donor)
    elif act == 3 and isinstance(place, list):
        place.insert(key, value(rng))
    elif act == 4 and isinstance(place, dict):
        place[rng.choice(KEYS)] = value(rng)
    elif act == 5 and type(place[key]) in (int, float) and abs(place[key]) < 1e30:
        old = place[key]
        place[key] = rng.choice([-old, old * 10**30, str(old), f"{old} {unit(rng)}"])
    else:
        place[key] = value(rng)


def hostile_config(rng: random.Random) -> bytes:
    """A config file made from the ready ones: changed as a tree, as text, or as bytes."""
    original, other = (rng.choice(CONFIGS).read_text() for _ in range(2))
    way = rng.random()
    if way < 0.65:
        tree = tomllib.loads(original)
        for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
            mutate(tree, tomllib.loads(other), rng)
        return to_toml(tree).encode("utf-8", "surrogatepass")
    if way < 0.8:
        lines = original.splitlines()
        for _ in range(rng.choice([1, 2, 5])):
            at = rng.randrange(len(lines) + 1)
            act = rng.randrange(4)
            if act == 0:
                del lines[at : at + 1]
            elif act == 1:
                lines.insert(at, rng.choice(lines or [""]))
            elif act == 2:
                lines.insert(at, rng.choice(other.splitlines()))
            else:
                lines.insert(at, f"{rng.choice(KEYS) or 'x'} = {_text(value(rng))}")
        return "\n".join(lines).encode("utf-8", "surrogatepass")
    return damaged(original.encode(), other.encode(), rng)


def damaged(content: bytes, other: bytes, rng: random.Random) -> bytes:
    """Bytes with bits flipped, ranges cut, doubled, zeroed, or spliced in from other bytes."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        if not data:
            break
        at = rng.randrange(len(data))
        size = min(rng.choice([1, 1, 4, 8, 64, 1024]), len(data) - at)
        act = rng.randrange(7)
        if act <= 1:
            data[at] ^= 1 << rng.randrange(8)
        elif act == 2:
            del data[at : at + size]
        elif act == 3:
            data[at:at] = data[at : at + size]
        elif act == 4:
            data[at : at + size] = bytes(size)
        elif act == 5:
            data[at : at + size] = rng.randbytes(size)
        else:
            start = rng.randrange(len(other)) if other else 0
            data[at : at + size] = other[start : start + size]
    return bytes(data[: rng.randrange(len(data) + 1)]) if rng.random() < 0.1 else bytes(data)
