"""Assumptions and limits of the estimate of a run's errors."""

from __future__ import annotations

from dataclasses import dataclass

LAST_BITS = 0.5
"""Epsilons by which a recorded value is wrong at most because it is rounded."""
LABEL = 0.25
"""Epsilons by which a sample's time is taken to be rounded: what is recorded belongs to another moment."""
AS_LARGE = 4.0
"""Bound for the error of a position that can't be predicted, over the size of the path: the whole way."""


@dataclass(frozen=True)
class Margins:
    """Assumptions and limits of an estimate of errors.

    With the defaults the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
    (``experiments/error_coverage.py``).

    Attributes:
        safety, path: factor on the root mean square of three perturbed motions; further factor for
            position and velocity.
        drifted, gone, tight_steps: growth of a step's error from which a loosely followed motion becomes a
            different one; growth, over that which leaves no digit, from which this doesn't matter; largest
            number of steps of a run that is followed tightly.
        strayed, looks: distance from the run's own states, relative to their size, from which a loosely
            followed motion counts as different; it is checked at every so many of the 16 to 32 waypoints.
        most_anew: largest number of steps of a run that its own integrator follows from then on.
        compared: factor on the largest difference from a closed form at some samples.
        angles, angle_series, momentum_series: errors of a step in Euler angles, over those in quaternions:
            rounding; truncation at a tolerance; truncation with canonical momenta.
        near, very_near: singular factors below which canonical momenta lose more than elsewhere.
        cut_off: a step's error, over the tolerance, in motions with switching surfaces.
        all_steps: steps that are followed whatever they cost: some 50 to 130 ms, compiling included.
        passing_steps: the same for flights with close passages, which windows would miss.
        own_steps, most_own_steps: the same, and the largest number, if only the run's own integrator can
            follow windows, at a tenth of the speed.
        canonical_steps: the same for canonical runs that are followed whole, since the loss of momenta near
            the singularity isn't known well elsewhere.
        charts: ratio of steps in Euler angles and their momenta to those in quaternions, with which such runs
            are followed.
        uneven: ratio of a flight's longest step to its shortest from which it has close passages.
        share: share of the run's cost that may be spent if errors grow as in stable motions.
        lane, unrolling: cost of a step of all neighbours, unrolled, over one of the run in double precision;
            cost of compiling that, in such steps.
        stage: steps after which a run that must be followed whole is checked for having lost all digits.
        switching_steps, switching_share: for a motion with switching surfaces, each of whose neighbours costs
            as much as itself: steps that are followed whatever they cost, and share of the run's.
        dearer: approximate cost ratio of a step in other precisions to one in double precision.
        windows, window, beginning: largest number of windows through the rest of the run; least number of
            steps of each; share of the steps that are followed from the start if there are windows.
        between_windows: least extra growth assumed if states have singularities, which may be passed between
            windows.
        stable: amplification up to which a motion is as stable as the round-off law assumes.
        wary_power, wary_steps: power of time of the errors' growth in the beginning from which runs of at
            most so many steps are followed whole.
        power, most_power: least and largest power of time by which errors are extrapolated.
        exponential: power of time past which growth counts as exponential.
    """

    safety: float = 2.75
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
