"""The engine's time, a sum of two numbers, put back on a single one.

That time is a single number at each stride's start is what lets whole strides be recorded by the engine's own
grid output, which starts at such a time only. The move back to it is a step of some 1e-16 of the time.
"""

from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.stepper import Stepper


class WholeTime(Effect):
    """Time put back on a single number at each stride's end."""

    @staticmethod
    def suits(stepper: Stepper) -> bool:
        """Not with events or surfaces, since a step back could cross one twice, nor with steps cut short."""
        return not (stepper.has_events or stepper.single_steps or stepper.system.stepwise)

    def apply(self, stepper: Stepper, stride: int) -> bool:
        """See ``Effect``; False if steps are too small to arrive there."""
        return stepper.to_whole_time()
