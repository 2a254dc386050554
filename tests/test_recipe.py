"""The version is the same wherever it is written, and the recipe for conda asks for what pip is asked for."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

import rigidsim

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
IN_CONDA = {
    "heyoka": "heyoka.py",
    "isal": "python-isal",
    "matplotlib": "matplotlib-base",  # without the windows of Qt
    "tzdata": "python-tzdata",
}
"""Packages whose name there is another one."""


@pytest.fixture(scope="module")
def recipe() -> dict[str, Any]:
    yaml = pytest.importorskip("yaml", reason="pip install -e '.[test]'")
    read: dict[str, Any] = yaml.safe_load((ROOT / "docs" / "conda" / "recipe.yaml").read_text("utf-8"))
    return read


def test_the_version_is_the_same_everywhere(recipe: dict[str, Any]) -> None:
    written = {
        "CITATION.cff": r"^version: (\S+)$",
        "CHANGELOG.md": r"^## (\d\S+)",
        "docs/versions.md": r"This is version (\S+);",
        "docs/method.md": r"version\s*= \{(\S+)\}",
    }
    found = {"pyproject.toml": PROJECT["version"], "recipe.yaml": recipe["context"]["version"]}
    for name, pattern in written.items():
        first = re.search(pattern, (ROOT / name).read_text("utf-8"), re.MULTILINE)
        found[name] = first and first[1]
    assert found == dict.fromkeys(found, rigidsim.__version__)
    assert recipe["package"]["version"] == "${{ version }}"


def requirement(text: str) -> tuple[str, set[str]]:
    """Name and bounds of a requirement, of pip's or of conda's."""
    found = re.match(r"[\w.-]+", text.partition(";")[0])
    assert found
    return found[0].strip(), {
        bound.strip() for bound in text.partition(";")[0][found.end() :].split(",") if bound
    }


def test_the_recipe_asks_for_the_same_packages_and_versions(recipe: dict[str, Any]) -> None:
    asked = dict(requirement(text) for text in PROJECT["dependencies"])
    here = dict(requirement(text) for text in recipe["requirements"]["run"])
    assert here.pop("python") == {PROJECT["requires-python"]}
    assert here == {IN_CONDA.get(name, name): bounds for name, bounds in asked.items()}
    (backend,) = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["build-system"]["requires"]
    assert requirement(backend) in [requirement(text) for text in recipe["requirements"]["host"]]
