"""``accuracy``: the choice is cheap and says why, and the certificate tells the truth about the run."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest
import xarray
from support import cases, config, same_bits, unoptimised_code
from support import run_estimated as run_text

import rigidsim
from experiments.random_scenes import KINDS, random_scene
from rigidsim import ConfigError
from rigidsim.accuracy.choice import certify, choose, chosen
from rigidsim.accuracy.comparison import angles_between, try_setting
from rigidsim.accuracy.setting import Setting

FREE = config(name="free", estimate=True)
CHAOTIC = config(
    "principal_moments = [1, 1.4, 2]\nmass = 1\ncenter_of_mass = [0.3, 0.2, 0.5]",
    loads='kind = "uniform_gravity"\nacceleration = [0, 0, -3]',
    estimate=True,
)


def test_a_quaternion_and_its_opposite_are_one_attitude() -> None:
    """Attitudes 1e-20 to 1e-12 rad apart, from two parts of float64 each; half of them of opposite sign."""
    random = np.random.default_rng(5)
    one = random.normal(size=(20, 4))
    one /= np.linalg.norm(one, axis=1)[:, None]
    across = random.normal(size=(20, 4))
    across -= np.sum(across * one, axis=1)[:, None] * one
    angles = 10.0 ** random.uniform(-20, -12, size=20)
    small = across / np.linalg.norm(across, axis=1)[:, None] * (angles / 2)[:, None]
    signs = np.where(np.arange(20) % 2, 1.0, -1.0)[:, None]
    found = angles_between([one, np.zeros_like(one)], [signs * one, signs * small])
    np.testing.assert_allclose(found, angles, rtol=1e-12)


def experiment(text: str, accuracy: Any, end: Any, *more: str, samples: int = 5) -> rigidsim.Experiment:
    settings = [f"time.end={end}", f"time.samples={samples}", f"integrator.accuracy={accuracy}"]
    return rigidsim.parse(text, overrides=[*settings, "output.timeline=false", *more])


def true_error(run: rigidsim.Run, of: rigidsim.Experiment) -> float:
    """Largest attitude error over all samples, against thirty digits or sixty."""
    with run.dataset as dataset:
        names = [n for n in ("quaternion", "quaternion_lo", "quaternion_lo2") if n in dataset]
        parts = [dataset[n].values for n in names]
        clock = [dataset[n.replace("quaternion", "time")].values for n in names]
    times = [mpmath.mpf(0) + sum(mpmath.mpf(float(x)) for x in row) for row in zip(*clock, strict=True)]
    truth = try_setting(of, Setting("quadruple", 1e-30), times, compact=True)
    return float(angles_between(parts, truth.attitudes).max())


# (a plunge may be refused before it begins)
SURE = [kind for kind in KINDS if kind != "plunge"]


@pytest.mark.parametrize("number", cases(range(len(SURE)), range(1)), ids=SURE)
def test_every_kind_of_scene_is_certified_to_what_is_true(number: int, tmp_path: Path) -> None:
    scene = random_scene(number, seed=1)
    asked = 10 ** (-5 - number % 6)
    whole = rigidsim.parse(scene.text)
    end = float(whole.config.time.end.rational) * min(1.0, 20 / scene.radians)  # type: ignore[union-attr]
    short = experiment(scene.text, asked, repr(end))
    run = rigidsim.run(short, out=tmp_path)
    summary = run.summary["accuracy"]
    assert true_error(run, short) <= summary["certified"] <= asked == summary["requested"]
    assert summary["times_compared"] == 5
    assert summary["how"].startswith("against")
    assert summary["chosen"]
    assert run.summary["cost"]["seconds"]["certify"] > 0
    assert run.summary["cost"]["seconds"]["choose"] > 0


@pytest.mark.slow
def test_what_was_chosen_runs_again_from_the_dataset_without_choosing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = rigidsim.run(experiment(FREE, 1e-8, 60), out=tmp_path / "first")
    monkeypatch.setattr("rigidsim.accuracy.choice.choose", None)  # to call it would be an error
    saved = rigidsim.load(run.folder.config)
    again = rigidsim.run(saved, out=tmp_path / "again")
    same_bits(run, again)
    assert again.summary["accuracy"]["certified"] == run.summary["accuracy"]["certified"]


@pytest.mark.slow
@pytest.mark.unoptimised
def test_keys_that_are_given_stay() -> None:
    given = {"precision": '"single"', "tolerance": "1e-13", "formulation": '"rotation_matrix"',
             "hold_invariants": "true", "method": '"taylor"'}  # fmt: skip
    for key, value in given.items():
        of = experiment(FREE, 1e-4, 20, f"integrator.{key}={value}")
        setting, choice = chosen(of)
        assert choice is not None
        kept, asked = (getattr(e.config.integrator, key) for e in (setting, of))
        assert kept == asked


def test_what_no_setting_reaches_is_refused_with_what_can_be_met(tmp_path: Path) -> None:
    of = experiment(FREE, 1e-9, 1000, 'integrator.precision="single"')
    with pytest.raises(ConfigError) as refusal:
        rigidsim.run(of, out=tmp_path)
    text = str(refusal.value)
    assert "[integrator] accuracy" in text
    assert "given 1e-09 rad at the end, which no setting open to it reaches" in text
    assert "would be right to about" in text
    assert "s; ask for less, or leave precision, tolerance and method open" in text
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_chaos_is_refused_where_no_digit_would_be_left_and_takes_digits_where_they_help(
    tmp_path: Path,
) -> None:
    with pytest.raises(
        ConfigError, match=r"would keep no digit.*errors here grow e-fold every .* nearer end"
    ):
        rigidsim.run(experiment(CHAOTIC, 1e-6, 400, 'integrator.precision="double"'), out=tmp_path)
    assert not list(tmp_path.iterdir())
    choice = choose(experiment(CHAOTIC, 1e-6, 60), 1e-6)
    stable = choose(experiment(FREE, 1e-6, 60, 'integrator.method="taylor"'), 1e-6)
    assert choice.setting.tolerance < stable.setting.tolerance


def forged(run: rigidsim.Run, change: Any) -> Any:
    """A finished run whose dataset says something else."""
    with run.dataset as dataset:
        other: xarray.Dataset = dataset.load().copy(deep=True)
    change(other["quaternion"].values)
    return SimpleNamespace(dataset=other)


def turned(angle: float, rows: slice) -> Any:
    """Quaternions turned about the body's x axis, in place."""

    def change(q: np.ndarray) -> None:
        w, x, y, z = q[rows].T
        s, c = math.sin(angle / 2), math.cos(angle / 2)
        q[rows] = np.array([c * w - s * x, c * x + s * w, c * y + s * z, c * z - s * y]).T

    return change


def test_a_wrong_run_gets_no_certificate(tmp_path: Path) -> None:
    """Wrong in one sample of three hundred."""
    of = experiment(FREE, 1e-9, 60, samples=300)
    run = rigidsim.run(of, out=tmp_path)
    saved = rigidsim.load(run.folder.config)
    for change, least, most in ((lambda _: None, 0, 1e-9), (turned(1e-6, slice(123, 124)), 1e-6, 2e-6)):
        found = certify(forged(run, change).dataset, saved, accuracy=1e-9)
        assert found is not None
        assert least <= found.error <= most  # its safety is 1.25


@pytest.mark.slow
@pytest.mark.unoptimised
def test_runs_without_an_attitude_and_runs_that_stop_are_certified() -> None:
    record = 'output.record=["angular_velocity"]'
    run = rigidsim.run(experiment(FREE, 1e-9, 20, record, samples=2), out=None)
    assert run.summary["accuracy"]["certified"] <= 1e-9
    stop = '[[events]]\nname = "flip"\nexpression = "wy - 0.99"\naction = "stop"\n'
    of = experiment(FREE + stop, 1e-9, 20)
    run = rigidsim.run(of, out=None)
    assert run.status == "finished: event"
    assert true_error(run, of) <= run.summary["accuracy"]["certified"] <= 1e-9


# ---- ``accuracy_position``: settings are chosen for the path as well, and what it kept is certified

ATTRACTORS = config(
    "principal_moments = [1, 1.3, 1.6]\nmass = 1",
    "angular_velocity = [0.02, 0.05, 0.01]\nposition = [30, 0, 2]\nvelocity = [0, 0.25, 0]",
    [
        'kind = "central_gravity"\ngravitational_parameter = 1\nposition = [4, 0, 0]',
        'kind = "central_gravity"\ngravitational_parameter = 1\nposition = [-4, 0, 0]',
    ],
    "end = 400\nsamples = 5",
)


@pytest.mark.slow
@unoptimised_code()
def test_the_path_is_certified_and_right() -> None:
    run = run_text(ATTRACTORS, "integrator.accuracy_position=1e-6")
    accuracy = run.summary["accuracy"]
    assert not run.summary["warnings"]
    assert accuracy["requested"] is None
    assert accuracy["certified_position"] <= accuracy["requested_position"] == 1e-6
    better = run_text(ATTRACTORS, 'integrator.precision="extended"', 'name="better"')
    with run.dataset as ours, better.dataset as theirs:
        off = np.linalg.norm(ours["position"].values - theirs["position"].values, axis=1).max()
    assert off <= accuracy["certified_position"]


@pytest.mark.slow
def test_what_a_fixed_setting_misses_is_said() -> None:
    fixed = ['integrator.precision="double"', "integrator.tolerance=1e-4", 'integrator.method="taylor"']
    run = run_text(ATTRACTORS, "integrator.accuracy_position=1e-12", *fixed)
    assert "not_certified" in run.summary["warning_codes"]
    assert any("accuracy_position = 1e-12 m was asked for" in text for text in run.summary["warnings"])
