"""How a config was understood, as values to show, and what in it is suspicious."""

from collections.abc import Iterator
from typing import Any

from rigidsim.model.formulations.formulation import ModelPlan
from rigidsim.model.load import Load, loads_of
from rigidsim.model.load_estimate import effects_at_start
from rigidsim.model.loads.gravity import Placed, UniformGravity
from rigidsim.model.placements import FlownByKernel
from rigidsim.model.plausibility import (
    about_load,
    about_named_strength,
    suspicious_angles,
    suspicious_end,
    suspicious_expressions,
    unreachable_events,
)
from rigidsim.model.sources import sources_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, norm, working_bits
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import ConfigTable
from rigidsim.scene.readable import TimeWords, length_text, number_text
from rigidsim.scene.registry import LOADS, one_of
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.starts import given_attitude
from rigidsim.scene.swept import plain
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.store.summary import Span, Start, Three, UnderstoodBody

_DIGITS = 6
_PLAIN = ("0", "False", "True")


def body_of(scene: Scene) -> UnderstoodBody:
    """The body, rounded to doubles."""
    body = scene.body
    return UnderstoodBody(
        source=body.source,
        principal_moments=tuple(float(m) for m in body.principal_moments),
        principal_axes=tuple(tuple(float(x) for x in axis) for axis in body.principal_axes),
        mass=None if body.mass is None else float(body.mass),
        center_of_mass=_three(body.center_of_mass),
        reference=None if body.reference is None else _three(body.reference),
    )


def start_of(scene: Scene) -> Start:
    """The state that the motion starts from; Euler angles in the config's sequence."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence

    def degrees(quaternion: Vector, angles: Vector | None) -> Three:
        if angles is None:
            angles = attitude.euler_from_matrix(context, attitude.rotation_matrix(quaternion), sequence)
        return _three([180 * angle / context.pi for angle in angles])

    frame, given = scene.config.initial.relative_to, None
    if frame is not None:
        begun = given_attitude(scene)
        given = degrees(begun.quaternion, begun.euler_angles)
    w, x, y, z = (float(component) for component in scene.quaternion)
    return Start(
        euler_sequence=sequence,
        euler_angles_deg=degrees(scene.quaternion, scene.euler_angles),
        relative_to=frame,
        relative_euler_angles_deg=given,
        quaternion=(w, x, y, z),
        angular_velocity=_three(scene.angular_velocity),
        position=None if scene.position is None else _three(scene.position),
        velocity=None if scene.velocity is None else _three(scene.velocity),
        equilibrium=scene.found_start,
    )


def span_of(scene: Scene) -> Span:
    """When the motion starts and ends."""
    samples = scene.samples
    return Span(
        start_s=float(scene.start),
        end_s=float(samples.last),
        samples=samples.count,
        every_s=None if samples.times is not None else abs(float(samples.step)),
        epoch="" if scene.epoch is None else str(scene.epoch),
        unit=scene.config.time.unit or "",
    )


def understood(prepared: InitialValueProblem, *, sizes: bool = True) -> dict[str, Any]:
    """Fields of ``Understood`` but for the warnings; ``sizes`` as for ``load_descriptions``."""
    scene = prepared.scene
    loads = load_descriptions(prepared, sizes=sizes)
    return {"body": body_of(scene), "start": start_of(scene), "time": span_of(scene), "loads": loads}


def load_descriptions(prepared: InitialValueProblem, *, sizes: bool = True) -> tuple[str, ...]:
    """Loads, user-defined states and impulses, a sentence for each: keys, and torque and force at the start.

    Args:
        sizes: whether torque and force are worked out, for which they are compiled.
    """
    plan, scene = prepared.system.plan, prepared.system.plan.scene
    pairs = zip(scene.config.loads, scene.given_loads, strict=True)
    rows: list[tuple[str, Any, Any]] = [(getattr(x, "kind", ""), x, load) for x, load in pairs]
    for table, found in scene.tabled.items():
        pairs = zip(getattr(scene.config, table), found, strict=True)
        rows += [(one_of(table).replace("_", " "), fields, load) for fields, load in pairs]
    for key, kind in LOADS["body"].items():
        rows += [
            (key, getattr(scene.config.body, key), load) for load in scene.loads if isinstance(load, kind)
        ]
    placed = {source.number for source in sources_of(scene.config)}
    rows += [(load.title, load.__doc__ or "given from Python", load) for load in prepared.python_loads]
    effects = effects_at_start(plan, [_together(plan, load) if sizes else [] for _, _, load in rows])
    said = []
    for number, (what, given, load) in enumerate(rows):
        name = getattr(given, "name", None)
        said.append(f"{what} {name}: {_value(given)}" if name else f"{what}: {_value(given)}")
        said[-1] += f"; {load.remark}" if load.remark else ""
        place = load.source_at_start(scene) if sizes and number in placed and not _only_in_plane(load) else []
        acting = [f"{kind} {number_text(size, _DIGITS)} {unit}" for kind, size, unit in effects[number]]
        if at_start := [*_seen(place, scene), *acting]:
            said[-1] += f"; at the start {', '.join(at_start)}"
    impulses = (f"impulse {x.name}: {_value(x)}" for x in scene.config.events if x.action == "impulse")
    return (*said, *(state.described for state in scene.states), *impulses)


def _seen(place: Vector, scene: Scene) -> Iterator[str]:
    """Where a source is, if it is at a known place."""
    if place:
        away = norm(scene.context, place)
        towards = ", ".join(number_text(float(plain(x / away))) for x in place)
        yield f"source {length_text(float(plain(away)))} away towards [{towards}] in space axes"


def _together(plan: ModelPlan, load: Load) -> list[Load]:
    """A load with its supplements, whose torque and force are shown.

    Nothing of long series, or of a source whose place isn't known.
    """
    together = [x for x in plan.loads if load is x or load is x.beside]
    if load.uniform_field is not None:  # all of which are one load
        together = [x for x in plan.loads if isinstance(x, UniformGravity)]
    return [] if any(x.wide or _only_in_plane(x) for x in together) else together


def _only_in_plane(load: Load) -> bool:
    """Whether its source has a moving plane, but no place on it."""
    return isinstance(load, Placed) and load.placement.node_averaged is not None


def _value(value: Any) -> str:
    """A value of a config; of a table the keys, but for zeros that weren't given."""
    if isinstance(value, ExactNumber):
        return f"{number_text(float(value.in_its_unit), _DIGITS)} {value.unit or value.assumed}".rstrip()
    if isinstance(value, ConfigTable):
        keys = [key for key in type(value).model_fields if key not in ("kind", "name")]
        texts = {key: _part(x) for key in keys if (x := getattr(value, key)) is not None}
        given = value.model_fields_set
        return ", ".join(f"{key} {x}" for key, x in texts.items() if key in given or x not in _PLAIN)
    if isinstance(value, dict):
        return f"of {len(value)} terms"
    if not isinstance(value, list):
        return " ".join(str(value).split("\n\n")[0].split())
    parts = [_value(x) for x in value]
    units = {x.partition(" ")[2] for x in parts}
    if len(units) != 1 or not all(isinstance(x, ExactNumber) for x in value):
        return f"[{', '.join(parts)}]"
    return f"[{', '.join(x.partition(' ')[0] for x in parts)}] {units.pop()}".rstrip()


def _part(value: Any) -> str:
    return f"({_value(value)})" if isinstance(value, ConfigTable) else _value(value)


def time_words(scene: Scene) -> TimeWords:
    """How times of the scene are written in messages."""
    attributes = {"epoch": scene.epoch, "time_unit": scene.config.time.unit}
    return TimeWords.of(attributes, float(scene.start), float(scene.samples.last))


def cautions_about(config: Config) -> list[Caution]:
    """Numbers in a config that may mean something other than was understood."""
    found = [Caution(WarningCode.ANGLE_WITHOUT_UNIT, str(p)) for p in suspicious_angles(config)]
    return found + [Caution(WarningCode.TIME_WITHOUT_UNIT, str(p)) for p in suspicious_end(config)]


def cautions_of(scene: Scene) -> list[Caution]:
    """Values that may mean something other than was understood, found before anything runs."""
    found = cautions_about(scene.config)
    found += [Caution(WarningCode.ANGLE_WITHOUT_UNIT, str(p)) for p in suspicious_expressions(scene)]
    found += [Caution(WarningCode.NEVER_HAPPENS, str(p)) for p in unreachable_events(scene)]
    for number, (fields, load) in enumerate(zip(scene.config.loads, scene.given_loads, strict=True), start=1):
        if isinstance(load, Load):
            where = f"[[loads]] number {number}"
            found += about_load(load, fields, where, scene)
    for number, one in enumerate(scene.config.bodies, start=1):
        if one.ephemeris:
            found += about_named_strength(
                one.gravitational_parameter, one.name, f"[[bodies]] number {number}"
            )
    for load in loads_of(scene):
        if isinstance(load, tuple(LOADS["body"].values())):
            found += load.cautions(scene.config.body, "[body]", scene)
    config, body, host = scene.config, scene.config.body, scene.host
    named = [getattr(fields, "source", None) for fields in config.loads]
    flies = bool(host) and any(isinstance(load.placement, FlownByKernel) for load in scene.given_loads)
    given = body.gravity_field is not None and body.preset is None
    felt = any(getattr(load, "degree", None) is not None for load in config.loads)
    seen = any(getattr(load, "ephemeris", None) for load in config.loads)
    wasted = _wasted_tolerance(scene)
    suspicious = [
        (
            flies and host not in named,
            WarningCode.HOST_WITHOUT_GRAVITY,
            f'[body] host: given "{host}", whose own gravity no load has, so that only what others do to it '
            f'acts; add central_gravity with source = "{host}", unless that is meant',
        ),
        (
            scene.gravity is not None and not scene.free_flight and scene.torque_arm is None,
            WarningCode.NO_EFFECT,
            "uniform_gravity has no effect, since the body turns about its centre of mass; give [body] "
            "reference or center_of_mass for a top, or [initial] position for free flight",
        ),
        (
            given and not felt,
            WarningCode.NO_EFFECT,
            "[body] gravity_field has no effect, since no load has degree; give a gravity_gradient or "
            "central_gravity the degree that it feels",
        ),
        (wasted, WarningCode.NO_EFFECT, wasted),
        (
            seen and body.preset not in (None, "earth", "earth_rigid"),
            WarningCode.EPHEMERIS_OF_EARTH,
            "the ephemerides give Sun and Moon as seen from the Earth, while the body is "
            f"{body.preset}; give gravity_gradient the orbit of its source instead",
        ),
    ]
    return found + [Caution(code, text) for holds, code, text in suspicious if holds]


def _wasted_tolerance(scene: Scene) -> str:
    """What to say of a tolerance that is of no use; empty for any other.

    Below an eighth of epsilon, which "auto" is in most precisions, a step's own rounding is all that counts.
    """
    integrator, context = scene.config.integrator, scene.context
    if isinstance(integrator.tolerance, str):
        return ""
    if not integrator.has_steps:
        return "[integrator] tolerance has no effect, since a closed form takes no steps; leave it out"
    given, epsilon = integrator.tolerance.at(context), 2.0 ** (1 - working_bits(integrator.precision))
    if given >= epsilon / 8:
        return ""
    name = integrator.precision if isinstance(integrator.precision, str) else f"{integrator.precision} digits"
    return (
        f"[integrator] tolerance: given {context.nstr(given, 3)}, but in {name} each step rounds by about "
        f"{epsilon:.3g}: a tolerance below {epsilon / 8:.3g} costs more and makes no error smaller; "
        'choose "auto", or a higher precision for more digits'
    )


def _three(vector: Vector) -> Three:
    x, y, z = (_float(component) for component in vector)
    return x, y, z


def _float(value: Any) -> float:
    return float(value) + 0.0  # no minus sign before zero
