"""Numerical fingerprints of the ready scenes: the same numbers on every machine, the same bits on one.

Over a short horizon the last state and the invariants must agree to a relative 1e-12 (of each vector's norm),
whatever the CPU: some hundred steps leave some 1e-15 of round-off, and the scenes are stable for so long or
start far from where they aren't. Written by ``python tests/test_fingerprints.py``, which is to be done only
when numbers are meant to move; the changelog says so then.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import cases

import rigidsim

pytestmark = pytest.mark.optimised

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
FILE = Path(__file__).parent / "data" / "fingerprints.json"
ALLOWED = 1e-12
ROWS = 5
TURNS = 5.0  # radians of the fastest rotation


def shortened(path: Path) -> list[str]:
    """Overrides: from the start over some radians, in a few samples, nothing but numbers."""
    config = rigidsim.load(path)
    from rigidsim.scene.scene import build_scene

    scene = build_scene(config)
    start, last = float(scene.start), float(scene.samples.last)
    rate = max(float(abs(x)) for x in scene.angular_velocity)
    end = min(last, start + float(f"{TURNS / rate:.3g}")) if rate else last
    spacing = f"time.samples={ROWS}"
    if config.config.time.every is not None:
        spacing = f"time.every={(end - start) / (ROWS - 1)!r}"
    return [f"time.end={end!r}", spacing, "output.estimate=false", "output.lyapunov=false"]


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Every variable of a shortened run."""
    run = rigidsim.run(rigidsim.load(path, overrides=shortened(path)), out=None)
    assert run.status == "finished"
    dataset = run.dataset
    names = [str(n) for n in dataset.variables if dataset[n].dtype == np.float64]
    return {name: np.asarray(dataset[name].values) for name in names if "time" in dataset[name].dims}


def fingerprint(path: Path) -> dict[str, list[str]]:
    """The last sample of everything that is no drift or residual, as decimals that name each double."""
    return {
        name: [repr(float(x)) for x in np.atleast_1d(values[-1])]
        for name, values in numbers(path).items()
        if not name.endswith("_drift") and "_lo" not in name
    }


def digest(path: Path) -> str:
    """Of all bits of all variables."""
    found = hashlib.sha256()
    for name, values in sorted(numbers(path).items()):
        found.update(name.encode() + np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


USUAL = (  # of each kind one, cheap to compile; the others by hand, before versions, and eight a day
    "asymmetric_top",
    "earth_precession_averaged",
)


@pytest.mark.parametrize(
    "path", cases(CONFIGS, [p for p in CONFIGS if p.stem in USUAL], daily=8), ids=lambda p: p.stem
)
def test_the_numbers_are_those_of_every_machine(path: Path) -> None:
    saved: dict[str, Any] = json.loads(FILE.read_text())[path.stem]
    found = fingerprint(path)
    assert sorted(found) == sorted(saved)
    for name, texts in saved.items():
        expected = np.array([float(t) for t in texts])
        got = np.array([float(t) for t in found[name]])
        apart = got - expected
        if name == "roll_pitch_yaw":  # at a start with a pitch of 90 deg the last bit decides the whole turn
            apart -= 2 * np.pi * np.round(apart / (2 * np.pi))
        error = np.linalg.norm(apart)
        assert error <= ALLOWED * np.linalg.norm(expected), f"{name}: {got} instead of {expected}"


def test_every_ready_scene_has_a_fingerprint() -> None:
    assert sorted(json.loads(FILE.read_text())) == [path.stem for path in CONFIGS]


@pytest.mark.slow
def test_the_bits_are_those_of_every_process() -> None:
    """Two fresh processes, with other hash seeds and in another order."""
    chosen = [p for p in CONFIGS if p.stem in ("asymmetric_top", "heavy_top_nutating")]
    outputs = []
    for seed, order in (("1", chosen), ("2", chosen[::-1])):
        command = [sys.executable, __file__, "--digests", *map(str, order)]
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, env=os.environ | {"PYTHONHASHSEED": seed}
        )
        outputs.append(sorted(done.stdout.split("\n")))
    assert outputs[0] == outputs[1]
    assert len([line for line in outputs[0] if line]) == len(chosen) == 2


if __name__ == "__main__":
    if sys.argv[1:2] == ["--digests"]:
        for given in sys.argv[2:]:
            print(Path(given).stem, digest(Path(given)))
    else:
        FILE.parent.mkdir(exist_ok=True)
        FILE.write_text(json.dumps({path.stem: fingerprint(path) for path in CONFIGS}, indent=1) + "\n")
