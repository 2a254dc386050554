"""Every peer integrates the same motion; costs are read off curves rightly; absence is said, not hidden."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from matplotlib.image import imread

from experiments import peer_comparison as study
from experiments.peers import ADAPTERS, campaign
from experiments.peers.curves import angle
from experiments.peers.scenes import SCENES

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
def test_rigidsim_and_bare_heyoka_agree_to_round_off(reports: dict[str, campaign.Measured]) -> None:
    measured = short_runs(reports, "heyoka"), short_runs(reports, "rigidsim")
    for scene, end in SHORT:
        # three times the round-off law at tolerance eps, (eps/2) sqrt(steps) |w| t / sqrt 3 (Brouwer 1937);
        # steps of a third of a radian and more; the last bits of the quaternion itself
        turned = SCENES[scene].rate * end
        law = 3 * 2.0**-53 * math.sqrt(3 * turned) * turned / math.sqrt(3) + 2.0**-51
        for report, title in zip(measured, ("bare heyoka, double", "rigidsim, quaternion"), strict=True):
            points = [p for p in report.points.values() if p.scene == scene and p.title == title]
            assert points[-1].knob == 2.0**-52
            assert points[-1].error < law


@pytest.mark.parametrize("name", ["free_top", "heavy_top"])
def test_the_reference_is_the_closed_form(name: str) -> None:
    scene = SCENES[name]
    end = scene.ends[0]
    truth = campaign.closed_form(scene, end)
    assert truth is not None
    # 128-bit arithmetic at tolerance 1e-32: the law with that for eps, and steps of a tenth of a radian
    turned = scene.rate * end
    law = 3 * 1e-32 / 2 * math.sqrt(10 * turned) * turned / math.sqrt(3)
    assert angle(campaign.reference(name, end), truth) < law


@pytest.mark.slow
def test_the_command_prints_ratios_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--short", "--scenes", "free_top", "--peers", "heyoka,scipy", "--repeats", "1"]
    assert study.main([*arguments, "--cap", "0.1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "| scene, horizon | error, rad | bare heyoka, CPU ms | scipy |" in printed
    # a compiled Taylor method against a step loop in Python: far more than any noise of the machine
    row = next(line for line in printed.splitlines() if "| 1e-06 |" in line)
    assert float(row.split("|")[4]) > 5
    pixels = imread(tmp_path / "peer_comparison.png")[:, :, :3]
    assert 0.01 < (pixels < 0.9).any(axis=2).mean() < 0.9
