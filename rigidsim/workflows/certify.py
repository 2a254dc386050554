"""Certifying a finished run against an independent solution, if its config asks for an accuracy."""

from collections.abc import Sequence
from typing import Any, TypeVar

from rigidsim.accuracy.certificate import certify, verdict
from rigidsim.accuracy.choice import Choice
from rigidsim.accuracy.setting import asked_of_attitude, wanted
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.session.session import Session
from rigidsim.solve.status import Status
from rigidsim.store.run import Run
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import Caution, WarningCode

AnyRun = TypeVar("AnyRun", bound=Run)


def certified(
    result: AnyRun,
    experiment: Experiment,
    choice: Choice | None,
    session: Session,
    loads: Sequence[Load] = (),
) -> tuple[AnyRun, bool]:
    """Certify a finished run, if its config asks for an accuracy: the certificate is put into its summary."""
    integrator, summary = experiment.config.integrator, result.outcome
    accuracy, length = wanted(experiment), integrator.accuracy_position
    complete = result.status in (Status.FINISHED.value, Status.EVENT.value)
    if accuracy is None or not complete or not isinstance(summary, Summary):
        return result, True
    session.observer.phase("certify")
    key, requested = asked_of_attitude(experiment) or ("accuracy", None)
    place = None if length is None else float(length)
    with result.dataset as dataset:
        found = certify(
            dataset,
            experiment,
            accuracy=accuracy,
            accuracy_position=place,
            loads=loads,
            known=None if choice is None else choice.known,
            told=session.observer.trying,
        )
    known: dict[str, Any] = {"requested": requested}
    if place is not None:
        known["requested_position"] = place
    doubt: str | None = "too little was recorded to certify the accuracy asked for"
    if found is not None:
        doubt = verdict(found, requested, place, key=key)
        known |= found.as_dict()
    if choice is not None:
        known |= {"chosen": choice.setting.title, "chosen_why": choice.why, "forecast": choice.forecast}
    cautions = summary.cautions
    if doubt is None:  # a certified error needs no estimate
        cautions = [c for c in cautions if c.code is not WarningCode.ATTITUDE_UNCERTAIN]
    else:
        cautions.append(Caution(WarningCode.NOT_CERTIFIED, doubt))
    session.phases.next("certify")
    phases, effort = session.phases, session.effort
    cost = summary.cost.having(
        seconds=dict(phases.wall),
        cpu_by_phase=dict(phases.cpu),
        cpu_seconds=effort.cpu,
        wall_seconds=effort.wall,
    )
    summary = summary.warned(cautions).having(accuracy=summary.accuracy.having(**known), cost=cost)
    return result.concluded(summary), doubt is None
