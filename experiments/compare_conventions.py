"""Does `compare` measure the error of others' files in any convention, and tell their models apart?

Method: random bodies, free, braked or under gravity about a fixed point, are integrated by SciPy and by
methods of fixed step, tight and loose, at rows near and far apart, from the same start. Their files are
written in one of 24 conventions: quaternions of two orders and directions with rates along body or space
axes, twelve Euler sequences about body or fixed axes in radians or degrees, matrices, other space or body
axes by a random turn. The true error is that from SciPy's DOP853 at 3e-14, written nowhere. Then the same
with other models, well integrated: another body, one moment or the load 1 % off, or the load left out.

Checked: the attitude error told is within 10 % of the true one (where that is above 1e-9 rad), and that of
rates is as large as the true one, so that the convention is right or makes no difference; no loose
integration is called a wrong model, no wrong model an integration error or agreement.

Run: python -m experiments.compare_conventions [--files N] [--models N] [--seed N] [--no-rates] [--mixed N]
Exit code 1 if one fails.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import rigidsim
from experiments.common import Command
from rigidsim.workflows.compare.compared import Comparison

SEQUENCES = ["zxz", "zyz", "xyx", "xzx", "yxy", "yzy", "zyx", "xyz", "xzy", "yxz", "yzx", "zxy"]
QUATERNIONS = [
    (order, way, axes) for order in ("wxyz", "xyzw") for way in (1, -1) for axes in ("body", "space")
]
CONVENTIONS = [*QUATERNIONS, *SEQUENCES, "matrix", "transposed", "space turn", "body turn"]
METHODS = ["DOP853", "RK45", "RK23", "LSODA", "Radau", "rk4", "heun"]
LEAST = 1e-9  # rad: errors below aren't held against each other
WITHIN = 0.1
QUANTILES = (0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1)
KINDS = ("free", "braked", "top")


@dataclass(frozen=True)
class Model:
    """A body, what acts on it, and its start."""

    kind: str
    moments: np.ndarray
    load: float
    rates: np.ndarray
    quaternion: np.ndarray
    end: float

    @classmethod
    def drawn(cls, chance: random.Random) -> Model:
        """Moments, rates and attitude at random; some 3 to 30 rad of turning."""
        a, b = chance.uniform(1, 3), chance.uniform(1, 3)
        moments = np.array([a, b, chance.uniform(max(abs(a - b) * 1.1, 0.3), (a + b) * 0.95)])
        rates = np.array([chance.gauss(0, 1) for _ in range(3)])
        quaternion = np.array([chance.gauss(0, 1) for _ in range(4)])
        size = float(np.linalg.norm(rates))
        kind = chance.choice(KINDS)
        load = {"free": 0.0, "braked": 0.02, "top": 1.0}[kind] * chance.uniform(0.5, 2)
        end = chance.uniform(3, 30) / max(size, 0.5)
        return cls(kind, moments, load, rates, quaternion / np.linalg.norm(quaternion), end)

    def slopes(self, _: float, y: np.ndarray) -> np.ndarray:
        """Derivatives of quaternion and rates."""
        q, w = y[:4], y[4:]
        torque = -self.load * w if self.kind == "braked" else np.zeros(3)
        if self.kind == "top":  # weight at (0, 0, 1) below a vertical Z: up in body axes times -load
            across = 2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1])
            up = np.array([*across, 1 - 2 * (q[1] ** 2 + q[2] ** 2)]) / (q @ q)
            torque = -self.load * np.cross([0, 0, 1.0], up)
        turn = np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))]) / 2
        return np.concatenate([turn, (torque - np.cross(w, self.moments * w)) / self.moments])

    def rows(self, method: str, accuracy: float, times: np.ndarray) -> np.ndarray:
        """Quaternion and rates (rows, 7), by a method: relative tolerance, or step times rate."""
        start = np.concatenate([self.quaternion, self.rates])
        if method not in ("rk4", "heun"):
            options = {"rtol": max(accuracy, 3e-14), "atol": accuracy * 0.1}
            return solve_ivp(self.slopes, (0, self.end), start, method, times, **options).y.T
        step, f = self.end / (len(times) - 1), self.slopes
        parts = max(1, round(step * float(np.linalg.norm(self.rates)) / accuracy))
        h, y, found = step / parts, start, [start]
        for _ in times[1:]:
            for _ in range(parts):
                y = heun(f, y, h) if method == "heun" else classical(f, y, h)
            found.append(y)
        return np.array(found)

    @property
    def config(self) -> str:
        """The experiment as TOML."""
        head = f"""name = "drawn"
[initial]
angular_velocity = {self.rates.tolist()}
quaternion = {self.quaternion.tolist()}
[time]
end = {self.end!r}
[body]
principal_moments = {self.moments.tolist()}
"""
        if self.kind == "braked":
            head += f'[[loads]]\nkind = "viscous_torque"\ncoefficients = {[self.load] * 3}\n'
        if self.kind == "top":
            head += "mass = 1\ncenter_of_mass = [0, 0, 1]\n"
            head += f'[[loads]]\nkind = "uniform_gravity"\nacceleration = [0, 0, {-self.load!r}]\n'
        return head


def heun(f: Callable[[float, np.ndarray], np.ndarray], y: np.ndarray, h: float) -> np.ndarray:
    """A step of Heun's method, of order 2."""
    a = f(0, y)
    return y + h / 2 * (a + f(0, y + h * a))


def classical(f: Callable[[float, np.ndarray], np.ndarray], y: np.ndarray, h: float) -> np.ndarray:
    """A step of the classical Runge-Kutta method, of order 4."""
    a = f(0, y)
    b = f(0, y + h / 2 * a)
    c = f(0, y + h / 2 * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(0, y + h * c))


def written(convention: Any, rows: np.ndarray, chance: random.Random) -> dict[str, np.ndarray]:
    """Columns of a file in a convention."""
    body = Rotation.from_quat(rows[:, [1, 2, 3, 0]])
    rates, turn = rows[:, 4:], Rotation.random(random_state=chance.randrange(2**31))
    scale = chance.choice([1.0, 180 / np.pi])
    if convention == "space turn":
        body = turn * body
    if convention == "body turn":
        body, rates = body * turn, turn.inv().apply(rates)
    if isinstance(convention, tuple):
        order, way, axes = convention
        rates = body.apply(rates) if axes == "space" else rates
        q = (body if way == 1 else body.inv()).as_quat()
        return {"q": q if order == "xyzw" else q[:, [3, 0, 1, 2]], "w": rates * scale}
    if convention in SEQUENCES:
        letters = convention if chance.random() < 0.5 else convention.upper()
        return {"euler": body.as_euler(letters, degrees=scale != 1), "w": rates * scale}
    if convention in ("matrix", "transposed"):
        return {"r": (body if convention == "matrix" else body.inv()).as_matrix(), "w": rates * scale}
    return {"q": body.as_quat(), "w": rates * scale}


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between attitudes, whatever the norms and signs of their quaternions."""
    p, q = (x[:, :4] / np.linalg.norm(x[:, :4], axis=1)[:, None] for x in (one, other))
    sign = np.where(np.einsum("ij,ij->i", p, q) < 0, -1.0, 1.0)[:, None]
    return 4 * np.arctan2(np.linalg.norm(p - sign * q, axis=1), np.linalg.norm(p + sign * q, axis=1))


def judged(model: Model, times: np.ndarray, columns: dict[str, np.ndarray], rates: bool) -> Comparison:
    """A file beside the model's experiment, with or without its rates."""
    kept = {name: values for name, values in columns.items() if rates or name != "w"}
    return rigidsim.compare(rigidsim.parse(model.config), {"t": times, **kept})


def spaced(model: Model, chance: random.Random) -> np.ndarray:
    """Even rows, near and far apart."""
    turned = model.end * float(np.linalg.norm(model.rates))
    return np.linspace(0, model.end, max(8, round(turned / 10 ** chance.uniform(-1.7, 0))))


def loose(method: str, chance: random.Random, least: float) -> float:
    """A step times rate, or a relative tolerance from a power of ten on."""
    return 10 ** (chance.uniform(-2, -0.7) if method in ("rk4", "heun") else chance.uniform(least, -3))


def a_file(chance: random.Random, convention: Any, rates: bool = True) -> tuple[Comparison, str]:
    """Judge the file of a loose or tight integration: the result, and what is wrong; empty for nothing."""
    model = Model.drawn(chance)
    method = chance.choice(METHODS)
    accuracy, times = loose(method, chance, -10), spaced(model, chance)
    size = float(np.linalg.norm(model.rates))
    rows, exact = model.rows(method, accuracy, times), model.rows("DOP853", 3e-14, times)
    found = judged(model, times, written(convention, rows, chance), rates)
    true = float(angles(rows, exact).max())
    true_rates = float(np.linalg.norm(rows[:, 4:] - exact[:, 4:], axis=1).max())
    told = found.attitude_error.largest
    name = f"{model.kind} {method} {accuracy:.1e} {len(times)} rows {convention}"
    if max(true, told) > LEAST and abs(told - true) > WITHIN * true:
        return found, f"{name}: {told:.3g} rad told, {true:.3g} true; {found.convention}"
    if rates and (found.rate_error is None or found.rate_error > 1.1 * true_rates + 2 * size * true + LEAST):
        return found, f"{name}: rates {found.rate_error} told, {true_rates:.3g} true"
    if found.verdict == "wrong_model":
        return found, f"{name}: {found.why}"
    return found, ""


def a_model(chance: random.Random, convention: Any, rates: bool = True) -> tuple[Comparison, str]:
    """Judge the file of another model: the result, and what is wrong."""
    model = Model.drawn(chance)
    wrong = chance.choice(["body", "moment", "load", "missing"])
    if model.kind == "free" and wrong in ("load", "missing"):
        wrong = "moment"
    other = {
        "body": lambda: replace(model, moments=model.moments[[1, 2, 0]]),
        "moment": lambda: replace(
            model, moments=model.moments * np.array([1, 1, chance.choice([0.99, 1.01])])
        ),
        "load": lambda: replace(model, load=model.load * chance.choice([0.99, 1.01])),
        "missing": lambda: replace(model, load=0.0),
    }[wrong]()
    accuracy = 10 ** chance.uniform(-12, -9)
    times = spaced(model, chance)
    rows = other.rows("DOP853", accuracy, times)
    found = judged(model, times, written(convention, rows, chance), rates)
    if found.verdict in ("integration_error", "agrees"):
        name = f"{model.kind} {wrong} {accuracy:.1e} {len(times)} rows {convention}"
        return found, f"{name}: {found.verdict}: {found.why}; {found.told}"
    return found, ""


TRUTHS = ("right", "loose", "model", "rounded")
WAYS = ("half", "opposite", "unrelated", "other axes", "other frame", "offset")
SCENES = 12  # experiments that mixed files are of, so that few are compiled
NEAR = 60.0  # deg from row to row, up to which a file has to be decided


@dataclass(frozen=True)
class Mixed:
    """A random file: what is true of it, and what ``compare`` says."""

    truth: str
    way: str
    rates: bool
    uneven: bool
    widest: float
    error: float
    label: str
    found: Comparison

    @property
    def wrong(self) -> str:
        """What is false about the verdict; empty if nothing is."""
        verdict = self.found.verdict
        if self.way:
            return f"false {verdict}" if verdict in ("agrees", "integration_error", "wrong_model") else ""
        right = {"right": "agrees", "rounded": "agrees", "loose": "integration_error", "model": "wrong_model"}
        if self.error <= self.found.within:
            return "" if verdict in ("agrees", "undecided") else f"false {verdict}"
        return "" if verdict in (right[self.truth], "undecided") else f"false {verdict}"


def a_mixed_file(seed: object) -> Mixed:
    """Half of the files have no rates, a third has uneven rows, a third has rates that contradict the
    attitudes; right files, loose integrations, other models and rounded numbers.
    """
    chance = random.Random(f"mixed {seed}")
    model = Model.drawn(random.Random(f"scene {chance.randrange(SCENES)}"))
    truth, size = chance.choice(TRUTHS), float(np.linalg.norm(model.rates))
    kind = chance.choice(["none", "none", "none", "contradicting", "contradicting", "honest"])
    uneven = chance.random() < 1 / 3
    count = max(60, round(model.end * size / 10 ** chance.uniform(-1.5, -0.1)))
    times = np.linspace(0, model.end, count)
    if uneven:
        lengths = np.array([0.05 + chance.random() for _ in range(count - 1)])
        times = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
        times = np.minimum(times, 1.0) * model.end
        if chance.random() < 0.5:
            times = np.delete(times, slice(count // 3, count // 3 + count // 8))
    other, method, accuracy, label = model, "DOP853", 3e-14, truth
    if truth == "loose":
        method = chance.choice([m for m in METHODS if not uneven or m not in ("rk4", "heun")])
        accuracy = loose(method, chance, -8)
        label = f"{method} {accuracy:.0e}"
    if truth == "model":
        change, axis = 10 ** chance.uniform(-4, -0.7), chance.randrange(3)
        other = replace(model, moments=model.moments * (1 + change * np.eye(3)[axis]))
        label = f"moment {axis} {change:+.0e}"
    exact = model.rows("DOP853", 3e-14, times)
    rows = other.rows(method, accuracy, times)
    error = float(angles(rows, exact).max())
    attitude, rates = rows[:, :4], rows[:, 4:]
    way = chance.choice(WAYS) if kind == "contradicting" else ""
    if way:
        body = Rotation.from_quat(rows[:, [1, 2, 3, 0]])
        shift = np.array([chance.gauss(0, 1) for _ in range(3)])
        noise = np.array([[chance.gauss(0, size) for _ in range(3)] for _ in range(9)])
        phases = np.cos(np.outer(times, np.arange(9)) * 2 / model.end)
        rates = {
            "half": lambda: rates / 2, "opposite": lambda: -rates, "unrelated": lambda: phases @ noise / 3,
            "other axes": lambda: rates[:, [1, 2, 0]], "other frame": lambda: body.inv().apply(rates),
            "offset": lambda: rates + shift / np.linalg.norm(shift) * size * 10 ** chance.uniform(-1.5, 0),
        }[way]()  # fmt: skip
    written_times = times
    if truth == "rounded":
        label = chance.choice(["float32", "times", "both", "digits"])
        if label in ("float32", "both"):
            attitude, rates = (x.astype(np.float32).astype(float) for x in (attitude, rates))
        if label in ("times", "both"):
            written_times = times.astype(np.float32).astype(float)
        if label == "digits":
            digits = chance.randrange(5, 12)
            attitude, rates = np.round(attitude, digits), np.round(rates, digits)
    order = chance.choice([[0, 1, 2, 3], [1, 2, 3, 0]])
    columns = {"t": written_times, "q": attitude[:, order]} | ({} if kind == "none" else {"w": rates})
    found = rigidsim.compare(rigidsim.parse(model.config), columns)
    steps = np.linalg.norm(exact[:-1, 4:], axis=1) * np.diff(times)
    widest, label = float(np.degrees(steps.max())), f"{model.kind} {label}"
    return Mixed(truth, way, kind != "none", uneven, widest, error, label, found)


def counted(seen: Counter[str]) -> str:
    """Verdicts, and how often they were given."""
    return ", ".join(f"{verdict} {n}" for verdict, n in sorted(seen.items()))


def mixed_campaign(count: int, seed: int) -> int:
    """Judge so many mixed files, and print the table; the number of false verdicts."""
    made = []
    for number in range(count):
        one = a_mixed_file(f"{seed} {number}")
        made.append(one)
        if one.wrong or (one.found.verdict == "undecided" and one.widest <= NEAR):
            print(
                f"{number}: {one.wrong or 'undecided'}: {one.label} {one.way} rates {one.rates} uneven "
                f"{one.uneven}, {len(one.found.dataset.time)} rows, {one.widest:.0f} deg, true error "
                f"{one.error:.2g}, {one.found.attitude_error.largest:.2g} found: {one.found.why}"
            )
    for name in (*TRUTHS, *WAYS):
        some = [x for x in made if (x.way or x.truth) == name]
        print(f"{name:12} {len(some):4}  {counted(Counter(x.found.verdict for x in some))}")
    near = [x for x in made if x.widest <= NEAR]
    undecided = sum(x.found.verdict == "undecided" for x in near)
    print(f"{undecided} undecided of {len(near)} files with rows at most {NEAR:g} deg apart")
    print(", ".join(f"{n} {what}" for what, n in Counter(x.wrong or "right" for x in made).items()))
    return sum(bool(x.wrong) for x in made)


@Command
def campaign(files: int = 24, models: int = 16, seed: int = 1, no_rates: bool = False, mixed: int = 0) -> int:
    """Judge so many files and other models, or mixed files instead; 1 if something failed."""
    if mixed:
        return int(bool(mixed_campaign(mixed, seed)))
    failures = 0
    for what, judge, count in (("files", a_file, files), ("other models", a_model, models)):
        seen: Counter[str] = Counter()
        shares: list[float] = []
        for number in range(count):
            chance = random.Random(f"{seed} {what} {number}")
            convention = CONVENTIONS[number % len(CONVENTIONS)]
            found, wrong = judge(chance, convention, not no_rates)
            seen[found.verdict] += 1
            local = found.local_defects
            if found.verdict != "agrees" and local is not None and local.unexplained is not None:
                shares.append(local.unexplained)
            if wrong:
                failures += 1
                print(f"{what} {number}: {wrong}")
        print(f"{count} {what}: {counted(seen)}")
        if shares:
            quantiles = ", ".join(f"{x:.2g}" for x in np.quantile(shares, QUANTILES))
            print(f"  shares of {len(shares)}, by quantiles {', '.join(map(str, QUANTILES))}: {quantiles}")
    print(f"{failures} failures")
    return int(failures > 0)
