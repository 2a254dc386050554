"""Which variables of a recorded run are shown as variables of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import rigidsim
from rigidsim.look.thinning import thin
from rigidsim.store.variables import parts_in


@pytest.mark.parametrize(("digits", "parts"), [("50", 4), ("120", 8)])
def test_no_residual_is_a_variable_of_its_own(
    digits: str, parts: int, free_body: Callable[..., str], tmp_path: Path
) -> None:
    """However many float64 numbers a value takes: 50 digits are 169 bits, four times 53 with room."""
    run = rigidsim.run(rigidsim.parse(free_body("end = 1\nsamples = 4", precision=digits)), out=tmp_path)
    with run.dataset as dataset:
        assert len(parts_in(dataset, "angular_velocity")) == parts
        shown = thin(dataset, 10)
        assert {"angular_velocity", "quaternion", "energy", "energy_drift"} <= set(shown)
        assert not any("_lo" in str(name) for name in shown)
