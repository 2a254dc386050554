"""Rounding makes the energy wander without direction (Brouwer 1937); a series cut off too early pushes it.

In 1e5 rad of single precision a push by a hundredth of a rounding per step is seen in the mean over two dozen
starts: it adds up like t, and the wandering, of which the mean has a fifth, like t^0.5.
"""

import math

import numpy as np
from support import EPSILON, config, loaded, run_text

import rigidsim

HORIZONS = {"single": 131_072.0, "extended": 65_536.0}  # rad


def scene(start: int, precision: str = "single", tolerance: float | str = "auto") -> rigidsim.Experiment:
    """Rates alone of a plain run, a few thousandths off, in binary fractions that every precision has."""
    offsets = np.random.default_rng([start, 20]).integers(-64, 65, size=3) / 16384
    rates = (repr(rate + float(offset)) for rate, offset in zip((0.5, 0.25, 1.0), offsets, strict=True))
    text = config(
        "principal_moments = [1, 2, 3]",
        f"angular_velocity = [{', '.join(rates)}]",
        time=f"end = {HORIZONS.get(precision, 10)}\nsamples = 2",
        integrator=f'precision = "{precision}"\ntolerance = {tolerance!r}\n'.replace("'", '"')
        + "hold_invariants = false",
        output='record = ["angular_velocity"]',
    )
    return rigidsim.parse(text)


def test_what_auto_stands_for_is_recorded() -> None:
    """Double precision's epsilon needs an order of 19.02, and so leaves 0.98; others leave at most 0.3."""
    for precision, below in (("single", 3), ("double", 0), ("extended", 3), ("quadruple", 3)):
        run = rigidsim.run(scene(0, precision), changes={"time.end": 10}, out=None)
        assert run.summary["tolerance"] == math.ldexp(EPSILON[precision], -below)
        assert run.dataset.attrs["tolerance"] == run.summary["tolerance"]
    assert loaded(run_text(scene(0).text, "time.end=10")).attrs["taylor_order"] == 11
