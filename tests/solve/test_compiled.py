"""What is compiled is compiled once, and serves only what asks for the very same."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from support import same_bits

import rigidsim
from rigidsim.solve.compiled import DISK_LIMIT, Kept, compiled_engine, compiled_function, limit_disk_cache
from rigidsim.solve.problem import prepare

pytestmark = pytest.mark.optimised

x, v = hy.make_vars("x", "v")
PENDULUM = [(x, v), (v, -hy.sin(x))]


@pytest.mark.parametrize("scalar", [np.float32, float, np.longdouble, hy.real128])
def test_an_engine_of_ones_own_is_as_if_newly_compiled(scalar: Any) -> None:
    initial = np.array([scalar(1), scalar(0)])
    options = {"fp_type": scalar, "time": scalar(2), "tol": scalar(1) / 2**20}
    first = compiled_engine(PENDULUM, initial, **options)
    first.propagate_until(scalar(9))
    second, fresh = (
        compiled_engine(PENDULUM, initial, **options),
        hy.taylor_adaptive(PENDULUM, initial, **options),
    )
    assert second.time == fresh.time == scalar(2)
    for engine in (second, fresh):
        engine.propagate_until(scalar(9))
    assert (second.state == fresh.state).all()
    assert (first.state == fresh.state).all()
    first.state[:] = 0
    assert (second.state == fresh.state).all()


def test_values_and_their_drifts_are_evaluated_once(free_body: Callable[..., str]) -> None:
    """Momentum, its norm and energy are terms of their drifts: recording them adds nothing to be computed."""
    system = prepare(rigidsim.parse(free_body())).system

    def terms(outputs: list[Any]) -> int:
        function = compiled_function(outputs, system.variables)
        return len(function.dc) - len(system.variables) - len(outputs)

    drifts = len(system.invariants)
    values = system.outputs[:-drifts]
    assert terms(values) > 40
    assert terms(system.outputs) == terms(system.outputs[-drifts:])


def test_functions_are_told_apart_by_the_sign_of_a_zero() -> None:
    """Expressions that differ in nothing else count as equal."""
    zeros = [hy.expression(0.0), hy.expression(-0.0)]
    assert zeros[0] == zeros[1]
    signs = [np.signbit(compiled_function([zero], [x])(np.array([1.0]))[0]) for zero in zeros]
    assert signs == [False, True]


@pytest.mark.parametrize(
    ("expressions", "options"),
    [([x * v], {}), ([x + v], {"compact_mode": True}), ([x + v], {"fp_type": np.longdouble})],
)
def test_other_expressions_and_options_give_other_functions(
    expressions: list[hy.expression], options: dict[str, Any]
) -> None:
    assert compiled_function([x + v], [x, v]) is compiled_function([x + v], [x, v])
    assert compiled_function(expressions, [x, v], **options) is not compiled_function([x + v], [x, v])
    assert compiled_function([x + v], [v, x]) is not compiled_function([x + v], [x, v])


def test_only_the_latest_are_kept() -> None:
    made: list[int] = []

    def make(number: int) -> int:
        made.append(number)
        return number

    kept: Kept[int] = Kept(2)
    for number in (1, 2, 1, 3, 1, 2):
        assert kept.get(number, lambda n=number: make(n)) == number
    assert made == [1, 2, 3, 2]


def test_a_second_run_compiles_nothing_and_is_the_same(
    monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    experiment = rigidsim.parse(free_body())
    first = rigidsim.run(experiment, out=None)

    def compiled(*_: Any, **__: Any) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr(hy, "taylor_adaptive", compiled)
    monkeypatch.setattr(hy, "cfunc", compiled)
    same_bits(first, rigidsim.run(experiment, out=None))


def test_the_cache_on_disk_stays_small_unless_somebody_set_its_limit() -> None:
    compiled_function([x * v], [x, v])
    assert hy.llvm_state.get_diskcache_limit() == DISK_LIMIT
    try:
        for limit in (DISK_LIMIT * 3, 0):
            hy.llvm_state.set_diskcache_limit(limit)
            limit_disk_cache.cache_clear()
            compiled_function([x * v + limit], [x, v])
            assert hy.llvm_state.get_diskcache_limit() == limit
    finally:
        hy.llvm_state.set_diskcache_limit(DISK_LIMIT)


def test_a_cache_that_cannot_be_written_stops_no_run(tmp_path: Path) -> None:
    """As on a full disk; a file in the cache's place does the same. The cache is chosen once per process."""
    (tmp_path / "file").touch()
    script = (
        "import warnings, heyoka as hy\n"
        "from rigidsim.solve.compiled import compiled_function\n"
        "x = hy.make_vars('x')\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    print(compiled_function([x * x], [x])([3.0])[0], [str(w.message) for w in told])\n"
    )
    cache = {"HEYOKA_CACHE_DIR": str(tmp_path / "file" / "cache")}
    found = subprocess.run(
        [sys.executable, "-c", script], env=os.environ | cache, capture_output=True, text=True, check=True
    )
    assert found.stdout.startswith("9.0 [\"compiled code isn't kept for the next process")
