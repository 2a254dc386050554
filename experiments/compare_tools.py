"""Ten tools by ten scenes, each trajectory judged by `compare`: what does it say of tools as they come?

Method: free, braked and heavy tops, as `compare_conventions` draws them, are integrated by tools with the
settings that they come with, or common ones: SciPy, MuJoCo, REBOUND and diffrax, and by methods by hand, at
rows 0.1 rad apart. An eleventh is SciPy's with one moment 1 % off. Tools that aren't installed stay blank.

Expected: no tool is called another model, the eleventh in no scene anything else; largest errors beside.

Run: python -m experiments.compare_tools [--figure FILE] [--data FILE]      Exit: 1 if a verdict is wrong
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import rigidsim
from experiments.compare_conventions import Model

COLORS = {
    "agrees": "#7fbf7b",
    "integration_error": "#fdc46a",
    "wrong_model": "#d9756c",
    "undecided": "#c9c9c9",
}
_MUJOCO = """<mujoco><option integrator="{integrator}" timestep="{step!r}" gravity="0 0 {gravity!r}">
<flag contact="disable" constraint="disable"/></option><worldbody><body>
<joint type="ball" damping="{damping!r}"/>
<inertial pos="0 0 {lever!r}" mass="1" diaginertia="{a!r} {b!r} {c!r}"/></body></worldbody></mujoco>"""

Rows = np.ndarray
"""Quaternion w x y z and rates in body axes, (rows, 7)."""


def scenes() -> list[Model]:
    """Four free bodies, three braked ones, and three heavy tops whose mass of 1 kg their moments allow."""
    found: list[Model] = []
    for kind, count in (("free", 4), ("braked", 3), ("top", 3)):
        drawn = (Model.drawn(random.Random(f"{kind} {n}")) for n in range(1000))
        of_kind = (one for one in drawn if one.kind == kind)
        for model in (next(of_kind) for _ in range(count)):
            heavy = {"moments": np.array([3.0, 3.4, 1.2])} if kind == "top" else {}
            found.append(replace(model, end=12.0 / float(np.linalg.norm(model.rates)), **heavy))
    return found


def by_scipy(method: str, accuracy: float) -> Callable[[Model, np.ndarray], Rows]:
    """SciPy's solve_ivp, or a method by hand with a step times rate."""
    return lambda model, times: model.rows(method, accuracy, times)


def by_mujoco(integrator: str, step: float) -> Callable[[Model, np.ndarray], Rows]:
    """MuJoCo, a body on a ball joint; rows are the steps nearest to the times, which they replace."""

    def rows(model: Model, times: np.ndarray) -> Rows:
        import mujoco

        lever = 1.0 if model.kind == "top" else 0.0
        a, b, c = model.moments.tolist()
        text = _MUJOCO.format(
            integrator=integrator, step=step, gravity=-model.load if lever else 0.0, lever=lever,
            damping=model.load if model.kind == "braked" else 0.0, a=a - lever, b=b - lever, c=c,
        )  # fmt: skip
        engine = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(engine)
        data.qpos[:], data.qvel[:] = model.quaternion, model.rates
        found, done = [], 0
        for n, count in enumerate(np.round(times / step).astype(int)):
            mujoco.mj_step(engine, data, nstep=int(count - done)) if count > done else None
            done, times[n] = int(count), count * step
            found.append([*data.qpos, *data.qvel])
        return np.array(found)

    return rows


def by_rebound(model: Model, times: np.ndarray) -> Rows:
    """REBOUND's Gragg-Bulirsch-Stoer with its own tolerance."""
    import rebound

    simulation = rebound.Simulation()
    simulation.integrator = "bs"
    ode = simulation.create_ode(length=7, needs_nbody=False)

    def derivatives(_: Any, slope: Any, state: Any, time: float) -> None:
        for n, value in enumerate(model.slopes(time, np.array([state[n] for n in range(7)]))):
            slope[n] = value

    ode.derivatives = derivatives
    for n, value in enumerate([*model.quaternion, *model.rates]):
        ode.y[n] = value
    found = []
    for time in times:
        if time > 0:
            simulation.integrate(time)
        found.append([ode.y[n] for n in range(7)])
    return np.array(found)


def by_diffrax(model: Model, times: np.ndarray) -> Rows:
    """diffrax's Tsit5 in double precision at 1e-6."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    moments = jnp.array(model.moments)

    def slopes(_: Any, y: Any, __: Any) -> Any:
        q, w = y[:4], y[4:]
        torque = -model.load * w if model.kind == "braked" else jnp.zeros(3)
        if model.kind == "top":
            up = jnp.stack(
                [
                    2 * (q[1] * q[3] - q[0] * q[2]),
                    2 * (q[2] * q[3] + q[0] * q[1]),
                    1 - 2 * (q[1] ** 2 + q[2] ** 2),
                ]
            )
            torque = -model.load * jnp.cross(jnp.array([0, 0, 1.0]), up / (q @ q))
        turn = jnp.concatenate([jnp.array([-q[1:] @ w]), q[0] * w + jnp.cross(q[1:], w)]) / 2
        return jnp.concatenate([turn, (torque - jnp.cross(w, moments * w)) / moments])

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(slopes), diffrax.Tsit5(), 0.0, float(times[-1]), None,
        jnp.array([*model.quaternion, *model.rates]), saveat=diffrax.SaveAt(ts=jnp.array(times)),
        stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-9), max_steps=100_000,
    )  # fmt: skip
    return np.asarray(solution.ys)


def another_moment(model: Model, times: np.ndarray) -> Rows:
    """SciPy's DOP853 with the third moment 1 % off."""
    return replace(model, moments=model.moments * np.array([1, 1, 1.01])).rows("DOP853", 1e-12, times)


TOOLS: dict[str, Callable[[Model, np.ndarray], Rows]] = {
    "SciPy DOP853, 1e-12": by_scipy("DOP853", 1e-12),
    "SciPy RK45, as it comes": by_scipy("RK45", 1e-3),
    "SciPy LSODA, 1e-8": by_scipy("LSODA", 1e-8),
    "SciPy Radau, 1e-6": by_scipy("Radau", 1e-6),
    "RK4 by hand, 0.05 rad": by_scipy("rk4", 0.05),
    "Heun by hand, 0.01 rad": by_scipy("heun", 0.01),
    "MuJoCo, as it comes": by_mujoco("Euler", 0.002),
    "MuJoCo RK4, 10 ms": by_mujoco("RK4", 0.01),
    "REBOUND BS, as it comes": by_rebound,
    "diffrax Tsit5, 1e-6": by_diffrax,
    "a moment 1 % off": another_moment,
}
WRONG = "a moment 1 % off"


def judge(tool: str, model: Model) -> tuple[str, float, float | None] | None:
    """Verdict, largest error (rad) and share of what rates don't explain; None where a tool is missing."""
    count = 1 + round(model.end * float(np.linalg.norm(model.rates)) / 0.1)
    times = np.linspace(0, model.end, count)
    try:
        rows = TOOLS[tool](model, times)
    except ImportError:
        return None
    config = replace(model, end=float(times[-1])).config
    found = rigidsim.compare(rigidsim.parse(config), {"t": times, "q": rows[:, :4], "w": rows[:, 4:]})
    local = found.local_defects
    return found.verdict, found.attitude_error.largest, None if local is None else local.unexplained


def draw(judged: dict[str, list[Any]], names: Sequence[str], path: Path) -> None:
    """The table of verdicts, with the largest error in each place."""
    from matplotlib import rc_context
    from matplotlib.patches import Patch, Rectangle

    from rigidsim.look.figures.style import STYLE, ShownFigure

    with rc_context(STYLE):  # type: ignore[arg-type]
        figure = ShownFigure(figsize=(11, 6.2), layout="constrained")
        axes = figure.subplots()
        for row, found in enumerate(judged.values()):
            for column, one in enumerate(found):
                color = "white" if one is None else COLORS[one[0]]
                axes.add_patch(Rectangle((column, row), 0.96, 0.92, color=color))
                text = "not installed" if one is None else f"{one[1]:.0e}"
                axes.text(column + 0.48, row + 0.46, text, ha="center", va="center", fontsize=9)
        axes.set_xlim(0, len(names))
        axes.set_ylim(len(judged), 0)
        axes.set_xticks(np.arange(len(names)) + 0.48, names)
        axes.set_yticks(np.arange(len(judged)) + 0.46, list(judged))
        axes.tick_params(length=0)
        axes.grid(visible=False)
        axes.set_frame_on(False)
        axes.xaxis.tick_top()
        handles = [Patch(color=color, label=name.replace("_", " ")) for name, color in COLORS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.suptitle("Largest attitude error over two turns, rad, and the verdict of rigidsim compare")
        figure.savefig(path, dpi=130)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 1 if a verdict is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--data", type=Path)
    given = parser.parse_args(arguments)
    models, failures = scenes(), 0
    counts: dict[str, int] = {}
    names = []
    for model in models:
        counts[model.kind] = counts.get(model.kind, 0) + 1
        names.append(f"{model.kind} {counts[model.kind]}")
    judged: dict[str, list[Any]] = {}
    for tool in TOOLS:
        judged[tool] = [judge(tool, model) for model in models]
        for name, one in zip(names, judged[tool], strict=True):
            if one is not None and (one[0] == "wrong_model") != (tool == WRONG):
                failures += 1
                print(f"{tool}, {name}: {one}")
        print(tool, *("-" if one is None else f"{one[0]} {one[1]:.1e}" for one in judged[tool]), sep=", ")
    if given.data is not None:
        given.data.write_text(json.dumps({"scenes": names, "judged": judged}, indent=1) + "\n")
    if given.figure is not None:
        draw(judged, names, given.figure)
    print(f"{failures} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
