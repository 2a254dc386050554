"""Impulses at given times and at roots, against Kepler's problem integrated from impulse to impulse."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import assert_announced, cases, config, loaded, run_text, same_bits, seeds, wide

import rigidsim
from rigidsim.solve.problem import prepare

GRAVITY = 'kind = "central_gravity"\ngravitational_parameter = 1'
SPHERE = "principal_moments = [0.5, 0.5, 0.5]\nmass = 2"
FORMULATIONS = ["quaternion", "euler_angles", "rotation_matrix"]


def event(name: str, **keys: object) -> str:
    said = "".join(
        f"{key} = {value if not isinstance(value, str) else repr(value)}\n" for key, value in keys.items()
    )
    return f'[[events]]\nname = "{name}"\naction = "impulse"\n{said}'


def scene(
    state: np.ndarray, rates: np.ndarray, events: str, time: str = "end = 9\nsamples = 37", **more: str
) -> str:
    place, speed = state[:3].tolist(), state[3:].tolist()
    start = f"position = {place}\nvelocity = {speed}\nangular_velocity = {rates.tolist()}"
    return config(SPHERE, start, GRAVITY, time, more=events, **more)


class Own:
    """The same motion by DOP853: a point, and a sphere that turns by itself."""

    def __init__(self, state: np.ndarray, rates: np.ndarray) -> None:
        self.state, self.turned, self.rates, self.now = state, Rotation.identity(), rates, 0.0

    def to(self, times: np.ndarray, until: float, apsis: bool) -> tuple[np.ndarray, bool]:
        """States at some times, and whether an apocentre ends the way; stays there."""

        def slow(_: float, y: np.ndarray) -> float:
            return float(y[:3] @ y[3:])

        slow.terminal, slow.direction = True, -1  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda _, y: np.r_[y[3:], -y[:3] / np.linalg.norm(y[:3]) ** 3], (self.now, until), self.state,
            method="DOP853", rtol=1e-13, atol=1e-15, dense_output=True, events=[slow] if apsis else None,
        )  # fmt: skip
        end = float(found.t[-1])
        rows = np.array([found.sol(t) for t in times if self.now < t <= end])
        self.turned, self.state = (
            self.turned * Rotation.from_rotvec(self.rates * (end - self.now)),
            found.y[:, -1],
        )
        self.now = end
        return rows, end < until

    def kick(self, axes: str, velocity: np.ndarray, spin: np.ndarray) -> None:
        place, speed = self.state[:3], self.state[3:]
        u, n = (x / np.linalg.norm(x) for x in (place, np.cross(place, speed)))
        basis = {
            "space": np.eye(3),
            "body": self.turned.as_matrix(),
            "rtn": np.array([u, np.cross(n, u), n]).T,
        }
        self.state = np.r_[place, speed + basis[axes] @ velocity]
        self.rates = self.rates + spin


@pytest.mark.parametrize("seed", seeds(3, 60))
def test_random_impulses(seed: int) -> None:
    """At two given times, in any axes, and at each apocentre; and back without the latter."""
    random = np.random.default_rng(seed)
    state = np.r_[1, 0, 0, 0.1, 1.1, 0] + 0.05 * random.normal(size=6)
    rates, own_formulation = random.normal(size=3), FORMULATIONS[seed % 3]
    axes = random.choice(["space", "body", "rtn"], 2).tolist()
    times = np.sort(random.uniform(0.5, 8.5, 2))
    times[0] = np.floor(times[0] * 4) / 4  # at a row, which is before it
    pushes, spin = 0.1 * random.normal(size=(3, 3)), random.normal(size=3)
    text = event(
        "one", time=times[0], axes=axes[0], velocity=pushes[0].tolist(), angular_velocity=spin.tolist()
    )
    text += event(
        "two", time=times[1], axes=axes[1], velocity=pushes[1].tolist(), angular_impulse=spin.tolist()
    )
    far = event(
        "far", expression="x*vx + y*vy + z*vz", direction="down", axes="rtn", velocity=pushes[2].tolist()
    )
    own, rows, apart, coming = Own(state, rates), [state], [], [0, 1]
    every = np.linspace(0, 9, 37)
    while own.now < 9:
        found, apsis = own.to(every, times[coming[0]] if coming else 9.0, apsis=True)
        rows += list(found)
        if apsis:
            apart.append(own.now)
            own.kick("rtn", pushes[2], np.zeros(3))
        elif coming:
            which = coming.pop(0)
            own.kick(axes[which], pushes[which], spin * (1, 2)[which])
    how = f'formulation = "{own_formulation}"'
    data = loaded(run_text(scene(state, rates, text + far, integrator=how)))
    np.testing.assert_allclose(
        np.c_[data.position, data.velocity], np.array(rows), rtol=0, atol=3e-9
    )  # by its interpolant
    np.testing.assert_allclose(data.angular_velocity[-1], own.rates, rtol=0, atol=1e-13)
    np.testing.assert_allclose(data.far_time, apart, rtol=0, atol=3e-9)
    assert data.one_time.values.tolist() == [times[0]]
    there = loaded(run_text(scene(state, rates, text, integrator=how)))
    end = there.isel(time=-1)
    given = f"quaternion = {end.quaternion.values.tolist()}"
    turned = scene(
        np.r_[end.position, end.velocity],
        end.angular_velocity.values,
        text,
        "start = 9\nend = 0\nsamples = 2",
    ).replace("angular_velocity", f"{given}\nangular_velocity", 1)
    back = loaded(run_text(turned)).isel(time=-1)
    np.testing.assert_allclose(np.r_[back.position, back.velocity], state, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.angular_velocity, rates, rtol=0, atol=1e-13)


START = np.array([1, 0, 0, 0.1, 1.1, 0.05]), np.array([0.1, 0.2, 0.7])
PUSHES = event("push", time=2.5, axes="rtn", velocity=[0.01, 0.1, 0.02], angular_velocity=[0, 0.1, 0])
FAR = event("far", expression="x*vx + y*vy + z*vz", direction="down", axes="rtn", velocity=[0, 0.05, 0])
SWITCHED = 'kind = "torque"\ncomponents = ["0.01*step(t - 2)", "0.02*abs(vx)", "0"]'


RESUMED = [(case, x) for case in ("roots", "switched") for x in ("double", "extended", "quadruple")]


@pytest.mark.parametrize("case", cases(RESUMED, RESUMED[:1]))
def test_resumed_has_the_same_bits(case: tuple[str, str], tmp_path: Path) -> None:
    kind, precision = case
    text = scene(*START, PUSHES + FAR) if kind == "roots" else scene(*START, PUSHES)
    text = text if kind == "roots" else text.replace("[[loads]]", f"[[loads]]\n{SWITCHED}\n[[loads]]", 1)
    given = f"integrator.precision='{precision}'"
    whole = run_text(text, given)
    for part in (3, 6):
        steps = f"limits.max_steps={part * whole.summary['cost']['steps'] // 8}"
        run_text(text, given, steps, tmp_path / str(part))
        done = rigidsim.resume(tmp_path / str(part) / "scene", overrides=["limits.max_steps=100000"])
        same_bits(done, whole)
    few = loaded(run_text(text.replace("samples = 37", "samples = 2"), given))
    assert (wide(few, "position")[-1] == wide(loaded(whole), "position")[-1]).all()


def test_derivatives_are_those_of_neighbouring_runs() -> None:
    keys = ["events[1].velocity[1]", "initial.velocity[1]", "events[1].angular_velocity[1]"]
    record = 'record = ["position", "velocity", "quaternion", "angular_velocity"]'
    text = scene(*START, '[[events]]\nname = "seen"\nexpression = "z"\n' + PUSHES, output=record)
    own = loaded(run_text(text, f"output.sensitivity={keys}"))
    for n, (key, value) in enumerate(zip(keys, (0.1, 1.1, 0.1), strict=True)):
        more, less = (loaded(run_text(text, f"{key}={value + x!r}")) for x in (1e-5, -1e-5))
        for name in ("position", "angular_velocity"):
            slope = (more[name] - less[name]).values / 2e-5
            np.testing.assert_allclose(own[f"{name}_sensitivity"][:, n], slope, rtol=0, atol=1e-6)
    assert np.abs(own["position_sensitivity"].sel(parameter=keys[0])[-1]).max() > 1


@pytest.mark.slow
def test_announced_errors_are_those_of_80_bits() -> None:
    announced, true = [], []
    for n in range(8):
        text = scene(START[0] + 0.01 * n, START[1], PUSHES + FAR, "end = 100\nsamples = 11", estimate=True)  # type: ignore[arg-type]
        run = run_text(text, estimate=True)
        better = loaded(run_text(text, "integrator.precision='extended'"))
        announced.append(run.summary["accuracy"]["estimated_position_error"])
        true.append(np.linalg.norm(loaded(run).position - better.position, axis=1).max())
    assert_announced(announced, true)


@pytest.mark.parametrize(
    ("events", "more", "words"),
    [
        (event("a", time=1), {}, "without what changes; add velocity"),
        (event("a", velocity=[1, 0, 0]), {}, "exactly one of time, expression is needed"),
        (
            PUSHES.replace("impulse", "stop", 1),
            {},
            'velocity and angular_velocity and axes with action = "stop"',
        ),
        (
            event("a", time=1, body="moon", velocity=[1, 0, 0]),
            {},
            'body: given "moon"; there are no [[rigid_b',
        ),
        (event("a", time=0, velocity=[1, 0, 0]), {}, "number 1 time: is the start (0.0 s); let it begin"),
        (PUSHES, {"output": "lyapunov = true"}, "an impulse changes velocities at once, where variational"),
        (PUSHES, {"output": 'record = ["tangent_growth"]'}, "at the impulse push velocities change at once"),
        (FAR, {"time": "end = -9\nsamples = 2"}, "can't be found from behind"),
        (PUSHES, {"integrator": 'method = "closed_form"'}, "the impulse push has no closed form"),
        (
            FAR,
            {"output": 'sensitivity = ["initial.velocity"]'},
            "an impulse acts where an expression vanishes",
        ),
        (PUSHES, {"output": 'sensitivity = ["events[0].time"]'}, "names the time of an impulse"),
    ],
)
def test_refusals(events: str, more: dict[str, str], words: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=re.escape(words)):
        run_text(scene(*START, events, **more))


def test_without_a_place_nothing_is_pushed_but_spins_change() -> None:
    push = event("a", time=1, velocity=[1, 0, 0])
    with pytest.raises(rigidsim.ConfigError, match=r"\[body\] has no place"):
        prepare(rigidsim.parse(config(more=push)))
    late = rigidsim.parse(config(more=event("a", time=10, angular_velocity=[1, 0, 0])))
    assert ["not within the run" in str(w) for w in rigidsim.plan(late).warnings] == [True]
    spun = config("principal_moments = [2, 2, 2]", more=event("a", time=1, angular_impulse=[0, 1, 0]))
    data = loaded(run_text(spun))
    np.testing.assert_allclose(data.angular_velocity[[0, -1]], [[0.3, 1, 0.5], [0.3, 1.5, 0.5]], rtol=1e-15)
    assert "energy_drift" not in data
