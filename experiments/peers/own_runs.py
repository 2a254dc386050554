"""rigidsim by its public face: config, run, dataset; CPU seconds of the integration and of the whole run.

What a run's integration takes includes recording: all variables and drifts at the samples, their statistics
and what is packed for the file. Peers do none of that; with "propagated" neither does rigidsim.
"""

import tempfile
import time
from collections.abc import Callable

import rigidsim
from experiments.peers import Answer
from experiments.peers.scenes import Scene
from rigidsim.session.session import Observer
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.problem import prepare as prepared_from
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import SampleReceiver
from rigidsim.solve.status import Status

PROPAGATED = "rigidsim, propagated alone"
TITLES = {
    "auto": "rigidsim, formulation auto",
    "propagated": PROPAGATED,
    "quaternion": "rigidsim, quaternion",
    "rotation_matrix": "rigidsim, rotation matrix",
    "euler_angles": "rigidsim, Euler angles",
    "held": "rigidsim, invariants held",
    "extended": "rigidsim, 80 bit",
    "closed_form": "rigidsim, closed form",
    "accuracy": "rigidsim, accuracy asked for",
}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Tolerances, or accuracies; what this version or scene refuses is skipped by ``prepare``."""
    if variant in ("auto", "propagated"):  # elsewhere that is the quaternion
        return [m * 10.0**-n for n in range(5, 13) for m in (1, 0.5, 0.3)] if scene.orbit_rate else []
    if variant == "accuracy":
        return [1e-6, 1e-9, 1e-12]
    if variant == "closed_form":
        return [2.0**-52]
    if variant == "extended":
        return [1e-16, 2.0**-63]
    if variant in ("rotation_matrix", "euler_angles"):
        return [2.0**-52]
    return [10.0**-n for n in range(3, 16)] + [2.0**-52]


def overrides(variant: str, knob: float) -> list[str]:
    """``KEY=VALUE`` texts of a setting."""
    if variant == "accuracy":
        return [f"integrator.accuracy={knob!r}"]
    if variant == "closed_form":
        return ['integrator.method="closed_form"']
    settings = [f"integrator.tolerance={knob!r}"]
    if variant == "extended":
        return [*settings, "integrator.hold_invariants=false", 'integrator.precision="extended"']
    if variant == "held":
        return [*settings, "integrator.hold_invariants=true"]
    formulation = "auto" if variant == "propagated" else variant
    return [*settings, "integrator.hold_invariants=false", f'integrator.formulation="{formulation}"']


class Clock(Observer):
    """CPU seconds of the last phase named "integrate": to the last sample, recording included."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._since: float | None = None

    def phase(self, name: str) -> None:
        """Start or stop."""
        now = time.process_time()
        if self._since is not None:
            self.seconds = now - self._since
            self._since = None
        if name == "integrate":
            self._since = now


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Answer]:
    """See ``experiments.peers``.

    Raises:
        ValueError: the setting isn't there in this version, or not for this scene; from the function
            returned as well.
        RuntimeError: from the function returned: the run didn't finish.
    """
    try:
        experiment = rigidsim.parse(scene.config(end), overrides=overrides(variant, knob))
    except rigidsim.ConfigError as error:
        raise ValueError(str(error)) from None
    if variant == "propagated":
        problem = prepared_from(experiment)
        return lambda: _propagated(problem)

    def solve() -> Answer:
        with tempfile.TemporaryDirectory() as folder:
            clock = Clock()
            try:
                run = rigidsim.run(experiment, out=folder, observer=clock)
            except rigidsim.RigidsimError as error:
                raise ValueError(str(error)) from None
            if run.status != "finished":
                raise RuntimeError(f"{scene.name}: {run.status}: {run.summary['message']}")
            with run.dataset as dataset:
                quaternion = [float(q) for q in dataset["quaternion"].values[-1]]
        return Answer(quaternion, clock.seconds)

    return solve


class _Kept(SampleReceiver):
    """Keeps the samples, and nothing else."""

    def __init__(self) -> None:
        self.blocks: list[SampleBlock] = []

    def take(self, block: SampleBlock) -> None:
        """Keep it."""
        self.blocks.append(block)


def _propagated(problem: InitialValueProblem) -> Answer:
    """The integration through all samples and the quaternion there, without what a run does around it.

    The integrator is a copy of one that was compiled before, as with the peers.
    """
    parts, kept = assemble(problem), _Kept()
    started = time.process_time()
    progress = parts.driver(kept).run()
    for block in kept.blocks:
        recorded = parts.evaluator.evaluate(block)
    quaternion = recorded["quaternion"][0][-1].tolist()
    seconds = time.process_time() - started
    if progress.status is not Status.FINISHED:
        raise RuntimeError(f"{problem.scene.name}: {progress.status}")
    return Answer(quaternion, seconds)
