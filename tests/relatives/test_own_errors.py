"""Errors of the code, a user's own and rigidsim's, are tracebacks, never a config's fault or a member's fate.

The truth is the very exception that was raised.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from support import config, run_text, seeds, unoptimised_code

import rigidsim
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.observables import Observable, only_when_named
from rigidsim.scene.registry import LOADS, OBSERVABLES, LoadFields, register_load, register_observable

ERRORS = [
    TypeError, AttributeError, KeyError, IndexError, ZeroDivisionError, FloatingPointError, RuntimeError,
    AssertionError, MemoryError, NotImplementedError, RecursionError, EOFError, NameError, BufferError,
    OSError, LookupError, ArithmeticError, ValueError,
]  # fmt: skip
PLACES = ["reads", "torque", "amplitude", "observable"]
TEXT = config(
    initial="angular_velocity = [0.1, 0.2, 0.3]\n{initial}",
    loads='kind = "raising"',
    time="end = 5\nsamples = 6",
    output='record = ["angular_velocity", "raising"]',
    more="{more}",
    estimate=True,
)
SWEEP = """
[sweep]
keep = ["final"]
batch = {batch}
axes."initial.angular_velocity[0]" = {{values = [0.1, 0.2, 0.3]}}
"""


class Raising(Load):
    """Raises an error at one of its places, from some member on."""

    class Fields(LoadFields):
        """No keys."""

        kind: Literal["raising"]

    title = "raising"
    error: BaseException | None = None
    place = ""
    above = 0.0

    @classmethod
    def resolve(cls, fields: Any, around: Any) -> Raising:
        return cls()

    @classmethod
    def raises(cls, place: str, rate: Any = 1.0) -> None:
        if place == cls.place and cls.error is not None and float(rate) > cls.above:
            raise cls.error

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        self.raises("reads")
        return frozenset()

    def torque(self, m: Kinematics) -> list[Term]:
        self.raises("torque", m.scene.angular_velocity[0])
        zero = m.scene.context.zero
        return [([m.scene.context.mpf("0.01"), zero, zero], m.rates[1])]

    def amplitude(self, scene: Any) -> Any:
        self.raises("amplitude", scene.angular_velocity[0])
        return scene.context.mpf("0.01")


def observed(m: Kinematics) -> list[Any]:
    Raising.raises("observable", m.scene.angular_velocity[0])
    return [m.rates[0]]


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    register_load(Raising)
    register_observable(Observable("raising", (), "rad/s", "a rate", observed, by_default=only_when_named))
    with unoptimised_code():
        yield
    Raising.error = None
    del LOADS["kind"]["raising"], OBSERVABLES["raising"]


def ways(folder: Path, seed: int) -> dict[str, Callable[[], Any]]:
    """Every way in which a motion is worked out."""
    initial = ["", "euler_angles = [0.1, 1, 0.2]"][seed % 2]
    plain = TEXT.format(initial=initial, more="")
    data = folder / "data.csv"
    data.write_text("time,wx,wy,wz\n" + "".join(f"{t},0.1,0.2,0.3\n" for t in range(6)))
    fit = f'[fit]\nparameters = ["initial.angular_velocity[1]"]\n[[fit.data]]\nfile = "{data}"\n'
    fit += 'observable = "angular_velocity"\ncolumns = ["wx", "wy", "wz"]\nsigma = 0.1'
    numbers = itertools.count()

    def given(more: str) -> rigidsim.Experiment:
        return rigidsim.parse(TEXT.format(initial=initial, more=more))

    def swept(batch: str) -> Any:
        return rigidsim.sweep(given(SWEEP.format(batch=batch)), out=folder / str(next(numbers)))

    return {
        "run": lambda: run_text(plain, estimate=True),
        "sweep": lambda: swept("true"),
        "one by one": lambda: swept("false"),
        "fit": lambda: rigidsim.fit(given(fit)),
        "plan": lambda: rigidsim.plan(given("")),
        "sensitivity": lambda: run_text(plain, "output.sensitivity=['initial.angular_velocity[1]']"),
    }


@pytest.mark.parametrize("seed", seeds(1, 54))
def test_errors_are_raised(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    Raising.place, kind = str(draw.choice(PLACES)), ERRORS[seed % len(ERRORS)]
    for name, way in ways(tmp_path, seed).items():
        if Raising.place == "observable" and name not in ("run", "sweep", "one by one"):
            continue  # others needn't record it
        Raising.error = kind(f"a defect of {seed}")
        several = "sweep" in name or "one" in name
        Raising.above = 0.25 if several and Raising.place in ("torque", "observable") else 0.0
        with pytest.raises(kind, match=f"a defect of {seed}") as caught:
            way()
        assert caught.value is Raising.error, name
