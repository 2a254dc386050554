"""Assumptions and limits of the estimate of a run's errors.

With these the errors of the campaign's scenes are covered as ``experiments/README.md`` shows
(``experiments/error_coverage.py``).
"""

LAST_BITS = 0.5  # epsilons by which a recorded value is wrong at most because it is rounded
LABEL = 0.25  # the same for a sample's time: what is recorded belongs to another moment
AS_LARGE = 4.0  # bound for the error of a position that can't be predicted, over the whole way's size
UNCERTAIN = 1e-2  # error (rad, or relative to the rates) above which a result counts as lost

SAFETY = 2.75  # factor on the root mean square of three tangents
PATH = 0.5  # further factor for position and velocity
COMPARED = 3.0  # factor on the largest difference from a better solution at some samples
STABLE = 4.0  # amplification up to which a motion is as stable as the round-off law assumes
POWER, MOST_POWER = 1.5, 2.5  # least and largest power of time by which errors are extrapolated
EXPONENTIAL = 5.0  # power of time past which growth counts as exponential

# errors of a step
ANGLES = 4.0  # rounding in Euler angles over that in quaternions
NEAR, VERY_NEAR = 0.2, 0.01  # singular factors below which canonical momenta lose more than elsewhere
COARSE = 8.0  # tolerance in epsilons from which a better solution in the next precision shows the error
BETTER = 2.0**-10  # factor on the tolerance of that solution

# how far is followed
WHOLE = 100_000  # steps of a run that is followed to its end: some 0.3 s; of a longer one
BEGINNING = 0.25  # that many, or this part
SWITCHING = 1000, 0.1  # the same with switching surfaces, where each tangent costs as much as the run
TOLERANCE = 1e-8  # of steps with tangents, whose motion begins anew at 16 to 32 places of the run
BY_ITSELF, UNROLLED, OPTIMISED = 1_000, 3_000, 20_000
"""Steps up to which the run's own stepper costs less than code compiled for all motions; from which code pays
that takes longer to compile, of a low order and of a high one.
"""
