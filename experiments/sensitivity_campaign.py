"""Are sensitivities right? Random keys and scenes, against differences of runs in higher precision.

Each case draws a scene (``sensitivity_scenes``) and one number of its config. A run in double precision
records the derivatives. Four runs with this number moved, in quadruple precision, give the central difference
of fourth order: steps h of 1e-6 leave some h^4 = 1e-24, and 1e-13 for the 80 bits in which they are
subtracted. They share nothing with the variational equations but the way from a config to equations. The
largest difference along the run, relative to the derivative's largest value there, may be 1e-9.

Run: python -m experiments.sensitivity_campaign [--scenes 200] [--first 0]      exit code 1 if one is off
"""

import warnings
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments.common import Command
from experiments.sensitivity_scenes import Case, case
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.varied_keys import varied_keys
from rigidsim.workflows.read import parse

BOUND = 1e-9
_MOVED = Fraction(1, 1 << 20)  # of a number's size
_WEIGHTS = {1: 8.0, -1: -8.0, 2: -1.0, -2: 1.0}  # times 1 / 12 h


@dataclass(frozen=True)
class Found:
    """Largest error of each recorded derivative, relative to its largest value."""

    errors: dict[str, float]

    @property
    def worst(self) -> float:
        """Of all of them; infinite if nothing was compared."""
        return max(self.errors.values(), default=float("inf"))


def checked(one: Case) -> Found:
    """The errors of one case."""
    base = parse(one.text, overrides=[f'output.sensitivity=["{one.key}"]', *_QUIET])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = rigidsim.run(base, out=None, progress=False).dataset
        differences = _differences(one)
    errors = {}
    for name, difference in differences.items():
        largest = np.abs(difference).max()
        if largest < _NONE:  # nothing there depends on the key
            largest = 1.0
        errors[name] = float(np.abs(found[name].to_numpy()[:, 0] - difference).max() / largest)
    return Found(errors)


_QUIET = ["output.timeline=false", "output.estimate=false"]
_NONE = 1e-12


def _turned(quaternion: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Rotation vectors, space axes, of small changes of unit quaternions."""
    w, v = quaternion[:, :1], quaternion[:, 1:]
    return 2 * (w * change[:, 1:] - change[:, :1] * v - np.cross(change[:, 1:], v))


def _differences(one: Case) -> dict[str, np.ndarray]:
    """Central differences of fourth order of attitude (rotation vector, space axes), rates and position."""
    given = parse(one.text)
    (key,) = varied_keys(given, [one.key])
    step = Fraction(abs(float(key.number)) or 1.0) * _MOVED
    record = ["quaternion", "angular_velocity"] + (["position"] if "position" in one.text else [])
    plain = ['integrator.precision="quadruple"', "integrator.hold_invariants=false", *_QUIET]
    plain += ['integrator.formulation="quaternion"', f"output.record={record}".replace("'", '"')]
    totals: dict[str, Any] = {}
    middle = None
    for sign, weight in _WEIGHTS.items():
        changes = [*_moved(given, key, sign * step), *plain]
        run = rigidsim.run(parse(one.text, overrides=changes), out=None, progress=False)
        assert run.status == "finished", run.status
        for name in record:
            part = _whole(run.dataset, name)
            if name == "quaternion":  # moved by little, so that one sign is the same motion
                middle = part if middle is None else middle
                part = part * np.sign((part * middle).sum(axis=1).astype(float))[:, None]
            totals[name] = totals.get(name, 0) + np.longdouble(weight) * part
    made = {name: (total / np.longdouble(12 * step)).astype(float) for name, total in totals.items()}
    found = {"angular_velocity_sensitivity": made["angular_velocity"]}
    change = made["quaternion"]
    base = rigidsim.run(parse(one.text, overrides=plain), out=None, progress=False).dataset
    q = _whole(base, "quaternion")
    q = (q * np.sign((q * middle).sum(axis=1).astype(float))[:, None]).astype(float)
    found["attitude_sensitivity"] = _turned(q, change)
    if "position" in made:
        found["position_sensitivity"] = made["position"]
    return found


def _moved(given: Any, key: Any, step: Fraction) -> list[str]:
    """Settings of the config with a key moved."""
    if key.places:
        number = key.number
        value = number.rational + step
        if number.pi_power:
            with mpmath.workdps(60):
                exact = mpmath.mpf(number.rational.numerator) / number.rational.denominator * mpmath.pi
                exact += mpmath.mpf(step.numerator) / step.denominator
                value = Fraction(int(exact * 10**45), 10**45)
        text = f'"{value.numerator}/{value.denominator}"'
        return [f"{place}={text}" for place in key.places]
    with mpmath.workdps(60):
        q = [
            mpmath.mpf(x.rational.numerator) / x.rational.denominator for x in given.config.initial.quaternion
        ]
        half = mpmath.mpf(step.numerator) / step.denominator / 2
        turn = [mpmath.cos(half)] + [
            mpmath.sin(half) if i == key.component else mpmath.mpf(0) for i in range(3)
        ]
        (a, b, c, d), (e, f, g, h) = q, turn
        turned = [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ]
        return [f"initial.quaternion={[mpmath.nstr(x, 50) for x in turned]}".replace("'", '"')]


def _whole(dataset: Any, name: str) -> np.ndarray:
    """Values with all their digits, as 80-bit numbers."""
    return sum(dataset[n].to_numpy().astype(np.longdouble) for n in reversed(parts_in(dataset, name)))


@Command
def campaign(scenes: int = 200, first: int = 0) -> int:
    """Print a line for each case, and those that are off."""
    off, worst = [], 0.0
    for number in range(first, first + scenes):
        one = case(number)
        try:
            found = checked(one)
        except rigidsim.RigidsimError as error:
            print(f"{number:4d} {one.family:10s} {one.key:34s} refused: {error}", flush=True)
            off.append(number)
            continue
        worst, beyond = max(worst, found.worst), found.worst > BOUND
        off += [number] * beyond
        shown = "  ".join(f"{name.split('_')[0]} {error:.1e}" for name, error in found.errors.items())
        print(f"{number:4d} {one.family:10s} {one.key:34s} {shown}{'  OFF' * beyond}", flush=True)
    print(f"{scenes} cases, largest relative error {worst:.1e}, {len(off)} off: {off}")
    return int(bool(off))
