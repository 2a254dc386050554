"""What is compiled is compiled once, and serves only what asks for the very same."""

from collections.abc import Callable
from typing import Any

import heyoka as hy
import pytest
from support import same_bits

import rigidsim

pytestmark = pytest.mark.optimised


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
