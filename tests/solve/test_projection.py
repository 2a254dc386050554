"""Projected invariants stay at their initial values to the last bit, to the gain of the attitude."""

from __future__ import annotations

import json
import math

import heyoka as hy
import numpy as np
import pytest
import xarray
from equations import Random, array, prepared
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import angle_between, cases, config, law, run_text

import rigidsim
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import Trial, try_setting
from rigidsim.errors import ConfigError
from rigidsim.model.projected_invariants import projected_invariants
from rigidsim.model.two_part import TwoPart, as_factor, in_two_parts
from rigidsim.scene.arithmetic import context_for
from rigidsim.solve.correction import least_correction
from rigidsim.solve.effects.angle_wrapping import AngleWrapping
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import (
    STEPS_BETWEEN,
    Projection,
    one_higher,
    projected_system,
    put_back_by_invariant,
    steps_between,
)
from rigidsim.solve.taylor_stepper import TaylorStepper

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
Scene = tuple[str, str, str]


def scene(
    parts: Scene, formulation: str = "auto", precision: str = '"double"', extra: str = ""
) -> InitialValueProblem:
    body, initial, loads = parts
    integrator = f'formulation = "{formulation}"\nprecision = {precision}\n{extra}'
    return prepared(body, initial, loads, integrator=integrator, end=1e6)


class Motion:
    """Natural steps, projected or plain, looked at between corrections, which no run shows."""

    def __init__(self, p: InitialValueProblem, *, held: bool, every: int = 0) -> None:
        system = projected_system(p.system, p.precision) if held else p.system
        zero = (
            p.precision.scalar(0.0) if p.precision.scalar is not hy.real else hy.real(0.0, p.precision.bits)
        )
        self.stepper = TaylorStepper(system, p.precision, p.tolerance, zero)
        self.projection = Projection(p.system, p.precision, 0.0) if held else None
        self.wrapping = AngleWrapping(p.system.angle_states, p.precision, p.scene.context)
        self.every = every or steps_between(p.precision)

    def loop(self, corrections: int = 1) -> None:
        for _ in range(corrections):
            assert self.stepper.skip(self.every)
            if self.wrapping.positions:
                self.wrapping.wrap(self.stepper.state)
            if self.projection is not None:
                self.projection.project(self.stepper.state, self.stepper.time)

    def until(self, time: float) -> np.ndarray:
        """State at an internal time: natural steps up to the last correction before it."""
        while True:
            mark = self.stepper.mark()
            self.loop()
            if self.stepper.time > time:
                break
        self.stepper.integrator.dtime = mark.time
        self.stepper.state[:] = mark.state
        assert self.stepper.to(self.stepper.state.dtype.type(time))
        return np.array(self.stepper.state)


# One correction leaves each invariant within the rounding of the state (a few last bits of components of
# order one) plus the offset that takes the interval's integral back: the wander of one interval. A step
# rounds some ten components by up to eps / 2 each, with gradients up to 2: sqrt(10) eps a step.
def rounding(precision: str, every: int) -> float:
    return (8 + math.sqrt(10 * every)) * float(precision_of(precision).epsilon)


@pytest.mark.parametrize("formulation", cases(FORMULATIONS, [f for f in FORMULATIONS if f != "canonical"]))
@pytest.mark.parametrize("parts", [FREE, LAGRANGE, KOVALEVSKAYA], ids=["free", "lagrange", "kovalevskaya"])
def test_invariants_stay_within_rounding(parts: Scene, formulation: str) -> None:
    held = Motion(scene(parts, formulation), held=True)
    assert held.projection is not None
    middle = {"euler_angles": 4, "canonical": 1}.get(formulation)
    amplification = 1.0
    for _ in range(60):
        for _ in range(5):
            held.loop()
            if middle is not None:  # angles amplify rounding on the way past their singularity
                amplification = max(amplification, 1 / abs(math.sin(held.stepper.state[middle])))
        largest = np.abs(held.projection.residuals(held.stepper.state)).max()
        assert largest < amplification * rounding("double", held.every)
    assert held.projection.skipped == 0


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        (FREE, ["angular_momentum", "energy", "quaternion_norm"]),
        (LAGRANGE, ["angular_momentum_axial", "angular_momentum_vertical", "energy", "quaternion_norm"]),
        (KOVALEVSKAYA, ["angular_momentum_vertical", "energy", "kovalevskaya_constant", "quaternion_norm"]),
        (SATELLITE, ["jacobi_constant", "orbit_norm_1", "quaternion_norm"]),
        (ORBITER, ["energy", "quaternion_norm", "total_angular_momentum"]),
        (THROWN, ["angular_momentum", "quaternion_norm", "rotational_energy"]),
    ],
    ids=["free", "lagrange", "kovalevskaya", "satellite", "orbiter", "thrown"],
)
def test_each_scene_holds_what_it_conserves(parts: Scene, names: list[str]) -> None:
    held = Motion(scene(parts), held=True)
    assert held.projection is not None
    assert sorted(set(held.projection.names)) == names
    held.loop(100)
    assert np.abs(held.projection.residuals(held.stepper.state)).max() < rounding("double", held.every)
    assert sorted(set(held.projection.names)) == names


@pytest.mark.parametrize(
    ("precision", "bits"), [('"single"', 24), ('"extended"', 64), ('"quadruple"', 113), ("40", 135)]
)
def test_every_precision_is_held_in_the_next(precision: str, bits: int) -> None:
    p = scene(FREE, precision=precision)
    assert p.precision.bits == bits < one_higher(p.precision).bits
    held = Motion(p, held=True, every=16)
    assert held.projection is not None
    held.loop(3 if bits > 64 else 50)
    assert np.abs(held.projection.residuals(held.stepper.state)).max() < (8 + 13) * 2.0 ** (1 - bits)
    assert held.projection.skipped == 0


def test_at_250_digits_the_last_one_is_put_back() -> None:
    """Corrections of 1e-250, whose squares no float64 holds."""
    p = scene(FREE, "rates", precision="250")
    projection = Projection(p.system, p.precision, 0.0)
    state = p.precision.array(p.system.initial)
    start = np.array(state)
    unit = p.precision.number(p.scene.context.mpf(2) ** (1 - p.precision.bits))
    state += np.array([unit * hy.real(x, p.precision.bits) for x in (2.0**20, -(2.0**20), 2.0**19)])
    off = projection.residuals(state)
    projection.project(state, 1.0)
    # the offset grew over the interval; as much as its mean, on the other side, takes that back over the next
    assert projection.residuals(state) == pytest.approx(-off / 2, rel=2.0**-15)
    assert projection.corrections == pytest.approx(off, rel=2.0**-15)
    # what lies along the motion stays
    assert float(max(abs(x) for x in (state - start) / unit)) > 1


def test_projecting_twice_changes_no_more_than_the_last_bit() -> None:
    held = Motion(scene(FREE), held=True)
    assert held.projection is not None
    for _ in range(50):
        held.loop()
        before = held.stepper.state.copy()
        held.projection.project(held.stepper.state, held.stepper.time)
        assert np.abs(held.stepper.state - before).max() <= 2 * np.finfo(float).eps


def test_the_same_run_gives_the_same_bits_and_can_be_resumed() -> None:
    for precision, corrections in (
        ('"double"', 40),
        ('"single"', 40),
        ('"extended"', 20),
        ('"quadruple"', 2),
    ):
        p = scene(LAGRANGE, precision=precision)
        whole, first, second = (Motion(p, held=True, every=16) for _ in range(3))
        whole.loop(2 * corrections)
        first.loop(corrections)
        assert first.projection is not None
        assert second.projection is not None
        assert whole.projection is not None
        mark = first.stepper.mark()
        assert first.projection.memory.dtype == np.float64
        second.stepper.integrator.dtime = mark.time
        second.stepper.state[:] = mark.state
        second.projection.memory[:] = first.projection.memory
        second.loop(corrections)
        assert np.array_equal(whole.stepper.state, second.stepper.state)
        assert np.array_equal(whole.projection.memory, second.projection.memory)


def ended(parts: Scene, end: float, setting: Setting) -> Trial:
    """A run whose last sample counts."""
    return try_setting(rigidsim.parse(config(*parts, f"end = {end}\nsamples = 2")), setting, compact=True)


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
        reference = ended(parts, time, Setting("extended"))
        for found, hold in ((held, True), (plain, False)):
            trial = ended(parts, time, Setting("double", hold_invariants=hold))
            found.append(angles_between(trial.attitudes, reference.attitudes)[-1])
    eps = np.finfo(float).eps
    assert max(held) < eps * STEPS_BETWEEN * math.sqrt(trial.steps / 12)
    # the law bounds what runs scatter below; the gain is its quotient, of which chance takes a part
    assert np.median(plain) < law(eps, trial.steps, 2.0, time)
    assert np.median(held) < np.median(plain) / 30


@pytest.mark.slow
def test_a_heavy_top_gains_as_much() -> None:
    settings = (Setting("extended"), Setting("double", hold_invariants=True), Setting("double"))
    reference, held, plain = (ended(LAGRANGE, 2e4, setting) for setting in settings)
    error, other = (angles_between(t.attitudes, reference.attitudes)[-1] for t in (held, plain))
    assert error < other / 10
    assert error < np.finfo(float).eps * STEPS_BETWEEN * math.sqrt(held.steps / 12)


def test_coefficients_in_two_parts_keep_a_held_run_from_drifting_off() -> None:
    """The coefficient 1/3 is off by a quarter of epsilon in single, and so is the speed along the polhode:
    over 1e5 time units that leads to 1e-8 * 1e5 rad, less what the mean over the polhode leaves of it.
    """
    parts = ("principal_moments = [3, 1, 2]", f"angular_velocity = [0.25, 1, -0.375]\n{ATTITUDE}", "")
    p, time = scene(parts, precision='"single"'), 1e5
    reference = Motion(scene(parts), held=False).until(time)
    split, rounded = (Motion(p, held=True, every=16) for _ in range(2))
    rounded.stepper = TaylorStepper(p.system, p.precision, p.tolerance, np.float32(0))
    two, one = (
        float(angle_between(m.until(time)[None, 3:7].astype(float), reference[None, 3:7])[0])
        for m in (split, rounded)
    )
    assert 1e-4 < one < 1e-3
    assert two < 2.0**-23 * split.every * math.sqrt(split.stepper.steps / 12)
    assert two < one / 3


def test_what_was_put_back_is_the_drift_that_the_run_would_have_had() -> None:
    """At a loose tolerance drifts come from the cut series, all to one side, and corrections don't feed
    back: the two agree but for second order.
    """
    p = scene(FREE, "rates", extra="tolerance = 1e-6")
    plain, held = Motion(p, held=False), Motion(p, held=True)
    plain.loop(200)
    held.loop(200)
    assert held.projection is not None
    drift = held.projection.residuals(plain.stepper.state)
    assert np.abs(drift).max() > 1e-6
    assert held.projection.corrections == pytest.approx(drift, rel=0.1, abs=1e-8)


def test_a_spin_about_a_principal_axis_and_rest_are_no_trouble() -> None:
    """There the gradients of energy and momentum are parallel, or vanish."""
    for rates in ([0, 0, 1], [0, 0, 0], [1e-9, 0, 1], [1, 1e-5, 0]):
        p = scene((FREE[0], f"angular_velocity = {rates}\n{ATTITUDE}", ""))
        held = Motion(p, held=True)
        held.loop(50)
        assert held.projection is not None
        assert held.projection.skipped == 0
        drift = np.abs(held.projection.residuals(held.stepper.state)).max()
        assert drift < rounding("double", held.every)


def test_a_state_that_is_lost_is_left_as_it_is() -> None:
    held = Motion(scene(FREE), held=True)
    assert held.projection is not None
    for spoilt in (np.nan, np.inf, 1e3):
        state = held.stepper.state.copy()
        state[1] = spoilt
        before = state.copy()
        held.projection.project(state, 1.0)
        assert np.array_equal(state, before, equal_nan=True)
    assert held.projection.skipped == 3


def test_another_chart_goes_on_with_the_same_memory() -> None:
    """The scalars that are held are the same in both charts, and so are their residuals."""
    motion = Motion(scene(FREE, "euler_angles", extra='euler_sequence = "zxz"'), held=True)
    projection, partner = motion.projection, motion.stepper.system.partner
    assert projection is not None
    assert partner is not None
    motion.loop(5)
    state = np.array(motion.stepper.state)
    matrix = hy.cfunc([x for row in partner.mechanics.matrix for x in row], partner.variables)
    turned = Rotation.from_euler("ZXZ", state[3:6]).as_matrix()
    angles = Rotation.from_matrix(turned).as_euler(partner.sequence.upper())
    other = np.concatenate([state[:3], angles])
    assert matrix(other).reshape(3, 3) == pytest.approx(turned, abs=1e-14)
    before, sums = projection.residuals(state), projection.corrections
    projection.use(1)
    # angles rounded once more, on components of L of the order of 3
    assert projection.residuals(other) == pytest.approx(before, abs=32 * np.finfo(float).eps)
    projection.project(other, motion.stepper.time + 1.0)
    assert np.abs(projection.residuals(other)).max() < rounding("double", motion.every)
    assert projection.corrections == pytest.approx(sums, abs=32 * np.finfo(float).eps)
    # the partner's equations have their coefficients in two parts too
    assert str(partner.equations) != str(scene(FREE, "euler_angles").system.partner.equations)  # type: ignore[union-attr]


def test_nothing_to_hold_is_refused() -> None:
    driven = ("principal_moments = [1, 2, 3]", f"angular_velocity = [0.5, 0.25, 1]\n{ATTITUDE}",
              'kind = "viscous_torque"\ncoefficients = [0.1, 0.1, 0.1]')  # fmt: skip
    p = scene(driven, "euler_angles")
    with pytest.raises(ConfigError, match=r"\[integrator\] hold_invariants.*nothing constant"):
        projected_invariants(p.system)
    held, left_out = projected_invariants(scene(driven, "quaternion").system)
    assert [h.name for h in held] == ["quaternion_norm"]
    assert [name for name, _ in left_out] == ["energy_balance"]


@settings(max_examples=200, deadline=None)
@given(
    st.integers(1, 10**12),
    st.integers(1, 10**12),
    st.sampled_from(["single", "double", "extended", "quadruple", 40]),
)
def test_two_parts_hold_half_as_many_digits_again(p: int, q: int, name: str | int) -> None:
    precision, context = precision_of(name), context_for(name)
    value = -context.mpf(p) / q
    split = in_two_parts(precision.number, precision.exact, precision.bits, context)(value)
    if not isinstance(split, TwoPart):
        assert context.mpf(precision.exact(split)) == value
        return
    high, low = (context.mpf(precision.exact(x)) for x in (split.high, split.low))
    assert abs(high + low - value) <= abs(value) * context.mpf(2) ** (
        -precision.bits - precision.bits // 2 + 1
    )
    # half the digits: a product with any number keeps room below for the other part
    mantissa = context.ldexp(context.frexp(high)[0], precision.bits // 2)
    assert mantissa == context.nint(mantissa)


def test_two_parts_are_written_out_in_products() -> None:
    x = hy.make_vars("x")
    third = TwoPart(0.25, 1 / 12, 1 / 3)
    products = [third * x, x * third, (-third) * x, (2.0 * third) * x, third + x, x - third, third - x]
    value = hy.cfunc(products, [x])(np.array([3.0]))
    assert value == pytest.approx([1, 1, -1, 2, 10 / 3, 8 / 3, -8 / 3], rel=4 * np.finfo(float).eps)
    assert as_factor(third) is third
    assert str(as_factor(0.0) * x) == "0.0000000000000000"


def test_plain_equations_are_untouched() -> None:
    """Coefficients that the working precision holds stay single, and the system of a plain run is its own."""
    whole = scene(("principal_moments = [1, 2, 2]", FREE[1], ""))
    held = projected_system(whole.system, whole.precision)
    third = scene(FREE)
    assert str(held.equations[:2]) == str(whole.system.equations[:2])
    assert str(projected_system(third.system, third.precision).equations) != str(third.system.equations)
    assert projected_system(third.system, third.precision).outputs is third.system.outputs


def test_the_least_correction_is_that_of_least_squares() -> None:
    random = Random(3).generator
    rows, right = random.normal(size=(3, 6)), random.normal(size=3)
    x = list(hy.make_vars(*(f"x{i}" for i in range(21))))
    expressions = least_correction([x[6 * j : 6 * j + 6] for j in range(3)], x[18:], 0.0)
    found = hy.cfunc(expressions, x)(np.concatenate([rows.ravel(), right]))
    expected = np.linalg.lstsq(rows, right, rcond=None)[0]
    condition = np.linalg.cond(rows) ** 2
    assert found == pytest.approx(expected, rel=0, abs=100 * condition * np.finfo(float).eps)


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
@pytest.mark.parametrize("formulation", ["quaternion", "euler_angles", "rates"])
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
    cases(
        ['"single"', '"double"', '"extended"', '"quadruple"', "25"], ['"single"', '"double"', '"extended"']
    ),
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


def test_components_are_joined_row_by_row() -> None:
    rows = Random(5).generator.normal(size=(7, 5)) * 1e-13
    found = put_back_by_invariant(["spin", "spin", "spin", "energy", "norm"], rows)
    assert list(found) == ["spin", "energy", "norm"]
    np.testing.assert_array_equal(found["energy"], rows[:, 3])  # with its sign
    assert found["spin"] == pytest.approx(np.linalg.norm(rows[:, :3], axis=1), rel=4 * np.finfo(float).eps)
    for n in range(7):
        one = put_back_by_invariant(["spin", "spin", "spin", "energy", "norm"], rows[n : n + 1])
        assert [float(v[0]) for v in one.values()] == [float(v[n]) for v in found.values()]
