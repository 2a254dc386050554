"""What several tests share: running texts, exact values of datasets, angles between attitudes, bounds."""

import fcntl
import hashlib
import math
import os
import random
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.accuracy.comparison import (
    Trial,
    angles_between,  # noqa: F401  (for the tests)
    try_setting,
)
from rigidsim.accuracy.setting import Setting
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.session.session import Tuning
from rigidsim.solve import compiled
from rigidsim.solve.problem import prepare
from rigidsim.solve.sampler import Pacing
from rigidsim.solve.status import Status
from rigidsim.store.segments import SegmentLimits

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
# a look at the guards after every few steps, so that they cut short runs where they say
IMPATIENT = Tuning(Pacing(chunk_seconds=0.0, patience=0.0))
# and a segment for each
EAGER = Tuning(IMPATIENT.pacing, SegmentLimits(seconds=0.0))
# for a process of its own, before it calls the command line
OFTEN = """
import functools, rigidsim.workflows.run as workflow
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store.segments import SegmentLimits
tuning = Tuning(Pacing(chunk_seconds=0.005, patience=0.0), SegmentLimits(seconds=0.0))
workflow.run = functools.partial(workflow.run, tuning=tuning)
"""
EPSILON = {"single": 2.0**-23, "double": 2.0**-52, "extended": 2.0**-63, "quadruple": 2.0**-112}


def run_text(
    text: str,
    *given: str | Path,
    out: Path | None = None,
    timeline: bool = False,
    estimate: bool = False,
    tuning: Tuning | None = None,
) -> rigidsim.Run:
    """Run a config text, without drawing, and without estimating its errors, unless asked for; in memory
    unless a folder is given, since to open a dataset takes longer than most runs.

    Args:
        given: overrides; a folder among them is ``out``.
        out: where it is saved.
    """
    overrides = [x for x in given if isinstance(x, str)]
    out = next((x for x in given if isinstance(x, Path)), out)
    asked = {"timeline": timeline, "estimate": estimate}
    settings = [*(f"output.{key}={str(value).lower()}" for key, value in asked.items()), *overrides]
    return rigidsim.run(
        rigidsim.parse(text, overrides=settings), out=out, force=out is not None, tuning=tuning
    )


run_estimated = partial(run_text, estimate=True)


def shared_run(folder: Path, scene: str | Path, *overrides: str) -> rigidsim.SavedRun:
    """The run of a ready scene, by its path or name, without timeline; made by the first who asks for it in a
    folder that several processes share.
    """
    path = scene if isinstance(scene, Path) else next(path for path in CONFIGS if path.stem == scene)
    key = repr((path.stem, overrides, hy.taylor_adaptive.__name__))  # another name in unoptimised code
    place = folder / hashlib.sha256(key.encode()).hexdigest()[:16]
    place.mkdir(parents=True, exist_ok=True)
    with (place / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (place / "done").exists():
            experiment = rigidsim.load(path, overrides=["output.timeline=false", *overrides])
            rigidsim.run(experiment, out=place / "runs", force=True)
            (place / "done").touch()
        [made] = (place / "runs").iterdir()
    return rigidsim.open_run(made)


def tried(text: str, given: str | int = "double", formulation: str = "quaternion", *overrides: str) -> Trial:
    """A config text integrated in memory, in compact code: attitudes and drifts alone, nothing written."""
    setting = Setting(given, formulation=formulation)
    trial = try_setting(rigidsim.parse(text, overrides=overrides), setting, compact=True)
    assert trial.status is Status.FINISHED
    return trial


def wide(dataset: xarray.Dataset, name: str) -> np.ndarray:
    """A variable with its residuals added, as 80-bit numbers (exact for extended precision)."""
    first, *residuals = (dataset[part].values for part in parts_in(dataset, name))
    return sum(residuals, first.astype(np.longdouble))


def angle_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Angle (rad) of the rotation between attitudes p and q, shape (n, 4); accurate for tiny angles."""
    p = p / np.sqrt((p * p).sum(axis=1))[:, None]
    q = q / np.sqrt((q * q).sum(axis=1))[:, None]
    chord = np.minimum(np.sqrt(((p - q) ** 2).sum(axis=1)), np.sqrt(((p + q) ** 2).sum(axis=1)))
    return (4 * np.arcsin(np.minimum(chord / 2, 1))).astype(float)


def matrices(quaternions: Any) -> np.ndarray:
    """Rotation matrices (..., 3, 3), body to space, of quaternions (..., 4) of any length."""
    q = np.asarray(quaternions)
    w, x, y, z = np.moveaxis(q / np.sqrt((q * q).sum(axis=-1, keepdims=True)), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def law(epsilon: float, steps: int, rate: float, duration: float) -> float:
    """The round-off law of attitude errors (Brouwer 1937): (eps / 2) sqrt(steps) |w| t / sqrt 3."""
    return epsilon / 2 * math.sqrt(steps) * rate * duration / math.sqrt(3)


def amplification(experiment: rigidsim.Experiment, points: int = 120) -> float:
    """How much an error made at any time can have grown at any later one: the largest spectral norm of
    the state transition matrix between two times, from the variational equations.

    For a stable motion it grows linearly with time (a change of frequency becomes one of phase), which the
    round-off law contains; where the motion is unstable it grows exponentially as long as the body stays
    near its unstable axis.
    """
    prepared = prepare(experiment)
    system = prepared.system
    variational = hy.var_ode_sys(system.equations, hy.var_args.vars)
    count = len(system.states)
    start = np.concatenate([[float(x) for x in system.initial], np.eye(count).ravel()])
    integrator = hy.taylor_adaptive(list(variational.sys), start, compact_mode=True, time=0.0)
    end = float(prepared.clock.at(prepared.clock.count - 1)) - float(prepared.clock.start)
    states = integrator.propagate_grid(np.linspace(0.0, end, points))[-1]
    matrices = states[:, count:].reshape(points, count, count)
    largest = 1.0
    for i in range(points):
        inverse = np.linalg.pinv(matrices[i])
        norms = np.linalg.norm(matrices[i:] @ inverse, ord=2, axis=(1, 2))
        largest = max(largest, float(norms.max()))
    return largest


@contextmanager
def unoptimised_code() -> Iterator[None]:
    """What heyoka compiles isn't optimised, which takes a tenth of the time and rounds otherwise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hy, "taylor_adaptive", _unoptimised(hy.taylor_adaptive, most=60))
        patch.setattr(hy, "cfunc", _unoptimised(hy.cfunc, most=2000))
        patch.setattr(compiled, "FUNCTIONS", _FUNCTIONS)
        patch.setattr(compiled, "ENGINES", _ENGINES)
        yield


_FUNCTIONS, _ENGINES = compiled.Kept[Any](32), compiled.Kept[Any](8)


def _unoptimised(make: Callable[..., Any], most: int) -> Callable[..., Any]:
    """Unrolled in machine numbers of at most so many operations, else compact: what is quicker to have.

    Measured, compilation and 1000 steps, s: a top in double precision 0.05 + 0.01 unrolled, 0.02 + 0.03
    compact, 0.09 + 0.02 compact and optimised; with its 49 variations 0.9 + 0.1, 0.07 + 0.25, and 0.15 + 0.05
    at the first level of optimisation, which is what such long systems get.
    """

    def made(expressions: Any, *args: Any, **options: Any) -> Any:
        right = [e[1] if isinstance(e, tuple) else e for e in getattr(expressions, "sys", expressions)]
        machine = options.get("fp_type", float) in (float, np.float32)
        small = machine and sum(map(len, right)) <= most
        options["opt_level"] = int(make.__name__ == "taylor_adaptive" and len(right) > 20)
        return make(expressions, *args, **{**options, "compact_mode": not small})

    return made


campaigns_asked = True
"""Whether ``pytest -m`` may select campaigns, which ``conftest`` finds out before tests are collected."""


def first_seed() -> int:
    """First of the day's random seeds; the environment variable ``RIGIDSIM_SEED`` gives another."""
    return int(os.environ.get("RIGIDSIM_SEED", f"{datetime.now(UTC):%y%m%d}000"))


def cases(every: Iterable[Any], usual: Collection[Any], daily: int = 1) -> list[Any]:
    """Parameters of which each suite tries the usual ones. ``daily`` of the others, drawn by the day, are
    long tests, and the rest is run by hand (``pytest -m campaign``).
    """
    every = list(every)
    others = [case for case in every if case not in usual]
    assert all(case in every for case in usual), "no such case"
    drawn = random.Random(first_seed()).sample(range(len(others)), min(daily, len(others)))
    marks = [pytest.mark.slow if k in drawn else pytest.mark.campaign for k in range(len(others))]
    marked = iter([pytest.param(case, marks=mark) for case, mark in zip(others, marks, strict=True)])
    return [case if case in usual else next(marked) for case in every]


def seeds(few: int, many: int) -> list[Any]:
    """Seeds of random relatives, which change by the day: the few first in each suite, the others by hand
    (``pytest -m campaign``). The name of a failing test shows its seed.
    """
    first = first_seed()
    every = [pytest.param(seed, id=f"seed{seed}") for seed in range(first, first + few)]
    # thousands take seconds to collect; a test without any would be a skipped one
    rest = range(first + few, first + (many if campaigns_asked else max(few, 1)))
    return every + [pytest.param(seed, id=f"seed{seed}", marks=pytest.mark.campaign) for seed in rest]


def assert_announced(announced: Sequence[float], true: Sequence[float], at_most: float = 10) -> None:
    """Errors announced for at least five motions: none too small by more than 3 times, and half of them at
    most so many times too large. The rounding of a single motion may cancel to any small error.
    """
    ratios = np.array(announced) / np.array(true)
    assert len(ratios) >= 5
    assert ratios.min() >= 1 / 3
    assert np.median(ratios) <= at_most


def config(
    body: str = "principal_moments = [1, 2, 2.5]",
    initial: str = "angular_velocity = [0.3, 1.0, 0.5]\neuler_angles = [0.2, 1.1, 0.7]",
    loads: str | Sequence[str] = (),
    time: str = "end = 3\nsamples = 49",
    integrator: str = "",
    output: str = "",
    more: str = "",
    *,
    name: str = "scene",
    estimate: bool = False,
) -> str:
    """The text of a config, without a timeline; by default of an asymmetric free body.

    Args:
        body: the lines of ``[body]``; ``initial``, ``time``, ``integrator`` and ``output`` likewise.
        loads: of one load, or of each.
        more: further tables as they stand.
        estimate: whether its errors are estimated, which is the larger part of short runs.
    """
    if "estimate" not in output + more:
        output = f"estimate = {str(estimate).lower()}\n{output}"
    tables = "".join(
        f"[[loads]]\n{load}\n" for load in ([loads] if isinstance(loads, str) else loads) if load
    )
    return (
        f'name = "{name}"\n[body]\n{body}\n[initial]\n{initial}\n{tables}[time]\n{time}\n'
        f"[integrator]\n{integrator}\n[output]\ntimeline = false\n{output}\n{more}\n"
    )


def loaded(run: rigidsim.Run) -> xarray.Dataset:
    """Its dataset, read into memory and closed."""
    with run.dataset as dataset:
        return dataset.load()


def same_bits(one: xarray.Dataset | rigidsim.Run, other: xarray.Dataset | rigidsim.Run) -> None:
    """Two datasets have the same variables and coordinates, with the same bits: -0.0 isn't 0.0, and a nan is
    itself.
    """
    one, other = (given if isinstance(given, xarray.Dataset) else loaded(given) for given in (one, other))
    assert sorted(map(str, one.variables)) == sorted(map(str, other.variables))
    for name, variable in one.variables.items():
        assert variable.dims == other[name].dims, name
        a, b = variable.values, other[name].values
        assert (a.dtype, a.shape) == (b.dtype, b.shape), name
        different = np.argwhere(bits(a) != bits(b))
        if len(different):
            first = tuple(map(int, different[0]))
            shown = f"{a[first]!r} and {b[first]!r}"
            raise AssertionError(f"{name}{list(first)}: {shown}, the first of {len(different)} differences")


def bits(values: Any) -> np.ndarray:
    """float64 numbers and dates as whole ones with the same bits; others as they are."""
    found = np.asarray(values)
    return (
        np.ascontiguousarray(found).view(np.int64).reshape(found.shape)
        if found.dtype == np.float64 or found.dtype.kind == "M"
        else found
    )
