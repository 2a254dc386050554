"""Commented configs to start from: one for each kind of scene."""

import re
import tomllib
from importlib.resources import files
from pathlib import Path

from rigidsim.errors import RigidsimError
from rigidsim.scene.validation_messages import nearest, shown

_FOLDER = files("rigidsim.workflows") / "templates"
SCENES = (
    "free_body",
    "racket",
    "top",
    "gyroscope",
    "coin",
    "satellite",
    "thrusters",
    "orbiter",
    "planet",
    "torque",
    "magnet",
)
"""Names of all templates, the simplest first."""


def template(scene: str) -> str:
    """The text of a template."""
    if scene not in SCENES:
        raise RigidsimError(
            f"new: given {shown(scene)}{nearest(scene, SCENES)}; scenes to choose from: {', '.join(SCENES)}"
        )
    return (_FOLDER / f"{scene}.toml").read_text(encoding="utf-8")


def described() -> dict[str, str]:
    """Description of each template."""
    return {scene: str(tomllib.loads(template(scene))["description"]) for scene in SCENES}


def write_new(scene: str, name: str | None = None, folder: Path = Path()) -> Path:
    """Write a template as ``NAME.toml``; an existing file is never replaced."""
    text = template(scene)
    name = scene if name is None else name.removesuffix(".toml")
    if not re.fullmatch(r"[A-Za-z0-9._-]{1,100}", name) or not name.strip("."):
        raise RigidsimError(
            f"new: given the name {shown(name)}; letters, digits, dots, underscores and hyphens are allowed"
        )
    path = folder / f"{name}.toml"
    text = text.replace(f'name = "{scene}"\n', f'name = "{name}"\n', 1)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise RigidsimError(
            f"{path}: is there already, and nothing was written; give another NAME, as in rigidsim new "
            f"{scene} my_{scene}"
        ) from None
    except OSError as error:
        raise RigidsimError(f"{path}: can't be written: {error.strerror or error}") from None
    return path
