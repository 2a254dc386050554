"""Do two versions of the code give the same bits, and does one resume what the other began?

Scenes: every ready config over some radians, random scenes of the coverage campaign (all formulations, three
precisions, held runs, loose tolerances, switching, averages), and closed forms, events and 128 bits besides.
Each is run by both versions, then begun by the other one, stopped at a random step and resumed by this one.
What counts is every bit of every variable along time.

Run: python -m experiments.same_bits --checkout DIR [--count N] [--seed S]      exit code 1 if any bit differs
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.common import Command
from experiments.coverage.families import coverage_scene

ROOT = Path(__file__).parents[1]
_TURNS = 5.0  # radians of a ready scene
_FREE = "[body]\nprincipal_moments = [1, 2, 2.5]\n[initial]\nangular_velocity = [0.3, 1, 0.5]\n"
_TOP = (
    '[body]\nprincipal_moments = [1, 1, "0.3 kg m^2"]\nmass = 1\ncenter_of_mass = [0, 0, 0.2]\n[initial]\n'
    'angular_velocity = [0.1, 0.2, 9]\neuler_angles = [0.2, 0.6, 0.7]\n[[loads]]\nkind = "uniform_gravity"\n'
)
_DRIVEN = '[[loads]]\nkind = "torque"\ncomponents = ["0.1*sin(t)", "-0.2*sign(wy)", "0.05*wx"]\n'
_TIME = "[time]\nend = 20\nsamples = 41\n"
_EVENT = '[[events]]\nname = "crossing"\nexpression = "wy"\n'
_OTHERS = {
    f"{name}, {setting}": f'name = "scene"\n{body}{_TIME}{more}[integrator]\n{setting}\n'
    for name, body, more, settings in (
        ("free body", _FREE, "", ('method = "closed_form"', 'precision = "quadruple"', "precision = 50")),
        ("top", _TOP, "", ('method = "closed_form"', 'precision = "quadruple"', "hold_invariants = true")),
        ("events", _FREE, _EVENT, ('formulation = "euler_angles"', 'precision = "extended"')),
        ("events, switching", _FREE + _DRIVEN, _EVENT, ('precision = "double"', 'precision = "extended"')),
    )
    for setting in settings
}

_WORKER = """
import hashlib, json, sys
import numpy as np
import rigidsim
from rigidsim.scene.scene import build_scene

def config(job):
    if "path" not in job:
        return rigidsim.parse(job["text"], overrides=job["overrides"])
    scene = build_scene(rigidsim.load(job["path"]))
    start, last = float(scene.start), float(scene.samples.last)
    rate = max(float(abs(x)) for x in scene.angular_velocity)
    end = min(last, start + float(f"{job['turns'] / rate:.3g}")) if rate else last
    spacing = "samples=9" if scene.config.time.every is None else f"every={(end - start) / 8!r}"
    return rigidsim.load(job["path"], overrides=[f"time.end={end!r}", "time." + spacing, *job["overrides"]])

for line in sys.stdin:
    job, answer = json.loads(line), {}
    try:
        if job["resumed"]:
            folder = next(p for p in __import__("pathlib").Path(job["out"]).iterdir() if p.is_dir())
            run = rigidsim.resume(folder, overrides={"limits.max_steps": None}, progress=False)
        else:
            run = rigidsim.run(config(job), out=job["out"], progress=False)
        found = hashlib.sha256()
        for name, values in sorted(run.dataset.variables.items()):
            if values.dims[:1] == ("time",) and values.dtype.kind in "fi":
                found.update(name.encode() + np.ascontiguousarray(values.values).tobytes())
        answer = {"status": run.status, "bits": found.hexdigest(), "steps": run.summary["cost"]["steps"]}
    except rigidsim.RigidsimError as error:
        answer = {"status": "refused", "bits": "", "steps": 0, "why": str(error)}
    print("answer " + json.dumps(answer), flush=True)
"""


class Version:
    """A process that runs scenes by one version of the code."""

    def __init__(self, checkout: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-c", _WORKER]
        self._process = subprocess.Popen(command, cwd=checkout, env=environment, text=True, **pipes)

    def run(self, scene: Scene, out: Path | None, *, most: int | None = None, resumed: bool = False) -> Any:
        """The answer of the process.

        Args:
            out: folder of the run's folder; None for a run in memory.
            most: steps at which it stops.
            resumed: whether to go on with the run in that folder.
        """
        overrides = ["output.timeline=false", "output.estimate=false"]
        if most is not None:
            overrides.append(f"limits.max_steps={most}")
        job = scene.job | {"overrides": overrides, "resumed": resumed, "out": out and str(out)}
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith("answer "):
                return json.loads(line[7:])
        raise RuntimeError(f"{scene.name}: the process ended with code {self._process.wait()}")


@dataclass(frozen=True)
class Scene:
    """A scene to be run, as its kind in the table, its name, and what the processes are told."""

    kind: str
    name: str
    job: dict[str, Any]


def scenes(count: int, seed: int) -> Iterator[Scene]:
    """All scenes, so many of them random."""
    for path in sorted((ROOT / "configs").glob("*.toml")):
        yield Scene("ready", path.stem, {"path": str(path), "turns": _TURNS})
    for name, text in _OTHERS.items():
        yield Scene(name.split(",")[0], name, {"text": text})
    for number in range(count):
        scene = coverage_scene(number, seed=seed)
        yield Scene(scene.family, f"{scene.family} {number}", {"text": scene.text})


def compared(scene: Scene, this: Version, other: Version, stop: random.Random) -> tuple[str, str]:
    """What came of the runs in one go, and of the one that was resumed, in a word each."""
    mine, theirs = this.run(scene, None), other.run(scene, None)
    if theirs["status"] == "refused" != mine["status"]:
        return "new", ""
    if mine["bits"] != theirs["bits"] or mine["status"] != theirs["status"]:
        return f"differs: {mine['status']} and {theirs['status']}", ""
    if mine["steps"] < 2:
        return "refused" if mine["status"] == "refused" else "same", ""
    with tempfile.TemporaryDirectory() as folder:
        begun = other.run(scene, Path(folder), most=stop.randrange(1, mine["steps"]))
        if "max_steps" not in begun["status"]:
            return "same", ""
        whole = this.run(scene, Path(folder), resumed=True)
    if whole["status"] == "refused":
        return "same", f"refused: {whole['why']}"
    return "same", "same" if whole["bits"] == mine["bits"] else "differs"


@Command
def campaign(checkout: str = "", count: int = 138, seed: int = 26) -> int:
    """Compare, and print a table.

    Args:
        checkout: folder of the other version's code.
        count: of random scenes.
    """
    this, other, stop = Version(ROOT), Version(Path(checkout).resolve()), random.Random(seed)
    runs: dict[str, Counter[str]] = {}
    wrong = 0
    for scene in scenes(count, seed):
        whole, resumed = compared(scene, this, other, stop)
        counted = runs.setdefault(scene.kind, Counter())
        counted[whole.split(":")[0]] += 1
        counted[f"resumed {resumed.split(':')[0]}"] += bool(resumed)
        if whole not in ("same", "refused", "new") or resumed not in ("", "same"):
            wrong += 1
            print(f"{scene.name}: {whole}; resumed: {resumed}", flush=True)
    columns = ("same", "differs", "refused", "new", "resumed same", "resumed differs", "resumed refused")
    print(f"| scenes | {' | '.join(columns)} |\n|{' --- |' * (len(columns) + 1)}")
    for kind, counted in (*runs.items(), ("all", sum(runs.values(), Counter()))):
        print(f"| {kind} | {' | '.join(str(counted[column]) for column in columns)} |")
    return int(wrong > 0)
