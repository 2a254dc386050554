"""``rigidsim compare``: another tool's trajectory and an experiment, at the file's times.

How late a trajectory's clock is against the experiment's follows from the motion itself. The norm of the
angular velocity is the same in every convention but for its unit. Where its course fits the experiment's
about as well as anywhere, the attitudes are compared; then the shift t makes them equal to first order: the
turn from the experiment's attitudes to the file's is t w (least squares over all rows).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from pydantic import PrivateAttr

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.store.outputs import refuse_loss, writing
from rigidsim.store.summary import SummaryPart
from rigidsim.workflows.compare.as_run import dataset_of_rows, files_of, trajectory_given
from rigidsim.workflows.compare.conventions import (
    LEAST_ROWS,
    Attitudes,
    Convention,
    attitudes_of,
    find_convention,
    holds_attitude,
    size_of,
)
from rigidsim.workflows.compare.defects import rms
from rigidsim.workflows.compare.evidence import Evidence, Partner, judged
from rigidsim.workflows.read import Given, as_experiment
from rigidsim.workflows.run import Sampled, sampled

if TYPE_CHECKING:
    from matplotlib.figure import Figure
from collections.abc import Callable
from dataclasses import replace

from rigidsim.errors import ensure
from rigidsim.scene.exact import parse_number
from rigidsim.scene.rotations import angles_between, conjugated, multiplied, vector_of
from rigidsim.workflows.compare.conventions import ANGLES

WITHIN = 1e-9
"""Largest angle (rad) between attitudes that agree, if nothing else is asked for."""
FIGURES = (".png", ".svg")
_ENDINGS = {"figure_file": FIGURES, "timeline_file": (".rrd",)}
_FAR_AWAY = 10.0  # spans of the file or of the experiment, beyond which times are counted from another zero
_MOST_SHOWN = 20_000  # rows of a timeline
_MOST_DRAWN = 4000  # points of a figure


class AttitudeError(SummaryPart):
    """Angle between the trajectory's attitudes and the experiment's, rad, over all rows.

    ``time``: of the largest one, s; ``row``: as the file counts it.
    """

    largest: float
    rms: float
    time: float
    row: str


class TrajectoryDrift(SummaryPart):
    """Largest drift of an invariant by the trajectory's own numbers, relative to ``rigidsim``'s scale."""

    name: str
    largest: float
    final: float


class LocalDefects(SummaryPart):
    """What the experiment's equations miss from rows to the next ones.

    Attributes:
        largest: angle, rad; rms: the same in the mean; time: of the largest, s.
        rate_largest: rad/s; None without rates in the trajectory.
        rows: number of rows that were started from.
        window_s: length of the windows that separate models from integrators.
        unexplained: of the windows' attitude defects, rms of what differences of the rates don't explain
            over rms of what they do; without rates of what no added acceleration explains over all.
        missing_acceleration: rms, rad/s^2, that would explain the rates' defects, or the attitude's where
            the trajectory has no rates.
    """

    largest: float
    rms: float
    time: float
    rate_largest: float | None
    rows: int
    window_s: float | None
    unexplained: float | None
    missing_acceleration: float | None


class Disagreement(SummaryPart):
    """The first row that is further from the experiment than ``within``."""

    time: float
    row: str


class Comparison(SummaryPart):
    """A trajectory of another tool compared with an experiment.

    Attributes:
        verdict: agrees, integration_error, wrong_model, inconsistent_rates or undecided.
        why: the verdict in words, with the numbers that it was given for.
        within: largest angle between attitudes that agree, rad.
        resolution: rad, of the trajectory's attitudes by the digits that they are written in.
        rate_error: largest difference of angular velocities, rad/s; None without rates.
        position_error: the same of positions, m.
        told: what a user should know besides.
        dataset_file, figure_file, timeline_file: where they were written; empty if nowhere.
    """

    name: str
    source: str
    rows: int
    span_s: float
    verdict: str
    why: str
    within: float
    resolution: float
    attitude_error: AttitudeError
    rate_error: float | None
    position_error: float | None
    convention: Convention
    drifts: list[TrajectoryDrift]
    local_defects: LocalDefects | None
    first_disagreement: Disagreement | None
    told: list[str]
    dataset_file: str = ""
    figure_file: str = ""
    timeline_file: str = ""

    _dataset: Any = PrivateAttr(default=None)

    @property
    def dataset(self) -> xarray.Dataset:
        """Attitude error, drifts and defects along time, with their units."""
        found: xarray.Dataset = self._dataset
        return found

    def plot(self) -> Figure:
        """Attitude error, drifts and local defects along time."""
        from rigidsim.look.figures.compared import compared_figure

        return compared_figure(thinned(self.dataset))

    def save(self, path: str | Path) -> Path:
        """Write the dataset (netCDF-4/HDF5)."""
        with writing(Path(path)) as temporary:
            self.dataset.to_netcdf(temporary, engine="h5netcdf")
        return Path(path)

    def __repr__(self) -> str:
        error = self.attitude_error
        return (
            f"<Comparison of {self.source} with {self.name!r}: {self.verdict}, attitude error "
            f"{error.largest:.3g} rad at {error.time:.6g} s ({error.rms:.3g} rms)>"
        )

    __str__ = __repr__

    def _repr_html_(self) -> str:
        rows = [
            ("verdict", self.verdict),
            ("why", self.why),
            ("attitude error", f"{self.attitude_error.largest:.4g} rad"),
        ]
        rows += [(f"drift of {x.name}", f"{x.largest:.3g}") for x in self.drifts]
        cells = "".join(f"<tr><th>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in rows)
        return f"<table>{cells}</table>"


def thinned(dataset: xarray.Dataset) -> xarray.Dataset:
    """A comparison's dataset with, of very many rows, the largest of each stretch, as a figure shows them."""
    stretch = -(-dataset.sizes["time"] // _MOST_DRAWN)
    return (
        dataset if stretch == 1 else abs(dataset).coarsen(time=stretch, boundary="pad").max(keep_attrs=True)
    )


def compare(
    experiment: Given,
    table: Any,
    *,
    within: float = WITHIN,
    convention: Mapping[str, str] | None = None,
    offset: str | float | None = None,
    out: str | Path | None = None,
    figure: str | Path | None = None,
    timeline: str | Path | None = None,
    kernels: Sequence[str | Path] = (),
    force: bool = False,
) -> Comparison:
    """Judge a trajectory by how far it is from an experiment, at its own times.

    Args:
        experiment: as for ``rigidsim.run``.
        table: a file (CSV, Parquet, netCDF, AEM), a run or its folder, a mapping of names to arrays,
            a pandas DataFrame, or an xarray Dataset. Columns are known by their names (docs/compare.md).
        within: largest angle between attitudes that agree, rad.
        convention: known parts of the file's convention, such as ``{"order": "xyzw", "rate_axes": "space"}``;
            the rest is found.
        offset: added to the file's times: s, a text with a unit, "first" (its first row is at the
            experiment's start) or "estimate".
        out: file for the dataset. figure: file for the figure, a .png or .svg.
        timeline: file for a timeline (.rrd) of both bodies with the angle between them.
        kernels: of SPICE, for reading a CK: clock and leap seconds.
        force: replace existing files; files that are read are never replaced.

    Raises:
        ConfigError: the config can't be run.
        RigidsimError: the trajectory can't be used, or a file would be replaced, and what to do.
    """
    asked = as_experiment(experiment)
    written = {"dataset_file": out, "figure_file": figure, "timeline_file": timeline}
    paths = {name: Path(path) for name, path in written.items() if path is not None}
    _refuse_names(paths)
    refuse_loss(paths.values(), [*asked.files, *files_of(table, kernels)], force=force)
    quiet, scene = _plain(asked)
    trajectory, partner = trajectory_given(table, scene, kernels), None
    if asked.config.rigid_bodies:
        trajectory, second = trajectory.of_pair(asked.config.rigid_bodies[0].name)
        partner = attitudes_of(second, scene.epoch) if holds_attitude(second) else None
    given = attitudes_of(trajectory, scene.epoch)
    if not 0 < within < np.pi:
        raise RigidsimError(f"within: given {within:g}; an angle above 0 and below pi, in rad, is allowed")
    span = float(scene.start), float(scene.samples.last)

    def motion_at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        made = _own_motion(quiet, times, []).dataset
        return made["quaternion"].values, made["angular_velocity"].values

    given = shifted(given, offset, span, motion_at, convention or {})
    _refuse_far(given, scene)
    notes = list(given.notes)
    if given.time_unit is None:
        notes.append("times were taken to be in s; name another unit in the column's name: t [day]")
    made = _own_motion(quiet, given.times, notes)
    given, own = given.at(made.reached), made.dataset
    motion = own["quaternion"].values, own["angular_velocity"].values
    found, more = find_convention(given, convention or {}, motion, float(scene.start))
    both = None if partner is None else _second(partner.at(made.reached), own, float(scene.start))
    seen = Evidence(given, found, own, made.attitude_error or 0.0, within, notes + more, scene, both)
    result = _result(seen, asked.config.name, {name: str(path) for name, path in paths.items()})
    if out is not None:
        result.save(out)
    if figure is not None:
        with writing(Path(figure)) as temporary:
            result.plot().savefig(temporary, format=Path(figure).suffix.lower()[1:])
    if timeline is not None:
        _draw(quiet, given, found, Path(timeline))
    return result


def _second(given: Attitudes, own: xarray.Dataset, begin: float) -> Partner:
    """The second of two bodies, in the convention nearest to the experiment's."""
    known = own["rigid_body_quaternion"].values[:, 0], own["rigid_body_angular_velocity"].values[:, 0]
    found, _ = find_convention(given, {"offset": "none"}, known, begin)
    quaternions = found.quaternions(given)
    rates = None if given.rates is None else found.rates(given.rates, quaternions)
    return Partner(quaternions, rates, given.positions, given.velocities)


def _refuse_names(paths: Mapping[str, Path]) -> None:
    """Refuse names that end as another kind of file does."""
    for name, path in paths.items():
        suffix, allowed = path.suffix.lower(), _ENDINGS.get(name, ())
        if (suffix not in allowed) if allowed else (suffix in (*FIGURES, ".rrd")):
            kind = name.removesuffix("_file")
            raise RigidsimError(
                f"{kind}: given {path}; a name that ends in {' or '.join(allowed or ('.h5',))} is allowed"
            )


def _refuse_far(given: Attitudes, scene: Scene) -> None:
    """Refuse times far from the experiment, such as Unix seconds."""
    first, last = float(given.times[0]), float(given.times[-1])
    begin, (least, most) = float(scene.start), scene.reach
    if max(first - most, least - last) <= _FAR_AWAY * max(last - first, most - begin):
        return
    unit, end = given.time_unit or "s", float(scene.samples.last)
    second = size_of(unit, "s")
    raise RigidsimError(
        f"{given.trajectory.source}: its times, {first / second:.15g} to {last / second:.15g} {unit}, lie "
        f"far {'behind' if first > begin else 'before'} the experiment ({begin:.6g} to {end:.6g} s), as if "
        f"counted from another zero; subtract {(first - begin) / second:.15g} from each time (offset "
        '"first"), if its first row is the experiment\'s start; or write dates, and give [time] epoch; or '
        "move [time] start"
    )


# --- the experiment -----------------------------------------------------------------------------------------


def _plain(experiment: Experiment) -> tuple[Experiment, Scene]:
    """The experiment with nothing recorded but attitude, rates and position; and its scene."""
    config = experiment.config
    if config.sweep is not None:
        what = "describes many members, and this takes a single experiment; remove [sweep]"
        raise ConfigError(Problem("[sweep]", what), experiment.source)
    flies = config.initial.position is not None or config.initial.velocity is not None
    names = ["quaternion", "angular_velocity", *(["position"] if flies else [])]
    if config.rigid_bodies:
        names += [f"rigid_body_{name}" for name in ("quaternion", "angular_velocity", "position")]
    quiet = experiment.quiet(names, estimate=config.output.estimate)
    return quiet, build_scene(quiet)


def _sampled(experiment: Experiment, times: np.ndarray) -> Sampled:
    """The experiment at exactly these doubles (s, ascending)."""
    return sampled(experiment, times.tolist(), estimate=experiment.config.output.estimate)


def _own_motion(experiment: Experiment, times: np.ndarray, notes: list[str]) -> Sampled:
    """The experiment at these times, as far as it gets.

    Raises:
        RigidsimError: the motion ends before the third of them.
    """
    made = _sampled(experiment, times)
    count, message = made.dataset.sizes["time"], made.outcome.message
    if count < LEAST_ROWS:
        raise RigidsimError(f"the experiment's motion {message}, before the trajectory begins")
    if count < len(times):
        notes.append(f"the experiment's motion {message}; rows beyond that aren't compared")
    return made


# --- the result ---------------------------------------------------------------------------------------------


def _result(seen: Evidence, name: str, files: Mapping[str, str]) -> Comparison:
    """Everything of it, with its dataset; ``files``: those that will be written."""
    trajectory, errors, source = seen.given.trajectory, seen.errors, seen.given.trajectory.source
    drifts, (verdict, why) = seen.drifts(), judged(seen)
    local, dataset = _local_defects(seen)
    rows = {
        "attitude_error": (errors, "rad", "angle between the attitudes"),
        "rate_error": (seen.rate_errors, "rad s-1", "difference of angular velocities"),
        "position_error": (seen.position_errors, "m", "distance of positions"),
    }
    rows |= {f"{key}_drift": (x, "1", f"drift of {key.replace('_', ' ')}") for key, x in drifts.items()}
    dataset |= {
        key: ("time", values, {"units": unit, "long_name": words})
        for key, (values, unit, words) in rows.items()
        if values is not None
    }
    time = ("time", seen.times, {"units": "s", "long_name": "time"})
    attributes = {"title": f"{source} compared with {name}", "kind": "comparison", "verdict": verdict}
    floor, beyond, worst = seen.floor[0], errors > seen.floor[0], int(np.argmax(errors))
    first = int(np.argmax(beyond))
    made = Comparison(
        name=name,
        source=source,
        rows=len(errors),
        span_s=seen.span,
        verdict=verdict,
        why=why,
        within=floor,
        resolution=seen.resolution,
        attitude_error=AttitudeError(
            largest=float(errors[worst]),
            rms=rms(errors),
            time=float(seen.times[worst]),
            row=trajectory.row(worst),
        ),
        rate_error=_largest(seen.rate_errors),
        position_error=_largest(seen.position_errors),
        convention=seen.convention,
        drifts=[
            TrajectoryDrift(name=key, largest=float(np.abs(values).max()), final=float(values[-1]))
            for key, values in drifts.items()
        ],
        local_defects=local,
        first_disagreement=Disagreement(time=float(seen.times[first]), row=trajectory.row(first))
        if beyond.any()
        else None,
        told=seen.notes,
        **files,
    )
    made._dataset = xarray.Dataset(dataset, {"time": time}, attributes)
    return made


def _largest(values: np.ndarray | None) -> float | None:
    return None if values is None else float(values.max())


def _local_defects(seen: Evidence) -> tuple[LocalDefects | None, dict[str, Any]]:
    """Local defects as values, and as variables of the dataset."""
    if seen.local is None:
        return None, {}
    (starts, sizes, slips), windows, explained = seen.local, seen.windows, seen.explained
    times = seen.times[starts]
    dataset: dict[str, Any] = {
        "defect": ("start", sizes, {"units": "rad", "long_name": "local defect of the attitude"}),
        "defect_time": ("start", times, {"units": "s", "long_name": "time of the row"}),
    }
    if slips is not None:
        words = {"units": "rad s-1", "long_name": "local defect of the angular velocity"}
        dataset["rate_defect"] = ("start", slips, words)
    at = int(np.nanargmax(sizes)) if np.isfinite(sizes).any() else 0
    share = acceleration = None
    if windows is not None:
        share, acceleration = windows.share, windows.acceleration
    if explained is not None and np.isfinite(explained.unexplained):
        share, acceleration = explained.unexplained / explained.size, explained.acceleration
    local = LocalDefects(
        largest=float(sizes[at]),
        rms=float(np.sqrt(np.nanmean(sizes**2))),
        time=float(times[at]),
        rate_largest=None if slips is None else float(np.nanmax(slips)),
        rows=len(starts),
        window_s=None if windows is None else windows.length,
        unexplained=share,
        missing_acceleration=acceleration,
    )
    return local, dataset


def _draw(experiment: Experiment, given: Attitudes, found: Convention, path: Path) -> None:
    """Write a timeline of the experiment and the trajectory, side by side, and the angle between them."""
    from rigidsim.look.timeline import write_comparison  # which loads rerun

    rows = np.unique(np.linspace(0, len(given.times) - 1, min(len(given.times), _MOST_SHOWN)).astype(int))
    own, name = _sampled(experiment, given.times[rows]).dataset, Path(given.trajectory.source).stem
    looks = {"scene": own.attrs["scene"], "title": name}
    theirs, mine = dataset_of_rows(given.at(rows), found, looks), str(own.attrs.get("title", "experiment"))
    try:
        with writing(path) as temporary:
            write_comparison(
                [(mine, own), (name if name != mine else f"{name} of the file", theirs)], temporary
            )
    except RuntimeError as error:
        raise RigidsimError(f"{path}: can't be written: {error}") from None


# --- offsets of times ---------------------------------------------------------------------------------------


FIRST, ESTIMATE = "first", "estimate"
Motion = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Attitudes (rows, 4) and rates (rows, 3) of an experiment at times, s."""
_GRID, _ROWS = 4000, 300  # times of the experiment, and rows, that are compared first
_TRIED = 24  # places where the rates fit best, at which attitudes are compared
_STEADY = 1e-3  # relative spread of rates that say nothing of time
_TURN, _MOST = 0.5, 400  # rad between places that are tried then, and their number
_RIVALS = 4  # places at which the experiment is integrated
_ALIKE, _ROUGH, _FLOOR = 10.0, 1e-3, 1e-9
"""Angles that count as equal to the least: times it, and rad more on the grid and at the rows."""
_ROUNDS = 12
_SETTLED = 1e-15  # of the times' size


def shifted(
    given: Attitudes, offset: str | float | None, span: tuple[float, float], motion: Motion,
    asked: Mapping[str, str],
) -> Attitudes:  # fmt: skip
    """The rows with other times.

    Args:
        offset: s, or a text with a unit, that is added to all times; "first": the first row is at the
            experiment's start; "estimate": found.
        span: start and end of the experiment, s.
        asked: known parts of the file's convention.

    Raises:
        RigidsimError: it is none of these, or can't be found.
    """
    if offset is None:
        return given
    notes = []
    if offset == FIRST:
        seconds = span[0] - float(given.times[0])
    elif offset == ESTIMATE:
        seconds = float(_estimated(given, span, motion, asked))
        notes = [f"{seconds!r} s were added to the file's times, as estimated"]
    else:
        try:
            seconds = float(parse_number(offset, "s"))
        except ValueError as error:
            what = f'offset: {error}; a time, "{FIRST}" or "{ESTIMATE}" is allowed'
            raise RigidsimError(what) from None
    return replace(given, times=given.times + seconds, notes=[*given.notes, *notes])


def _estimated(
    given: Attitudes, span: tuple[float, float], motion: Motion, asked: Mapping[str, str]
) -> float:
    begin, room = span[0], span[1] - span[0] - float(given.times[-1] - given.times[0])
    source = given.trajectory.source
    what = f"{source}: offset: it is longer than the experiment by {-room:.6g} s; set a later [time] end"
    ensure(room >= 0, RigidsimError(what))
    rows = np.unique(np.linspace(0, len(given.times) - 1, _ROWS).astype(int))
    since = given.times[rows] - given.times[0]
    sizes = _speeds(given)[rows]
    grid = np.linspace(*span, _GRID)
    quaternions, rates = motion(grid)
    own = np.linalg.norm(rates, axis=1)
    late = np.linspace(0, room, max(int(_GRID * room / (span[1] - span[0])), 1))
    if min(np.ptp(own) / own.max(), np.ptp(sizes) / (sizes.max() or 1.0)) > _STEADY:
        seen = np.interp(begin + late[:, None] + since, grid, own)
        scale = np.sum(seen * sizes, axis=1, keepdims=True) / np.sum(sizes**2)
        misfit = np.sqrt(np.mean((seen - scale * sizes) ** 2, axis=1)) / own.mean()
        lowest = np.pad(misfit, 1, constant_values=np.inf)
        valleys = np.flatnonzero((misfit <= lowest[:-2]) & (misfit <= lowest[2:]))
        late = late[valleys[np.argsort(misfit[valleys])][:_TRIED]]
    else:  # rates that hardly change say nothing
        late = np.linspace(0, room, int(np.clip(room * own.max() / _TURN, 1, _MOST)))
    zero = begin - float(given.times[0])
    tried = sorted(_settled(given, zero + one, grid, (quaternions, rates), asked) for one in late)
    apart = 2 * (grid[1] - grid[0])
    found: list[tuple[float, float]] = []
    for angle, seconds in tried:
        if angle <= _ALIKE * tried[0][0] + _ROUGH and all(abs(seconds - x) > apart for _, x in found):
            found.append(_settled_exactly(given, seconds, motion, asked))
        if len(found) == _RIVALS:
            break
    found.sort()
    best, others = found[0], [x for angle, x in found[1:] if angle <= _ALIKE * found[0][0] + _FLOOR]
    words = " and ".join(f"{x:.6g}" for x in (best[1], *others[:1]))
    what = f"{source}: offset: {words} s fit equally well, since this motion repeats itself; give the offset"
    ensure(all(abs(x - best[1]) <= apart for x in others), RigidsimError(f"{what} itself"))
    return best[1]


def _speeds(given: Attitudes) -> np.ndarray:
    """Norms of the angular velocity at the rows, in any unit."""
    if given.rates is not None:
        return np.asarray(np.linalg.norm(given.rates, axis=1))
    what = (
        f"{given.trajectory.source}: offset: Euler angles without rates don't show it; add wx wy wz, or give"
    )
    ensure(given.kind != ANGLES, RigidsimError(f"{what} the offset itself"))
    quaternions = find_convention(given, {}, (given.attitude, given.attitude))[0].quaternions(given)
    turns = angles_between(quaternions[:-1], quaternions[1:]) / np.diff(given.times)
    middle = (given.times[1:] + given.times[:-1]) / 2
    return np.interp(given.times, middle, turns)


def _apart(
    given: Attitudes, seconds: float, own: tuple[np.ndarray, np.ndarray], asked: Mapping[str, str]
) -> tuple[float, float]:
    """Mean angle from the experiment's attitudes at the rows (rad), and the shift that removes it (s)."""
    moved = replace(given, times=given.times + seconds)
    found, _ = find_convention(moved, {"offset": "none", **asked}, own)
    turns = vector_of(multiplied(conjugated(own[0]), found.quaternions(moved)))
    return float(np.linalg.norm(turns, axis=1).mean()), float(np.sum(turns * own[1]) / np.sum(own[1] ** 2))


def _settled(
    given: Attitudes, seconds: float, grid: np.ndarray, own: tuple[np.ndarray, np.ndarray],
    asked: Mapping[str, str],
) -> tuple[float, float]:  # fmt: skip
    """Mean angle and shift near a guess, by the experiment at the times of a grid."""

    def near(late: float) -> tuple[np.ndarray, np.ndarray]:
        times = given.times + late
        place = np.clip(np.searchsorted(grid, times), 1, len(grid) - 1)
        place -= (times - grid[place - 1] < grid[place] - times).astype(int)
        rates = own[1][place]
        ahead = (times - grid[place])[:, None] / 2 * rates
        turns = np.concatenate([np.ones((len(times), 1)), ahead], axis=1)
        return multiplied(own[0][place], turns / np.linalg.norm(turns, axis=1, keepdims=True)), rates

    angle, step = _apart(given, seconds, near(seconds), asked)
    after, _ = _apart(given, seconds + step, near(seconds + step), asked)
    return (after, seconds + step) if after < angle else (angle, seconds)


def _settled_exactly(
    given: Attitudes, seconds: float, motion: Motion, asked: Mapping[str, str]
) -> tuple[float, float]:
    """The same by the experiment at the rows themselves, until nothing changes."""
    size = max(map(abs, (given.times[0], given.times[-1], seconds)))
    least, angle = np.inf, np.inf
    for _ in range(_ROUNDS):
        angle, step = _apart(given, seconds, motion(given.times + seconds), asked)
        if not abs(step) < least:  # rounding, or another model
            break
        seconds, least = seconds + step, abs(step)
        if least <= _SETTLED * size:
            break
    return angle, seconds
