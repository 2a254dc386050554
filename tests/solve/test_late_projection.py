"""``hold_invariants = "auto"``: the plain run up to a fixed count of steps, and held from there on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import IMPATIENT, angle_between, bits, cases, config, law, run_text, same_bits

import rigidsim
from rigidsim.errors import ConfigError
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.problem import prepare
from rigidsim.solve.projection import LATE

EPS = 2.0**-52
BODY = "principal_moments = [1, 2, 3]"
SPIN = "angular_velocity = [0.5, 0.25, 1]"
RATE = 1.15  # rad per unit of time, of this motion
STEP = 0.36  # units of time, of this motion in double precision


def text(end: float, hold: str, *, samples: int = 5, more: str = "", formulation: str = "auto") -> str:
    integrator = f'hold_invariants = {hold}\nformulation = "{formulation}"\n{more}'
    return config(body=BODY, initial=SPIN, time=f"end = {end}\nsamples = {samples}", integrator=integrator)


def steps(run: rigidsim.Run) -> int:
    return int(run.summary["cost"]["steps"])


@pytest.mark.parametrize("samples", [5, 5001])
def test_a_run_of_fewer_steps_is_the_plain_one(samples: int) -> None:
    end = 0.9 * LATE * STEP
    plain, auto = (run_text(text(end, hold, samples=samples)) for hold in ("false", '"auto"'))
    assert 0.8 * LATE < steps(auto) < LATE
    for name in ("quaternion", "angular_velocity", "energy", "energy_drift"):
        assert np.array_equal(bits(plain.dataset[name].values), bits(auto.dataset[name].values))
    assert set(auto.dataset) == set(plain.dataset)
    assert auto.dataset.attrs["hold_from_step"] == LATE
    assert auto.dataset.attrs["hold_invariants"] == 1
    assert "hold_from_step" not in plain.dataset.attrs


@pytest.mark.parametrize("formulation", cases(["quaternion", "euler_angles"], ["quaternion"]))
def test_a_run_that_is_prolonged_past_the_count_is_the_run_in_one_go(
    formulation: str, tmp_path: Path
) -> None:
    scale = STEP if formulation == "quaternion" else 0.75 * STEP  # steps in Euler angles are shorter
    short = round(0.5 * LATE * scale)
    begun, whole = text(short, '"auto"', formulation=formulation), 4 * short
    run = rigidsim.run(rigidsim.parse(begun, overrides=["output.estimate=false"]), out=tmp_path)
    assert steps(run) < LATE
    assert "energy_put_back" not in run.dataset
    later = rigidsim.resume(run.folder.path, until=str(whole), tuning=IMPATIENT)
    assert steps(later) > 1.3 * LATE
    at_once = run_text(text(whole, '"auto"', samples=17, formulation=formulation))
    same_bits(later.dataset, at_once.dataset)
    put_back = np.abs(later.dataset.energy_put_back.values)
    assert not put_back[:5].any()  # as in the run that was prolonged
    assert put_back[-1] > 0.0
    if formulation == "quaternion":
        later = rigidsim.resume(run.folder.path, until=str(2 * whole))  # from beyond the count
        same_bits(later.dataset, run_text(text(2 * whole, '"auto"', samples=33)).dataset)
        assert rigidsim.verify(later.folder.path).identical


def test_samples_move_no_bit_across_the_count() -> None:
    """Whichever way steps are taken: skipped, in grids, in blocks, or one by one."""
    end = 4 * round(1.5 * LATE * STEP / 4)
    dense = run_text(text(end, '"auto"', samples=8 * end + 1)).dataset
    sparse = run_text(text(end, '"auto"', samples=3)).dataset
    middling = run_text(text(end, '"auto"', samples=end // 4 + 1)).dataset
    assert np.array_equal(bits(dense.quaternion[-1].values), bits(sparse.quaternion[-1].values))
    common, here, there = np.intersect1d(dense.time.values, middling.time.values, return_indices=True)
    assert len(common) > 400
    assert np.array_equal(bits(dense.quaternion.values[here]), bits(middling.quaternion.values[there]))


def test_errors_stay_those_of_the_beginning() -> None:
    end = 1e5
    exact = run_text(text(end, "false", more='method = "closed_form"\nprecision = "quadruple"')).dataset
    plain, auto = (run_text(text(end, hold)) for hold in ("false", '"auto"'))

    def error(run: rigidsim.Run) -> float:
        return float(angle_between(run.dataset.quaternion.values[-1:], exact.quaternion.values[-1:])[0])

    # what rounding does until the count; what it did to the phase is taken back, so that this is plenty
    allowed = law(EPS, LATE, RATE, LATE * STEP)
    assert error(auto) < allowed
    assert error(plain) > 5 * allowed
    drift = float(np.abs(auto.dataset.energy_drift).max())
    assert float(np.abs(plain.dataset.energy_drift).max()) > 4 * drift
    assert auto.summary["invariants"]["energy"]["put_back"] != 0


def test_where_nothing_can_be_held_it_means_nothing() -> None:
    for load in (
        'kind = "torque"\ncomponents = ["0.01*sin(t)", 0, 0]',
        'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
        "orbit = {semi_major_axis = 1, eccentricity = 0.2, period = 7}",
        'kind = "torque"\ncomponents = ["abs(wx)/9", 0, 0]',
    ):
        found = rigidsim.parse(
            config(body=BODY, initial=SPIN, loads=load, output='record = ["angular_velocity"]',
                   integrator='hold_invariants = "auto"', time="end = 1\nsamples = 2")
        )  # fmt: skip
        assert not prepare(found).holds_invariants
    closed = text(10, '"auto"', more='method = "closed_form"')
    assert not prepare(rigidsim.parse(closed)).holds_invariants


def test_anything_else_is_refused() -> None:
    with pytest.raises(ConfigError, match='given "late"; true, false or "auto" is allowed'):
        rigidsim.parse(text(10, '"late"'))


def test_members_of_a_sweep_are_plain() -> None:
    swept = text(10, '"auto"') + '[sweep]\naxes."initial.angular_velocity[0]" = {values = [0.5, 0.6]}\n'
    sweep = Sweep.of(rigidsim.parse(swept))
    for member in (sweep.experiment_of(1), sweep.worked_out(1)):
        assert member.config.integrator.hold_invariants is False
    held = Sweep.of(rigidsim.parse(swept.replace('hold_invariants = "auto"', "hold_invariants = true")))
    assert held.experiment_of(1).config.integrator.hold_invariants is True
