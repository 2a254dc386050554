"""How late a trajectory's clock is against the experiment's, from the motion itself.

The norm of the angular velocity is the same in every convention but for its unit. Where its course fits the
experiment's about as well as anywhere, the attitudes are compared; then the shift t makes them equal to first
order: the turn from the experiment's attitudes to the file's is t w (least squares over all rows).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rigidsim.errors import RigidsimError, ensure
from rigidsim.scene.exact import parse_number
from rigidsim.scene.rotations import angles_between, conjugated, multiplied, vector_of
from rigidsim.workflows.compare.conventions import ANGLES, Attitudes, find_convention

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
