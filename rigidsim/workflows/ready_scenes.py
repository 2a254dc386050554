"""Ready scenes: the texts of ``configs/``, which wheels have in the package, by subjects and by names."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from rigidsim.errors import RigidsimError
from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.config import texts_in
from rigidsim.scene.validation_messages import nearest, shown

SUBJECTS: Mapping[str, tuple[str, ...]] = {
    "To start from, with a comment at each key": (
        "free_body", "racket", "top", "gyroscope", "coin", "satellite", "thrusters", "orbiter",
        "planet", "moon",
        "torque", "magnet",
    ),
    "Free rotation": (
        "asymmetric_top", "free_symmetric_top", "intermediate_axis", "tossed_plate", "wobbling_coin",
        "square_plate_corner",
        "damped_top", "tumbling_planet", "water_molecule",
    ),
    "Tops": (
        "heavy_top_nutating", "heavy_top_regular_precession", "heavy_top_fast", "heavy_top_sleeping_stable",
        "heavy_top_sleeping_unstable", "kovalevskaya_top", "goryachev_chaplygin_top",
    ),
    "Satellites in orbit": (
        "gravity_gradient_libration", "satellite_libration", "central_gravity_dumbbell", "j2_orbit",
        "gravity_gradient_boom", "aerostable_cubesat", "sun_pointing_sail",
        "detumbling_cubesat", "lageos_spin_decay", "tumbling_rocket_body",
    ),
    "Wheels, pointing, and mass that moves": (
        "intermediate_axis_with_wheel", "dual_spin_turn", "pointing_law", "pointing_with_wheels",
        "nadir_pointing",
        "detumbling_by_magnetorquers", "cubesat_with_hysteresis_rods", "momentum_dumping",
        "slosh", "skater", "rocket_coning",
    ),
    "The Earth, the Moon and other bodies": (
        "earth_free_nutation", "earth_free_nutation_axes", "earth_free_core_nutation",
        "earth_chandler_wobble",
        "earth_precession_averaged",
        "earth_moon_sun", "moon_cassini_state", "moon_mean_axis", "young_moon", "mars_precession",
        "mars_with_table",
        "mars_obliquity", "earth_deep_time", "phobos_libration", "vesta_nutation",
    ),
    "Two rigid bodies": ("didymos", "didymos_impact", "didymos_after_dart", "kw4_1999", "antiope"),
    "Under JPL's ephemerides (pip install 'rigidsim[ephemeris]')": (
        "moon_since_1969", "rigid_moon", "rigid_earth_nutation", "mars_nutation", "mercury_libration",
        "apophis_2029",
    ),
    "Fits to observations: rigidsim fit": ("toutatis_1992",),
    "Sweeps: rigidsim sweep": (
        "first_flip", "flip_sphere", "hyperion_map", "mars_obliquities", "apophis_flyby", "round_off",
    ),
}  # fmt: skip
"""Names of all scenes by what they are about, the simplest first."""

ALIASES: Mapping[str, str] = {
    "apophis": "apophis_2029",
    "ashbaugh": "racket",
    "bdot": "detumbling_by_magnetorquers",
    "boom": "gravity_gradient_boom",
    "cassini": "moon_cassini_state",
    "chandler": "earth_chandler_wobble",
    "dart": "didymos_after_dart",
    "dzhanibekov": "intermediate_axis",
    "euler": "asymmetric_top",
    "feynman": "tossed_plate",
    "flat_spin_recovery": "dual_spin_turn",
    "goryachev": "goryachev_chaplygin_top",
    "hyperion": "hyperion_map",
    "kovalevskaya": "kovalevskaya_top",
    "lageos": "lageos_spin_decay",
    "lagrange": "heavy_top_nutating",
    "mars": "mars_precession",
    "mercury": "mercury_libration",
    "milankovitch": "earth_deep_time",
    "phobos": "phobos_libration",
    "sail": "sun_pointing_sail",
    "shuttlecock": "aerostable_cubesat",
    "tle": "tumbling_rocket_body",
    "toutatis": "toutatis_1992",
    "vesta": "vesta_nutation",
}
"""Names by which scenes are known, too."""


def ready_folder() -> Path:
    """Where the texts are: in the package as wheels have it, next to it in a clone."""
    package = Path(str(files("rigidsim")))
    packed = package / "configs"
    return packed if packed.is_dir() else package.parent / "configs"


def ready_scenes() -> dict[str, Path]:
    """The file of each scene, by subjects."""
    found = {path.stem: path for path in sorted(ready_folder().rglob("*.toml"))}
    return {name: found[name] for names in SUBJECTS.values() for name in names if name in found}


def described() -> dict[str, str]:
    """Description of each scene, as it gives it itself."""
    return {name: str(_parsed(path)["description"]) for name, path in ready_scenes().items()}


def by_subject() -> Iterator[tuple[str, dict[str, str]]]:
    """The scenes of each subject with their descriptions, and other names that they go by."""
    descriptions = described()
    also: dict[str, list[str]] = {}
    for alias, name in ALIASES.items():
        also.setdefault(name, []).append(alias)
    for subject, names in SUBJECTS.items():
        rows = {name: descriptions[name] for name in names if name in descriptions}
        known = {name: f" (also {', '.join(also[name])})" if name in also else "" for name in rows}
        yield subject, {name: f"{text}{known[name]}" for name, text in rows.items()}


def write_new(scene: str, name: str | None = None, folder: Path = Path()) -> list[Path]:
    """Write a scene as ``NAME.toml``, and next to it the files that it reads.

    Args:
        scene: its name or an alias.
        name: of the experiment and its file; by default as the scene was asked for.

    Returns:
        What was written, the config first. An existing file is never replaced.
    """
    source = _file_of(scene)
    name = scene if name is None else name.removesuffix(".toml")
    if not re.fullmatch(r"[A-Za-z0-9._-]{1,100}", name) or not name.strip("."):
        raise RigidsimError(
            f"new: given the name {shown(name)}; letters, digits, dots, underscores and hyphens are allowed"
        )
    text = source.read_text(encoding="utf-8")
    beside = {folder / path.name: path.read_bytes() for path in _companions(source)}
    written = {
        folder / f"{name}.toml": text.replace(f'name = "{source.stem}"\n', f'name = "{name}"\n', 1).encode()
    }
    for path, content in beside.items():
        if not path.exists():
            written[path] = content
        elif not path.is_file() or path.read_bytes() != content:
            raise RigidsimError(
                f"{path}: another file of this name, which {scene} reads, is there; move it first"
            )
    for path, content in written.items():
        try:
            with path.open("xb") as file:
                file.write(content)
        except FileExistsError:
            raise RigidsimError(
                f"{path}: is there already, and nothing was written; give another NAME, as in rigidsim new "
                f"{scene} my_{scene}"
            ) from None
        except OSError as error:
            raise RigidsimError(f"{path}: can't be written: {error.strerror or error}") from None
    return list(written)


def _file_of(scene: str) -> Path:
    found = ready_scenes()
    name = ALIASES.get(scene.lower(), scene)
    if name not in found:
        hint = nearest(scene, [*found, *ALIASES])
        if scene.lower() in PRESETS:
            hint = f'; that is a body, which any scene takes as [body] preset = "{scene.lower()}"'
        raise RigidsimError(f"new: given {shown(scene)}{hint}; the command rigidsim new lists all scenes")
    return found[name]


def _companions(config: Path) -> list[Path]:
    """Files next to a config that it names as values."""
    names = dict.fromkeys(text for text in texts_in(_parsed(config)) if re.fullmatch(r"\w[\w.-]*\.\w+", text))
    return [path for path in (config.parent / name for name in names) if path.is_file()]


def _parsed(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))
