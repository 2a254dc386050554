"""What the tests of the closed forms share: scenes, random bodies and starts, integrations as a measure."""

from typing import Any

import mpmath
import numpy as np
from support import config

import rigidsim
from rigidsim.solve.closed_form import ClosedForm, closed_form_of
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.taylor_stepper import TaylorStepper

DOWN = [0, 0, -1]


def scene(
    body: str,
    rates: Any,
    *,
    quaternion: Any = (1, 0, 0, 0),
    gravity: Any = None,
    precision: Any = "double",
    end: Any = 10,
    more: str = "",
) -> InitialValueProblem:
    """A config of a body (lines of ``[body]``), prepared; three samples."""
    initial = f"angular_velocity = {written(rates)}\nquaternion = {written(quaternion)}\n{more}"
    loads = f'kind = "uniform_gravity"\nacceleration = {written(gravity)}' if gravity else ""
    setting = precision if isinstance(precision, int) else f'"{precision}"'
    time, integrator = f"end = {end}\nsamples = 3", f"precision = {setting}"
    return prepare(rigidsim.parse(config(body, initial, loads, time, integrator)))


def written(numbers: Any) -> str:
    """As a TOML array, exactly: floats by their shortest digits, strings as they are."""
    return "[" + ", ".join(f'"{x}"' if isinstance(x, str) else repr(x) for x in numbers) + "]"


def principal(moments: Any) -> str:
    """A body by its principal moments."""
    return f"principal_moments = {written(moments)}"


def top(across: Any, along: Any, height: Any = 1) -> str:
    """A symmetric body of unit mass on a fixed point ``height`` below its centre of mass."""
    return f"{principal([across, across, along])}\nmass = 1\ncenter_of_mass = {written([0, 0, height])}"


def scene_over(units: float, **given: Any) -> InitialValueProblem:
    """A scene that lasts some internal units of time, in which the fastest rate is between 1/2 and 1."""
    return scene(**given, end=repr(units * 2.0 ** scene(**given).system.scaling.time))


def closed(prepared: InitialValueProblem) -> ClosedForm:
    """Its closed form, which must exist."""
    return closed_form_of(prepared.scene)


def against_integration(prepared: InitialValueProblem) -> float:
    """Largest difference of any state at the last sample: rates in the unit of the fastest, the rest O(1)."""
    clock = prepared.clock
    stepper = TaylorStepper(prepared.system, prepared.precision, prepared.tolerance, clock.at(0))
    assert stepper.to(clock.at(2))
    times = clock.internal(0, 3)
    states = closed(prepared).states(prepared.system, prepared.precision, times, clock.at(0))
    # each rate has a unit of its own; a rate far below the others' rounding may read as none
    exponents = prepared.system.state_exponents
    units = [2.0 ** (e - max(exponents[:3])) if n < 3 else 1.0 for n, e in enumerate(exponents)]
    pairs = zip(states[2], np.array(stepper.state), units, strict=True)
    return max(float(abs(a - b)) * unit for a, b, unit in pairs)


def attitude_error(exact: list[Any], quaternion: Any) -> float:
    """Angle between an attitude in mpmath and a double one with the same sign, rad."""
    return 2 * float(mpmath.sqrt(sum((a - float(b)) ** 2 for a, b in zip(exact, quaternion, strict=True))))


TILTED = (4, 3, 2, 1)
LEVEL = (1, 1, 0, 0)


def _free(moments: Any, rates: Any) -> dict[str, Any]:
    return {"body": principal(moments), "rates": rates, "quaternion": TILTED}


def _heavy(body: str, rates: Any, quaternion: Any = TILTED) -> dict[str, Any]:
    return {"body": body, "rates": rates, "quaternion": quaternion, "gravity": DOWN}


def _near(digits: int) -> dict[str, dict[str, Any]]:
    """Scenes 10^-digits away from something singular."""
    d, one, upright = 10.0**-digits, 10**digits, (1, 0, 0, 0)
    more, less = f"{one + 1}/{one}", f"{one - 1}/{one}"
    return {
        "outside the separatrix": _free([3, 6, 8], [4, 10, f"{3 * one + 1}/{one}"]),
        "inside the separatrix": _free([3, 6, 8], [4, 10, f"{3 * one - 1}/{one}"]),
        "about the middle axis": _free([3, 6, 8], [d, 1, d]),
        "about the largest axis": _free([3, 6, 8], [d, 2 * d, 1]),
        "about the smallest axis": _free([3, 6, 8], [-1, d, 2 * d]),
        "nearly symmetric, oblate": _free([1, more, 2], [0.5, 1, -0.3]),
        "nearly symmetric, prolate": _free([0.5, 1, more], [d, 1, 0.3]),
        "nearly a sphere": _free([1, more, f"{one + 3}/{one}"], [0.5, 1, 0.3]),
        "rod in a spin": _free([d, 1, more], [1 / d, 1, 0.1]),
        "rod across": _free([d, 1, f"{2 * one + 1}/{2 * one}"], [0.5, 1, 0.3]),
        "upright, unstable": _heavy(top(1, 0.5), [d, 0, 1], upright),
        "upright, stable": _heavy(top(1, 0.5), [d, 0, 5], upright),
        "pendulum short of the top": _heavy(top(1, 0.5, -1), [2, 0, d], upright),
        "pendulum over the top": _heavy(top(1, 0.5, f"-{less}"), [2, 0, 0], upright),
        "hanging": _heavy(top(1, 0.5, -1), [d, d, 1], upright),
        "regular precession": _heavy(top(1, 0.5), [d, 1, 2], LEVEL),
        "weak gravity": _heavy(top(1, 0.5, d), [0.1, 0.8, 3]),
        "rod as a top": _heavy(top(1, d), [0.1, 0.8, 1 / d]),
    }


LIMITS: dict[str, dict[str, Any]] = {
    "on the separatrix": _free([3, 6, 8], [4, 10, 3]),
    "on the separatrix, rounded": _free([3, 6, 8], [0.4, -1, -0.3]),
    "plate": _free([1, 2, 3], [0.3, 1, 0.2]),
    "sphere": _free([2, 2, 2], [0.3, 1, 0.2]),
    "rod": _free([2, 0, 2], [0.3, 0, 0.2]),
    "symmetric": _free([2, 1, 2], [0.3, -1, 0.2]),
    "spin": _free([1, 2, 3], [0, 1, 0]),
    "at rest": _free([1, 2, 3], [0, 0, 0]),
    "double root": _heavy(top(1, 0.5), [0, 1, 2], LEVEL),
    "released from rest": _heavy(top(1, 0.5), [0, 0, 0]),
    "cusps": _heavy(top(1, 0.5), [0, 0, 3]),
    "pendulum to the top": _heavy(top(1, 0.5, -1), [2, 0, 0], (1, 0, 0, 0)),
    "asleep": _heavy(top(1, 0.5), [0, 0, -1], (1, 0, 0, 0)),
    "rod on a point": _heavy(top(2, 0), [0.3, 1, 0]),
    "sphere off its centre": {
        "body": f"{principal([1, 1, 1])}\nmass = 1\ncenter_of_mass = [0.2, 0.3, 0.5]",
        "rates": [0.3, 0.2, -1],
        "quaternion": TILTED,
        "gravity": [0.3, -0.2, -1],
    },
}
EXTREMES = LIMITS | {
    f"{name}, 1e-{digits}": keys for digits in (3, 8, 12, 15) for name, keys in _near(digits).items()
}
"""Scenes by name, as arguments of ``scene``."""
