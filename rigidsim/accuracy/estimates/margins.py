"""Assumptions and limits of the estimate of a run's errors."""

from __future__ import annotations

from rigidsim.scene.records import dataclass


@dataclass(frozen=True)
class Margins:
    """Assumptions and limits of an estimate of errors.

    With the defaults the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
    (``experiments/error_coverage.py``).

    Attributes:
        safety: over the root mean square of three neighbours; ``path``: of it, for position and velocity.
        drifted: growth of a step's error from which a loosely followed motion is another one; ``gone``: over
            what leaves no digit, from which that doesn't matter; ``tight_steps``: of runs that are followed
            tightly at most.
        strayed: distance from the run's own states, relative to their size, from which a loosely followed
            motion is another one; every so many ``looks`` waypoints it is looked at, of 16 to 32 in the run.
        most_anew: steps of a run whose own integrator follows it from then on.
        compared: over the largest difference from a closed form at some samples.
        angles, angle_series, momentum_series: errors of a step in Euler angles over those in quaternions: of
            rounding, and of series that a tolerance cuts off; of the latter with canonical momenta.
        near, very_near: singular factors below which canonical momenta lose more than elsewhere.
        cut_off: of a tolerance, what a step is wrong by in motions with switching surfaces.
        all_steps: that are followed whatever they cost: some 50 to 130 ms with what is compiled for them;
            ``passing_steps``: of flights with close passages, which windows would miss; ``own_steps``: where
            windows can only be looked at by the run's own integrator, at a tenth of that speed;
            ``most_own_steps``: that it takes at most; ``canonical_steps``: likewise of canonical runs that
            are followed whole, since what momenta lose beside the singularity isn't known well elsewhere.
        charts: steps in Euler angles and their momenta over those of quaternions, by which such runs are
            followed.
        uneven: longest step of a flight over its shortest, from which it passes something closely.
        share: of the run's cost that may be spent, where errors grow as those of stable motions do.
        lane: cost of a step of all neighbours, unrolled, over one of the run in double precision;
            ``unrolling``: of compiling that, in such steps.
        stage: steps of a run that is to be followed whole after all, before it is seen whether all is lost.
        switching_steps, switching_share: of a motion with switching surfaces, whose neighbours cost as much
            as itself each: steps that are followed whatever they cost, and share of the run's.
        dearer: a step in other precisions than one in double precision, roughly.
        windows: through the rest of the run, at most; ``window``: steps of each at least; ``beginning``:
            part of the steps that are followed from the start on, where there are windows.
        between_windows: by how much more errors grow at least where states have singularities, which may be
            passed between windows.
        stable: amplification up to which a motion is as stable as the law of rounding takes it to be.
        wary_power: of time that errors grow with in the beginning, from which runs of ``wary_steps`` at most
            are followed whole.
        power, most_power: of time that errors grow with, at least and at most, where no more was followed.
        exponential: power of time past which growth is none.
    """

    safety: float = 3.0
    drifted: float = 1e6
    gone: float = 1e6
    tight_steps: int = 50_000
    path: float = 0.5
    strayed: float = 1e-2
    looks: int = 4
    most_anew: int = 10_000
    compared: float = 3.0
    angles: float = 4.0
    angle_series: float = 5.0
    momentum_series: float = 20.0
    near: float = 0.2
    very_near: float = 0.01
    cut_off: float = 0.1
    all_steps: int = 20_000
    passing_steps: int = 60_000
    own_steps: int = 1_500
    most_own_steps: int = 20_000
    canonical_steps: int = 10_000
    charts: float = 2.5
    uneven: float = 10.0
    share: float = 0.05
    lane: float = 0.5
    unrolling: float = 1.3e4
    stage: int = 30_000
    switching_steps: int = 1000
    switching_share: float = 0.25
    windows: int = 16
    window: int = 128
    beginning: float = 0.6
    between_windows: float = 2.0
    dearer: tuple[tuple[str, float], ...] = (("single", 0.3), ("double", 1.0), ("extended", 10.0))
    stable: float = 4.0
    wary_power: float = 2.0
    wary_steps: int = 100_000
    power: float = 1.5
    most_power: float = 2.5
    exponential: float = 5.0


MARGINS = Margins()
