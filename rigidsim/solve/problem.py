"""From an experiment to everything its integration needs; whatever can't be run is refused here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.errors import ConfigError, Problem, Remedy
from rigidsim.model.load import Load, own_loads
from rigidsim.model.mechanics import carried_beside
from rigidsim.model.model_plan import plan_model
from rigidsim.model.scaling import gyroscopic_rate
from rigidsim.model.system import System, build_system, conserves, projected_invariants
from rigidsim.model.two_part import in_two_parts
from rigidsim.scene.choices import AUTO, FORMULATIONS
from rigidsim.scene.config import Experiment
from rigidsim.scene.expressions.tree import ExpressionError, evaluate, names_used
from rigidsim.scene.paths import numbers
from rigidsim.scene.scene import Scene, build_scene, check_start, start_values, without_apart
from rigidsim.scene.surfaces import root_parts
from rigidsim.solve.compiled import compiled_engine, compiled_function
from rigidsim.solve.precision import Precision, Scalar, precision_of
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.solvers.algorithm import Algorithm, algorithm_of

if TYPE_CHECKING:
    from rigidsim.model.averaged.average import Average
    from rigidsim.solve.by_keys import Parametrised

DRIFT_FACTOR = 50.0
"""A sound run keeps relative drifts below this times tolerance times sqrt(steps): rounding errors of the
steps add up like a random walk (Brouwer 1937), with a few roundings per step.
"""

_SPARE_ORDER = 0.9
_AUTO_BITS = 3
"""What is cut off from a series always has the same sign for a motion, so that its share in energy grows like
t, and rounding's like t^0.5. The order is rounded up from 1 - ln(tolerance) / 2 (Jorba and Zou 2005,
eq. 11): from 19.02 to 20 in double precision, which cuts off a seventh of epsilon and shows no bias to 1e7
rad; from 8.97 to 9 in single and from 22.83 to 23 in 80 bits, which cut off nearly all of it: mean energy
errors of 9 standard errors over 1e5 rad, and growth like t^0.6. Where less than this part of an order is
gained by rounding up, "auto" is this many bits below epsilon: another order, at least.
"""

_BITS_OF_AVERAGES = 53, 10
"""Precisions of at least so many bits use a tolerance looser by so many bits for averaged motions."""


@dataclass(frozen=True)
class InitialValueProblem:
    """A scene with its equations, ready to be integrated."""

    experiment: Experiment
    scene: Scene
    precision: Precision
    system: System
    clock: SampleClock
    tolerance: Scalar | None  # scalar of the precision, or None for its epsilon; "auto" becomes one of these
    algorithm: Algorithm
    python_loads: tuple[Load, ...] = ()
    holds_late: bool = False  # whether invariants are projected only after a number of steps

    @property
    def has_steps(self) -> bool:
        """Whether the motion is integrated in steps; a closed form gives the samples without any."""
        return self.algorithm.method.has_steps

    @property
    def holds_invariants(self) -> bool:
        """Whether invariants are projected along the way."""
        return self.scene.config.integrator.hold_invariants is True or self.holds_late

    @cached_property
    def projected_scalars(self) -> tuple[str, ...]:
        """The invariant that each projected scalar belongs to; empty if invariants aren't projected."""
        projected = projected_invariants(self.system)[0] if self.holds_invariants else []
        return tuple(h.name for h in projected)

    @property
    def sensitivity_keys(self) -> tuple[str, ...]:
        """Keys by which derivatives are recorded, as the config names them."""
        return tuple(self.scene.config.output.sensitivity or ())

    @cached_property
    def parametrised(self) -> Parametrised:
        """The system with these keys as parameters; ConfigError if its equations have no derivatives."""
        from rigidsim.solve.by_keys import parametrised  # which few runs need

        try:
            return parametrised(self.experiment, self.sensitivity_keys, self.python_loads)
        except ConfigError as error:
            raise error.at(self.experiment.source) from None

    @property
    def effective_tolerance(self) -> float:
        """Tolerance that the step control works with."""
        epsilon = float(self.precision.epsilon)
        return epsilon if self.tolerance is None else float(self.tolerance)

    @property
    def law_tolerance(self) -> float:
        """Tolerance that error laws start from: one below the precision's epsilon makes no error smaller."""
        return max(self.effective_tolerance, float(self.precision.epsilon))

    def drift_bound(self, steps: int | np.ndarray) -> np.ndarray:
        """Relative drift of an invariant that rounding alone explains after so many steps; any shape."""
        return DRIFT_FACTOR * self.law_tolerance * np.sqrt(np.maximum(steps, 1))


def prepare(experiment: Experiment, *, loads: Sequence[Load] = ()) -> InitialValueProblem:
    """Work out an experiment, with user-defined loads, up to its equations; a ConfigError says what was
    given, what is allowed and where.
    """
    if experiment.config.sweep is not None:
        what = (
            "describes many members, and this takes a single experiment: "
            f"{Remedy('rigidsim sweep runs', 'rigidsim.sweep(...) runs')} them; remove [sweep] to run the "
            "experiment without it"
        )
        raise ConfigError(Problem("[sweep]", what), experiment.source)
    prepared = prepare_scene(experiment, build_scene(experiment), loads=loads)
    if prepared.sensitivity_keys:
        from rigidsim.scene.varied_keys import varied_keys
        from rigidsim.solve.by_keys import refuse_without_derivatives

        try:
            refuse_without_derivatives(prepared.scene, prepared.system, has_steps=prepared.has_steps)
            varied_keys(experiment, prepared.sensitivity_keys)
        except ConfigError as error:
            raise error.at(experiment.source) from None
    return prepared


def prepare_scene(
    experiment: Experiment,
    scene: Scene,
    *,
    loads: Sequence[Load] = (),
    tolerance: float | None = None,
    along: Average | None = None,
) -> InitialValueProblem:
    """Like ``prepare``, for another scene; ``along`` is the average of a motion that it is a part of."""
    loads = own_loads(loads)
    try:
        precision = precision_of(scene.config.integrator.precision)
        asked = scene.config.integrator.tolerance
        given = None if isinstance(asked, str) else asked.at(scene.context)
        if tolerance is not None:
            given = scene.context.mpf(tolerance)
        if given is not None:
            _check_tolerance(given, precision)
        check_start(scene)
        scene = without_apart(scene, loads)
        if loads and scene.found_start is not None:
            what = "given with loads from Python, which have no part in finding it; give attitude and rates"
            raise ConfigError(Problem("[initial] equilibrium", what))
        if scene.config.model.level == AUTO:
            what = 'given "auto", which run and plan settle by [integrator] accuracy_axis; choose a level'
            raise ConfigError(Problem("[model] level", what))
        system = build_system(plan_model(scene, loads, along=along), precision.number)
        averaged = not system.formulation.resolves_rotation and scene.bodies is None  # orbits need all digits
        step_control = _auto(precision, averaged=averaged) if given is None else precision.number(given)
        _refuse_spectrum(system)
        if loads:
            refuse_non_finite_start(system, precision)
        algorithm = algorithm_of(scene, system, driven=bool(loads))
        if algorithm.takes_series:
            refuse_roots_of_zero(system, precision)
        late = False
        holds = scene.config.integrator.hold_invariants is True
        if holds and system.mechanics.shape is not None:
            what = f"given true, but {carried_beside(system.mechanics.loads)}, which corrections don't know; "
            what += "leave it out"
            raise ConfigError(Problem("[integrator] hold_invariants", what))
        if holds or gyroscopic_rate(scene) > _NUTATES * system.rate_bound:
            parts = in_two_parts(precision.number, precision.exact, precision.bits, scene.context)
            system = system.with_coefficients(parts)
        if not holds and scene.config.integrator.hold_invariants and algorithm.method.has_steps:
            late = _is_worth_holding(system)
        clock = SampleClock(scene.samples, precision, system.scaling)
        prepared = InitialValueProblem(
            experiment, scene, precision, system, clock, step_control, algorithm, tuple(loads), late
        )
        if not system.formulation.carries_rates and system.formulation.twin != system.formulation.name:
            double_twin(prepared)  # its stability is a question of the rates, which it doesn't carry itself
    except ConfigError as error:
        raise error.at(experiment.source) from None
    except (OverflowError, ExpressionError) as error:
        raise ConfigError(_out_of_range(scene, error), experiment.source) from None
    return prepared


_REMEDY = "check its unit, write 0, or choose another precision"


def _out_of_range(scene: Scene, error: OverflowError | ExpressionError) -> list[Problem]:
    """What to say of numbers that the precision can't hold, by their keys where these are known."""
    config = scene.config
    if isinstance(error, ExpressionError):
        where = (x.where for x in scene.formulas() if x.text == error.of)
        return [Problem(next(where, "config"), str(error))]
    single = config.integrator.precision == "single"
    largest = 10 ** (30 if single else 250)
    extreme = [
        Problem(path.where, f"given {scene.context.nstr(x.at(scene.context), 6)}; {error}: {_REMEDY}")
        for path, found in numbers(config)
        for x in found
        if x.sign and not 1 < largest * abs(x.rational) < largest**2
    ]
    if extreme:
        return extreme
    what = (
        f"the scene's numbers span more than single precision can hold ({error}); choose a higher "
        "precision or check the units"
        if single
        else f"the scene's numbers are too large, too small or too far apart ({error}): they and their "
        "products, such as the energy, may be between about 1e-300 and 1e300; check the units"
    )
    return [Problem("config", what)]


_NUTATES = 4
"""Times the body's own rate from which on the nutation by its wheels is so fast that rounded coefficients, by
which the rates drift by eps a radian of it, show among the rounding of steps.
"""


def _is_worth_holding(system: System) -> bool:
    """Whether "auto" projects: not if nothing physical is conserved, nor if steps end on surfaces."""
    if not system.formulation.resolves_rotation:  # whose norm is no invariant that its rate would depend on
        return False
    if system.switches or system.mechanics.shape is not None:
        return False
    return conserves(system)


def auto_tolerance(epsilon: float) -> float:
    """The tolerance that ``tolerance = "auto"`` means in a precision of this epsilon."""
    return math.ldexp(epsilon, -_auto_bits(epsilon))


def _auto_bits(epsilon: float) -> int:
    """Bits by which "auto" is below epsilon."""
    needed = 1 - math.log(epsilon) / 2
    return 0 if math.ceil(needed) - needed >= _SPARE_ORDER else _AUTO_BITS


def _auto(precision: Precision, *, averaged: bool) -> Scalar | None:
    """The tolerance for "auto"; None for the epsilon itself.

    The terms averaged away are far above double precision's epsilon, and a step moves the direction by at
    most 1e-6 rad: ten bits less lose nothing and make runs of ``spin_averaged`` cheaper by a quarter.
    """
    least, looser = _BITS_OF_AVERAGES
    bits = looser if averaged and precision.bits >= least else -_auto_bits(float(precision.epsilon))
    return precision.number(mpmath.ldexp(precision.epsilon, bits)) if bits else None


def _check_tolerance(tolerance: mpmath.mpf, precision: Precision) -> None:
    """Refuse a tolerance further below the precision's epsilon than that is below 1: it would cost ever
    higher orders and gain nothing.
    """
    least = precision.epsilon**2
    if tolerance < least:
        given, shortest, epsilon = (mpmath.nstr(x, 3) for x in (tolerance, least, precision.epsilon))
        what = (
            f"given {given}, but {precision.name} precision rounds each number by about {epsilon}, so that "
            f'tolerances below that gain nothing; {shortest} or more is allowed: choose "auto", or a higher '
            "precision for more digits"
        )
        raise ConfigError(Problem("[integrator] tolerance", what))


def _refuse_spectrum(system: System) -> None:
    """Refuse a Lyapunov spectrum where variational equations end: at switches, and rows of tables."""
    found = system.plan.surfaces.found
    if not system.scene.config.output.lyapunov or not (found or system.pieces or system.kicks):
        return
    why, instead = "states are set at the edges of a table or kernel", "give orbits by elements"
    if system.kicks:
        why, instead = "an impulse changes velocities at once", "remove the impulse"
    if found:
        why = f"the equations switch at a kink or jump of {found[0].text} ({found[0].where})"
        instead = found[0].remedy
    what = f"given true, but {why}, where variational equations end; set it to false, or {instead}"
    raise ConfigError(Problem("[output] lyapunov", what))


def double_twin(prepared: InitialValueProblem) -> System:
    """The same motion in double precision and, if possible, in quaternions, for questions about itself."""
    config, own = prepared.scene.config, prepared.system.formulation
    if own.twin is None:
        return prepared.system.rounded(precision_of("double").number)
    twin = FORMULATIONS[own.twin]
    record = ["quaternion" if twin.keeps_attitude else "angular_velocity"]
    integrator = config.integrator.model_copy(update={"formulation": twin.name})
    output = config.output.model_copy(update={"record": record})
    plain = replace(
        prepared.scene, config=config.model_copy(update={"integrator": integrator, "output": output})
    )
    # rates that aren't states have no scales
    scaling = prepared.system.scaling if own.carries_rates or own.name == twin.name else None
    return build_system(plan_model(plain, prepared.python_loads, scaling), precision_of("double").number)


# --- starts from which no step leads away -------------------------------------------------------------------

_ROUGH = 1e-2
"""Tolerance of the trial: low orders show whether there is a series."""


def refuse_non_finite_start(system: System, precision: Precision) -> None:
    """Evaluate the equations once: a load from Python may have no finite value at the start."""
    outputs, sides = [right for _, right in system.equations], _sides(system, precision)
    if count := system.parameters:
        outputs.append(hy.par[count - 1])
    rhs = compiled_function(outputs, system.variables, compact_mode=True, **precision.options)
    values = rhs(precision.array(system.initial), time=_start(system, precision), **sides)
    lost = [n for n, v in zip(system.states, values, strict=False) if not math.isfinite(float(v))]
    if lost and system.partner is not None:  # a chart's own singularity is no fault of a load
        refuse_non_finite_start(system.partner, precision)
    elif lost:
        what = (
            f"the derivatives of {', '.join(lost)} aren't finite at the start; start elsewhere, or give "
            "the loads from Python finite torques and forces there"
        )
        raise ConfigError(Problem("loads", what))


def refuse_roots_of_zero(system: System, precision: Precision) -> None:
    """Refuse expressions that have values at the start, but no finite derivatives: sqrt(s) where s = 0.

    Raises:
        ConfigError: names them, with what they read there.
    """
    problems = _roots_of_zero(system.scene)
    charts = [system] if system.partner is None else [system, system.partner]
    if problems and not any(_begins(chart, precision) for chart in charts):
        raise ConfigError(problems)


def _roots_of_zero(scene: Scene) -> list[Problem]:
    """Expressions with a root that vanishes at the start."""
    formulas = [(x, parts) for x in scene.formulas() if (parts := root_parts(x))]
    if not formulas:
        return []
    values, context, problems = start_values(scene), scene.context, []
    for expression, parts in formulas:
        lost = [part for part in parts if evaluate(part, values, context) == 0]
        if lost:
            read = sorted(set().union(*map(names_used, lost)))
            given = ", ".join(f"{name} = {context.nstr(values[name], 8)}" for name in read)
            what = (
                f'"{expression.text}" has no finite derivative at the start ({given}), where its sqrt, '
                "fractional power, asin or acos is at the end of its range and has no series; start "
                "elsewhere, write abs(u) for the norm of a single component u, or add a small number under "
                "the root"
            )
            problems.append(Problem(expression.where, what))
    return problems


def _begins(system: System, precision: Precision) -> bool:
    """Whether the equations, and what events follow, have a series at the start."""
    followed = [(hy.make_vars(f"followed_{n}"), x.expression) for n, x in enumerate(system.crossings)]
    initial = [*system.initial, *[mpmath.mpf(0) for _ in followed]]
    options = {**precision.options, **_sides(system, precision), "time": _start(system, precision)}
    engine = compiled_engine(
        [*system.equations, *followed],
        precision.array(initial),
        tol=precision.number(mpmath.mpf(_ROUGH)),
        compact_mode=True,
        **options,
    )
    outcome, _ = engine.step()
    return bool(outcome != hy.taylor_outcome.err_nf_state)


def _sides(system: System, precision: Precision) -> dict[str, Any]:
    """Parameters of the equations: on whichever side of surfaces, and at the start's own time."""
    if system.pieces is not None:
        pieces = system.pieces.parameters(0)
        sides = [mpmath.mpf(1)] * system.first_of_pieces
        return {"pars": np.concatenate([precision.array(sides), pieces]) if sides else pieces}
    if count := system.parameters:
        return {"pars": precision.array([mpmath.mpf(n < count - system.clocked) for n in range(count)])}
    return {}


def _start(system: System, precision: Precision) -> Any:
    return precision.number(system.start)
