"""Assumptions and limits of the estimate of a run's errors.

With these the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
(``experiments/error_coverage.py``).
"""

LAST_BITS = 0.5  # epsilons by which a recorded value is wrong at most because it is rounded
LABEL = 0.25  # the same for a sample's time: what is recorded belongs to another moment
AS_LARGE = 4.0  # bound for the error of a position that can't be predicted, over the whole way's size

SAFETY = 2.75  # factor on the root mean square of three perturbed motions
PATH = 0.5  # further factor for position and velocity
COMPARED = 3.0  # factor on the largest difference from a closed form at some samples
STABLE = 4.0  # amplification up to which a motion is as stable as the round-off law assumes
POWER, MOST_POWER = 1.5, 2.5  # least and largest power of time by which errors are extrapolated
EXPONENTIAL = 5.0  # power of time past which growth counts as exponential

# errors of a step
ANGLES, ANGLE_SERIES = 4.0, 5.0  # in Euler angles over those in quaternions: rounding, truncation
MOMENTUM_SERIES = 20.0  # truncation with canonical momenta
NEAR, VERY_NEAR = 0.2, 0.01  # singular factors below which canonical momenta lose more than elsewhere
CUT_OFF = 0.1  # over the tolerance, in motions with switching surfaces in Euler angles or their momenta

# a loosely followed motion
DRIFTED = 1e6  # growth of a step's error from which it becomes a different one
GONE = 1e6  # growth, over that which leaves no digit, from which this doesn't matter
TIGHT_STEPS = 50_000  # most steps of a run that is followed tightly
STRAYED = 1e-2  # distance from the run's own states, over their size, from which it counts as different
LOOKS = 4  # that is checked at every so many of the 16 to 32 waypoints
MOST_ANEW = 10_000  # most steps of a run that its own integrator follows from then on

# how far is followed
ALL_STEPS = 20_000  # steps that are followed whatever they cost: some 50 to 130 ms, compiling included
PASSING_STEPS = 60_000  # the same for flights with close passages, which windows would miss
UNEVEN = 10.0  # ratio of a flight's longest step to its shortest from which it has close passages
OWN_STEPS, MOST_OWN_STEPS = 1_500, 20_000
"""The same, and the most, if only the run's own integrator can follow windows, at a tenth of the speed."""
CANONICAL_STEPS = 10_000
"""The same for canonical runs, followed whole: the loss of momenta near the singularity isn't known well."""
CHARTS = 2.5  # ratio of steps in Euler angles and their momenta to those in quaternions that follow them
SHARE = 0.05  # of the run's cost that may be spent if errors grow as in stable motions
LANE, UNROLLING = 0.5, 1.3e4
"""Cost of a step of the whole ensemble, unrolled, over one of the run in double precision; and that of
compiling it, in such steps.
"""
STAGE = 30_000  # steps after which a run that must be followed whole is checked for having lost all digits
SWITCHING_STEPS, SWITCHING_SHARE = 1000, 0.25
"""Steps followed whatever they cost, and share of the run's, with switching surfaces, where each perturbed
motion costs as much as the run.
"""
DEARER = {"single": 0.3, "double": 1.0, "extended": 10.0}  # approximate cost of a step, over double's
WINDOWS, WINDOW = 16, 128  # most windows through the rest of the run, and least steps of each
BEGINNING = 0.6  # share of the steps that are followed from the start if there are windows
BETWEEN_WINDOWS = 2.0  # least extra growth where states have singularities, passed between windows perhaps
WARY_POWER, WARY_STEPS = 2.0, 100_000
"""Power of time of the errors' growth in the beginning from which runs of at most so many steps are followed
whole.
"""
