"""Are sensitivities right? Random keys and scenes, against differences of runs in higher precision.

Each case draws a scene and one number of its config. A run in double precision
records the derivatives. Four runs with this number moved, in quadruple precision, give the central difference
of fourth order: steps h of 1e-6 leave some h^4 = 1e-24, and 1e-13 for the 80 bits in which they are
subtracted. They share nothing with the variational equations but the way from a config to equations (and the
product of quaternions, by which a start is turned). The
largest difference along the run, relative to the derivative's largest value there, may be 1e-9.

Run: python -m experiments.sensitivity_campaign [--scenes 200] [--first 0]      exit code 1 if one is off
"""

import random
import warnings
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments.common import Command
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.rotations import product
from rigidsim.scene.varied_keys import varied_keys
from rigidsim.workflows.read import parse

BOUND = 1e-9
_MOVED = Fraction(1, 1 << 20)  # of a number's size
_WEIGHTS = {1: 8.0, -1: -8.0, 2: -1.0, -2: 1.0}  # times 1 / 12 h


@dataclass(frozen=True)
class Case:
    """A scene, and the number of its config that derivatives are by."""

    number: int
    family: str
    text: str
    key: str


def _moments(draw: random.Random) -> str:
    a, b = draw.uniform(1, 2), draw.uniform(1, 2)
    return f"[{a:.6f}, {b:.6f}, {draw.uniform(max(a, b), 0.95 * (a + b)):.6f}]"


def _vector(draw: random.Random, size: float = 1.0) -> str:
    return "[" + ", ".join(f"{draw.uniform(-size, size):.6f}" for _ in range(3)) + "]"


def _start(draw: random.Random) -> str:
    q = [draw.gauss(0, 1) for _ in range(4)]
    return f"[initial]\nangular_velocity = {_vector(draw)}\nquaternion = {[round(x, 6) for x in q]}\n"


_STARTS = [f"initial.angular_velocity[{i}]" for i in range(3)] + [f"initial.attitude[{i}]" for i in range(3)]
_MOMENTS = [f"body.principal_moments[{i}]" for i in range(3)]
_IN_ORBIT = ["semi_major_axis", "eccentricity", "inclination", "ascending_node", "periapsis", "mean_anomaly"]


def _turning(draw: random.Random, load: str = "", moments: str = "") -> str:
    """A body with principal moments that are drawn unless given, its start, and a load."""
    return f"[body]\nprincipal_moments = {moments or _moments(draw)}\n{_start(draw)}{load}"


def _gravity_gradient(draw: random.Random) -> str:
    a, e = draw.uniform(1, 2), draw.choice([0.01, draw.uniform(0.01, 0.4)])
    texts = f"{a:.6f}", f"{e:.6f}", f'"{draw.uniform(0, 180):.4f} deg"'
    texts += tuple(f"{draw.uniform(0, 6):.5f}" for _ in range(3))
    orbit = ", ".join(f"{key} = {text}" for key, text in zip(_IN_ORBIT, texts, strict=True))
    return f'[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = 1.2\norbit = {{{orbit}}}\n'


def _free(draw: random.Random) -> tuple[str, list[str]]:
    if draw.random() < 0.5:
        return _turning(draw), _STARTS + _MOMENTS
    off = [draw.choice([0.0, draw.uniform(-0.2, 0.2)]) for _ in range(3)]
    a, b, c = (draw.uniform(1.5, 2) for _ in range(3))
    rows = [[a, off[0], off[1]], [off[0], b, off[2]], [off[1], off[2], c]]
    shown = [[round(x, 6) for x in row] for row in rows]
    keys = [f"body.inertia_tensor[{i}][{j}]" for i in range(3) for j in range(i, 3)]
    return f"[body]\ninertia_tensor = {shown}\n{_start(draw)}", _STARTS[:2] + keys


def _symmetric(draw: random.Random) -> tuple[str, list[str]]:
    return _turning(draw, moments=f"[1.5, 1.5, {draw.uniform(1, 2):.5f}]"), _MOMENTS


def _momentum(draw: random.Random) -> tuple[str, list[str]]:
    keys = [f"initial.angular_momentum[{i}]" for i in range(3)] + _STARTS[3:] + _MOMENTS
    return _turning(draw).replace("angular_velocity", "angular_momentum"), keys


def _shape(draw: random.Random) -> tuple[str, list[str]]:
    size = [round(draw.uniform(0.5, 1.5), 4) for _ in range(3)]
    text = f'[body]\nshape = "cuboid"\nmass = {draw.uniform(1, 3):.4f}\nsize = {size}\n{_start(draw)}'
    torque = '[[loads]]\nkind = "torque"\ncomponents = ["0.1", "-0.05*wy", "0"]\n'
    return text + torque, [_STARTS[0], "body.mass", "body.size[0]", "body.size[2]"]


def _torque(draw: random.Random) -> tuple[str, list[str]]:
    k = [draw.choice([0.0, draw.uniform(-0.5, 0.5)]), draw.uniform(0.1, 1), draw.uniform(0.5, 2)]
    names = f"[parameters]\na = {k[0]:.5f}\nb = {k[1]:.5f}\nc = {k[2]:.5f}\n"
    frame = draw.choice(["body", "space"])
    parts = '["a*wx + b*sin(c*t)", "-b*wy*exp(-c*wz^2)", "a*b*cos(c*t)"]'
    load = f'[[loads]]\nkind = "torque"\nframe = "{frame}"\ncomponents = {parts}\n'
    keys = 2 * [f"parameters.{name}" for name in "abc"]
    return names + _turning(draw, load), _STARTS[::2] + _MOMENTS[:1] + keys


def _viscous(draw: random.Random) -> tuple[str, list[str]]:
    load = f'[[loads]]\nkind = "viscous_torque"\ncoefficients = [0.1, 0.02, {draw.uniform(0.01, 0.2):.4f}]\n'
    return _turning(draw, load), _MOMENTS[:1] + [f"loads[0].coefficients[{i}]" for i in range(3)]


def _top(draw: random.Random) -> tuple[str, list[str]]:
    center = draw.choice([_vector(draw, 0.3), "[0, 0, 0.4]"])
    body = f"[body]\nprincipal_moments = {_moments(draw)}\nmass = 1.5\ncenter_of_mass = {center}\n"
    load = '[[loads]]\nkind = "uniform_gravity"\nacceleration = [0, 0, -1.3]\n'
    keys = ["body.mass", "loads[0].acceleration[2]", "loads[0].acceleration[0]"]
    return body + _start(draw) + load, _STARTS + _MOMENTS + keys + [
        f"body.center_of_mass[{i}]" for i in (0, 2)
    ]


def _gradient(draw: random.Random) -> tuple[str, list[str]]:
    keys = ["loads[0].gravitational_parameter", *(f"loads[0].orbit.{key}" for key in _IN_ORBIT)]
    return _turning(draw, _gravity_gradient(draw)), [*_STARTS[::3], *keys]


def _flight(draw: random.Random) -> tuple[str, list[str]]:
    place = f"position = [5, 0.3, -0.2]\nvelocity = [0.05, {draw.uniform(0.4, 0.5):.4f}, 0.1]\n"
    load = '[[loads]]\nkind = "central_gravity"\ngravitational_parameter = 1.1\n'
    body = f"[body]\nprincipal_moments = {_moments(draw)}\nmass = {draw.uniform(1, 2):.4f}\n"
    keys = ["initial.position[0]", "initial.velocity[1]", "loads[0].gravitational_parameter", "body.mass"]
    return body + _start(draw) + place + load, [*_STARTS[1:5], *keys, _MOMENTS[1]]


def _wheels(draw: random.Random) -> tuple[str, list[str]]:
    wheel = '[[rotors]]\nname = "wheel"\naxis = [0.2, 0.3, 1]\nmoment = 0.08\nrate = 4\ntorque = "-k*wz"\n'
    fixed = '[[rotors]]\nname = "second"\naxis = [1, 0, 0]\nmoment = 0.05\nrate = -3\nfixed = true\n'
    parameter = f"[parameters]\nk = {draw.uniform(0.05, 0.2):.4f}\n"
    keys = ["rotors[0].moment", "rotors[0].rate", "rotors[1].rate", "rotors[0].axis[0]", "parameters.k"]
    return parameter + _turning(draw, wheel + fixed), _MOMENTS[:2] + keys


def _core(draw: random.Random) -> tuple[str, list[str]]:
    core = "moment = 0.2\nflattening = 0.05\nfriction = 0.03\nangular_velocity = [0.1, 0.2, 0.9]\n"
    keys = [f"body.core.{key}" for key in ("moment", "flattening", "friction", "angular_velocity[0]")]
    body = f"[body]\nprincipal_moments = [1.6, 1.7, {draw.uniform(1.8, 2):.4f}]\n[body.core]\n{core}"
    return body + _start(draw), _MOMENTS[::2] + keys


def _own(draw: random.Random) -> tuple[str, list[str]]:
    state = '[[states]]\nname = "integral"\ninitial = 0.2\nderivative = "wz - g*integral"\n'
    load = '[[loads]]\nkind = "torque"\ncomponents = ["-0.2*wx", "0", "-g*integral"]\n'
    parameter = f"[parameters]\ng = {draw.uniform(0.2, 0.6):.4f}\n"
    return parameter + _turning(draw, load + state), ["parameters.g", "states[0].initial", *_MOMENTS[1:]]


def _elastic(draw: random.Random) -> tuple[str, list[str]]:
    part = "[body.elasticity]\nlove_number = 6e-13\ndelay = 0.05\nradius = 1.2\nmean_rate = 0.8\n"
    load = _gravity_gradient(draw)
    keys = [f"body.elasticity.{key}" for key in ("love_number", "delay", "radius")]
    body = f"[body]\nprincipal_moments = [1.6, 1.7, 1.9]\nmass = 1.5\n{part}"
    return body + _start(draw) + load, [*keys, "loads[0].orbit.semi_major_axis", _STARTS[0], _STARTS[3]]


def _dipole(draw: random.Random) -> tuple[str, list[str]]:
    load = f'[[loads]]\nkind = "magnetic_dipole"\nmoment = {_vector(draw)}\nfield = {_vector(draw)}\n'
    keys = ["loads[0].moment[0]", "loads[0].field[2]"]
    return _turning(draw, load), _STARTS[1:4] + keys


FAMILIES = {
    "free": _free, "symmetric": _symmetric, "momentum": _momentum, "shape": _shape, "torque": _torque,
    "viscous": _viscous, "top": _top, "gradient": _gradient, "flight": _flight, "wheels": _wheels,
    "core": _core, "own": _own, "elastic": _elastic, "dipole": _dipole,
}  # fmt: skip


def case(number: int) -> Case:
    """The case of a number."""
    draw = random.Random(f"sensitivity {number}")
    family = list(FAMILIES)[number % len(FAMILIES)]
    body, keys = FAMILIES[family](draw)
    formulation = draw.choice(["auto", "auto", "euler_angles", "rotation_matrix"])
    sequence = draw.choice(["zxz", "zyx"])
    held = draw.choice(["true", "false"]) if family in ("free", "symmetric", "momentum", "top") else "false"
    end = draw.uniform(5, 15)
    text = f"""name = "case-{number}"
{body}
[time]
end = {end:.4f}
samples = {draw.choice([4, 9, 60])}
[integrator]
formulation = "{formulation}"
euler_sequence = "{sequence}"
hold_invariants = {held}
"""
    return Case(number, family, text, draw.choice(keys))


def checked(one: Case) -> dict[str, float]:
    """Largest error of each recorded derivative, relative to its largest value."""
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
    return errors


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
        given_q = given.config.initial.quaternion
        q = [mpmath.mpf(x.rational.numerator) / x.rational.denominator for x in given_q]
        half, turn = mpmath.mpf(step.numerator) / step.denominator / 2, [mpmath.mpf(0)] * 4
        turn[0], turn[key.component + 1] = mpmath.cos(half), mpmath.sin(half)
        turned = product(q, turn)
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
        largest = max(found.values(), default=float("inf"))  # if nothing was compared
        worst, beyond = max(worst, largest), largest > BOUND
        off += [number] * beyond
        shown = "  ".join(f"{name.split('_')[0]} {error:.1e}" for name, error in found.items())
        print(f"{number:4d} {one.family:10s} {one.key:34s} {shown}{'  OFF' * beyond}", flush=True)
    print(f"{scenes} cases, largest relative error {worst:.1e}, {len(off)} off: {off}")
    return int(bool(off))
