"""Every study passes at reduced length, draws its figure, and can fail."""

import functools
from pathlib import Path

import mpmath
import pytest
from matplotlib.image import imread

ROOT = Path(__file__).parents[2]

from experiments import all as everything  # noqa: E402
from experiments import closed_forms  # noqa: E402
from experiments.common import Check  # noqa: E402

# some seconds each; `python -m experiments.all` runs all studies, before a version
IN_CI = ("earth_free_nutation", "spectral_lines")


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
    commands = {name for name, text in texts.items() if "\n@Study\n" in text or "\n@Command\n" in text}
    missing = sorted(name for name in commands if f"`{name}`" not in guide and f".{name}`" not in guide)
    assert not missing, f"experiments/README.md says nothing of: {missing}"


@pytest.mark.slow
def test_a_wrong_expected_value_makes_the_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from experiments import earth_free_nutation as earth

    arguments = ["--out", str(tmp_path)]
    assert everything.main(["earth_free_nutation", *arguments]) == 0
    assert "all passed" in capsys.readouterr().out
    wrong = functools.partial(earth.study.measure, flattening="0.003273795")  # the eighth digit
    monkeypatch.setattr(earth.study, "measure", wrong)
    assert earth.study.main(arguments) == 1
    assert "FAILED" in capsys.readouterr().out
    assert everything.main(["earth_free_nutation", *arguments]) == 1
    assert "**FAILED**" in capsys.readouterr().out


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
