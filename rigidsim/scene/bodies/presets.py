"""Published bodies: a file each in ``published/``, with remarks and the source of every value.

The Sun, the planets and the Moon are recognised by their gravitational parameters as well.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from rigidsim.scene.arithmetic import Matrix, diagonal
from rigidsim.scene.exact import parse_number


@dataclass(frozen=True)
class Preset:
    """Moments of inertia, mass and picture of a body, and their source.

    Moments are principal ones along x, y, z (``ratios``), a ``tensor``, or follow from ``parts``.

    Attributes:
        source: publication of the numbers.
        ratios: I_x, I_y, I_z over the largest moment, as exact texts.
        largest_moment: kg m^2, or the factor C/(M R^2) if ``radius`` is given.
        tensor: the tensor of inertia, kg m^2, where its axes aren't the principal ones.
        parts: solids as in ``[body]``, whose mass, moments and picture are the body's.
        mass: kg; empty if it isn't published.
        semi_axes: semi-axes for pictures, m; empty if only the moments are known.
        radius: R of the factor C/(M R^2), m.
        rotation: the published rotation, rad/s about the body axes; empty if there is no lasting one.
            A scene itself starts as its ``[initial]`` says.
        tables: what else of ``[body]`` is published with them, as it would be written there: gravity_field,
            elasticity, core.
        drawn_as: name of the body whose picture is its own; by default the preset's.
    """

    source: str
    ratios: tuple[str, str, str] | tuple[()] = ()
    largest_moment: str = ""
    tensor: tuple[tuple[str, str, str], ...] = ()
    parts: tuple[Mapping[str, Any], ...] = ()
    mass: str = ""
    semi_axes: tuple[str, str, str] | tuple[()] = ()
    radius: str = ""
    rotation: tuple[str, str, str] | tuple[()] = ()
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    drawn_as: str | None = None

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Preset:
        """The preset of its file's table, whose inner tables are tables of ``[body]``."""
        tables = {key: value for key, value in table.items() if isinstance(value, dict)}
        own = {key: value for key, value in table.items() if key not in tables}
        lists = {key: tuple(value) for key, value in own.items() if isinstance(value, list)}
        if "tensor" in lists:
            lists["tensor"] = tuple(map(tuple, lists["tensor"]))
        return cls(**{**own, **lists}, tables=tables)

    def completed(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """``[body]`` as given, with this preset's tables where it says nothing else.

        Keys of a table count one by one: ``core = {friction = 0}`` keeps the rest of the core. A gravity
        field with a radius or a file is another one.
        """
        found = dict(given)
        for name, table in self.tables.items():
            own = given.get(name)
            if own is None:
                found[name] = dict(table)
            elif isinstance(own, Mapping) and not (name == "gravity_field" and {"radius", "file"} & set(own)):
                found[name] = _filled(table, own)
        return found

    def inertia(self, context: Any, mass: Any = None) -> Matrix:
        """Tensor of inertia, kg m^2 (mpf), of ``ratios`` or ``tensor``; in proportion to another ``mass``."""
        own = self.own_mass(context)
        if self.radius:
            radius = parse_number(self.radius, "m").at(context)
            largest = parse_number(self.largest_moment, "1").at(context)
            largest *= (own if mass is None else mass) * radius**2
            return diagonal([parse_number(ratio, "1").at(context) * largest for ratio in self.ratios])
        if self.tensor:
            found = [[parse_number(x, "kg m^2").at(context) for x in row] for row in self.tensor]
        else:
            largest = parse_number(self.largest_moment, "kg m^2").at(context)
            found = diagonal([parse_number(ratio, "1").at(context) * largest for ratio in self.ratios])
        if mass is None or own is None:
            return found
        return [[x * mass / own for x in row] for row in found]

    def own_mass(self, context: Any) -> Any | None:
        """Kg (mpf); None if it isn't published, or is the parts' mass."""
        return parse_number(self.mass, "kg").at(context) if self.mass else None


def _filled(table: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A table with its keys, also in the tables within, replaced by the given ones."""
    found = {**table, **own}
    for key, inner in table.items():
        if isinstance(inner, Mapping) and isinstance(own.get(key), Mapping):
            found[key] = {**inner, **own[key]}
    return found


class Published(Mapping[str, Preset]):
    """Presets by name: the files of a folder, each read when it is asked for."""

    def __init__(self, folder: Traversable) -> None:
        """The files ``NAME.toml`` of a folder."""
        self._folder = folder
        self._read: dict[str, Preset] = {}

    @cached_property
    def _names(self) -> list[str]:
        found = (file.name for file in self._folder.iterdir())
        return sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml"))

    def __getitem__(self, name: str) -> Preset:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._read:
            text = (self._folder / f"{name}.toml").read_text(encoding="utf-8")
            self._read[name] = Preset.of(tomllib.loads(text))
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


FOLDER = files("rigidsim.scene.bodies") / "published"
PRESETS = Published(FOLDER)

_ALIKE = 0.01
"""Relative difference up to which a gravitational parameter means a known body: for what is written in
few digits (4e14), and less than what the Moon adds to the Earth (0.0123).
"""


@dataclass(frozen=True)
class KnownBody:
    """A body that attracts others.

    Attributes:
        gravitational_parameter: m^3/s^2.
        radius: at the equator, m.
        distance: semi-major axis of its orbit about the Sun, of the Moon's about the Earth, m; 0 for the Sun.
    """

    name: str
    gravitational_parameter: float
    radius: float
    distance: float

    def attracts_by(self, strength: Any) -> bool:
        """Whether a gravitational parameter (m^3/s^2) is this body's."""
        return bool(abs(strength / self.gravitational_parameter - 1) < _ALIKE)

    @property
    def called(self) -> str:
        """Its name in a sentence: ``the Sun``, ``Saturn``."""
        return f"the {self.name}" if self.name in ("Sun", "Earth", "Moon") else self.name

    @property
    def owner(self) -> str:
        """Its name as the owner of something: ``the Sun's``, ``Mars'``."""
        return f"{self.called}'" if self.name.endswith("s") else f"{self.called}'s"


KNOWN: tuple[KnownBody, ...] = (
    # nominal G M and equatorial radii of IAU 2015 Resolution B3 for Sun, Earth and Jupiter; else G M of JPL's
    # planetary ephemerides and radii of Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22; semi-major
    # axes of Standish's mean elements at J2000 (JPL), rounded
    KnownBody("Sun", 1.3271244e20, 6.957e8, 0.0),
    KnownBody("Mercury", 2.2031868e13, 2.4397e6, 5.7909e10),
    KnownBody("Venus", 3.24858592e14, 6.0518e6, 1.08209e11),
    KnownBody("Earth", 3.986004e14, 6.3781e6, 1.49598e11),
    KnownBody("Moon", 4.902800e12, 1.7374e6, 3.84400e8),
    KnownBody("Mars", 4.2828375e13, 3.39619e6, 2.27944e11),
    KnownBody("Jupiter", 1.2668653e17, 7.1492e7, 7.78341e11),
    KnownBody("Saturn", 3.7931206e16, 6.0268e7, 1.426666e12),
    KnownBody("Uranus", 5.7939512e15, 2.5559e7, 2.870658e12),
    KnownBody("Neptune", 6.8350999e15, 2.4764e7, 4.498396e12),
)
EARTH = next(body for body in KNOWN if body.name == "Earth")


def known_body(strength: float) -> KnownBody | None:
    """The body with a gravitational parameter (m^3/s^2); None if no known body has it."""
    near = min(KNOWN, key=lambda one: abs(one.gravitational_parameter - strength))
    return near if near.attracts_by(strength) else None
