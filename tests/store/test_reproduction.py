"""Bit for bit: twice the same config, however it is driven, and one bare call of heyoka."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import heyoka as hy
import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.prepare import prepare
from rigidsim.solve import advance, evaluate, harvest, rhythm

RUNS = [
    ('"single"', "quaternion"),
    ('"double"', "rates"),
    ('"double"', "quaternion"),
    ('"double"', "euler_angles"),
    ('"double"', "rotation_matrix"),
    ('"extended"', "quaternion"),
    ('"extended"', "euler_angles"),
    ('"quadruple"', "quaternion"),
    ('"quadruple"', "euler_angles"),
    ("30", "rotation_matrix"),
]
GRIDS = {
    "dense": "end = 40\nsamples = 641",
    "a sample per step": "end = 40\nsamples = 81",
    "sparse": "end = 200\nsamples = 4",
    "uneven": "times = [0, 0.01, 0.02, 7, 7.001, 30, 90, 90.5]",
}


def run(text: str, out: Path) -> xarray.Dataset:
    with rigidsim.run(rigidsim.parse(text), out=out).dataset as dataset:
        return dataset.load()


def assert_same_bits(a: xarray.Dataset, b: xarray.Dataset) -> None:
    assert list(a.variables) == list(b.variables)
    for name in a.variables:
        one, other = a[name].values, b[name].values
        if one.dtype == np.float64:
            one, other = one.view(np.int64), other.view(np.int64)  # tells -0.0 from 0.0
        np.testing.assert_array_equal(one, other, err_msg=str(name), strict=True)


@pytest.mark.parametrize(("precision", "formulation"), RUNS)
def test_twice_the_same_config(
    precision: str, formulation: str, tmp_path: Path, free_body: Callable[..., str]
) -> None:
    output = 'record = ["angular_velocity"]' if formulation == "rates" else ""
    text = free_body("end = 4\nsamples = 33", precision=precision, formulation=formulation, output=output)
    first, second = run(text, tmp_path / "a"), run(text, tmp_path / "b")
    assert_same_bits(first, second)
    moved = text.replace("[0.3, 1.0, 0.5]", "[0.3, 1.0, 0.500001]")
    with pytest.raises(AssertionError):  # and the comparison does see a change
        assert_same_bits(first, run(moved, tmp_path / "c"))


DRIVES = {
    "one step at a time": {"_CHUNK_SECONDS": 0.0, "_GRID_ROWS": 0, "_WORTH_A_BLOCK": 10**9},
    "grids of one step": {"_CHUNK_SECONDS": 0.0},
    "few rows": {"ROWS_AT_ONCE": 7, "_BLOCK_STEPS": 13, "_WORTH_A_BLOCK": 1, "_GRID_ROWS": 0},
    "blocks of three": {"_BLOCK_STEPS": 3, "_WORTH_A_BLOCK": 1, "_SPARSE": 1e9, "_GRID_ROWS": 0},
    "skips wherever it can": {"_SPARSE": 1.0, "_MARGIN": 0.5, "_LOOK_AHEAD": 1, "_GRID_ROWS": 0},
    "skips too far": {
        "_SPARSE": 2.0,
        "_MARGIN": 1.7,
        "_MEAN_MARGIN": 1.4,
        "_LONG_GAP": 10.0,
        "_GRID_ROWS": 0,
    },
    "skips mixed with grids": {"_SPARSE": 1.0, "_GRID_STRIDES": 0.01},
    "impatient": {"_CHUNK_SECONDS": 1e-7, "_PATIENCE": 0.0},
}


@pytest.mark.parametrize(
    ("formulation", "grid"),
    [
        *(("quaternion", grid) for grid in GRIDS),
        ("euler_angles", "a sample per step"),
        ("euler_angles", "sparse"),
    ],
)
def test_the_bits_do_not_depend_on_how_it_is_driven(
    formulation: str,
    grid: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    free_body: Callable[..., str],
) -> None:
    record = 'record = ["angular_velocity", "quaternion", "euler_angles", "energy"]'
    text = free_body(GRIDS[grid], formulation=formulation, output=record)
    monkeypatch.setattr(rhythm, "STRIDE", 8)  # many of them in a short run
    plain = run(text, tmp_path / "plain")
    for number, constants in enumerate(DRIVES.values()):
        with monkeypatch.context() as patch:
            for name, value in constants.items():
                patch.setattr(advance if hasattr(advance, name) else harvest, name, value)
            assert_same_bits(plain, run(text, tmp_path / str(number)))


@pytest.mark.parametrize("precision", ['"quadruple"', "30"])
def test_the_bits_of_wide_numbers_do_not_depend_on_it_either(
    precision: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    text = free_body("end = 20\nsamples = 21", precision=precision, formulation="euler_angles")
    plain = run(text, tmp_path / "plain")
    for name, value in {"ROWS_AT_ONCE": 3, "_CHUNK_SECONDS": 1e-7, "_SPARSE": 4.0}.items():
        monkeypatch.setattr(advance, name, value)
    assert_same_bits(plain, run(text, tmp_path / "driven"))


def test_the_sample_grid_does_not_change_the_motion(tmp_path: Path, free_body: Callable[..., str]) -> None:
    """Samples are read off the steps, never steered by: a coarser or longer grid gives the same values."""
    fine = run(free_body("end = 64\nevery = 0.125"), tmp_path / "fine")
    coarse = run(free_body("end = 128\nevery = 16"), tmp_path / "coarse")
    assert coarse.sizes["time"] == 9
    for name in ("time", "angular_velocity", "quaternion", "energy", "angular_momentum_drift"):
        np.testing.assert_array_equal(fine[name].values[::128], coarse[name].values[:5])


def test_a_row_does_not_depend_on_its_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """The padding in ``Evaluator`` is what makes it so: heyoka's rest of a batch has other bits."""
    x, y = hy.make_vars("x", "y")
    function = hy.cfunc([hy.sqrt(x * x + y * y) / (1.0 + x * y), hy.sin(x) * hy.cos(y)], [x, y])
    states = np.random.default_rng(1).uniform(-1, 1, (301, 2))
    whole = evaluate.Evaluator._rowwise(function, states)
    assert whole.shape == (2, 301)
    for first, last in ((0, 1), (1, 64), (64, 301), (300, 301), (100, 165)):
        piece = evaluate.Evaluator._rowwise(function, states[first:last])
        np.testing.assert_array_equal(piece, whole[:, first:last])


@pytest.mark.parametrize(
    ("precision", "formulation", "grid"),
    [
        ('"single"', "quaternion", "dense"),
        ('"double"', "rates", "dense"),
        ('"double"', "quaternion", "dense"),
        ('"double"', "quaternion", "sparse"),
        ('"double"', "quaternion", "uneven"),
        ('"double"', "rotation_matrix", "a sample per step"),
        ('"extended"', "quaternion", "uneven"),
        ('"quadruple"', "quaternion", "sparse"),
        ("30", "rotation_matrix", "a sample per step"),
    ],
)
def test_it_is_one_bare_propagation(
    precision: str, formulation: str, grid: str, tmp_path: Path, free_body: Callable[..., str]
) -> None:
    """The same equations handed to heyoka's own ``propagate_grid``; Euler angles, which are kept small on the
    way, have no such counterpart.
    """
    output = 'record = ["angular_velocity"]' if formulation == "rates" else ""
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
