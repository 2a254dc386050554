"""Every peer integrates the same motion; costs are read off curves rightly; absence is said, not hidden."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

ROOT = Path(__file__).parents[2]

from experiments import peer_comparison as study  # noqa: E402
from experiments.peers import ADAPTERS, campaign  # noqa: E402
from experiments.peers.child import measure, thinned  # noqa: E402
from experiments.peers.curves import STEPWISE, Point, angle, cost_at, frontier  # noqa: E402
from experiments.peers.scenes import SCENES  # noqa: E402

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


def test_a_satellite_has_no_closed_form() -> None:
    assert campaign.closed_form(SCENES["satellite"], 1.0) is None


def test_an_absent_peer_is_named_with_the_extra_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rebound.py").write_text("raise ImportError('No module named rebound')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    measured = campaign.measure(["rebound", "heyoka"], SHORT[:1], repeats=2, stride=20, fill=0.0)
    (note,) = measured.notes
    assert note.startswith("rebound left out: No module named")
    assert note.endswith('pip install "rigidsim[peers]"')
    assert {p.peer for p in measured.points.values()} == {"heyoka"}
    assert all(len(p.seconds) == 2 for p in measured.points.values())


def test_extras_hold_what_the_messages_promise() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for peer in set(ADAPTERS) - {"heyoka", "rigidsim"}:
        extra = campaign.how_to_install(peer).split("[")[1].split("]")[0]
        assert any(line.startswith(f"{peer}>=") for line in project["optional-dependencies"][extra])


def test_mistyped_peers_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        study.main(["--peers", "heyoka,reboun"])
    assert stop.value.code == 2
    assert "given reboun; known: heyoka" in capsys.readouterr().err


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


def curve_of(exponent: float, factor: float, errors: list[float], title: str = "a") -> list[Point]:
    return [Point("p", title, "s", 1.0, e, e, seconds=[factor * e**-exponent]) for e in errors]


@given(st.floats(0.01, 2), st.floats(1e-6, 1e3), st.floats(-11.9, -3.1))
def test_a_power_law_is_read_off_exactly(exponent: float, factor: float, logarithm: float) -> None:
    points = curve_of(exponent, factor, [1e-3, 1e-5, 1e-6, 1e-9, 1e-12])
    error = 10**logarithm
    expected = factor * error**-exponent
    # logarithms of up to 60 carry 60 eps into the exponential
    assert cost_at(points, error) == pytest.approx(expected, rel=1e-12)


def test_no_curve_is_extended_and_the_cheapest_way_counts() -> None:
    points = curve_of(0.1, 1.0, [1e-4, 1e-8]) + curve_of(0.1, 0.5, [1e-7, 1e-10], "b")
    assert cost_at(points, 1e-11) is None
    assert cost_at(points, 1e-10) == pytest.approx(5.0)
    assert cost_at(points, 1e-6) == pytest.approx(0.5 * 1e-7**-0.1)  # b's loosest, not less
    assert cost_at([], 1e-3) is None
    assert cost_at(curve_of(0.1, 1.0, [1e-4, 1e-8], STEPWISE[0]), 1e-6) == pytest.approx(1e-8**-0.1)


def test_the_frontier_drops_what_another_beats_in_both() -> None:
    worse = Point("p", "a", "s", 1.0, 0.0, error=1e-5, seconds=[9.0])
    best = curve_of(0.1, 1.0, [1e-4, 1e-8])
    failed = Point("p", "a", "s", 1.0, 0.0, error=math.nan, seconds=[0.1])
    assert frontier([worse, failed, *best]) == best


@given(st.floats(1e-15, 3.1), st.sampled_from([1.0, -1.0, 0.5]))
def test_the_angle_between_attitudes_ignores_sign_and_norm(turned: float, factor: float) -> None:
    with mpmath.workdps(50):
        half = mpmath.mpf(turned) / 2
        there = [factor * mpmath.cos(half), 0, factor * mpmath.sin(half), 0]
        assert angle(there, [1, 0, 0, 0]) == pytest.approx(turned, rel=1e-15)


def test_the_tightest_setting_is_always_measured() -> None:
    assert thinned([5.0, 4.0, 3.0, 2.0, 1.0], 3) == [4.0, 1.0]
    assert thinned([3.0, 2.0, 1.0], 3) == [3.0, 2.0, 1.0]


def test_slow_calls_are_not_repeated_and_the_fastest_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 1.0, 1.0, 4.0, 0.0, 1.0, 1.0, 1.5, 1.5, 1.75, 1.75, 2.75])
    monkeypatch.setattr("experiments.peers.child.time.process_time", lambda: next(clock))
    slow = measure(lambda: lambda: [1.0, 0.0, 0.0, 0.0], fill=0.0)
    assert (slow["prepare"], slow["seconds"]) == (1.0, 3.0)
    fast = measure(lambda: lambda: [1.0, 0.0, 0.0, 0.0], fill=0.0)
    assert (fast["prepare"], fast["seconds"]) == (1.0, 0.25)
