"""Bit for bit: however a run is driven or sampled, and one bare call of heyoka."""

from collections.abc import Callable
from pathlib import Path

import heyoka as hy
import numpy as np
import pytest
import xarray
from support import cases, run_text, same_bits

import rigidsim
from rigidsim.session.session import Tuning
from rigidsim.solve.problem import prepare
from rigidsim.solve.sampler import Pacing

GRIDS = {
    "dense": "end = 40\nsamples = 641",
    "a sample per step": "end = 40\nsamples = 81",
    "sparse": "end = 200\nsamples = 4",
    "uneven": "times = [0, 0.01, 0.02, 7, 7.001, 30, 90, 90.5]",
}


def run(text: str, out: Path) -> xarray.Dataset:
    with rigidsim.run(rigidsim.parse(text), out=out).dataset as dataset:
        return dataset.load()


DRIVES = {
    "one step at a time": Pacing(chunk_seconds=0.0),
    "few rows": Pacing(rows_at_once=7),
    "no skips": Pacing(skipped_from=10**9),
    "skips wherever it can": Pacing(skipped_from=1, margin=0.5, spare=0.0),
    "skips too far": Pacing(skipped_from=2, margin=1.7, spare=0.0),
    "impatient": Pacing(chunk_seconds=1e-7, patience=0.0),
}


WAYS = [("quaternion", "dense"), ("euler_angles", "sparse"), ("euler_angles", "a sample per step")]


@pytest.mark.parametrize("way", cases(WAYS, WAYS[:1]), ids="-".join)
def test_the_bits_do_not_depend_on_how_it_is_driven(
    way: tuple[str, str], free_body: Callable[..., str]
) -> None:
    formulation, grid = way
    record = 'record = ["angular_velocity", "quaternion", "euler_angles", "energy"]'
    text = free_body(GRIDS[grid], formulation=formulation, output=record)
    plain = run_text(text)
    for pacing in DRIVES.values():
        same_bits(plain, run_text(text, tuning=Tuning(pacing)))


def test_the_sample_grid_does_not_change_the_motion(tmp_path: Path, free_body: Callable[..., str]) -> None:
    """Samples are read off the steps, never steered by: a coarser or longer grid gives the same values."""
    fine = run(free_body("end = 64\nevery = 0.125"), tmp_path / "fine")
    coarse = run(free_body("end = 128\nevery = 16"), tmp_path / "coarse")
    assert coarse.sizes["time"] == 9
    for name in ("time", "angular_velocity", "quaternion", "energy", "angular_momentum_drift"):
        np.testing.assert_array_equal(fine[name].values[::128], coarse[name].values[:5])


BARE = [
    ('"single"', "quaternion", "dense"),
    ('"double"', "quaternion", "uneven"),
    ('"double"', "rotation_matrix", "a sample per step"),
    ('"quadruple"', "quaternion", "sparse"),
    ("30", "rotation_matrix", "a sample per step"),
]


@pytest.mark.optimised
@pytest.mark.parametrize("case", cases(BARE, BARE[1:2]), ids="-".join)
def test_it_is_one_bare_propagation(
    case: tuple[str, str, str], tmp_path: Path, free_body: Callable[..., str]
) -> None:
    """The same equations handed to heyoka's own ``propagate_grid``; Euler angles, which are kept small on the
    way, have no such counterpart.
    """
    precision, formulation, grid = case
    output = ""
    if formulation == "rotation_matrix":
        output = 'record = ["angular_velocity", "rotation_matrix"]'
    text = free_body(GRIDS[grid], precision=precision, formulation=formulation, output=output)
    prepared = prepare(rigidsim.parse(text))
    system, chosen = prepared.system, prepared.precision
    bare = hy.taylor_adaptive(
        system.equations,
        chosen.array(system.initial),
        time=prepared.clock.at(0),
        compact_mode=chosen.compact,
        **chosen.options,
        **({} if prepared.tolerance is None else {"tol": prepared.tolerance}),
    )
    states = bare.propagate_grid(prepared.clock.internal(0, prepared.clock.count))[-1]
    lead = np.array(states).astype(np.float64)
    recorded = {"quaternion": "quaternion", "rotation_matrix": "rotation_matrix"}.get(formulation)
    dataset = run(text, tmp_path)
    rates = np.ldexp(lead[:, :3], system.state_exponents[:3])
    pairs = [(dataset.angular_velocity.values, rates)]
    if recorded:
        pairs.append((dataset[recorded].values.reshape(len(lead), -1), lead[:, 3:]))
    # the last step of propagate_grid is clamped, so only its end is another (equally good) result: rounding
    # of one step, some operations on components of order 1
    few = 16 * 2.0 ** (1 - min(chosen.bits, 53))
    for ours, theirs in pairs:
        assert ours.shape == theirs.shape
        np.testing.assert_array_equal(ours[:-1], theirs[:-1])
        np.testing.assert_allclose(ours[-1], theirs[-1], rtol=0, atol=few)
