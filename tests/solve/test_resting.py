"""Rest where two surfaces meet: a relay on an angle and friction on its rate, against the swings by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import EPSILON, config, run_text, same_bits

import rigidsim

SPHERE = "principal_moments = [1, 1, 1]"
TURNED = "euler_angles = [0, 0, 0.5]\nangular_velocity = [0, 0, 0.3]"
STILL = "euler_angles = [0, 0, 0]\nangular_velocity = [0, 0, 0]"
RELAY, DRY = 0.4, 0.2
PARKED = f"-{RELAY}*sign(psi) - {DRY}*sign(wz)"


def parked(
    torque: str,
    initial: str = TURNED,
    time: str = "end = 20\nsamples = 41",
    integrator: str = "",
    others: str = '"0", "0"',
    **rest: Any,
) -> rigidsim.Run:
    """A sphere about z, its angle psi that of the turn."""
    return run_text(
        config(
            SPHERE,
            initial,
            f'kind = "torque"\ncomponents = [{others}, "{torque}"]',
            time,
            f'euler_sequence = "xyz"\n{integrator}',
            'record = ["angular_velocity", "euler_angles"]',
        ),
        **rest,
    )


def by_hand(times: np.ndarray, angle: float, rate: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Angles and rates of the swings at ascending times, and when they are over: parabolas one by one."""
    found, begin = np.zeros((2, len(times))), 0.0
    for _ in range(200):
        outwards = angle == 0 or angle * rate > 0  # or back to zero from a rest
        pull = -math.copysign(RELAY + (DRY if outwards else -DRY), angle or rate)
        lasts = abs(rate / pull) if outwards else math.sqrt(2 * abs(angle / pull))
        inside = (times >= begin) & (times <= begin + lasts)
        t = times[inside] - begin
        found[:, inside] = angle + rate * t + pull * t * t / 2, rate + pull * t
        begin += lasts
        angle, rate = (angle + rate * lasts / 2, 0.0) if outwards else (0.0, pull * lasts)
    return *found, begin


def test_swings_come_to_rest_where_and_when_they_do_by_hand() -> None:
    run = parked(f"{RELAY}*sign(-2*psi) + {DRY}*sign(-wz)")
    assert run.status == "finished"
    times = run.dataset["time"].values
    angles, rates, over = by_hand(times, 0.5, 0.3)
    assert 8.0 < over < 8.1
    psi, wz = run.dataset["euler_angles"].values[:, 2], run.dataset["angular_velocity"].values[:, 2]
    # some sixty switches, at each a rounding of the time, by which the largest torque acts too long
    bound = 60 * 8 * EPSILON["double"] * (RELAY + DRY)
    assert np.abs(wz - rates).max() < bound
    assert np.abs(psi - angles).max() < bound
    resting = times > over
    assert resting.sum() > 20
    assert (np.abs(wz[resting]) == 0).all()
    assert (np.abs(psi[resting]) < 1e-30).all()


def test_it_rests_until_what_pulls_is_stronger_than_both() -> None:
    """From rest, 0.1 t against 0.6: pulled off after 6 s, and then w' = 0.1 (t - 6)."""
    run = parked(f"{PARKED} + 0.1*t", STILL, "end = 8\nsamples = 9")
    assert run.status == "finished"
    times = run.dataset["time"].values
    late = np.maximum(times - 6, 0)
    psi, wz = run.dataset["euler_angles"].values[:, 2], run.dataset["angular_velocity"].values[:, 2]
    assert np.abs(wz - late**2 / 20).max() < 64 * EPSILON["double"]  # of a run of three steps
    assert np.abs(psi - late**3 / 60).max() < 64 * EPSILON["double"]


def test_beside_friction_about_other_axes() -> None:
    """All three rates come to rest, and the angle does, on four surfaces."""
    initial = "euler_angles = [0, 0, 0.5]\nangular_velocity = [0.1, 0.05, 0.3]"
    run = parked(PARKED, initial, others='"-0.2*sign(wx)", "-0.2*sign(wy)"')
    assert run.status == "finished"
    assert (run.dataset["angular_velocity"].values[-1] == 0).all()
    psi = run.dataset["euler_angles"].values[-1]
    assert abs(psi[2]) < 16 * EPSILON["double"]
    assert abs(psi[0]) > 1e-3  # which nothing brings back


def test_what_could_swing_either_way_is_not_decided() -> None:
    """Friction of the wrong sign: swings grow from nothing."""
    run = parked(f"-{RELAY}*sign(psi) + 0.1*sign(wz)", STILL)
    assert run.status == "stopped: switching unresolved"
    assert "swings about it grow" in run.summary["message"]


@pytest.mark.slow
def test_resumed_at_rest_it_rests(tmp_path: Path) -> None:
    text = f"{PARKED} + step(t - 15)"
    whole = parked(text, out=tmp_path / "whole")
    steps = whole.summary["cost"]["steps"]
    part = run_text(
        (whole.folder.path / "config.toml").read_text(),
        "limits.max_steps=63",
        'name="part"',
        out=tmp_path / "part",
    )
    assert part.status == "stopped: max_steps"
    assert steps > 63
    assert part.summary["time_reached"] > 8.1
    same_bits(rigidsim.resume(part.folder.path), whole)
