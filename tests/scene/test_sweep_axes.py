"""Sweeps: the exact values that members are known by, and what is no sweep."""

from fractions import Fraction
from math import sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidsim import ConfigError, parse
from rigidsim.scene.sweep import Sweep

BASE = """\
name = "box"
[body]
principal_moments = [1, 2, 2.5]  # kept
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 10
samples = 11
"""
RATE = 'axes."initial.angular_velocity[2]"'


def swept(table: str, base: str = BASE) -> Sweep:
    return Sweep.of(parse(f"{base}[sweep]\n{table}\n"))


def values(sweep: Sweep) -> list[tuple[str, ...]]:
    return [sweep.texts(member) for member in range(sweep.count)]


def test_a_linspace_is_exact_and_a_member_has_its_values() -> None:
    sweep = swept(f'{RATE} = {{linspace = [0.1, 0.9, 9]}}\naxes."time.end" = {{values = ["1 h", 7]}}')
    assert sweep.shape == (9, 2)
    assert sweep.dims == ("angular_velocity_2", "end")
    assert sweep.texts(5) == ("0.3", "7")
    assert [axis.unit for axis in sweep.axes] == ["rad/s", "s"]
    config = sweep.experiment_of(4).config
    assert config.initial.angular_velocity[2].rational == Fraction(3, 10)
    assert config.time.end.rational == 3600
    assert config.sweep is None
    assert "# kept" in sweep.experiment_of(4).text
    assert [axis.exact(i)[0].rational for axis, i in zip(sweep.axes, sweep.indices(5), strict=True)] == [
        Fraction(3, 10),
        7,
    ]


WAYS = {
    "step": "step = [0.1, 0.003, {count}]",
    "uniform": "uniform = [-1, 1], count = {count}",
    "normal": "normal = [0, 0.1], count = {count}",
}


def axis(way: str, count: int, seed: int = 0) -> list[tuple[str, ...]]:
    return values(swept(f"seed = {seed}\n{RATE} = {{{WAYS[way].format(count=count)}}}"))


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(sorted(WAYS)), st.integers(1, 40), st.integers(1, 40), st.integers(0, 5))
def test_a_longer_axis_keeps_what_it_had(way: str, count: int, more: int, seed: int) -> None:
    long = axis(way, count + more, seed)
    assert long[:count] == axis(way, count, seed)
    assert len(set(long)) == len(long)


def test_a_prolonged_space_of_the_same_step_keeps_its_values() -> None:
    short = values(swept(f"{RATE} = {{linspace = [0, 0.999, 1000]}}"))
    assert values(swept(f"{RATE} = {{linspace = [0, 1.099, 1100]}}"))[:1000] == short
    decades = values(swept(f"{RATE} = {{logspace = [0.01, 1, 21]}}"))
    assert values(swept(f"{RATE} = {{logspace = [0.01, 10, 31]}}"))[:21] == decades
    assert decades[10] == ("0.1",)


def test_draws_have_the_distribution_asked_for() -> None:
    count = 2000
    table = f'mode = "zip"\n{RATE} = {{normal = [2, 0.5], count = {count}}}\n'
    table += f'axes."time.end" = {{uniform = [3, 5], count = {count}}}'
    normal, uniform = ([float(axis.exact(i)[0]) for i in range(count)] for axis in swept(table).axes)
    for found, mean, deviation in ((normal, 2, 0.5), (uniform, 4, sqrt(4 / 12))):
        average = sum(found) / count
        spread = sqrt(sum((x - average) ** 2 for x in found) / (count - 1))
        assert abs(average - mean) < 5 * deviation / sqrt(count)
        assert abs(spread / deviation - 1) < 5 / sqrt(count)
    assert min(uniform) > 3
    assert max(uniform) < 5
    below = sum(x < 2 for x in normal)  # binomial with one half
    assert abs(below - count / 2) < 5 * sqrt(count) / 2


def test_directions_lie_on_the_sphere_and_cover_it() -> None:
    table = 'axes."initial.angular_velocity" = {sphere = "2 rad/s", %s}'
    for how, count in (("count = 600", 600), ("grid = [20, 30]", 600)):
        sweep = swept(table % how)
        points = [sweep.axes[0].exact(index) for index in range(count)]
        assert sweep.axes[0].components == 3
        for point in points:
            square = sum(x.rational**2 for x in point)
            assert abs(square - 4) < Fraction(1, 10**37)
        for axis in range(3):  # mean 0, mean square a third
            assert abs(sum(float(p[axis]) for p in points)) / count < 5 * 2 / sqrt(3 * count)
            assert abs(sum(float(p[axis]) ** 2 for p in points) / count - 4 / 3) < 0.2
    assert len(set(values(swept(table % "grid = [20, 30]")))) == 600
    unit = swept('axes."initial.quaternion" = {sphere = 1, count = 3}')
    assert len(unit.axes[0].columns) == 4


REFUSED = {
    "nan": (f"{RATE} = {{values = [0.1, nan]}}", "finite numbers are allowed"),
    "no way of values": (f'{RATE} = {{name = "rate"}}', "exactly one of linspace"),
    "a count of none": (f"{RATE} = {{normal = [0, 1]}}", "missing; random values need it"),
    "too many": (
        f'{RATE} = {{step = [0, 1, 1000000]}}\naxes."time.end" = {{step = [1, 1, 1000000]}}',
        "1e12 members; at most 1e8",
    ),
    "one name twice": (
        f'{RATE} = {{values = [1]}}\naxes."time.end" = {{values = [1], name = "angular_velocity_2"}}',
        "give one of them another name",
    ),
    "zip of different lengths": (
        f'mode = "zip"\n{RATE} = {{values = [1, 2]}}\naxes."time.end" = {{values = [1]}}',
        "needs axes of one length",
    ),
    "mixed units": (f'{RATE} = {{linspace = ["1 deg/s", 2, 3]}}', "write both in one unit"),
    "kept what nobody knows": (f'keep = ["finale"]\n{RATE} = {{values = [1]}}', 'did you mean "final"'),
    "the output itself": ('axes."output.record" = {values = [["energy"]]}', "can't be swept"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_sweep_is_refused(case: str) -> None:
    table, told = REFUSED[case]
    with pytest.raises(ConfigError) as caught:
        swept(table)
    assert told in str(caught.value)
    assert "[sweep]" in str(caught.value)
