"""Invariants that have no value at some samples: their drift isn't known there, which counts as drifted.

The truth is the sign of a recorded rate less a number, whose logarithm the invariant takes times nothing.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from support import config, run_text, seeds, unoptimised_code

import rigidsim
from rigidsim.model.observables import Observable, only_when_named
from rigidsim.scene.registry import OBSERVABLES, register_observable

NAME = "constant_where_defined"
LEAST = [0.0]
TEXT = config(
    initial="angular_velocity = [0.5, 0.4, {rate}]",
    time="end = 20\nsamples = 41",
    output=f'record = ["angular_velocity", "{NAME}"]',
)
SWEEP = '[sweep]\nkeep = ["extremes"]\naxes."initial.angular_velocity[2]" = {values = [0.1, 0.3, 0.5, 0.7]}'


def value(m: Any) -> list[Any]:
    number = m.number(m.scene.context.mpf(LEAST[0] * 2.0**m.scaling.time))
    return [1.0 + 2.0**-300 * hy.log(m.rates[0] - number)]


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    register_observable(
        Observable(
            NAME, (), "1", "one, or nothing", value, by_default=only_when_named,
            conserved=lambda m: "a constant", drift_scale=lambda m: (m.scene.context.one, "one"),
        )
    )  # fmt: skip
    with unoptimised_code():
        yield
    del OBSERVABLES[NAME]


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_drifts(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    LEAST[0] = float(draw.uniform(-0.7, 0.45))
    text = TEXT.format(rate=float(draw.uniform(0.1, 0.9)))
    run = run_text(text)
    defined = run.dataset.angular_velocity.values[:, 0] > LEAST[0]
    row = run.summary["invariants"][NAME]
    assert (row["largest_drift"] is None) == (not defined.all())
    assert (row["final_drift"] is None) == (not defined[-1])
    assert ("drift" in run.summary["warning_codes"]) == (not defined.all())
    guarded = run_text(text, "limits.max_drift=1e-6")
    assert (guarded.summary["status"] == "stopped: max_drift") == (not defined.all())
    until = len(defined) if defined.all() else int(np.argmin(defined)) + 1
    assert len(guarded.dataset.time) == until
    with rigidsim.sweep(rigidsim.parse(text + SWEEP), out=tmp_path).dataset as members:
        lost = members.angular_velocity_min.values[:, 0] <= LEAST[0]
        flags = members.warnings.attrs
        masks = dict(zip(flags["flag_meanings"].split(), flags["flag_masks"], strict=True))
        assert ((members.warnings.values & masks["drift"] > 0) == lost).all()
