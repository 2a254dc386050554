"""Every study passes at reduced length, draws its figure, and can fail."""

from __future__ import annotations

import functools
import subprocess
import sys
from pathlib import Path

import mpmath
import numpy as np
import pytest
import xarray
from matplotlib.image import imread

from experiments import long_horizon, peer_comparison
from experiments.peers import ADAPTERS, campaign
from experiments.peers.scenes import SCENES

ROOT = Path(__file__).parents[2]

from experiments import all as everything  # noqa: E402
from experiments import closed_forms  # noqa: E402
from experiments.common import Check  # noqa: E402

# some seconds each; `python -m experiments.all` runs all studies, before a version
IN_CI = ("earth_free_nutation", "toutatis")


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_CI)
def test_study_passes_and_draws(name: str, tmp_path: Path) -> None:
    checks, broken = everything.run_studies([name], False, tmp_path)
    failed = [check.row for check in checks if not check.passed]
    assert checks
    assert not broken
    assert not failed, "\n".join(failed)
    assert all(check.source for check in checks)
    pixels = imread(tmp_path / f"{name}.png")[:, :, :3]
    inked = (pixels < 0.9).any(axis=2).mean()
    assert pixels.shape[0] >= 500
    assert pixels.shape[1] >= 1000
    assert 0.01 < inked < 0.9


def test_every_study_is_in_the_list_and_every_command_in_the_guide() -> None:
    folder = ROOT / "experiments"
    texts = {path.stem: path.read_text(encoding="utf-8") for path in folder.glob("*.py")}
    assert {name for name, text in texts.items() if "\n@Study\ndef study(" in text} == set(everything.STUDIES)
    guide = (folder / "README.md").read_text(encoding="utf-8")
    commands = {name for name, text in texts.items() if '__name__ == "__main__"' in text}
    missing = sorted(name for name in commands if f"`{name}`" not in guide and f".{name}`" not in guide)
    assert not missing, f"experiments/README.md says nothing of: {missing}"


@pytest.mark.slow
def test_a_wrong_expected_value_makes_the_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from experiments import earth_free_nutation as earth

    arguments = ["--out", str(tmp_path)]
    assert everything.main(["earth_free_nutation", "toutatis", *arguments]) == 0
    assert "all passed" in capsys.readouterr().out
    wrong = functools.partial(earth.study.measure, flattening="0.003273795")  # the eighth digit
    monkeypatch.setattr(earth.study, "measure", wrong)
    assert earth.study.main(arguments) == 1
    assert "FAILED" in capsys.readouterr().out
    assert everything.main(["earth_free_nutation", *arguments]) == 1
    assert "**FAILED**" in capsys.readouterr().out


@pytest.mark.slow
def test_a_study_runs_as_a_command(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "experiments.earth_free_nutation", "--out", str(tmp_path / "out")],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "all passed" in done.stdout
    assert (tmp_path / "out" / "earth_free_nutation.png").exists()


def check(measured: float, kind: str = "relative", tolerance: float = 0.1) -> Check:
    return Check("x", measured, 10.0, tolerance, "s", "nowhere", kind)  # type: ignore[arg-type]


def test_closed_forms_agree_with_quadrature() -> None:
    with mpmath.workdps(30):
        moments, rates = (
            [mpmath.mpf(m) for m in ("3.09", "3.22", "1")],
            [mpmath.mpf(w) for w in ("2", "3", "9.8")],
        )
        top = closed_forms.free_top(moments, rates)
        assert top.m + top.complement == pytest.approx(1, abs=1e-25)
        # sn^2 of the rates from the amplitudes: phi' = L (I1 w1^2 + I2 w2^2) / (L^2 - I3^2 w3^2)
        twice = sum(i * w * w for i, w in zip(moments, rates, strict=True))
        square = top.momentum**2

        def rate(u: mpmath.mpf) -> mpmath.mpf:
            sn = mpmath.ellipfun("sn", u, m=top.m)
            w2 = (square - twice * top.i3) / (top.i2 * (top.i2 - top.i3)) * sn**2
            e3 = (square - twice * top.i1 - top.i2 * (top.i2 - top.i1) * w2) / (top.i3 - top.i1)  # I3 w3^2
            return top.momentum * (twice - e3) / (square - top.i3 * e3)

        quarter = mpmath.ellipk(top.m)
        assert abs(mpmath.quad(rate, [0, quarter]) / quarter - top.precession) < mpmath.mpf("1e-20")

        a, c, mu = mpmath.mpf("2e-4"), mpmath.mpf("1e-4"), mpmath.mpf("0.0392266")
        heavy = closed_forms.heavy_top(
            a, c, mu, mpmath.mpf("0.5"), [mpmath.mpf(0), mpmath.mpf(2), mpmath.mpf(100)]
        )

        def azimuth(u: mpmath.mpf) -> mpmath.mpf:
            height = heavy.u1 + (heavy.u2 - heavy.u1) * mpmath.ellipfun("sn", u, m=heavy.m) ** 2
            return (heavy.vertical - heavy.axial * height) / (a * (1 - height**2))

        # at the turning points all energy is in the precession and the height
        for u in (heavy.u1, heavy.u2):
            rate = (heavy.vertical - heavy.axial * u) / (a * (1 - u * u))
            energy = a * rate**2 * (1 - u * u) / 2 + mu * u
            start = a * 4 / mpmath.mpf(2) + mu * mpmath.cos(mpmath.mpf("0.5"))
            assert abs(energy - start) < mpmath.mpf("1e-25")
        quarter = mpmath.ellipk(heavy.m)
        assert abs(mpmath.quad(azimuth, [0, quarter]) / quarter - heavy.precession) < mpmath.mpf("1e-20")


# ---- every peer integrates the same motion; costs are read off curves rightly; absence is said, not hidden

SHORT = [(name, 16.0) for name in SCENES]


@pytest.fixture(scope="module")
def reports() -> dict[str, campaign.Measured]:
    """A few settings of each peer over 16 s, as far as they are installed."""
    return {}


def short_runs(reports: dict[str, campaign.Measured], peer: str) -> campaign.Measured:
    if peer not in reports:
        reports[peer] = campaign.measure(
            [peer], SHORT, repeats=1, stride=20 if peer == "rigidsim" else 6, fill=0.0, fewest=1, cap=0.5
        )
    return reports[peer]


@pytest.mark.parametrize(
    "peer", [pytest.param(p, marks=pytest.mark.slow if p in ("rigidsim", "heyoka") else ()) for p in ADAPTERS]
)
def test_errors_against_128_bits_vanish_as_the_setting_gets_tighter(
    peer: str, reports: dict[str, campaign.Measured]
) -> None:
    measured = short_runs(reports, peer)
    if peer not in measured.imports:
        assert any(f"{peer} left out" in note and "pip install" in note for note in measured.notes)
        pytest.skip(measured.notes[0])
    assert not [note for note in measured.notes if "broke down" in note]
    curves = {(p.scene, p.title) for p in measured.points.values()}
    assert curves
    for scene, title in curves:
        curve = [p for p in measured.points.values() if (p.scene, p.title) == (scene, title)]
        loose, tight = curve[0], curve[-1]
        if title == "MuJoCo implicit":  # first order: 2^8 times smaller steps, as much smaller errors
            assert tight.error < loose.error * (tight.knob / loose.knob) ** 0.8
        else:
            # another motion would be off by radians; nine digits are within reach of each in these 16 s
            assert tight.error < (1e-5 if peer == "mujoco" else 1e-9), (scene, title)
            assert tight.error <= max(loose.error, 2.0**-51)  # of two at a double's end either may win


@pytest.mark.slow
def test_the_command_prints_ratios_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--short", "--scenes", "free_top", "--peers", "heyoka,scipy", "--repeats", "1"]
    assert peer_comparison.main([*arguments, "--cap", "0.1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "| scene, horizon | error, rad | bare heyoka, CPU ms | scipy |" in printed
    # a compiled Taylor method against a step loop in Python: far more than any noise of the machine
    row = next(line for line in printed.splitlines() if "| 1e-06 |" in line)
    assert float(row.split("|")[4]) > 5
    pixels = imread(tmp_path / "peer_comparison.png")[:, :, :3]
    assert 0.01 < (pixels < 0.9).any(axis=2).mean() < 0.9


# ---- the study of long runs: its fit knows the laws, and its measurement the closed form

HORIZON = 3e3


def made_up(walk: float, drift: float, starts: int = 400, horizon: float = 1e7) -> xarray.Dataset:
    """Random walks of a rate, which tilt a phase, with a constant drift of the rate beside them."""
    moments = np.array(long_horizon.times(horizon)[1:])
    generator = np.random.default_rng(1)
    steps = np.diff(moments, prepend=0.0)
    rate = walk * np.cumsum(generator.standard_normal((starts, len(moments))) * np.sqrt(steps), axis=1)
    rate += drift * moments
    phase = np.cumsum(rate * steps, axis=1)
    errors = np.abs(np.array([rate, rate, phase]))
    return xarray.Dataset(
        {"error": (("quantity", "start", "time"), errors), "cpu_seconds": ("start", np.zeros(starts))},
        coords={"quantity": list(long_horizon.QUANTITIES), "time": moments},
        attrs={"body": "free asymmetric body", "precision": "double", "held": 0},
    )


def test_a_random_walk_has_the_exponents_of_brouwer() -> None:
    data = made_up(1e-17, 0.0)
    for quantity in long_horizon.QUANTITIES:
        fitted = long_horizon.fit(data, quantity)
        assert fitted is not None
        # four times the uncertainty that the fit itself claims, over 400 walks of some per cent
        assert abs(fitted.exponent - long_horizon.LAW[quantity]) < 4 * fitted.sigma + 0.02
        assert fitted.sigma < 0.05
    assert all(check.passed for check in long_horizon.checks([data]))


@pytest.fixture(scope="module")
def measured() -> dict[tuple[str, bool], xarray.Dataset]:
    return {
        (body, held): long_horizon.measure(body, "double", held, HORIZON, starts=3)
        for body in long_horizon.BODIES
        for held in (False, True)
    }


@pytest.mark.slow
@pytest.mark.parametrize("body", long_horizon.BODIES)
def test_errors_stay_within_the_law(body: str, measured: dict[tuple[str, bool], xarray.Dataset]) -> None:
    plain, held = (measured[body, h]["error"].sel(quantity="attitude") for h in (False, True))
    # five times (eps/2) sqrt(steps) t / sqrt 3 with at most 4 steps to a radian: five sigma of a random walk
    law = 5 * 2.0**-53 * (4 * HORIZON) ** 0.5 * HORIZON * 1.5 / 3**0.5
    assert plain.max() < law
    assert (plain > 0).all()
    # held: no more than some eps to a radian is left
    assert held.max() < 8 * 2.0**-52 * HORIZON
