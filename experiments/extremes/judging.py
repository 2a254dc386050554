"""What a run says of a scene, held against its closed form at many digits.

A result is right within the round-off law, or its doubts are announced, or the scene is refused. All else is
a wrong answer given in silence.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath

import rigidsim
from experiments.coverage.judging import Kept, angle, apart, gone_through
from experiments.extremes.scenes import Extreme, Way
from rigidsim.accuracy.estimates import round_off_law
from rigidsim.errors import ConfigError
from rigidsim.scene.cautions import WarningCode
from rigidsim.session.execution import Diagnostics
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.status import Status

FACTOR = 3.0
"""Between an error and the law or estimate that covers it."""
_EVALUATION = 16.0
"""eps; the initial state, and a sample made of the state, are some thirty operations on numbers up to 1."""
_WALK = 4.0
"""eps sqrt(steps): the walk of the attitude itself, a few roundings of each component and step."""
_CLOSED = 50.0
"""eps; thirty operations, and numpy's sines are right to 4 ulp."""
_DIGITS = 50
MOST_STEPS = 10**9
"""More than a scene to 1e8 radians takes."""


@dataclass(frozen=True)
class Verdict:
    """What became of one scene in one formulation.

    Attributes:
        kind: "right", "announced", "refused", or "SILENT".
        error: largest at the samples, rad, or relative to the rates; nan where refused.
        bound: three times the law, and the last bits of a sample.
        estimate: the run's own, or None.
        text: message or warnings.
    """

    scene: Extreme
    way: Way
    kind: str
    text: str
    error: float = math.nan
    bound: float = math.nan
    estimate: float | None = None

    @property
    def line(self) -> str:
        """For lists of what went wrong."""
        estimate = "none" if self.estimate is None else f"{self.estimate:.2e}"
        return (
            f"{self.kind}: {self.scene.row} / {self.scene.name} / {self.way.title}: error "
            f"{self.error:.2e}, bound {self.bound:.2e}, estimate {estimate}; {self.text}"
        )


def judge(scene: Extreme, way: Way) -> Verdict:
    """Run a scene in one way."""
    try:
        prepared = prepare(rigidsim.parse(scene.text(way)))
        samples, progress, *_ = gone_through(prepared, MOST_STEPS)
    except ConfigError as refusal:
        return Verdict(scene, way, "refused", str(refusal).replace("\n", " "))
    if progress.status is not Status.FINISHED:
        return Verdict(scene, way, "refused", f"the run ended: {progress.status.value}")
    diagnostics = Diagnostics(prepared, progress, samples.statistics).estimated(samples.trail)
    assert diagnostics.estimate is not None
    found, estimate = diagnostics.cautions(), diagnostics.estimate.leading
    error = _largest_error(scene, way.column, prepared, samples)
    epsilon = float(prepared.precision.epsilon)
    duration = float(samples.times[-1] - samples.times[0])
    tolerance, rate = max(prepared.effective_tolerance, epsilon), float(prepared.system.rate_bound)
    law = round_off_law(tolerance, progress.steps, rate, duration)
    steps = math.sqrt(max(progress.steps, 1))
    closed = prepared.algorithm.form is not None
    last_bits = _CLOSED * epsilon if closed else epsilon * (_EVALUATION + _WALK * steps)
    bound = last_bits if closed else FACTOR * law + last_bits
    doubts = [c for c in found if c.code not in (WarningCode.NOT_JOINED, WarningCode.NO_EFFECT)]
    covered = error <= FACTOR * estimate + last_bits
    kind = "SILENT"
    if error <= bound and covered:
        kind = "right"
    elif doubts or covered:
        kind = "announced"
    return Verdict(scene, way, kind, "; ".join(c.text for c in found), error, bound, estimate)


def _largest_error(scene: Extreme, column: str, prepared: InitialValueProblem, samples: Kept) -> float:
    form = reference(scene)
    rows = samples.exact("angular_velocity" if column == "rates" else "quaternion")
    with mpmath.workdps(_DIGITS + 20):
        exact = [form.exactly(time, _DIGITS) for time in samples.times]
        if column != "rates":
            return angle(rows, [q for _, q in exact])
        inertia = [[mpmath.mpf(x) for x in row] for row in prepared.scene.body.inertia]
        rates = [w for w, _ in exact]
        momenta = [[[mpmath.fdot(r, w) for r in inertia] for w in part] for part in (rows, rates)]
        return float(max(_relative(rows, rates), _relative(*momenta)))


_known: dict[str, ClosedForm] = {}


def reference(scene: Extreme) -> ClosedForm:
    """The scene's closed form, at many digits.

    Raises:
        ValueError: it has none, and doesn't belong into the table.
    """
    text = scene.text(Way("closed_form", _DIGITS))
    if text not in _known:
        try:
            _known[text] = closed_form_of(prepare(rigidsim.parse(text)).scene)
        except NoClosedForm as none:
            raise ValueError(f"{scene.row}, {scene.name}: {none}") from None
    return _known[text]


def _relative(found: Sequence[Any], exact: Sequence[Any]) -> Any:
    """Largest difference over the largest size, of vectors at all samples."""
    size = max(mpmath.norm(x) for x in exact)
    far = [apart([one], [other]) for one, other in zip(found, exact, strict=True)]
    largest = mpmath.inf if any(map(mpmath.isnan, far)) else max(far)
    return largest / size if size else largest
