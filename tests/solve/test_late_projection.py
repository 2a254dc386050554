"""``hold_invariants = "auto"``: the plain run up to a fixed count of steps, and held from there on."""

import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support import IMPATIENT, bits, cases, config, run_text, same_bits

import rigidsim
from rigidsim import RunFolderError
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.projection import LATE
from rigidsim.store import seal

BODY = "principal_moments = [1, 2, 3]"
SPIN = "angular_velocity = [0.5, 0.25, 1]"
STEP = 0.36  # units of time, of this motion in double precision


def text(end: float, hold: str, *, samples: int = 5, more: str = "", formulation: str = "auto") -> str:
    integrator = f'hold_invariants = {hold}\nformulation = "{formulation}"\n{more}'
    return config(body=BODY, initial=SPIN, time=f"end = {end}\nsamples = {samples}", integrator=integrator)


def steps(run: rigidsim.Run) -> int:
    return int(run.summary["cost"]["steps"])


def test_a_run_of_fewer_steps_is_the_plain_one() -> None:
    end = 0.9 * LATE * STEP
    plain, auto = (run_text(text(end, hold)) for hold in ("false", '"auto"'))
    assert 0.8 * LATE < steps(auto) < LATE
    for name in ("quaternion", "angular_velocity", "energy", "energy_drift"):
        assert np.array_equal(bits(plain.dataset[name].values), bits(auto.dataset[name].values))
    assert set(auto.dataset) == set(plain.dataset)
    assert auto.dataset.attrs["hold_from_step"] == LATE
    assert auto.dataset.attrs["hold_invariants"] == 1
    assert "hold_from_step" not in plain.dataset.attrs


@pytest.mark.parametrize("formulation", cases(["quaternion", "euler_angles"], []))
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
        as_by_an_earlier_version(later.folder.path / "checkpoint.h5")
        with pytest.raises(RunFolderError, match="an earlier version of rigidsim began it"):
            rigidsim.resume(later.folder.path, until=str(3 * whole))


def as_by_an_earlier_version(checkpoint: Path) -> None:
    """Take away the versions of its parts, and seal it again."""
    content = checkpoint.read_bytes()
    checkpoint.write_bytes(content[: -len(seal.sealed(io.BytesIO()))])
    with h5py.File(checkpoint, "r+") as file:
        for name in [name for name in file["checkpoint"] if name.startswith("version_")]:
            del file["checkpoint"][name]
    seal.seal(checkpoint)


class WrongPotential(Load):
    """A torque that turns the body's z axis towards the space axis X, and a potential that belongs to a
    somewhat larger one.
    """

    title = "wrong_potential"
    reads = frozenset({"attitude"})
    conservative = True

    def torque(self, m: Kinematics) -> list[Term]:
        k, zero = m.scene.context.mpf("0.1"), m.scene.context.zero
        return [([-k, zero, zero], m.matrix[0][1]), ([zero, k, zero], m.matrix[0][0])]

    def potential(self, m: Kinematics) -> Any:
        k = m.scene.context.mpf("0.1000001")
        return -m.number(k) * m.matrix[0][2]

    def amplitude(self, scene: Any) -> Any:
        return 0.2


def test_what_is_not_conserved_after_all_is_not_put_back_in_silence() -> None:
    """With a sample at the end alone: no drift before the count is seen. The warning of the drift since the
    latest correction is joined by one of all that was put back.
    """
    end = 1.2 * LATE * STEP
    wrong = rigidsim.parse(text(end, '"auto"', samples=2), overrides=["output.estimate=false"])
    run = rigidsim.run(wrong, loads=[WrongPotential()], out=None)
    assert steps(run) > LATE
    energy = run.summary["invariants"]["energy"]
    assert abs(energy["put_back"]) > energy["bound"]
    assert "drift" in run.summary["warning_codes"]
    assert any("energy was corrected by" in warning for warning in run.summary["warnings"])
    assert verdict_on(run.outcome).soundness is Soundness.DRIFTED
    guarded = wrong.with_overrides(["limits.max_drift=1e-12", "time.samples=1001", f"time.end={4 * end}"])
    stopped = rigidsim.run(guarded, loads=[WrongPotential()], out=None)
    assert stopped.summary["status"] == "stopped: max_drift"
