"""Projected invariants stay at their initial values to the last bit, to the gain of the attitude."""

from __future__ import annotations

import json
import math

import heyoka as hy
import numpy as np
import pytest
import xarray
from equations import Random, array
from support import EPSILON, angle_between, cases, config, law, loaded, run_text

import rigidsim
from rigidsim.model.two_part import TwoPart

ATTITUDE = "quaternion = [0.5, 0.5, -0.5, 0.5]"
FREE = ("principal_moments = [1, 2, 3]", f"angular_velocity = [0.5, 0.25, 1]\n{ATTITUDE}", "")
LAGRANGE = (
    "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 0.5]",
    f"angular_velocity = [0.3, 0.2, 3]\n{ATTITUDE}",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
)
KOVALEVSKAYA = (
    "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0.5, 0, 0]",
    f"angular_velocity = [0.3, 0.2, 1]\n{ATTITUDE}",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
)
SATELLITE = (
    "principal_moments = [0.8, 0.9, 1]",
    "angular_velocity = [0.05, 0.03, 1.02]\nquaternion = [0.98, 0.1, 0.05, 0.02]",
    'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}',
)
ORBITER = (
    "principal_moments = [0.8, 0.9, 1]\nmass = 10",
    f"angular_velocity = [0.2, 0.1, 1]\n{ATTITUDE}\nposition = [3, 0, 0]\nvelocity = [0, 0.55, 0.1]",
    'kind = "central_gravity"\ngravitational_parameter = 1',
)
THROWN = (
    "principal_moments = [1, 2, 3]\nmass = 1",
    f"angular_velocity = [0.5, 0.25, 1]\n{ATTITUDE}\nposition = [0, 0, 0]\nvelocity = [1, 0, 3]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
)
FORMULATIONS = ("rates", "quaternion", "rotation_matrix", "euler_angles", "canonical")
STEPS_BETWEEN = 128
Scene = tuple[str, str, str]


def run(
    parts: Scene, end: float, integrator: str = "hold_invariants = true", samples: int = 65
) -> rigidsim.Run:
    return run_text(config(*parts, f"end = {end}\nsamples = {samples}", integrator))


def drifts(found: rigidsim.Run) -> dict[str, float]:
    """The largest of each invariant, of the samples, which lie anywhere between two corrections."""
    data = loaded(found)
    return {name: float(np.abs(data[f"{name}_drift"]).max()) for name in found.summary["invariants"]}


def rounding(precision: str = "double") -> float:
    """One correction leaves each invariant within the rounding of the state (a few last bits of components of
    order one) plus the offset that takes the interval's integral back: the wander of one interval. A step
    rounds some ten components by up to eps / 2 each, with gradients up to 2: sqrt(10) eps a step.
    """
    return (8 + math.sqrt(10 * STEPS_BETWEEN)) * EPSILON[precision]


@pytest.mark.parametrize("formulation", cases(FORMULATIONS, ["quaternion", "euler_angles"]))
@pytest.mark.parametrize(
    "parts",
    [
        pytest.param(FREE, id="free", marks=pytest.mark.slow),
        pytest.param(LAGRANGE, id="lagrange", marks=pytest.mark.slow),
        pytest.param(KOVALEVSKAYA, id="kovalevskaya"),
    ],
)
def test_invariants_stay_within_rounding(parts: Scene, formulation: str) -> None:
    found = run(parts, 500, f'hold_invariants = true\nformulation = "{formulation}"')
    # angles amplify rounding on the way past their singularity, which charts keep at 60 degrees
    amplification = {"euler_angles": 2.0, "canonical": 10.0}.get(formulation, 1.0)
    assert max(drifts(found).values()) < amplification * rounding()


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        (SATELLITE, {"jacobi_constant", "orbit_norm_1", "quaternion_norm"}),
        (ORBITER, {"energy", "quaternion_norm", "total_angular_momentum"}),
        (THROWN, {"angular_momentum", "quaternion_norm", "rotational_energy"}),
        # where the gradients of energy and momentum are parallel, or vanish
        ((FREE[0], f"angular_velocity = [1e-9, 0, 1]\n{ATTITUDE}", ""), set()),
        ((FREE[0], f"angular_velocity = [0, 0, 0]\n{ATTITUDE}", ""), set()),
    ],
    ids=["satellite", "orbiter", "thrown", "about an axis", "at rest"],
)
def test_each_scene_holds_what_it_conserves(parts: Scene, names: set[str]) -> None:
    found = run(parts, 300)
    held = {name for name, row in found.summary["invariants"].items() if row["put_back"] is not None}
    assert held >= names
    assert max(drifts(found)[name] for name in held) < rounding()


@pytest.mark.parametrize("precision", cases(["single", "extended", "quadruple"], ["extended"]))
def test_every_precision_is_held_in_the_next(precision: str) -> None:
    found = run(FREE, 20, f'hold_invariants = true\nprecision = "{precision}"')
    assert max(drifts(found).values()) < rounding(precision)


def attitude(found: rigidsim.Run) -> np.ndarray:
    return loaded(found)["quaternion"].values[-1:]


@pytest.mark.slow
def test_attitude_errors_no_longer_grow_faster_than_the_root_of_the_steps() -> None:
    """Against 80-bit runs, whose own error is 2000 times smaller than a plain double's. Between corrections
    the frequency is off by the wander of energy and momentum, some eps sqrt(k) after k steps, and its part
    over the ends is taken back: eps K sqrt(N / 12) in all over N steps K apart, where the law without
    correction has eps N^1.5 / (2 sqrt 3).
    """
    random, time = Random(7), 2e4
    held, plain = [], []
    for _ in range(5):
        rates = random.generator.uniform(0.3, 1.0, 3)
        parts = (FREE[0], f"angular_velocity = {array(rates)}\n{ATTITUDE}", "")
        reference = attitude(run(parts, time, 'precision = "extended"', 2))
        for found, hold in ((held, "true"), (plain, "false")):
            trial = run(parts, time, f"hold_invariants = {hold}", 2)
            found.append(angle_between(attitude(trial), reference)[0])
    steps = trial.summary["cost"]["steps"]
    assert max(held) < EPSILON["double"] * STEPS_BETWEEN * math.sqrt(steps / 12)
    # the law bounds what runs scatter below; the gain is its quotient, of which chance takes a part
    assert np.median(plain) < law(EPSILON["double"], steps, 2.0, time)
    assert np.median(held) < np.median(plain) / 30


@pytest.mark.slow
def test_a_heavy_top_gains_as_much() -> None:
    ways = ('precision = "extended"', "hold_invariants = true", "hold_invariants = false")
    reference, held, plain = (run(LAGRANGE, 2e4, way, 2) for way in ways)
    error, other = (angle_between(attitude(found), attitude(reference))[0] for found in (held, plain))
    assert error < other / 10
    assert error < EPSILON["double"] * STEPS_BETWEEN * math.sqrt(held.summary["cost"]["steps"] / 12)


def test_two_parts_of_a_coefficient_are_written_out_in_products() -> None:
    x = hy.make_vars("x")
    third = TwoPart(0.25, 1 / 12, 1 / 3)
    products = [third * x, x * third, (-third) * x, (2.0 * third) * x, third + x, x - third, third - x]
    value = hy.cfunc(products, [x])(np.array([3.0]))
    assert value == pytest.approx([1, 1, -1, 2, 10 / 3, 8 / 3, -8 / 3], rel=4 * EPSILON["double"])


def test_nothing_to_hold_is_refused() -> None:
    driven = (FREE[0], FREE[1], 'kind = "viscous_torque"\ncoefficients = [0.1, 0.1, 0.1]')
    with pytest.raises(rigidsim.ConfigError, match=r"\[integrator\] hold_invariants.*nothing constant"):
        run(driven, 1, 'formulation = "euler_angles"\nhold_invariants = true')
    rows = run(driven, 1).summary["invariants"]
    assert [name for name, row in rows.items() if row["put_back"] is not None] == ["quaternion_norm"]


def test_a_held_run_says_so_and_tells_what_its_drift_would_have_been() -> None:
    text = """
name = "held"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
end = 2000
samples = 11
[integrator]
hold_invariants = true
"""
    held = run_text(text)
    plain = run_text(text, "integrator.hold_invariants=false", 'name="plain"')
    assert held.summary["hold_invariants"] is True
    put_back = held.summary["invariants"]["energy"]["put_back"]
    drifted = plain.summary["invariants"]["energy"]["largest_drift"]
    # both are the same random walk of rounding errors, though not its same path
    assert 0.02 * drifted < abs(put_back) < 50 * drifted
    assert held.summary["invariants"]["energy"]["largest_drift"] < 2.0**-48
    with held.dataset as dataset:
        assert json.loads(dataset.attrs["put_back"])["energy"] == put_back
        assert float(dataset["energy_put_back"][-1]) == put_back
    with plain.dataset as dataset:
        assert "put_back" not in dataset.attrs
        assert not [name for name in dataset.variables if str(name).endswith("_put_back")]


LOOSE = """
name = "loose"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
{time}
[integrator]
{integrator}
"""


def put_back_of(dataset: xarray.Dataset) -> dict[str, np.ndarray]:
    return {str(n): dataset[n].values for n in dataset.data_vars if str(n).endswith("_put_back")}


@pytest.mark.optimised  # two motions that part by chance: rounding decides by how much
@pytest.mark.parametrize("formulation", cases(["quaternion", "euler_angles", "rates"], ["quaternion"]))
def test_what_was_put_back_along_time_is_what_the_drift_would_have_been(formulation: str) -> None:
    """At a tolerance whose truncation errors stand far above rounding, and bias the invariants."""
    tolerance, end = 1e-6, 3000
    integrator = f'tolerance = {tolerance}\nformulation = "{formulation}"\n'
    text = LOOSE.format(time=f"end = {end}\nsamples = 31", integrator=integrator)
    text = text.replace("[integrator]", '[output]\nrecord = ["angular_velocity"]\n[integrator]')
    plain = run_text(text, "integrator.hold_invariants=false")
    held = run_text(text, "integrator.hold_invariants=true", 'name="held"')
    with plain.dataset as free, held.dataset as kept:
        drift, would = free.energy_drift.values, (kept.energy_put_back + kept.energy_drift).values
        # the two motions part by what was put back, so that each later step falls elsewhere in its period: a
        # hundredth over 3000 radians, and a tenth in angles, whose errors come near the singularity
        assert np.abs(drift).max() > 20 * tolerance * 2.0**-6
        assert would == pytest.approx(drift, abs=0.2 * np.abs(drift).max())
        assert kept.energy_put_back.attrs["units"] == "1"
        assert kept.energy_put_back.attrs["scale"] == kept.energy_drift.attrs["scale"]
        assert kept.energy_put_back.attrs["put_back_of"] == "energy"
        assert np.abs(kept.energy_drift).max() < 0.05 * np.abs(kept.energy_put_back).max()
        rows = held.summary["invariants"]
        found = put_back_of(kept)
        assert {name.removesuffix("_put_back") for name in found} == {
            name for name, row in rows.items() if row["put_back"] is not None
        }
        for name, values in found.items():
            assert values[0] == 0
            assert values[-1] == rows[name.removesuffix("_put_back")]["put_back"]
            assert len(np.unique(values)) > 20  # it changes along the way


@pytest.mark.parametrize(
    "precision",
    cases(['"single"', '"double"', '"extended"', '"quadruple"', "25"], ['"double"']),
)
def test_what_was_put_back_does_not_depend_on_when_it_is_looked_at(precision: str) -> None:
    """Dense samples come in grids, single ones after skipped steps: the same bits at the same times."""
    end = 64 if precision in ('"quadruple"', "25") else 1024
    integrator = f"hold_invariants = true\nprecision = {precision}\n"
    often, rarely, seldom = (
        run_text(LOOSE.format(time=f"end = {end}\nsamples = {n}", integrator=integrator), f'name="n{n}"')
        for n in (4 * end + 1, end // 16 + 1, 3)
    )
    with often.dataset as dense, rarely.dataset as sparse, seldom.dataset as ends:
        all_of_them = put_back_of(dense)
        assert len(all_of_them) == 3
        for name, values in all_of_them.items():
            assert np.any(values != 0)
            np.testing.assert_array_equal(sparse[name].values, values[::64])
            np.testing.assert_array_equal(ends[name].values, values[:: 2 * end])
