"""What is packed is whole: wheel and sdist run outside the clone, with ready scenes, presets and types."""

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKED = (
    "rigidsim",
    "configs",
    "setup.py",
    "MANIFEST.in",
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "CHANGELOG.md",
)


def call(*command: str, **options: object) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, capture_output=True, text=True, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tracked files of the clone, elsewhere: building writes beside them."""
    folder = tmp_path_factory.mktemp("source")
    tracked = call("git", "ls-files", "--", *PACKED, cwd=ROOT).stdout.split("\n")
    for name in filter(None, tracked):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes((ROOT / name).read_bytes())
    return folder


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from an sdist, as an index would have it built."""
    folder = tmp_path_factory.mktemp("wheel")
    tools = folder / "tools"
    required = tomllib.loads((source / "pyproject.toml").read_text())["build-system"]["requires"]
    call(sys.executable, "-m", "pip", "install", "-q", "--target", str(tools), *required)
    environment = {**os.environ, "PYTHONPATH": str(tools)}
    backend = f"import setuptools.build_meta as backend; print(backend.build_sdist({str(folder)!r}))"
    call(sys.executable, "-c", backend, cwd=source, env=environment)
    (packed,) = folder.glob("*.tar.gz")
    with tarfile.open(packed) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    pip = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation")
    call(*pip, "-w", str(folder), str(unpacked), env=environment)
    (found,) = folder.glob("*.whl")
    return found


@pytest.mark.slow
def test_a_wheel_holds_all_that_is_tracked(wheel: Path) -> None:
    tracked = call("git", "ls-files", "--", "rigidsim", cwd=ROOT).stdout.split()
    with zipfile.ZipFile(wheel) as archive:
        packed = set(archive.namelist())
    assert {name for name in tracked if name not in packed} == set()
    ready = call("git", "ls-files", "--", "configs", cwd=ROOT).stdout.split()
    assert {name for name in ready if f"rigidsim/{name}" not in packed} == set()
    assert not any(name.startswith("configs/") for name in packed)
    assert not any(name.startswith(("tests/", "docs/", "experiments/")) for name in packed)


@pytest.mark.slow
def test_it_runs_outside_the_clone(wheel: Path, tmp_path: Path) -> None:
    """Installed alone into a folder; its libraries are those of this environment."""
    place, work = tmp_path / "installed", tmp_path / "work"
    work.mkdir()
    call(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(place), str(wheel))
    libraries = [p for p in sys.path if p and Path(p) != ROOT and not Path(p).is_relative_to(ROOT / "tests")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(place), *libraries])}

    def rigidsim(*words: str) -> str:
        return call(sys.executable, "-m", "rigidsim", *words, cwd=work, env=environment).stdout

    where = "import rigidsim; print(rigidsim.__file__)"
    found = call(sys.executable, "-c", where, cwd=work, env=environment).stdout
    assert Path(found.strip()).is_relative_to(place)
    listed = rigidsim("new")
    rest = (
        "from rigidsim.workflows.ready_scenes import *\n"
        "assert ready_folder().parent.name == 'rigidsim'\n"
        "for name in [*ready_scenes(), 'cassini']: print(write_new(name)[0])"
    )
    scenes = call(sys.executable, "-c", rest, cwd=work, env=environment).stdout.split()
    assert len(scenes) > 60
    assert all(scene.removesuffix(".toml") in listed for scene in scenes)
    rigidsim("check", *scenes)
    assert "finished" in rigidsim("run", "top.toml", "--set", "time.end=0.1")
    assert "identical" in rigidsim("verify", "runs/top")
    assert rigidsim("plot", "runs/top").strip().endswith("figure.png")
    rigidsim(
        "run",
        "planet.toml",
        "--set",
        "time.end=86400",
        "--set",
        "time.every=3600",
        "--set",
        "output.timeline=false",
    )
