"""Axes in space about which nothing acts are found by evaluating the loads: none is missed, none is invented.

The truth: torques of all loads together at random attitudes, by numpy, and the axes along which these vanish.
"""

import tomllib
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import matrix
from support import config, run_text, seeds

import rigidsim
from rigidsim.model.loads import Load
from rigidsim.solve.problem import prepare

SCENES = 4  # per seed
DIRECTIONS = [[0, 0, 1], [0, 0, -2], [0, 1, 0], [1, 0, 0], [0, 0.6, 0.8], [0, 0.3, 0.4], [0.5, 0.5, 0.25]]
KINDS = ("uniform_gravity", "magnetic_dipole", "gravity_gradient", "torque", "force")


def drawn(draw: np.random.Generator) -> str:
    loads = []
    for kind in draw.choice(KINDS, draw.integers(1, 4), replace=False):
        towards = list(DIRECTIONS[draw.integers(len(DIRECTIONS))])
        arm = DIRECTIONS[draw.integers(len(DIRECTIONS))]
        keys = {
            "uniform_gravity": f"acceleration = {towards}",
            "magnetic_dipole": f"moment = {arm}\nfield = {towards}",
            "gravity_gradient": f"gravitational_parameter = 1\nposition = {towards}",
            "torque": f'components = {towards}\nframe = "space"',
            "force": f'components = {towards}\nframe = "space"\npoint = {arm}',
        }[kind]
        loads.append(f'kind = "{kind}"\n{keys}')
    body = f"principal_moments = [1, 1.7, 2]\nmass = 1\ncenter_of_mass = {DIRECTIONS[draw.integers(7)]}"
    start = "angular_velocity = [0.3, 0.9, 0.4]\nquaternion = [0.7, 0.4, 0.5, 0.3]"
    return config(body, start, "\n[[loads]]\n".join(loads), "end = 1\nsamples = 2")


def torque(load: dict[str, Any], arm: np.ndarray, r: np.ndarray) -> np.ndarray:
    match load["kind"]:
        case "uniform_gravity":
            return np.cross(r @ arm, load["acceleration"])
        case "magnetic_dipole":
            return np.cross(r @ load["moment"], load["field"])
        case "force":
            return np.cross(r @ load["point"], load["components"])
        case "torque":
            return np.array(load["components"], dtype=float)
    place = np.array(load["position"], dtype=float)
    c = r.T @ place / np.linalg.norm(place)
    return 3 / np.linalg.norm(place) ** 3 * r @ np.cross(c, np.array([1, 1.7, 2]) * c)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_what_is_kept_is_found(seed: int) -> None:
    draw = np.random.default_rng(seed)
    for _ in range(SCENES):
        text = drawn(draw)
        scene = tomllib.loads(text)
        arm = np.array(scene["body"]["center_of_mass"], dtype=float)
        turns = [matrix(q / np.linalg.norm(q)) for q in draw.normal(size=(9, 4))]
        acting = np.array([sum(torque(load, arm, r) for load in scene["loads"]) for r in turns])

        def kept(axis: Any, acting: np.ndarray = acting) -> bool:
            return bool(np.abs(acting @ axis).max() < 1e-12 * np.linalg.norm(axis))

        by_kind = {load["kind"]: load for load in scene["loads"]}
        named = {}
        if "uniform_gravity" in by_kind:
            named["vertical"] = np.array(by_kind["uniform_gravity"]["acceleration"], dtype=float)
        _, sizes, axes = np.linalg.svd(acting)
        fields = [load[key] for load in scene["loads"] for key in ("field", "acceleration") if key in load]
        fields += [by_kind["force"]["components"]] if "force" in by_kind else []
        only = axes[2] if sizes[2] < 1e-12 * sizes[0] < 1e-3 * sizes[1] else None
        if only is not None and not along(only, named.get("vertical")):
            coordinate = np.abs(only).max() > 1 - 1e-12
            if "gravity_gradient" in by_kind:
                named["source"] = only
            elif not coordinate or any(along(only, np.array(f, dtype=float)) for f in fields):
                named["field"] = only
        for name, axis in zip("xyz", np.eye(3), strict=True):
            if not any(along(axis, other) for other in named.values()):
                named[name] = axis
        expected = {f"angular_momentum_{name}" for name, axis in named.items() if kept(axis)}
        found = {x.name for x in prepare(rigidsim.parse(text)).system.invariants}
        others = {"angular_momentum", "angular_momentum_norm", "angular_momentum_axial"}
        assert {x for x in found - others if x.startswith("angular_momentum")} == expected, text


def along(axis: np.ndarray, other: np.ndarray | None) -> bool:
    return other is not None and float(np.linalg.norm(np.cross(axis, other))) < 1e-12 * np.linalg.norm(other)


class Compass(Load):
    """A torque a x R^T f that says nothing of what it conserves."""

    title = "compass"
    reads = frozenset({"attitude"})

    def torque(self, m: Any) -> list[Any]:
        field = m.seen([hy.expression(m.number(m.scene.context.mpf(x))) for x in (1, 2, 2)])
        return [([0, 0, -1], field[1]), ([0, 1, 0], field[2])]


def test_a_load_of_a_user_needs_to_declare_nothing() -> None:
    text = config(
        "principal_moments = [1, 1.7, 2]", "angular_velocity = [0.3, 0.9, 0.4]", "", "end = 20\nsamples = 9"
    )
    run = rigidsim.run(rigidsim.parse(text.replace("[[loads]]\n", "")), loads=[Compass()], out=None)
    assert run.summary["invariants"]["angular_momentum_field"]["largest_drift"] < 1e-13
    kept = run.dataset.angular_momentum.values @ [1, 2, 2] / 3
    np.testing.assert_allclose(np.abs(run.dataset.angular_momentum_field.values), np.abs(kept), rtol=1e-13)
    assert np.ptp(run.dataset.angular_momentum.values[:, 0]) > 0.1


def test_a_pulse_between_the_states_that_are_tried_counts() -> None:
    load = 'kind = "torque"\ncomponents = ["exp(-((t - 1)/0.01)^2)", 0, "exp(-(wx/1e-3)^2)"]\nframe = "space"'
    text = config(
        "principal_moments = [1, 1.7, 2]", "angular_velocity = [0.3, 0.9, 0.4]", load, "end = 2\nsamples = 9"
    )
    found = {name for name in run_text(text).summary["invariants"] if name.startswith("angular_momentum")}
    assert found == {"angular_momentum_y"}
