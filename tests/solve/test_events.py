"""Events: crossings to full precision, found however the run is driven."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from support import EPSILON, amplification, angle_between, cases, config, law, run_text, wide

import rigidsim
from rigidsim import ConfigError
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing

FLIPS = config(
    "principal_moments = [1, 2, 3]",
    "angular_velocity = [0.0625, 1, 0.0625]\neuler_angles = [0.1, 1, 0.2]",
    time="end = 200\nsamples = {samples}",
)
FLIP = '[[events]]\nname = "flip"\nexpression = "wy"\n'


def flip_interval() -> mpmath.mpf:
    """2 K(k) / p of the asymmetric free top (Landau & Lifshitz, Mechanics, section 37)."""
    with mpmath.workdps(50):
        i1, i2, i3 = mpmath.mpf(1), mpmath.mpf(2), mpmath.mpf(3)
        w1, w2, w3 = mpmath.mpf(1) / 16, mpmath.mpf(1), mpmath.mpf(1) / 16
        energy2 = i1 * w1**2 + i2 * w2**2 + i3 * w3**2
        square = (i1 * w1) ** 2 + (i2 * w2) ** 2 + (i3 * w3) ** 2
        if square < energy2 * i2:  # the axis that L circles is the other one
            i1, i3 = i3, i1
        p = mpmath.sqrt((square - energy2 * i1) * (i3 - i2) / (i1 * i2 * i3))
        m = (square - energy2 * i3) * (i1 - i2) / ((square - energy2 * i1) * (i3 - i2))
        return 2 * mpmath.ellipk(m) / p


@pytest.mark.parametrize(
    ("precision", "epsilon"),
    [("double", 2.0**-52), pytest.param("quadruple", 2.0**-112, marks=pytest.mark.campaign)],
)
def test_flips_come_at_the_interval_of_the_closed_form(precision: str, epsilon: float) -> None:
    both = FLIP + FLIP.replace('"flip"', '"down"') + 'direction = "down"\n'
    run = run_text(FLIPS.format(samples=11) + both, f'integrator.precision="{precision}"')
    names = [n for n in ("flip_time", "flip_time_lo", "flip_time_lo2") if n in run.dataset]
    with mpmath.workdps(50):
        times = [
            sum(mpmath.mpf(float(x)) for x in reversed(parts))
            for parts in zip(*(run.dataset[n].values for n in names), strict=True)
        ]
        intervals = [b - a for a, b in pairwise(times)]
        # an error e of the invariants shifts a flip by e over the square of the offset 1/16 (and over a rate
        # of about 0.6); errors of some steps' rounding at each of some hundred steps
        allowed = 100 * epsilon * 16**2
        assert len(intervals) > 10
        assert max(abs(x - flip_interval()) for x in intervals) < allowed
    # at the crossing the rate is zero to the rounding of its dense output
    assert np.abs(run.dataset["flip_angular_velocity"].values[:, 1]).max() < 100 * epsilon
    assert run.summary["events"] == {"flip": len(times), "down": (len(times) + 1) // 2}
    assert np.array_equal(run.dataset["down_time"], run.dataset["flip_time"][::2])


def test_events_do_not_depend_on_the_samples_or_on_how_the_run_is_driven() -> None:
    setting = 'integrator.formulation="euler_angles"'
    expected = run_text(FLIPS.format(samples=2001) + FLIP, setting).dataset.load()
    sparse = run_text(FLIPS.format(samples=3) + FLIP, setting, 'name="sparse"').dataset
    assert np.array_equal(expected["flip_time"], sparse["flip_time"])
    # skips that go too far are taken back, and their events with them
    tuning = Tuning(Pacing(chunk_seconds=10.0, skipped_from=2, margin=1.7, spare=0.0))
    driven = run_text(FLIPS.format(samples=3) + FLIP, setting, 'name="driven"', tuning=tuning)
    assert driven.summary["cost"]["steps_redone"] > 0
    assert np.array_equal(expected["flip_time"], driven.dataset["flip_time"])
    assert np.array_equal(sparse["flip_quaternion"], driven.dataset["flip_quaternion"])


def test_a_run_can_end_at_an_event() -> None:
    whole = run_text(FLIPS.format(samples=2001) + FLIP, 'name="whole"').dataset
    run = run_text(FLIPS.format(samples=2001) + FLIP + 'action = "stop"\n')
    assert run.status == "finished: event"
    assert run.summary["exit_code"] == 0
    first = float(whole["flip_time"][0])
    assert run.dataset["flip_time"].values.tolist() == [first]
    assert run.summary["message"] == f"the run ended at an event, as asked: flip at {first:.9g} s"
    times = run.dataset["time"].values
    assert times[-1] <= first < times[-1] + 0.1
    assert np.array_equal(run.dataset["quaternion"], whole["quaternion"][: len(times)])


def test_events_read_attitude_position_and_time() -> None:
    text = config(
        'shape = "sphere"\nmass = 1\nradius = 0.1',
        "angular_velocity = [0, 0, 3]\nvelocity = [0, 0, 10]",
        'kind = "uniform_gravity"\nacceleration = [0, 0, -10]',
        "end = 2\nsamples = 3",
        more='[parameters]\nh = 1\n[[events]]\nname = "top"\nexpression = "vz"\n'
        '[[events]]\nname = "rising"\nexpression = "z - h"\ndirection = "up"\n'
        '[[events]]\nname = "turned"\nexpression = "qz - sin(3*t/2) + t - 1"',
    )
    data = run_text(text).dataset
    # z = 10 t - 5 t^2
    assert data["top_time"].values == pytest.approx([1.0], abs=1e-14)
    assert data["rising_time"].values == pytest.approx([1 - np.sqrt(0.8)], abs=1e-14)
    assert data["turned_time"].values == pytest.approx([1.0], abs=1e-13)  # qz = sin(3 t / 2) exactly
    assert data["top_position"].values[0, 2] == pytest.approx(5.0, abs=1e-13)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ('name = "a b"\nexpression = "wy"', "allowed: letters, digits and underscores"),
        ('name = "a"\nexpression = "x"', 'unknown name "x"'),
        ('name = "a"\nexpression = "wy > 0"', "an event takes the difference"),
        ('name = "a"\nexpression = "wy"\naction = "halt"', "allowed: record, stop"),
        (
            'name = "a"\nexpression = "wy"\n[[events]]\nname = "a"\nexpression = "wx"',
            'two events are named "a"',
        ),
    ],
)
def test_bad_events_are_refused(event: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        run_text(FLIPS.format(samples=11) + f"[[events]]\n{event}\n")


@pytest.mark.parametrize("precision", cases(["double", "extended"], ["double"]))
def test_events_of_large_values_cost_the_motion_no_digits(precision: str) -> None:
    """The engine's steps are relative to the largest of states and events: here a billion times looser."""
    text = config(time="end = 200\nsamples = 41", integrator=f'precision = "{precision}"')
    event = '[[events]]\nname = "late"\nexpression = "1e9*(t - 150)"\n'
    plain, watched = run_text(text), run_text(text + event, 'name="watched"')
    assert watched.summary["cost"]["steps"] == pytest.approx(plain.summary["cost"]["steps"], abs=3)
    assert watched.dataset["late_time"].values == pytest.approx([150], rel=4 * EPSILON["double"])
    bound = 6 * law(EPSILON[precision], plain.summary["cost"]["steps"], 1.2, 200)  # three times for each run
    apart = angle_between(wide(plain.dataset, "quaternion"), wide(watched.dataset, "quaternion"))
    assert apart.max() <= bound * amplification(rigidsim.parse(text)) / 200
