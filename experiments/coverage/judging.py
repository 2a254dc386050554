"""What a scene's run announces of its errors at the end, held against what is true there."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments.coverage import moments
from experiments.coverage.families import DEEP_TIME, SAMPLES, CoverageScene
from rigidsim.accuracy.reversal import there_and_back
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.scene.cautions import WarningCode
from rigidsim.scene.config import Experiment
from rigidsim.session.execution import Diagnostics
from rigidsim.session.session import SampleStatistics
from rigidsim.solve.assembly import Assembly, assemble
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Progress, SampleReceiver
from rigidsim.solve.status import Status

MOST_STEPS = 100_000
"""Of a scene; what would take longer is cut off, and counted as that."""
GONE = (WarningCode.ATTITUDE_UNCERTAIN, WarningCode.RATES_UNCERTAIN)
Vectors = list[list[mpmath.mpf]]
"""(samples, components)."""
_AXES = ("momentum_axis", "figure_axis")
_TURNS = ("double", "double", "extended", "quadruple", "single")
_SHORT = 20.0  # rad, of scenes that go forth and back
_TRUTH = {"single": "double", "double": "extended", "extended": "quadruple"}


@dataclass(frozen=True)
class Judged:
    """One scene.

    Attributes:
        ended: "finished", "refused", or how the run ended otherwise.
        true, announced: largest attitude error at the samples, the end among them, rad.
        true_place, announced_place: of the position, m; nan where there is none.
        warned: codes of the warnings but "digits are gone"; ``gone``: that one.
        drifting: invariants that are none: those of the better solution that drift by more than the root of
            their bound, which is far from rounding even where the energy has grown a thousandfold.
    """

    number: int
    family: str
    setting: str
    ended: str
    radians: float = math.nan
    steps: int = 0
    true: float = math.nan
    announced: float = math.nan
    true_place: float = math.nan
    announced_place: float = math.nan
    gone: bool = False
    warned: str = ""
    drifting: str = ""

    @property
    def line(self) -> str:
        """As the campaign goes."""
        place, more = "", [self.warned] if self.warned else []
        more += [f"no invariant: {self.drifting}"] * bool(self.drifting)
        if not math.isnan(self.true_place):
            place = f", place {self.true_place:.1e}/{self.announced_place:.1e}"
        ratio = self.true / max(self.announced, 1e-300)
        return (
            f"{self.number:5d} {self.family:24s} {self.setting:36s} {self.ended:10s} {self.steps:7d} steps, "
            f"true/announced {self.true:.1e}/{self.announced:.1e} = {ratio:.2g}{place}"
            + "".join(f", {what}" for what in ["gone"] * self.gone + more)
        )


class Kept(SampleReceiver):
    """Keeps all samples, and watches them as a run does."""

    def __init__(self, prepared: InitialValueProblem, evaluator: object) -> None:
        self._prepared, self._evaluator = prepared, evaluator
        self.statistics = SampleStatistics()
        self.trail = SampleTrail(prepared.precision)
        self.parts: dict[str, list[list[np.ndarray]]] = {}
        self.times: list[mpmath.mpf] = []  # s

    def take(self, block: SampleBlock) -> None:
        """Keep a block, and watch it."""
        self.trail.take(block)
        recorded = self._evaluator.evaluate(block)  # type: ignore[attr-defined]
        exact, exponent = self._prepared.precision.exact, round(math.log2(abs(self._prepared.clock.unit)))
        self.times += [mpmath.ldexp(exact(t), exponent) for t in block.times]
        for invariant in self._prepared.system.invariants:
            self.statistics.see(invariant.name, recorded[f"{invariant.name}_drift"][0][:, 0])
        factors = self._evaluator.singular_factors(block.states, block.chart)  # type: ignore[attr-defined]
        if factors is not None:
            self.statistics.see_singular(factors, np.array([float(t) for t in block.times]))
        for name, parts in recorded.items():
            self.parts.setdefault(name, []).extend([list(row) for row in zip(*parts, strict=True)])

    def exact(self, name: str) -> Vectors:
        """A variable at all samples."""
        with mpmath.workdps(80):
            return [
                [mpmath.fsum(float(x) for x in parts) for parts in zip(*row, strict=True)]
                for row in self.parts[name]
            ]


def judge(scene: CoverageScene) -> Judged:
    """Run a scene in memory, with its estimate, and then better."""
    turned, place = _recorded(scene)
    recorded = [*turned, *place]
    asked = [f"output.record={recorded}".replace("'", '"')]
    begin = Judged(scene.number, scene.family, _setting(scene), "refused", scene.radians)
    try:
        prepared = compactly(rigidsim.parse(scene.text, overrides=asked))
        seen, progress, parts = gone_through(prepared)
    except ConfigError:
        return begin
    begin = replace(begin, ended=progress.status.value, steps=progress.steps)
    if progress.status is not Status.FINISHED:
        return begin
    found = Diagnostics(prepared, progress, seen.statistics).estimated(seen.trail, parts.corrected)
    assert found.estimate is not None
    codes = [c.code for c in found.cautions()]
    truth, drifting = _truth(scene, asked, prepared)
    if truth is None:
        return replace(begin, ended="no truth")
    announced = found.estimate.attitude
    places = (math.nan, math.nan)
    for name in place:
        places = (float(apart(seen.exact(name), truth[name])), found.estimate.position or 0.0)
    return replace(
        begin,
        true=max(angle(seen.exact(name), truth[name]) for name in turned),
        announced=math.nan if announced is None else announced,
        true_place=places[0],
        announced_place=places[1],
        gone=any(code in GONE for code in codes),
        warned=" ".join(
            sorted({c.value for c in codes if c not in GONE and c is not WarningCode.NOT_JOINED})
        ),
        drifting=" ".join(drifting),
    )


def judge_average(scene: CoverageScene) -> Judged:
    """Run a scene averaged and in full; the axis whose announced error is nearest to the true one, or below
    it, stands for both.
    """
    experiment = rigidsim.parse(scene.text, overrides=["output.record=['momentum_axis','figure_axis']"])
    model = experiment.config.model
    begin = Judged(scene.number, scene.family, str(model.level), "refused", scene.radians)
    try:
        averaged = compactly(experiment)
    except ConfigError:
        return begin
    seen, progress, _ = gone_through(averaged)
    begin = replace(begin, ended=progress.status.value, steps=progress.steps)
    if progress.status is not Status.FINISHED:
        return begin
    found = Diagnostics(averaged, progress, seen.statistics).modelled(seen.trail)
    truth, progress, _ = gone_through(
        compactly(experiment.with_overrides(['model.level="full"'])), 2 * MOST_STEPS
    )
    if progress.status is not Status.FINISHED or found.modelling is None:
        return replace(begin, ended="no truth")
    announced = dict(zip(_AXES, (found.modelling.momentum_axis, found.modelling.figure_axis), strict=True))
    pairs = []
    for name in _AXES:
        apart = np.array(seen.exact(name), dtype=float) - np.array(truth.exact(name), dtype=float)
        pairs.append((float(np.linalg.norm(apart, axis=1).max()), announced[name] or 0.0))
    true, said = max(pairs, key=lambda pair: pair[0] / max(pair[1], 1e-300))
    codes = {caution.code for caution in found.cautions()}
    return replace(begin, true=true, announced=said, gone=WarningCode.MODEL_UNCERTAIN in codes)


def judge_reversal(scene: CoverageScene) -> Judged:
    """Integrate a shortened scene to its end and back; scenes take turns in direction and precision."""
    turn = "60" if scene.number % 60 == 59 else f'"{_TURNS[scene.number // 2 % len(_TURNS)]}"'
    setting = [] if "precision = " in scene.text else [f"integrator.precision={turn}"]
    end = float(scene.text.split("[time]\nend = ")[1].split("\n")[0])
    if scene.family != DEEP_TIME:  # whose table has rows on one side
        end *= min(1.0, _SHORT / scene.radians) * (-1) ** scene.number
    asked = [*setting, f"limits.max_steps={MOST_STEPS // 5}"]
    asked += [f"time.end={end!r}", "time.samples=2"]
    begin = Judged(scene.number, scene.family, " ".join(setting), "refused", scene.radians)
    try:
        found = there_and_back(rigidsim.parse(scene.text, overrides=asked), compact=True)
    except RigidsimError as error:
        return replace(begin, warned=str(error).splitlines()[-1])
    apart = found.rates if found.attitude is None else found.attitude
    known = {"true": apart or 0.0, "announced": math.nan if found.announced is None else found.announced}
    return replace(begin, ended="finished", steps=found.steps, **known)


def _recorded(scene: CoverageScene) -> tuple[list[str], list[str]]:
    """Names of the attitudes, or axes, and of the position where there is one."""
    if "[[rigid_bodies]]" in scene.text:
        return ["quaternion", "rigid_body_quaternion"], ["rigid_body_position"]
    start = scene.text.partition("[initial]")[2].partition("[[")[0]
    turned = "momentum_axis" if scene.family == DEEP_TIME else "quaternion"
    return [turned], ["position"] * ("position = " in start)


def _setting(scene: CoverageScene) -> str:
    lines = scene.text.split("[integrator]\n")[1].split("[output]")[0].splitlines()
    return ", ".join(
        line.split(" = ")[1].strip('"') if "formul" in line or "prec" in line else line for line in lines
    )


def compactly(experiment: Experiment) -> InitialValueProblem:
    """Prepared for equations that are compiled soon."""
    prepared = prepare(experiment)
    return replace(prepared, precision=replace(prepared.precision, compact=True))


def gone_through(prepared: InitialValueProblem, most: int = MOST_STEPS) -> tuple[Kept, Progress, Assembly]:
    """Integrate, unless it takes too many steps: samples, how it ended, what did it."""
    parts = assemble(prepared)
    seen = Kept(prepared, parts.evaluator)
    check: Callable[[Progress], Status | None] = lambda p: Status.MAX_STEPS if p.steps > most else None  # noqa: E731
    return seen, parts.driver(seen, check).run(), parts


def _truth(
    scene: CoverageScene, asked: list[str], prepared: InitialValueProblem
) -> tuple[dict[str, Vectors] | None, list[str]]:
    """The samples by a better solution: exact where a kink leaves no other, or where integrations might share
    what is wrong; else with more digits, with the names of the invariants that drift there.
    """
    if scene.family in ("kink", "late switch", "late spike"):
        last = prepared.scene.samples.last
        times = [last * n / (SAMPLES - 1) for n in range(SAMPLES)]
        with mpmath.workdps(moments.DIGITS):  # else times are rounded to doubles
            if scene.family == "kink":
                return {"quaternion": [kinked_attitude(prepared, mpmath.mpf(time)) for time in times]}, []
            angles = [moments.turned(prepared, scene.text, mpmath.mpf(time)) for time in times]
            return {"quaternion": [turned_attitude(prepared, 2, angle) for angle in angles]}, []
    precision = _TRUTH[prepared.precision.name]
    if precision == "extended" and "tolerance" in scene.text:
        precision = "double" if prepared.effective_tolerance > 1e-10 else "extended"
    better = [
        f'integrator.precision="{precision}"',
        'integrator.tolerance="auto"',
        "integrator.hold_invariants=false",
        *(() if scene.family == DEEP_TIME else ['integrator.formulation="quaternion"']),
    ]
    try:
        found = compactly(rigidsim.parse(scene.text, overrides=[*asked, *better]))
        seen, progress, _ = gone_through(found, 2 * MOST_STEPS)
    except ConfigError:
        return None, []
    if progress.status is not Status.FINISHED:
        return None, []
    bound = float(found.drift_bound(progress.steps))
    drifting = [name for name, drift in seen.statistics.largest.items() if not drift <= math.sqrt(bound)]
    names = asked[0].split("=")[1].strip("[]").replace('"', "").split(", ")
    return {name: seen.exact(name) for name in names}, drifting


def kinked_attitude(prepared: InitialValueProblem, end: mpmath.mpf) -> list[mpmath.mpf]:
    """The attitude at a time under a torque about one axis that is a root of a square, exactly.

    I w' = k |t - c|: w = w0 + (k / I) F(t), F the integral of |t - c|, and the angle its integral.
    I w' = -(k / n) |w - a| with a = 0.3 n: from w0 > a the rate falls to a exponentially and never gets
    there, from w0 < a it falls away from it.
    """
    scene = prepared.scene
    with mpmath.workdps(50):
        moment = mpmath.mpf(scene.body.principal_moments[0])
        given = {k: mpmath.mpf(v.at(scene.context)) for k, v in scene.config.parameters.items()}
        rates = [mpmath.mpf(w) for w in scene.angular_velocity]
        if "late" in given:
            c, k = given["late"], given["k"] / moment
            turned = rates[2] * end + k * _integral_of_kink(end, c)
            axis = 2
        else:
            low, k = mpmath.mpf("0.3") * given["n"], given["k"] / given["n"] / moment
            gap = rates[0] - low
            sign = -1 if gap > 0 else 1
            turned = low * end + gap * (mpmath.exp(sign * k * end) - 1) / (sign * k)
            axis = 0
        return turned_attitude(prepared, axis, turned)


def turned_attitude(prepared: InitialValueProblem, axis: int, angle: mpmath.mpf) -> list[mpmath.mpf]:
    """The attitude after the start's has turned by an angle about an axis of the body."""
    half = [mpmath.cos(angle / 2), mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(0)]
    half[axis + 1] = mpmath.sin(angle / 2)
    w, x, y, z = (mpmath.mpf(q) for q in prepared.scene.quaternion)
    a, b, c, d = half
    return [
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    ]


def _integral_of_kink(end: mpmath.mpf, c: mpmath.mpf) -> mpmath.mpf:
    """The double integral of |t - c| from 0 to the end, with c > 0."""
    if end <= c:
        return c * end**2 / 2 - end**3 / 6
    return c**3 / 3 + c**2 / 2 * (end - c) + (end - c) ** 3 / 6


def angle(one: Vectors, other: Vectors) -> float:
    """Largest between attitudes, rad, up to the quaternions' sign, or axes; a norm off 1 counts."""
    sizes = (2, (1,)) if len(one[0]) == 3 else (4, (1, -1))
    with mpmath.workdps(60):
        chords = [
            min(apart([p], [[sign * x for x in q]]) for sign in sizes[1])
            for p, q in zip(one, other, strict=True)
        ]
        lost = any(map(mpmath.isnan, chords))
        return math.pi if lost else float(sizes[0] * mpmath.asin(min(max(chords) / 2, 1)))


def apart(one: Vectors, other: Vectors) -> Any:
    """Largest distance, mpf, with every digit of both whatever the caller works with."""
    pairs = zip(one, other, strict=True)
    with mpmath.workdps(60):
        return max(mpmath.norm([mpmath.mpf(a) - b for a, b in zip(p, q, strict=True)]) for p, q in pairs)
