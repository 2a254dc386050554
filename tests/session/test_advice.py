"""What a run says would do better does, by as much; and what can't be promised isn't said."""

from typing import Any

import pytest
from support import config

import rigidsim
from rigidsim.cli.screens.summary import verdict_line
from rigidsim.scene.cautions import WarningCode
from rigidsim.session.verdict import LEAST, Soundness, verdict_on
from rigidsim.store.summary import AdviceCode

LONG = config(  # some 24,000 steps
    time="end = 12000\nsamples = 101", integrator="hold_invariants = false", estimate=True
)


def run(text: str, **changes: Any) -> rigidsim.Run:
    return rigidsim.run(rigidsim.parse(text), changes=changes.get("changes", {}), out=None)


@pytest.fixture(scope="module")
def plain() -> rigidsim.Run:
    return run(LONG)


def advised(run: rigidsim.Run) -> dict[str, dict[str, Any]]:
    return {row["code"]: row for row in run.summary.get("advice", [])}


def error(run: rigidsim.Run) -> float:
    return float(run.summary["accuracy"]["estimated_attitude_error"])


@pytest.mark.parametrize(
    ("code", "key", "value"),
    [
        (AdviceCode.HOLD_INVARIANTS, "integrator.hold_invariants", True),
        (AdviceCode.CLOSED_FORM, "integrator.method", "closed_form"),
    ],
)
def test_advice_keeps_its_word(plain: rigidsim.Run, code: AdviceCode, key: str, value: Any) -> None:
    promised = advised(plain)[code.value]
    assert promised["now"] == error(plain)
    assert promised["then"] < promised["now"] / 30
    better = run(LONG, changes={key: value})
    # "about": the estimate of a held run has a margin of 3 over what it found against the closed form
    assert error(better) <= 3 * promised["then"]


def test_what_has_no_closed_form_is_promised_nothing() -> None:
    driven = config(
        time="end = 3000\nsamples = 11",
        loads='kind = "torque"\ncomponents = ["1e-9", "0", "0"]',
        estimate=True,
    )
    assert advised(run(driven)) == {}


def test_no_verdict_contradicts_a_warning(plain: rigidsim.Run) -> None:
    """Over all warnings, and all ways in which an invariant, a norm by definition too, can drift."""
    assert set(LEAST) == set(WarningCode)
    degrees = list(Soundness)
    for code, least in LEAST.items():
        warned = plain.outcome.having(warnings=("?",), warning_codes=(code.value,))
        assert degrees.index(verdict_on(warned).soundness) >= degrees.index(least)
        told, _ = verdict_line(warned)
        assert told.startswith("sound: ") == (least is Soundness.SOUND)
    unknown = plain.outcome.having(warnings=("?",), warning_codes=("of a later version",))
    assert not verdict_line(unknown)[0].startswith("sound: ")
    for name, row in plain.summary["invariants"].items():
        drifted = plain.outcome.invariants[name].having(largest_drift=3 * row["bound"])
        found = verdict_on(plain.outcome.having(invariants={**plain.outcome.invariants, name: drifted}))
        assert (found.soundness, found.worst) == (Soundness.DRIFTED, name)
        assert found.share == pytest.approx(3)
