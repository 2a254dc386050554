"""Equations that read full turns of angles: motions, spectra, indicators, sweeps, fits, announced errors.

The truth is DOP853 on rates, quaternion and the first and last angle of zxz as a state each, which needs no
turns; tangents are complex steps through the same equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import angle_between, config, run_text, seeds, unoptimised_code

import rigidsim
from rigidsim.errors import ConfigError
from rigidsim.solve.problem import prepare

TEXT = config(
    "principal_moments = {moments}",
    "angular_velocity = {rates}\neuler_angles = {angles}\n{more}",
    'kind = "torque"\ncomponents = [{torque}]',
    "end = {end}\nsamples = {samples}",
    output='record = ["angular_velocity", "quaternion"{record}]\nlyapunov = {lyapunov}',
)


@dataclass
class Drawn:
    """A random scene whose torque reads turns."""

    moments: np.ndarray
    rates: np.ndarray
    angles: np.ndarray
    torque: list[str]

    @classmethod
    def of(cls, seed: int, spin: float = 1.0) -> Drawn:
        draw = np.random.default_rng(seed)
        a, b = draw.uniform(1, 2, 2)
        moments = np.array([a, b, draw.uniform(max(a, b), a + b)])
        torque = [cls.component(draw) for _ in range(3)]
        return cls(moments, spin * draw.uniform(0.3, 1, 3), draw.uniform([-3, 0.6, -3], [3, 2.5, 3]), torque)

    @staticmethod
    def component(draw: np.random.Generator) -> str:
        angle, size, width = draw.choice(["phi", "psi"]), draw.uniform(0.01, 0.1), draw.uniform(3, 20)
        form = draw.choice(["-{s}*{a}/10", "{s}*tanh({a}/{w})", "{s}*sin({a}/3)", "{s}*atan({a}/{w})", "0.0"])
        return str(form.format(s=size, a=angle, w=width))

    def text(
        self, end: float, samples: int = 5, more: str = "", record: str = "", *, lyapunov: bool = False
    ) -> str:
        numbers = {name: getattr(self, name).tolist() for name in ("moments", "rates", "angles")}
        torque = ", ".join(f'"{x}"' for x in self.torque)
        return TEXT.format(
            **numbers, torque=torque, end=end, samples=samples, more=more, record=record,
            lyapunov=str(lyapunov).lower(),
        )  # fmt: skip

    @cached_property
    def _laws(self) -> list[Callable[..., np.ndarray]]:
        known = {"tanh": np.tanh, "sin": np.sin, "atan": np.arctan}
        return [eval(f"lambda phi, psi: {x} + 0 * phi", known) for x in self.torque]

    @property
    def start(self) -> np.ndarray:
        """Rates, quaternion, phi and psi."""
        phi, theta, psi = self.angles
        c, s = math.cos(theta / 2), math.sin(theta / 2)
        plus, minus = (phi + psi) / 2, (phi - psi) / 2
        q = [c * math.cos(plus), s * math.cos(minus), s * math.sin(minus), c * math.sin(plus)]
        return np.array([*self.rates, *q, phi, psi])

    def field(self, y: np.ndarray) -> np.ndarray:
        w, (a, b, c, d) = y[:3], y[3:7]
        torque = [f(y[7], y[8]) for f in self._laws]
        x, y_, z = w
        i, j, k = self.moments
        spin = [
            (y_ * z * (j - k) + torque[0]) / i,
            (z * x * (k - i) + torque[1]) / j,
            (x * y_ * (i - j) + torque[2]) / k,
        ]
        q = [-b * x - c * y_ - d * z, a * x + c * z - d * y_, a * y_ - b * z + d * x, a * z + b * y_ - c * x]
        size = a * a + b * b + c * c + d * d
        last = [2 * (b * d - a * c) / size, 2 * (c * d + a * b) / size, 2 * (a * a + d * d) / size - 1]
        phi = (x * last[0] + y_ * last[1]) / (last[0] ** 2 + last[1] ** 2)
        return np.array([*spin, *(0.5 * np.array(q)), phi, z - phi * last[2]])

    def motion(self, times: np.ndarray) -> np.ndarray:
        found = solve_ivp(
            lambda t, y: self.field(y), (0, times[-1]), self.start, "DOP853", times, rtol=1e-13, atol=1e-13
        )
        return np.asarray(found.y.T)

    def tangents(self, end: float) -> np.ndarray:
        """Derivatives (7, 7) of rates and quaternion at the end by those at the start."""
        step = 1e-30j
        a, b, c, d = self.start[3:7, None] + step * np.eye(4)
        phi = (b * d + a * c) / (a * b - c * d)  # tangents of the angles, from the columns of the matrix
        psi = (b * d - a * c) / (c * d + a * b)
        begun = np.eye(9, 7)
        begun[7:, 3:] = [x.imag / abs(step) / (1 + x.real**2) for x in (phi, psi)]

        def rates(t: float, both: np.ndarray) -> np.ndarray:
            y, tangents = both[:9], both[9:].reshape(9, 7)
            along = self.field(y[:, None] + step * tangents).imag / abs(step)
            return np.concatenate([self.field(y), along.ravel()])

        both = np.concatenate([self.start, begun.ravel()])
        found = solve_ivp(rates, (0, end), both, "DOP853", rtol=1e-10, atol=1e-10)
        return np.asarray(found.y[9:, -1].reshape(9, 7)[:7])


def checked(run: rigidsim.Run, drawn: Drawn, bound: float) -> None:
    dataset = run.dataset
    truth = drawn.motion(dataset.time.values)
    assert run.summary["status"] == "finished"
    assert np.abs(dataset.angular_velocity.values - truth[:, :3]).max() < bound
    assert np.abs(truth[:, 7:] - truth[0, 7:]).max() > 2 * math.pi  # they turn


@pytest.fixture(autouse=True)
def _quickly_compiled() -> Iterator[None]:
    with unoptimised_code():
        yield


@pytest.mark.parametrize("seed", seeds(1, 60))
@pytest.mark.slow
@pytest.mark.unoptimised
def test_spectra(seed: int) -> None:
    end, drawn = 20.0, Drawn.of(seed)
    text = drawn.text(end, lyapunov=True)
    run = run_text(text)
    checked(run, drawn, 1e-9)
    # of states in units of powers of two
    units = np.ldexp(1.0, np.array(prepare(rigidsim.parse(text)).system.state_exponents)[:7])
    scaled = drawn.tangents(end) * units / units[:, None]
    exponents = np.log(np.abs(np.diag(np.linalg.qr(scaled)[1]))) / end
    found = run.summary["lyapunov"]["exponents"]
    assert np.abs(np.sort(exponents)[::-1] - found).max() < 1e-7


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_motions_and_announced_errors(seed: int) -> None:
    """In all precisions, whose steps may exceed half a turn; half of the bodies spin about an axis."""
    draw = np.random.default_rng(seed)
    drawn = Drawn.of(seed, spin=draw.uniform(1, 8))
    if draw.random() < 0.5:
        drawn.rates[:2], drawn.torque[:2] = 0, ["0.0", "0.0"]
    precision = draw.choice(["double", "extended", "quadruple"])
    run = run_text(drawn.text(10.0), f'integrator.precision="{precision}"')
    checked(run, drawn, 1e-8)
    loose = run_text(drawn.text(10.0), "integrator.tolerance=1e-8", estimate=True)
    quaternions = (x.dataset.quaternion.values for x in (run, loose))
    announced = loose.summary["accuracy"]["estimated_attitude_error"]
    assert angle_between(*quaternions)[-1] < 10 * announced < 1e-3


@pytest.mark.parametrize("seed", seeds(0, 50))
def test_members_and_growth(seed: int, tmp_path: Path) -> None:
    """Members run one by one; and a tangent vector under an orbit, as without a term that does nothing."""
    drawn = Drawn.of(seed)
    sweep = '\n[sweep]\nkeep = ["final"]\naxes."initial.angular_velocity[2]" = {values = [0.5, 1.5]}\n'
    found = rigidsim.sweep(rigidsim.parse(drawn.text(15.0) + sweep), out=tmp_path).dataset
    for member, rate in enumerate((0.5, 1.5)):
        drawn.rates[2] = rate
        truth = drawn.motion(np.array([0.0, 15.0]))[-1, :3]
        assert np.abs(found.angular_velocity_final.values[member] - truth).max() < 1e-9
    orbit = "[[loads]]\nkind = 'gravity_gradient'\ngravitational_parameter = 0.3\n"
    orbit += "orbit = {semi_major_axis = 1, eccentricity = 0.2}"
    growths = []
    for beside in ("", " + 1e-13*tanh(phi/100)"):
        drawn.torque = [f"0.1*sin(psi){beside}", "0.0", "0.0"]
        run = run_text(drawn.text(10.0, more=orbit, record=', "tangent_growth"'))
        growths.append(run.dataset.tangent_growth)
    assert np.abs(growths[0].values - growths[1].values).max() < 1e-6


@pytest.mark.parametrize("seed", seeds(0, 10))
def test_fits(seed: int, tmp_path: Path) -> None:
    """Fits go by runs alone, since sensitivities are refused."""
    drawn, file = Drawn.of(seed, spin=2.0), tmp_path / "data.csv"
    times = np.linspace(0.0, 6.0, 7)
    rows = np.column_stack([times, drawn.motion(times)[:, :3]])
    np.savetxt(file, rows, delimiter=",", header="time,wx,wy,wz", comments="", fmt="%.17g")
    key, true = "initial.angular_velocity[2]", drawn.rates[2]
    drawn.rates[2] += 1e-3
    fit = f'[fit]\nparameters = ["{key}"]\n[[fit.data]]\nfile = "{file}"\nobservable = "angular_velocity"\n'
    fit += 'columns = ["wx", "wy", "wz"]\nsigma = 1e-6\n'
    found = rigidsim.fit(rigidsim.parse(drawn.text(6.0) + fit))
    assert found.converged
    assert abs(found.parameters[0].value - true) < 1e-8
    with pytest.raises(ConfigError, match="full turns of Euler angles"):
        run_text(drawn.text(5.0), f"output.sensitivity=['{key}']")


def test_roots_over_turns_are_watched() -> None:
    """A root whose radicand touches zero many turns away: |psi + 20| has a kink there, and no series."""
    drawn = Drawn.of(1)
    drawn.rates, drawn.angles = np.array([0.0, 0.0, -1.0]), np.array([0.3, 1.0, 0.0])
    drawn.torque = ["0.0", "0.0", "0.01*sqrt(psi + 20)"]
    run = run_text(drawn.text(60.0))
    assert run.summary["status"] == "stopped: non-finite state"
    assert "a root of zero has no series" in run.summary["message"]
