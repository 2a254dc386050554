"""Every study passes at reduced length, draws its figure, and can fail."""

import functools
from pathlib import Path

import pytest
from matplotlib.image import imread

ROOT = Path(__file__).parents[2]

from experiments import all as everything  # noqa: E402

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
