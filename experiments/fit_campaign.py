"""Are the sigmas of `fit` right, and does it say what data can't determine?

Random bodies, free, braked or under gravity about a fixed point, are integrated by SciPy's DOP853 at 3e-14,
seen at random times with noise of known size, as quaternions or Euler angles, as angular velocities, or both.
`fit` starts elsewhere, and near where the body is a top, which may be chaotic. Some numbers have a prior from
which the config's value was drawn; in some scenes the load is only considered, and drawn from its sigma, too.

Checked: e' P^-1 e of each scene, with e the errors of the estimate and P its covariance, is chi-square
distributed (Kolmogorov's p above 0.01), and 68.3 and 95.4 % of all errors are within one and two sigmas to 3
%. Directions that are undetermined by symmetry or scaling are found, and nothing else. The covariance with a
considered number is that of Tapley, Schutz and Born's formula, by derivatives from SciPy's motions, to 1e-6.

Run: python -m experiments.fit_campaign [--scenes N] [--nulls N] [--seed N]      exit code 1 if one fails
"""

import random
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

import rigidsim
from experiments.common import Command
from experiments.compare_conventions import Model
from experiments.fitted_bodies import MOMENTS, observations

LOADS = {"braked": "loads[0].coefficients[2]", "top": "loads[0].acceleration[2]"}
ATTITUDE, RATES = "initial.attitude", "initial.angular_velocity"


@dataclass
class Scene:
    """A true motion, where its fit starts, and observations of it.

    Attributes:
        true: numbers in the order of the estimated keys, of the attitude from the start's.
        config: the TOML text with its ``[fit]``.
    """

    model: Model
    true: np.ndarray
    config: str


def a_scene(number: int, seed: int, folder: Path) -> Scene:
    """A scene with noisy observations."""
    chance, noise = random.Random(f"{seed} {number}"), np.random.default_rng([seed, number])
    model = Model.drawn(chance)
    size = float(np.linalg.norm(model.rates))
    far = 0.02 if model.kind == "top" else 1.0  # tops may be chaotic: from afar fits end elsewhere
    start = replace(
        model,
        quaternion=turned(model.quaternion, -0.03 * far * noise.standard_normal(3)),
        rates=model.rates + 0.02 * far * size * noise.standard_normal(3),
        moments=model.moments * np.array([*(1 + 0.02 * far * noise.standard_normal(2)), 1.0]),
    )
    fit = ""
    keys = [ATTITUDE, RATES, "body.principal_moments[0]", "body.principal_moments[1]"]
    if chance.random() < 0.4:  # the config's value is what was known beforehand
        sigma = 0.01 * far
        value = model.moments[0] + sigma * noise.standard_normal()
        start = replace(start, moments=np.array([value, *start.moments[1:]]))
        fit += f'prior."{keys[2]}" = {{sigma = {sigma}}}\n'
    load = []
    if model.kind in LOADS:
        sigma = 0.01 * far * model.load
        start = replace(start, load=model.load + sigma * float(noise.standard_normal()))
        if chance.random() < 0.5:
            fit += f'consider."{LOADS[model.kind]}" = {{sigma = {sigma!r}}}\n'
        else:
            keys.append(LOADS[model.kind])
            load = [model.load if model.kind == "braked" else -model.load]
    times = np.sort(noise.uniform(0, model.end, chance.randrange(25, 120)))
    data = observed(model, times, chance, noise, folder / f"{number}")
    true = [*apart(start.quaternion, model.quaternion), *model.rates, *model.moments[:2], *load]
    text = config_of(start, model) + f"[fit]\nparameters = {keys!r}\n{fit}".replace("'", '"') + data
    return Scene(model, np.array(true), text)


def config_of(start: Model, model: Model) -> str:
    """The start's config; all but one coefficient of a brake are the true ones."""
    text = start.config.replace('name = "drawn"', 'name = "drawn"\n')
    if model.kind == "braked":
        given, true = [start.load] * 3, [model.load, model.load, start.load]
        text = text.replace(f"coefficients = {given}", f"coefficients = {true}")
    return text


def drawn(chance: random.Random, kind: str) -> Model:
    """A random model of a kind."""
    model = Model.drawn(chance)
    while model.kind != kind:
        model = Model.drawn(chance)
    return model


def observed(
    model: Model, times: np.ndarray, chance: random.Random, noise: np.random.Generator, stem: Path,
    kinds: Sequence[str] = (),
) -> str:  # fmt: skip
    """Write noisy observations to files; the ``[[fit.data]]`` of them."""
    rows = model.rows("DOP853", 3e-14, np.array([0.0, *times]))[1:]
    size, found = float(np.linalg.norm(model.rates)), []
    chosen = kinds or chance.choice([["attitude"], ["attitude", "rates"]])
    if "attitude" in chosen:
        sigma = 10 ** chance.uniform(-4, -2)
        seen = Rotation.from_rotvec(sigma * noise.standard_normal((len(times), 3)))
        seen = seen * Rotation.from_quat(rows[:, [1, 2, 3, 0]])
        path = stem.with_suffix(".attitude.csv")
        if chance.random() < 0.5:
            values, names, observable, unit = seen.as_quat()[:, [3, 0, 1, 2]], "wxyz", "quaternion", ""
        else:
            values, names, observable = seen.as_euler("ZXZ", degrees=True), "abc", "euler_angles"
            unit = 'unit = "deg"'
        found.append(observations(path, times, values, observable, f'"{sigma!r} rad"', names, unit))
    if "rates" in chosen:
        sigma = size * 10 ** chance.uniform(-4, -2)
        values = rows[:, 4:] + sigma * noise.standard_normal((len(times), 3))
        path = stem.with_suffix(".rates.csv")
        found.append(observations(path, times, values, "angular_velocity", repr(sigma)))
    return "".join(found)


def turned(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A quaternion turned by a rotation vector in body axes."""
    made = Rotation.from_quat(quaternion[[1, 2, 3, 0]]) * Rotation.from_rotvec(vector)
    return np.asarray(made.as_quat()[[3, 0, 1, 2]])


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The rotation vector, in body axes, from one quaternion to another."""
    inverse = Rotation.from_quat(one[[1, 2, 3, 0]]).inv()
    return np.asarray((inverse * Rotation.from_quat(other[[1, 2, 3, 0]])).as_rotvec())


def coverage(scenes: int, seed: int) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Pulls of all parameters, the chi-squares' cumulative probabilities by scene, and what went wrong."""
    pulls, shares, wrong = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(scenes):
            scene = a_scene(number, seed, Path(folder))
            found = rigidsim.fit(rigidsim.parse(scene.config))
            if not found.converged or found.undetermined:
                wrong.append(f"scene {number} ({scene.model.kind}): {found!r}")
                continue
            error = np.array([one.value for one in found.parameters]) - scene.true
            sigmas = np.array([one.sigma for one in found.parameters])
            covariance = found.dataset["covariance"].values
            pulls += list(error / sigmas)
            scaled = covariance / np.outer(sigmas, sigmas)
            pull = error / sigmas
            shares.append(float(chi2.cdf(pull @ np.linalg.solve(scaled, pull), len(pull))))
            if (number + 1) % 25 == 0:
                print(f"{number + 1} of {scenes} scenes", flush=True)
    return np.array(pulls), np.array(shares), wrong


def undetermined(number: int, seed: int, folder: Path) -> tuple[str, list[set[str]], list[set[str]]]:
    """A scene whose undetermined directions follow from symmetry or scaling: its name, the keys of those that
    there are, and of those that were found.
    """
    chance, noise = random.Random(f"{seed} null {number}"), np.random.default_rng([seed, 7, number])
    kind = ("free", "blind", "braked", "top", "vertical")[number % 5]
    model = drawn(chance, {"blind": "free", "vertical": "top"}.get(kind, kind))
    times = np.sort(noise.uniform(0, model.end, 60))
    keys: list[str] = [ATTITUDE, RATES, *MOMENTS]
    seen = ["attitude", "rates"]
    expected: list[set[str]] = [set(MOMENTS)]  # all moments times a number turn a free body alike
    if kind in (
        "blind",
        "vertical",
    ):  # rates don't show an attitude, those of a top no turn about the vertical
        keys, seen = [ATTITUDE, RATES, *MOMENTS[:2]], ["rates"]
        attitude = [f"{ATTITUDE}[{i}]" for i in range(3)]
        expected = [{key} for key in attitude] if kind == "blind" else [set(attitude)]
    if kind == "braked":
        keys.append("loads[0].coefficients")
        expected = [{*MOMENTS, *(f"loads[0].coefficients[{i}]" for i in range(3))}]
    if kind == "top":
        keys.append(LOADS["top"])
        expected = [{*MOMENTS, LOADS["top"]}]
    data = observed(model, times, chance, noise, folder / f"null{number}", seen)
    text = config_of(model, model) + f"[fit]\nparameters = {keys!r}\n".replace("'", '"') + data
    found = rigidsim.fit(rigidsim.parse(text))
    named = [set(one.keys) for one in found.undetermined]
    given = {one.key for one in found.parameters if one.sigma is not None}
    if any(given & keys for keys in named):
        named.append({"a sigma was given"})
    return kind, expected, named


def considered(seed: int, folder: Path) -> float:
    """Largest relative difference of the covariance with a considered load from the formula's."""
    chance, noise = random.Random(f"{seed} consider"), np.random.default_rng([seed, 9])
    model = drawn(chance, "top")
    times = np.sort(noise.uniform(0, model.end, 40))
    rows = model.rows("DOP853", 3e-14, np.array([0.0, *times]))[1:]
    sigma = 1e-3
    data = observations(folder / "rates.csv", times, rows[:, 4:], "angular_velocity", repr(sigma))
    known = 0.02 * model.load
    keys = [RATES, *MOMENTS[:2]]
    text = model.config + f"[fit]\nparameters = {keys!r}\n".replace("'", '"')
    text += f'consider."{LOADS["top"]}" = {{sigma = {known!r}}}\n' + data
    found = rigidsim.fit(rigidsim.parse(text))

    def moved(index: int, step: float) -> np.ndarray:
        rates, moments, load = model.rates.copy(), model.moments.copy(), model.load
        if index < 3:
            rates[index] += step
        elif index < 5:
            moments[index - 3] += step
        else:
            load -= step  # the acceleration is -load
        other = replace(model, rates=rates, moments=moments, load=load)
        return other.rows("DOP853", 3e-14, np.array([0.0, *times]))[1:, 4:].ravel()

    step = 1e-3  # of sixth order: 1e-18 of what is cut off, 1e-11 of rounding
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    slopes = np.stack(
        [
            sum(c * (moved(i, n * step) - moved(i, -n * step)) / step for n, c in weights.items())
            for i in range(6)
        ],
        axis=1,
    )
    normal = slopes[:, :5].T @ slopes[:, :5] / sigma**2
    plain = np.linalg.inv(normal)
    effect = -plain @ slopes[:, :5].T @ slopes[:, 5] / sigma**2
    expected = plain + np.outer(effect, effect) * known**2
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    return float(np.abs((found.dataset["covariance"].values - expected) / scale).max())


@Command
def campaign(scenes: int = 300, nulls: int = 50, seed: int = 1) -> int:
    """Print what came out; 1 if something failed.

    Args:
        nulls: scenes with undetermined directions.
    """
    pulls, shares, wrong = coverage(scenes, seed)
    failed = len(wrong)
    for text in wrong:
        print(f"FAILED {text}")
    if len(shares):
        p = float(kstest(shares, "uniform").pvalue)
        inside = [float((np.abs(pulls) < n).mean()) for n in (1, 2)]
        print(
            f"{len(shares)} scenes, {len(pulls)} parameters: Kolmogorov p = {p:.3f} of chi-squares, "
            f"{100 * inside[0]:.1f} % within one sigma (68.3), {100 * inside[1]:.1f} % within two (95.4), "
            f"largest {np.abs(pulls).max():.2f} sigmas"
        )
        failed += p < 0.01
        for share, expected in zip(inside, (0.6827, 0.9545), strict=True):
            chance = (expected * (1 - expected) / len(pulls)) ** 0.5  # of so few parameters
            failed += abs(share - expected) > max(0.03, 3 * chance)
    right = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(nulls):
            kind, expected, named = undetermined(number, seed, Path(folder))
            good = sorted(map(sorted, expected)) == sorted(map(sorted, named))
            right += good
            if not good:
                print(f"FAILED undetermined {number} ({kind}): {named}, expected {expected}")
        off = considered(seed, Path(folder))
    print(f"undetermined directions: {right} of {nulls} scenes right")
    print(f"covariance with a considered load: {off:.1e} from the formula at most")
    return int(failed > 0 or right < nulls or not off < 1e-6)
