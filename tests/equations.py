"""The symbolic equations of a scene, evaluated in SI, and mechanics in numpy to hold them against."""

from typing import Any

import heyoka as hy
import numpy as np
from scipy.spatial.transform import Rotation
from support import config

from rigidsim import parse
from rigidsim.solve.problem import InitialValueProblem, prepare

EPS = np.finfo(float).eps
# Expressions of at most some tens of operations in double, on numbers of order one.
CLOSE = 100 * EPS
GRAVITY = 'kind = "uniform_gravity"\n'


def array(value: Any) -> str:
    """Numbers as TOML, every bit of the doubles kept."""
    return repr(np.asarray(value, dtype=float).tolist())


def prepared(
    body: str,
    initial: str,
    loads: str = "",
    record: str = "",
    integrator: str = "",
    end: float = 1.0,
    *,
    start: float = 0.0,
    parameters: str = "",
) -> InitialValueProblem:
    output = f"record = {record}" if record else ""
    time, more = f"start = {start!r}\nend = {end!r}", f"[parameters]\n{parameters}"
    return prepare(parse(config(body, initial, loads, time, integrator, output, more)))


def internal(system: Any, state: np.ndarray) -> np.ndarray:
    """SI to the system's own units: powers of two, nothing is rounded."""
    return np.ldexp(state, -np.array(system.state_exponents))


_COMPILED: list[tuple[str, Any, Any]] = []  # of the last systems, which most calls ask for again


def _compiled(kind: str, system: Any, expressions: list[Any]) -> Any:
    for known, of, function in _COMPILED:
        if known == kind and of is system:
            return function
    _COMPILED.append((kind, system, hy.cfunc(expressions, system.variables)))
    del _COMPILED[:-6]
    return _COMPILED[-1][2]


def derivative(system: Any, state: np.ndarray, time: float = 0.0) -> np.ndarray:
    """Time derivative of the states, SI, at a state in SI and a time in seconds."""
    rhs = _compiled("derivative", system, [rhs for _, rhs in system.equations])
    inside, options = internal(system, state), {"time": float(np.ldexp(time, -system.scaling.time))}
    if system.surfaces:  # a parameter for each says on which side the state is
        options["pars"] = np.sign(_compiled("surfaces", system, system.surfaces)(inside))
    return np.ldexp(rhs(inside, **options), np.array(system.state_exponents) - system.scaling.time)


def observed(system: Any, state: np.ndarray) -> dict[str, np.ndarray]:
    """All recorded variables, SI, at a state in SI."""
    count = sum(r.count for r in system.recorded)
    values = _compiled("observed", system, system.outputs[:count])(internal(system, state))
    return {r.name: np.ldexp(values[r.first : r.first + r.count], r.exponents) for r in system.recorded}


class Random:
    """Seeded scenes; every test has its own."""

    def __init__(self, seed: int) -> None:
        self.generator = np.random.default_rng(seed)

    def vector(self, size: float = 1.0) -> np.ndarray:
        return size * self.generator.uniform(-1, 1, 3)

    def quaternion(self) -> np.ndarray:
        q = self.generator.normal(size=4)
        return q / np.linalg.norm(q)

    def tensor(self) -> np.ndarray:
        """A tensor in general axes that some body has: I = tr(S) 1 - S with S positive."""
        a = self.generator.uniform(-1, 1, (3, 3))
        s = a @ a.T + 0.1 * np.eye(3)
        return np.trace(s) * np.eye(3) - (s + s.T) / 2


def matrix(q: np.ndarray) -> np.ndarray:
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


def skew(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def general_body(tensor: np.ndarray, mass: float = 1.0, center: Any = (0, 0, 0)) -> str:
    return f"inertia_tensor = {array(tensor)}\nmass = {mass!r}\ncenter_of_mass = {array(center)}"
