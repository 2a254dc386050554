"""Every study passes at reduced length, draws its figure, and can fail."""

from __future__ import annotations

import functools
import subprocess
import sys
from pathlib import Path

import mpmath
import pytest
from matplotlib.image import imread
from test_documented_outputs import differences, shown_in

ROOT = Path(__file__).parents[2]

from experiments import all as everything  # noqa: E402
from experiments import closed_forms, common  # noqa: E402
from experiments.common import Check  # noqa: E402

GUIDE = ROOT / "experiments" / "README.md"
CHECKS = ROOT / "experiments" / "checks.md"
SLOW = {  # about how many seconds they take
    "apophis_flyby": 15,
    "averaged_motions": 100,
    "cassini_states": 40,
    "damped_averages": 30,
    "earth_obliquity": 25,
    "flip_period": 15,
    "flip_sphere": 10,
    "heavy_top_regimes": 15,
    "hyperion": 40,
    "luni_solar_precession": 15,
    "precession_and_nutation": 40,
    "round_off_ensemble": 25,
    "satellite_stability": 15,
    "spectral_lines": 15,
    "sweep_coverage": 20,
    "tumbling_averages": 15,
    "whole_cycle": 15,
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow(SLOW[name]) if name in SLOW else ())
        for name in everything.STUDIES
    ],
)
def test_study_passes_and_draws_and_the_guide_shows_its_rows(name: str, tmp_path: Path) -> None:
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
    head, rows = shown_checks()
    shown = [row for row in rows if row.startswith(f"| {name}: ")]
    made = [line for line in common.table(checks).splitlines() if line.startswith("|")]
    found = differences("\n".join([*head, *shown]), "\n".join(made))
    assert not found, "\n".join(["experiments/checks.md", *found])


def shown_checks() -> tuple[list[str], list[str]]:
    """The table of all studies: its two lines of head, and its rows."""
    (shown,) = (shown for shown in shown_in(CHECKS) if shown.stage == "studies")
    lines = shown.text.splitlines()
    return lines[:2], lines[2:]


def test_every_study_of_the_folder_is_in_the_list_and_in_the_guide() -> None:
    found = {path.stem for path in (ROOT / "experiments").glob("*.py") if "\ndef study(" in path.read_text()}
    assert found == set(everything.STUDIES)
    assert list(dict.fromkeys(row[2:].split(":")[0] for row in shown_checks()[1])) == [*everything.STUDIES]


def test_every_command_of_the_folder_is_in_the_guides_table() -> None:
    _, _, after = GUIDE.read_text(encoding="utf-8").partition("\n## All studies\n")
    listed = after.partition("\n## ")[0]
    commands = {
        path.stem for path in GUIDE.parent.glob("*.py") if '__name__ == "__main__"' in path.read_text()
    }
    assert len(commands) > 20
    missing = sorted(name for name in commands if f"`{name}`" not in listed)
    assert not missing, f"a row of experiments/README.md, All studies, is wanted for: {missing}"


@pytest.mark.slow
def test_a_wrong_expected_value_makes_the_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from experiments import earth_free_nutation as earth

    arguments = ["--out", str(tmp_path)]
    assert everything.main(["earth_free_nutation", "free_flight_energy", *arguments]) == 0
    assert "all passed" in capsys.readouterr().out
    wrong = functools.partial(earth.study, flattening="0.003273795")  # the eighth digit
    monkeypatch.setattr(earth, "study", wrong)
    assert common.main(earth.study, earth.NAME, arguments) == 1
    assert "FAILED" in capsys.readouterr().out
    assert everything.main(["earth_free_nutation", *arguments]) == 1
    assert "**FAILED**" in capsys.readouterr().out


@pytest.mark.slow
def test_a_study_runs_as_a_script(tmp_path: Path) -> None:
    script = ROOT / "experiments" / "earth_free_nutation.py"
    done = subprocess.run(
        [sys.executable, str(script), "--out", str(tmp_path / "out")],
        capture_output=True, text=True, cwd=tmp_path, check=False,
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
