"""From an experiment to everything that its integration needs, with all that can be refused refused."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import mpmath

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.held import held_invariants
from rigidsim.model.loads import LoadModel
from rigidsim.model.recording import Invariant
from rigidsim.model.system import System, build_system
from rigidsim.scene.reading import Experiment
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.start import check_start
from rigidsim.solve.closed import ClosedForm, closed_form_of
from rigidsim.solve.growth import Growth, measure_growth
from rigidsim.solve.hold import held_system
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.sampling import SampleClock
from rigidsim.store.variables import Variable, time_variable

_LARGEST_EXPONENT = 600.0  # keeps products within doubles
_SPARE_ORDER = 0.9
_AUTO_BITS = 3
"""What is cut off from a series always has the same sign for a motion, so that its share in energy grows like
t, and that of rounding like t^0.5. The order is rounded up from 1 - ln(tolerance) / 2 (Jorba and Zou 2005,
eq. 11): from 19.02 to 20 in double precision, which cuts off a seventh of epsilon and shows no bias to 1e7
rad; from 8.97 to 9 in single and from 22.83 to 23 in 80 bits, which cut off nearly all of it: mean energy
errors of 9 standard errors over 1e5 rad, and growth like t^0.6. Where less than this part of an order is
gained by rounding up, "auto" is this many bits below epsilon: another order, at least."""


@dataclass(frozen=True)
class Prepared:
    """A scene with its equations, before the first step.

    Attributes:
        tolerance: scalar of the precision, or None for its epsilon; "auto" is either of these.
        python_loads: loads given from Python, of which the config knows nothing.
        closed: the solution in closed form, where the samples are to come from it.
    """

    experiment: Experiment
    scene: Scene
    precision: Precision
    system: System
    clock: SampleClock
    tolerance: Any | None
    python_loads: tuple[LoadModel, ...] = ()
    closed: ClosedForm | None = None

    @property
    def holds_invariants(self) -> bool:
        """Whether invariants are put back as the run goes on."""
        return self.scene.config.integrator.hold_invariants

    @cached_property
    def held_scalars(self) -> tuple[str, ...]:
        """The invariant that each held scalar belongs to; none where invariants aren't held."""
        held = held_invariants(self.system)[0] if self.holds_invariants else []
        return tuple(h.name for h in held)

    @property
    def effective_tolerance(self) -> float:
        """What the step control works with."""
        epsilon = float(self.precision.epsilon)
        return epsilon if self.tolerance is None else float(self.tolerance)

    @property
    def law_tolerance(self) -> float:
        """What the laws of errors start from: a tolerance below the precision's epsilon makes no error
        smaller.
        """
        return max(self.effective_tolerance, float(self.precision.epsilon))

    def variables(self) -> list[Variable]:
        """The dataset's variables, time first, then what is recorded, then each invariant's drift, and what
        was put back of those held.
        """
        parts = self.precision.part_count
        result = [time_variable(parts)]
        for recorded in self.system.recorded:
            attributes: dict[str, Any] = {
                "units": recorded.units,
                "long_name": recorded.long_name,
            }
            if recorded.frame:
                attributes["frame"] = recorded.frame
            if recorded.name == "euler_angles":
                attributes["euler_sequence"] = self.system.sequence
                attributes["convention"] = "intrinsic"
            if recorded.invariant:
                attributes["invariant"] = 1
            result.append(Variable(recorded.name, recorded.dims, attributes, parts))
        for invariant in self.system.invariants:
            result.append(
                Variable(
                    f"{invariant.name}_drift",
                    (),
                    {
                        "units": "1",
                        "long_name": f"drift of the {invariant.long_name}",
                        "scale": float(invariant.scale),
                        "scale_units": invariant.units,
                        "scale_name": invariant.scale_name,
                        "definition": "norm of (value - initial) / scale"
                        if len(invariant.expressions) > 1
                        else "(value - initial) / scale",
                        "drift_of": invariant.name,
                    },
                )
            )
        result += [
            held_variable(i, self.held_scalars) for i in self.system.invariants if i.name in self.held_scalars
        ]
        return result


def held_variable(invariant: Invariant, held: Sequence[str]) -> Variable:
    """What was put back of a held invariant, along time.

    Args:
        held: the invariant that each held scalar belongs to.
    """
    what = "norm of the sum of the changes" if held.count(invariant.name) > 1 else "sum of the changes"
    return Variable(
        f"{invariant.name}_put_back",
        (),
        {
            "units": "1",
            "long_name": f"what was put back of the {invariant.long_name}",
            "scale": float(invariant.scale),
            "scale_units": invariant.units,
            "scale_name": invariant.scale_name,
            "definition": f"{what} of (value - initial) / scale from one correction to the next, up to the "
            "last one before each sample: to first order what the drift would have been without them",
            "put_back_of": invariant.name,
        },
    )


def prepare(experiment: Experiment, *, loads: Sequence[LoadModel] = ()) -> Prepared:
    """Work out an experiment up to its equations.

    Args:
        loads: loads of one's own, beside those of the config.

    Raises:
        ConfigError: with what was given, what is allowed and where.
    """
    return prepare_scene(experiment, build_scene(experiment), loads=loads)


def prepare_scene(
    experiment: Experiment, scene: Scene, *, loads: Sequence[LoadModel] = (), tolerance: float | None = None
) -> Prepared:
    """As ``prepare``, for a scene that differs from the experiment's own.

    Args:
        tolerance: in place of the config's.

    Raises:
        ConfigError: with what was given, what is allowed and where.
    """
    try:
        precision = precision_of(scene.config.integrator.precision)
        asked = scene.config.integrator.tolerance
        step_control = None if isinstance(asked, str) else precision.number(asked.at(scene.context))
        if tolerance is not None:
            step_control = precision.number(scene.context.mpf(tolerance))
        _check_tolerance(step_control, precision)
        step_control = _auto(precision) if step_control is None else step_control
        check_start(scene)
        system = build_system(scene, precision.number, loads)
        if loads:
            _refuse_non_finite_start(system, precision)
        closed = _closed_form(scene, system, driven=bool(loads))
        if scene.config.integrator.hold_invariants:
            system = held_system(system, precision, loads)
        clock = SampleClock(scene.samples, precision, system.scaling.time)
        prepared = Prepared(experiment, scene, precision, system, clock, step_control, tuple(loads), closed)
        if system.requirements.formulation == "canonical":
            double_twin(prepared)  # its stability is a question of the rates, which it doesn't carry itself
    except ConfigError as error:
        raise error.at(experiment.source) from None
    except OverflowError as error:
        single = scene.config.integrator.precision == "single"
        what = (
            f"the scene's numbers span more than single precision can hold ({error}); choose a higher "
            "precision or check the units"
            if single
            else f"the scene's numbers are too large, too small or too far apart ({error}): they and their "
            "products, such as the energy, may be between about 1e-300 and 1e300; check the units"
        )
        problem = Problem("config", what)
        raise ConfigError(problem, experiment.source) from None
    return prepared


def auto_tolerance(epsilon: float) -> float:
    """What ``tolerance = "auto"`` stands for in a precision of this epsilon."""
    return math.ldexp(epsilon, -_auto_bits(epsilon))


def _auto_bits(epsilon: float) -> int:
    """By which "auto" is below epsilon."""
    needed = 1 - math.log(epsilon) / 2
    return 0 if math.ceil(needed) - needed >= _SPARE_ORDER else _AUTO_BITS


def _auto(precision: Precision) -> Any | None:
    """None for the epsilon itself."""
    bits = _auto_bits(float(precision.epsilon))
    return precision.number(mpmath.ldexp(precision.epsilon, -bits)) if bits else None


def _check_tolerance(tolerance: Any | None, precision: Precision) -> None:
    """Refuse what would cost ever higher orders and gain nothing.

    Raises:
        ConfigError: a tolerance further below the precision's epsilon than that is below 1.
    """
    least = precision.epsilon**2
    if tolerance is not None and precision.exact(tolerance) < least:
        given, shortest, epsilon = (
            mpmath.nstr(x, 3) for x in (precision.exact(tolerance), least, precision.epsilon)
        )
        raise ConfigError(
            Problem(
                "[integrator] tolerance",
                f"given {given}, but {precision.name} precision rounds each number by about {epsilon}, so "
                f'that tolerances below that gain nothing; {shortest} or more is allowed: choose "auto", or '
                "a higher precision for more digits",
            )
        )


def _closed_form(scene: Scene, system: System, *, driven: bool) -> ClosedForm | None:
    """The solution in closed form where ``method`` asks for it.

    Raises:
        ConfigError: the scene has none, or something is asked for that only steps can give.
    """
    integrator = scene.config.integrator
    if integrator.method != "closed_form":
        return None
    why = None
    if integrator.hold_invariants:
        why = "holds its invariants by itself; set hold_invariants = false"
    elif system.requirements.formulation not in ("rates", "quaternion"):
        why = f'gives rates and quaternions, not {integrator.formulation}; set formulation = "auto"'
    elif scene.events:
        why = 'takes no steps in which events could be found; remove [[events]], or choose method = "taylor"'
    if why is not None:
        raise ConfigError(Problem("[integrator] method", f'given "closed_form", which {why}'))
    form = closed_form_of(scene, driven=driven)
    if isinstance(form, str):
        what = f'given "closed_form", but {form}; allowed here: "taylor"'
        raise ConfigError(Problem("[integrator] method", what))
    return form


def _refuse_non_finite_start(system: System, precision: Precision) -> None:
    """Evaluate the equations once: a load from Python may have no value at the start.

    Raises:
        ConfigError: names the states whose derivatives aren't finite.
    """
    rhs = hy.cfunc(
        [right for _, right in system.equations],
        system.variables,
        compact_mode=True,
        **precision.options,
    )
    start = precision.number(system.scene.context.ldexp(system.scene.start, -system.scaling.time))
    values = rhs(precision.array(system.initial), time=start)
    lost = [n for n, v in zip(system.states, values, strict=True) if not math.isfinite(float(v))]
    if lost and system.partner is not None:  # a chart's own singularity is no fault of a load
        _refuse_non_finite_start(system.partner, precision)
    elif lost:
        raise ConfigError(
            Problem(
                "loads",
                f"the derivatives of {', '.join(lost)} aren't finite at the start; start elsewhere, or give "
                "the loads from Python finite torques and forces there",
            )
        )


def double_twin(prepared: Prepared) -> System:
    """The same motion in double precision and, where an attitude is carried, in quaternions: for questions
    about the motion itself, such as its stability.
    """
    config = prepared.scene.config
    formulation = "rates" if prepared.system.requirements.formulation == "rates" else "quaternion"
    record = ["angular_velocity"] if formulation == "rates" else ["quaternion"]
    integrator = config.integrator.model_copy(update={"formulation": formulation})
    output = config.output.model_copy(update={"record": record})
    plain = replace(
        prepared.scene, config=config.model_copy(update={"integrator": integrator, "output": output})
    )
    return build_system(plain, precision_of("double").number, prepared.python_loads)


def motion_growth(prepared: Prepared) -> Growth:
    """How strongly the motion itself amplifies errors (some 30 ms).

    Measured in quaternions, or in rates where no attitude is carried: a chart's own singularity is another
    matter. A closed form makes no errors on the way that could grow.
    """
    if prepared.closed is not None:
        return Growth(factor=1.0, seconds=0.0, rate=0.0, window=0.0)
    system = double_twin(prepared)
    clock, last = prepared.clock, prepared.clock.count - 1
    growth = measure_growth(system, precision_of("double"), float(clock.start), float(clock.at(last)))
    return _beyond_measure(prepared, growth) if growth.saturated else growth


def _beyond_measure(prepared: Prepared, growth: Growth) -> Growth:
    """The growth of a motion past an unstable axis, where offsets became too large to be measured.

    In elliptic functions of parameter m a change of m moves each passage by 1 / (1 - m) times as much, as far
    as there is time to: errors grow no faster than exp(p t), with p the rate of the functions' argument. The
    motion being integrable, they don't grow exponentially for longer. In the unstable state itself, which
    has no m, they grow as fast as they were seen to.
    """
    scene = prepared.scene
    form = closed_form_of(scene, driven=bool(prepared.python_loads))
    if isinstance(form, str):
        return growth
    seconds = float(scene.samples.last - scene.samples.start)
    argument = getattr(form.motion, "argument", None)
    if argument is None:
        return replace(growth, rate=max(growth.rate, growth.passing_rate), window=0.0)
    passage = min(float(argument.speed) * math.ldexp(seconds, -form.scaling.time), _LARGEST_EXPONENT)
    complement = max(float(argument.lattice.complement), math.exp(-_LARGEST_EXPONENT))
    factor = max(growth.factor, min(1 / complement, math.exp(passage)))
    return replace(growth, factor=factor, rate=0.0)
