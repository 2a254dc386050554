"""``rigidsim orbits``: orbits of the planets over millions of years, as tables of averaged elements.

The eight planets are points under each other's gravity, with the relativistic advance of the perihelia as the
potential -3 (G M / c r)^2 of the Sun (Nobili & Roxburgh 1986) and the quadrupole of the Earth with its Moon
(Quinn, Tremaine & Duncan 1991, AJ 101, 2287, with the factor of Varadi, Runnegar & Ghil 2003, ApJ 592, 620).
They start where a kernel of the Jet Propulsion Laboratory has them at J2000, as barycentres of their systems.
REBOUND's WHFast (Rein & Tamayo 2015, MNRAS 452, 376) takes steps of 5 days with a symplectic corrector of
order 11: the map of Wisdom & Holman (1991, AJ 102, 1528).
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import json
import math
import os
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, TextIO
from zipfile import BadZipFile

import mpmath
import numpy as np

from rigidsim.errors import FORCE, OUT, Remedy, RigidsimError, RunFolderError, once_mended
from rigidsim.scene.exact import parse_number
from rigidsim.scene.kernels.reading import KernelError, kernel_of
from rigidsim.scene.space_axes import obliquity, to_ecliptic
from rigidsim.scene.validation_messages import nearest, shown
from rigidsim.session.progress import left_text, meter
from rigidsim.store import atomic
from rigidsim.store.outputs import refuse_loss

PLANETS = ("mercury", "venus", "earth", "mars", "jupiter", "saturn", "uranus", "neptune")
"""Planets, each with its moons."""
CHAOTIC = 50e6
"""Years beyond which an orbit of the Earth is one of many that fit what is known (Laskar et al. 2011, A&A
532, A89).
"""
BEYOND = 3
"""Rows beyond both ends, with which a table is interpolated there as elsewhere."""
RESUMED = Remedy("--resume", "resume=True")
SAVED_EVERY = 10.0
"""Seconds between states that are saved."""
_EARTH = 1 + PLANETS.index("earth")
_AU, _LIGHT = 149597870.7, 299792.458  # km, km/s
_DAY, _YEAR = 86400, 31557600  # s
_STEP, _LOOK = 5, 500  # days: the longest step, and the longest between two looks, whose mean is within 1e-7
_MOON_SHARE = 81.30057 / (1 + 81.30057) ** 2  # product of both masses over the square of their sum
_MOON_DISTANCE = 384400 / _AU
_MOON_FACTOR = 0.8525  # for the Moon's eccentricity, inclination and perturbed orbit (Varadi et al. 2003)
_HEAD = """# {planet}, from J2000 to {end}: elements about the Sun, averaged over {window} by Hann's weights.
# Ecliptic and equinox of J2000. Eight planets from {kernel}, with relativity and the quadrupole of Earth and
# Moon, by REBOUND's WHFast (rigidsim orbits). The mean of the semi-major axis is given in the last line.
time [yr], eccentricity, inclination [deg], ascending_node [deg], longitude_of_periapsis [deg]
"""


@dataclass(frozen=True)
class Orbits:
    """What was written.

    Attributes:
        files: a table per planet.
        rows: rows of each. reached: time of the last one, years since J2000.
        axes: means of the semi-major axes by planet, au.
        complete: False after Ctrl-C.
    """

    files: list[Path]
    rows: int
    reached: float
    axes: dict[str, float]
    complete: bool

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"files": list(map(str, self.files))}


@dataclass(frozen=True)
class _Rhythm:
    """Steps (days, with the sign of time), so that looks and rows are at whole numbers of them.

    Attributes:
        looks: from one row to the next. half: looks on both sides of a row that are averaged.
        rows: asked for, from J2000 to the end, without those beyond.
    """

    step: float
    steps: int
    looks: int
    half: int
    rows: int
    every: float

    @property
    def first(self) -> int:
        """Number of the first look, counted from J2000."""
        return -BEYOND * self.looks - self.half

    def year(self, row: int) -> float:
        """Years since J2000 of a row."""
        return math.copysign(self.every, self.step) * row / _YEAR + 0.0  # no -0


def write_orbits(
    planets: Sequence[str],
    end: Any,
    *,
    every: Any = "1 kyr",
    window: Any = "1 kyr",
    kernel: str = "de421",
    out: str | Path = ".",
    force: bool = False,
    resume: bool = False,
) -> Orbits:
    """Integrate the planets from J2000 to ``end``, and write ``PLANET.csv`` of those named, row by row. Until
    they are complete, ``PLANET.unfinished`` holds a state from which they are continued with the same bits.

    Args:
        planets: names from ``PLANETS``; all eight are integrated.
        end: before J2000 if negative. every: from one row to the next. window: length of the average; 0 for
            osculating elements. All in s, or with a unit ("-1 Myr").
        kernel: an installed package of an ephemeris, as ``[ephemeris] kernel``.
        out: folder of the tables. force: whether they may replace files.
        resume: whether tables that were interrupted are continued; others begin.

    Returns:
        What was written, also after Ctrl-C.

    Raises:
        RigidsimError: an argument isn't allowed, REBOUND is missing, or files can't be written.
    """
    for name in planets:
        if name not in PLANETS:
            raise RigidsimError(
                f"PLANET: given {shown(name)}{nearest(name, PLANETS)}; allowed: {', '.join(PLANETS)}"
            )
    rhythm = _rhythm(_seconds("--end", end), _seconds("--every", every), _seconds("--window", window))
    missing = [name for name in ("rebound", "numba") if find_spec(name) is None]
    if missing:
        raise RigidsimError(
            f'rigidsim orbits needs {" and ".join(missing)}, which is missing: pip install "rigidsim[orbits]"'
        )
    start = _start(kernel)
    names = list(dict.fromkeys(planets))
    files = [Path(out) / f"{name}.csv" for name in names]
    unfinished = _Unfinished(
        files[0].with_suffix(".unfinished"),
        {
            "planets": names,
            **{"end": str(end), "every": str(every), "window": str(window), "kernel": kernel},
            "state of the kernel at J2000": hashlib.sha256(start.tobytes()).hexdigest(),
            **{name: version(name) for name in ("rebound", "numba")},
        },
    )
    averages = _Averages(start, rhythm, [1 + PLANETS.index(name) for name in names])
    if resume and unfinished.path.exists():
        unfinished.restore(averages)
    else:
        if unfinished.path.exists() and not force:
            what = (
                f"tables that were interrupted can be continued from it: {RESUMED} does, {FORCE} begins again"
            )
            raise RunFolderError(f"{unfinished.path}: {what}")
        refuse_loss(files, [], force=force)
    begin = saved = time.perf_counter()
    first, complete = averages.share, True
    with ExitStack() as stack:
        stack.enter_context(_writing(files[0]))
        unfinished.save(averages)
        opened = [stack.enter_context(_table(file, averages.rows)) for file in files]
        for name, file in zip(names, opened, strict=True):
            if not averages.rows:
                file.write(_HEAD.format(planet=name.title(), end=end, window=window, kernel=kernel))
        show = stack.enter_context(meter())
        show.name = "orbits"
        show.phase(f"integrating the planets to {end}")
        try:
            for means in averages:
                for file, (k, h, ix, iy, _) in zip(opened, means, strict=True):
                    angles = 2 * math.asin(math.hypot(ix, iy) / 2), math.atan2(iy, ix), math.atan2(h, k)
                    degrees = ", ".join(f"{math.degrees(x):.10f}" for x in angles)
                    file.write(f"{averages.year:.12g}, {math.hypot(k, h):.12f}, {degrees}\n")
                    file.flush()
                now, share = time.perf_counter(), averages.share
                if now > saved + SAVED_EVERY:
                    unfinished.save(averages, opened)
                    saved = now
                left = left_text(now - begin, (share - first) / (1 - first))
                show.update(share, f"{100 * share:.1f} %, t = {averages.year / 1000:,.6g} kyr, {left}")
        except KeyboardInterrupt:
            complete = False
        axes = dict(zip(names, (averages.axes / max(averages.rows, 1)).tolist(), strict=True))
        for file, axis in zip(opened, axes.values(), strict=True):
            file.write(f"# mean semi-major axis {axis:.10f} au\n")
            file.flush()
        if complete:
            unfinished.remove()
    return Orbits(files, averages.rows, averages.year if averages.rows else 0.0, axes, complete)


def _seconds(option: str, given: Any) -> float:
    try:
        return float(parse_number(given, "s"))
    except ValueError as error:
        raise RigidsimError(f"{option}: {error}") from None


def _rhythm(end: float, every: float, window: float) -> _Rhythm:
    if every <= 0 or window < 0:
        raise RigidsimError(
            f"--every, --window: given {every:g} s and {window:g} s; positive lengths of time are allowed, "
            "and a window of 0 for osculating elements"
        )
    rows = math.ceil(abs(end) / every - 1e-9)
    if rows < 1:
        raise RigidsimError(
            f"--end: given {end:g} s; a time other than J2000 is allowed, such as --end '-1 Myr'"
        )
    looks = math.ceil(every / (_LOOK * _DAY))
    steps = math.ceil(every / (_STEP * _DAY * looks))
    half = round(window / 2 / (every / looks))
    return _Rhythm(math.copysign(every / (_DAY * looks * steps), end), steps, looks, half, rows, every)


def _start(name: str) -> np.ndarray:
    """G M, place and velocity of the Sun and the planets at J2000, (9, 7), in au and days, ecliptic."""
    context = mpmath.MPContext()
    found = []
    try:
        kernel = kernel_of(name, "")
        for body in ("sun", *PLANETS):
            body = "earth_moon_barycenter" if body == "earth" else body
            strength, sight = kernel.strength(body), kernel.sight(body, "")
            if strength is None:
                raise KernelError("which has no gravitational parameters; an installed package of an "
                                  "ephemeris is allowed: de405, de421, de423 (pip install NAME)")  # fmt: skip
            first, last = sight.span
            if not first <= 0 <= last:
                raise KernelError("which doesn't reach J2000; one that does is allowed, such as de421")
            place, velocity = (
                [float(x) / _AU * _DAY**order
                 for x in to_ecliptic(sight.at(context, context.zero, order), obliquity(context))]
                for order in (0, 1)
            )  # fmt: skip
            found.append([float(strength) / 1e9 / _AU**3 * _DAY**2, *place, *velocity])
    except KernelError as error:
        raise RigidsimError(f"--kernel: given {shown(name)}, {error}") from None
    return np.array(found)


class _Averages:
    """Means of the bodies' elements (bodies, 5), row by row.

    Attributes:
        look: number of the last look. seen: elements at the looks that the next row may need.
        rows: given so far. axes: sums of their semi-major axes, au.
        planets: at the last look; None before the first.
    """

    def __init__(self, start: np.ndarray, rhythm: _Rhythm, bodies: list[int]) -> None:
        self._start, self._rhythm, self._bodies = start, rhythm, bodies
        self._last = (rhythm.rows + BEYOND) * rhythm.looks + rhythm.half
        self.look, self.seen = rhythm.first - 1, list[np.ndarray]()
        self.rows, self.axes = 0, np.zeros(len(bodies))
        self.planets: _Sun | None = None

    @property
    def share(self) -> float:
        """How much of the way is done."""
        return (self.look - self._rhythm.first + 1) / (self._last - self._rhythm.first + 1)

    @property
    def year(self) -> float:
        """Of the last row, years since J2000."""
        return self._rhythm.year(self.rows - 1 - BEYOND)

    def __iter__(self) -> Iterator[np.ndarray]:
        rhythm = self._rhythm
        weights = np.cos(np.pi * np.arange(-rhythm.half, rhythm.half + 1) / (2 * rhythm.half + 2)) ** 2
        weights /= weights.sum()
        while self.look < self._last:
            if self.planets is None:
                before = _Sun.begun(self._start, -rhythm.step)
                before.advance(-rhythm.first * rhythm.steps)
                self.planets = _Sun.begun(before.state(), rhythm.step)
            else:
                self.planets.advance(rhythm.steps)
            self.look += 1
            if (self.look + rhythm.half) % rhythm.looks <= 2 * rhythm.half:  # within a window
                kept = self.seen[max(0, len(self.seen) - 2 * rhythm.half) :]
                self.seen = [*kept, self.planets.elements(self._bodies)]
            if not (self.look - rhythm.half) % rhythm.looks and len(self.seen) == len(weights):
                means = np.tensordot(weights, np.array(self.seen), 1)
                self.rows, self.axes = self.rows + 1, self.axes + means[:, 4]
                yield means


@dataclass(frozen=True)
class _Unfinished:
    """The file of a state from which tables are continued, and what has to be the same then."""

    path: Path
    about: dict[str, Any]

    def save(self, averages: _Averages, opened: Sequence[TextIO] = ()) -> None:
        """Replace the state, once the tables are on disk."""
        for file in opened:
            os.fsync(file.fileno())
        numbers = {name: getattr(averages, name) for name in ("look", "seen", "rows", "axes")}
        with atomic.replacing(self.path) as new:
            content = b"" if averages.planets is None else averages.planets.saved(new)
            numbers |= {"planets": np.frombuffer(content, np.uint8), "about": json.dumps(self.about)}
            with new.open("wb") as binary:
                np.savez(binary, **numbers)

    def remove(self) -> None:
        """Remove it, with what killed processes were writing."""
        for path in (*self.path.parent.glob(f".{self.path.name}.*.partial"), self.path):
            path.unlink(missing_ok=True)

    def restore(self, averages: _Averages) -> None:
        """Set the averages on the state.

        Raises:
            RunFolderError: it is of other tables, or damaged.
        """
        try:
            with np.load(self.path) as arrays:
                found = {name: arrays[name] for name in arrays.files}
            begun = json.loads(str(found["about"]))
            other = [f"{k} {begun.get(k)}, given {v}" for k, v in self.about.items() if begun.get(k) != v]
            if other:
                what = f"was begun with {'; '.join(other)}; give the same, or {FORCE} alone begins again"
                raise RunFolderError(f"{self.path}: {what}")
            averages.look, averages.seen = int(found["look"]), list(found["seen"])
            averages.rows, averages.axes = int(found["rows"]), found["axes"]
            averages.planets = _Sun.restored(found["planets"].tobytes()) if found["planets"].size else None
        except (OSError, ValueError, KeyError, RuntimeError, BadZipFile) as error:
            raise RunFolderError(f"{self.path}: is damaged ({error}); {FORCE} alone begins again") from None


def _table(path: Path, rows: int) -> TextIO:
    """A table for further rows, cut after so many."""
    with path.open("rb+" if rows else "wb") as table:
        for _ in range(rows + _HEAD.count("\n") if rows else 0):
            if not table.readline().endswith(b"\n"):
                raise RunFolderError(f"{path}: rows were removed since; {FORCE} alone begins again")
        table.truncate(table.tell())
    return path.open("a", encoding="utf-8", newline="\n")


@contextmanager
def _writing(first: Path) -> Iterator[None]:
    """Keep other processes out of the tables' folder, that of the first; say why writing stopped."""
    with ExitStack() as stack:
        folder = os.open(first.parent, os.O_RDONLY)
        stack.callback(os.close, folder)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            what = f"another process is at work there; wait for it, or choose another {OUT}"
            raise RunFolderError(f"{first.parent}: {what}") from None
        try:
            yield
        except OSError as error:
            what = f"can't be written: {error.strerror or error}; {once_mended(error)}, {RESUMED} continues"
            raise RunFolderError(f"{error.filename or first}: {what}") from None


class _Sun:
    """The Sun with its planets in REBOUND: a simulation, ready for steps."""

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation
        simulation.additional_forces = _forces(len(simulation.particles)).address

    @classmethod
    def begun(cls, state: np.ndarray, step: float) -> _Sun:
        """At rest in their common centre, from G M, places and velocities."""
        import rebound

        simulation = rebound.Simulation()
        simulation.G = 1.0
        for m, x, y, z, vx, vy, vz in state:
            simulation.add(m=m, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz)
        simulation.move_to_com()
        simulation.integrator = "whfast"
        whfast = simulation.integrator
        # looks leave the motion as it is
        whfast.corrector, whfast.safe_mode, whfast.keep_unsynchronized = 11, 0, 1
        simulation.dt = step
        return cls(simulation)

    @classmethod
    def restored(cls, content: bytes) -> _Sun:
        """As they were saved, in every bit."""
        import rebound

        with NamedTemporaryFile() as file, warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # forces have to be set again
            file.write(content)
            file.flush()
            return cls(rebound.Simulation(file.name))

    def saved(self, path: Path) -> bytes:
        """REBOUND's own archive of one state, by way of a new file."""
        self._simulation.save_to_file(str(path), delete_file=True)
        return path.read_bytes()

    def advance(self, steps: int) -> None:
        """Take steps."""
        self._simulation.steps(steps)

    def state(self) -> np.ndarray:
        """G M, places and velocities, (bodies, 7)."""
        self._simulation.synchronize()
        return np.array([[p.m, *p.xyz, *p.vxyz] for p in self._simulation.particles])

    def elements(self, bodies: list[int]) -> np.ndarray:
        """Osculating e cos and e sin of the longitude of perihelion, 2 sin(i / 2) times cos and sin of the
        node's, and the semi-major axis (au), about the Sun, (bodies, 5).
        """
        self._simulation.synchronize()
        sun = self._simulation.particles[0]
        found = [self._simulation.particles[i].orbit(primary=sun) for i in bodies]
        return np.array([[x.pal_k, x.pal_h, x.pal_ix, x.pal_iy, x.a] for x in found])


@cache
def _forces(count: int) -> Any:
    """Compiled accelerations of relativity and of the Moon, which REBOUND calls at each step."""
    import numba
    import rebound

    particle = rebound.Particle
    size, pushed, mass = (x // 8 for x in (ctypes.sizeof(particle), particle.ax.offset, particle.m.offset))
    place = rebound.Simulation._particles.offset // 8
    relativity = 6 / (_LIGHT / _AU * _DAY) ** 2
    moon = 0.75 * _MOON_FACTOR * _MOON_SHARE * _MOON_DISTANCE**2
    types = numba.types

    @numba.cfunc(types.void(types.CPointer(types.CPointer(types.float64))))
    def forces(simulation: Any) -> None:
        p = simulation[place]
        sun = p[mass]
        for body in range(1, count):
            i = body * size
            x, y, z = p[i] - p[0], p[i + 1] - p[1], p[i + 2] - p[2]
            r2 = x * x + y * y + z * z
            pull = relativity * sun * sun / (r2 * r2)
            if body == _EARTH:
                pull += moon * sun / (r2 * r2 * math.sqrt(r2))
            back = pull * p[i + mass] / sun
            for axis, along in enumerate((x, y, z)):
                p[i + pushed + axis] -= pull * along
                p[pushed + axis] += back * along

    return forces
