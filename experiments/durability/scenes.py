"""Scenes of some tenths of a second of work each, and whether two datasets agree in every bit."""

import time
from pathlib import Path

import numpy as np
import xarray

import rigidsim
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing
from rigidsim.store.segments import SegmentLimits

BODY = """
[body]
principal_moments = [1, 2, 2.5]
mass = 1.5
center_of_mass = [0.01, 0.02, 0.3]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
euler_angles = [0.2, 1.1, 0.7]
"""
EVENT = '[[events]]\nname = "flip"\nexpression = "wy"\n'
DRIVEN = '[[loads]]\nkind = "torque"\ncomponents = ["0.1*sin(t)", "0", "0.05*wx"]\n'
GRAVITY = '[[loads]]\nkind = "uniform_gravity"\n'

MOON = """
[body]
preset = "moon"
host = "moon"
elasticity = {love_number = 0.0216, radius = "1738 km", delay = "0.108 day", raised_by = ["earth"]}
core = {moment = 0.0007, flattening = 3.8e-4, friction = "1.5e-8 day^-1"}
[body.gravity_field]
radius = "1738 km"
C = {"3,0" = -8.4e-6, "3,1" = 2.8e-5, "3,2" = 4.8e-6, "3,3" = 1.7e-6, "4,0" = 9.6e-6, "4,2" = -1.6e-6}
S = {"3,1" = 5.9e-6, "3,2" = 1.7e-6, "3,3" = -2.5e-7, "4,1" = 1.6e-6, "4,2" = -1.5e-6}
[initial]
euler_angles = [0.0051, 0.3824, 1.2942]
angular_velocity = ["4.6e-5 rad/day", "-2.2e-6 rad/day", "0.2299 rad/day"]
[ephemeris]
kernel = "de421"
[[loads]]
kind = "gravity_gradient"
name = "earth"
source = "earth"
degree = 4
figure = {J2 = 1.0826e-3, radius = "6378.1 km", pole = "iau1976"}
[[loads]]
kind = "gravity_gradient"
source = "sun"
"""
"""Its kernel's blocks end every 4 and every 16 days, which are 1 and 4 samples here."""
PAIR = """
[body]
shape = "ellipsoid"
mass = 5.24e11
semi_axes = [431, 419, 310]
[initial]
angular_velocity = [1e-5, 0, 7.7e-4]
[[rigid_bodies]]
name = "moonlet"
shape = "ellipsoid"
mass = 4.8e9
semi_axes = [103, 79, 66]
position = [1190, 0, 0]
velocity = [0, 0.1714, 0.001]
angular_velocity = [0, 1e-6, 1.46e-4]
[[loads]]
kind = "mutual_gravity"
degree = 4
[[events]]
name = "near"
expression = "separation - 1125"
"""
DAYS = 86400
KINKED = '[[loads]]\nkind = "torque"\ncomponents = ["0.01*sign(wx - 0.2)", "0.02*abs(sin(t))", "0"]\n'
_ROWS = "".join(f"{100 * n}, 1000, {0.1 + 0.001 * (n % 7)}, 0.2, {3.16 * n:.2f}\n" for n in range(-42, 43))
TABLE = (
    '[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = 1e6\norbit = {table = "t.csv"}\n'
    f'[tables."t.csv"]\ntext = """time, semi_major_axis, eccentricity, periapsis, mean_anomaly\n{_ROWS}"""\n'
)
# end, samples, [integrator], rest, [output]
MOONS = {
    "moon_double": (1000 * DAYS, 251, "", "", ""),
    "moon_extended": (400 * DAYS, 101, 'precision = "extended"', "", ""),
    "moon_quadruple": (104 * DAYS, 105, 'precision = "quadruple"', "", ""),
}
SCENES = {
    "double_dense": (4000, 16001, "", "", ""),
    "double_chunks": (8000, 120_001, "", "", ""),  # segments of whole chunks
    "double_sparse": (60000, 13, "", "", ""),
    "double_driven": (3000, 3001, "", DRIVEN, ""),
    "double_euler": (1000, 2001, 'formulation = "euler_angles"', GRAVITY, ""),
    "double_events": (3000, 1501, "", EVENT, ""),
    "double_held": (8000, 4001, "hold_invariants = true", "", ""),
    "double_lyapunov": (1500, 301, "", DRIVEN, "lyapunov = true"),
    "extended_dense": (3000, 3001, 'precision = "extended"', "", ""),
    "extended_events": (1000, 501, 'precision = "extended"', EVENT + DRIVEN, ""),
    "quadruple_dense": (80, 321, 'precision = "quadruple"', "", ""),
    "quadruple_events": (60, 61, 'precision = "quadruple"\nformulation = "rotation_matrix"', EVENT, ""),
    **MOONS,
    "pair_double": (30 * DAYS, 2001, "", "", ""),
    "pair_extended": (5 * DAYS, 601, 'precision = "extended"', "", ""),
    "double_kinked": (600, 601, "", KINKED + EVENT, ""),
    "double_table": (4000, 4001, "", TABLE, ""),
}
_BACK = ("driven", "held", "kinked", "table", "double")
SCENES |= {f"{n}_back": (-end, *rest) for n, (end, *rest) in SCENES.items() if n.split("_")[1] in _BACK}


def text_of(name: str, longer: int = 1) -> str:
    """The scene's config.

    Args:
        longer: factor of its end, with as many samples.
    """
    end, samples, integrator, rest, output = SCENES[name]
    end *= longer
    body = {"moon": MOON, "pair": PAIR}.get(name.split("_")[0], BODY)
    epoch = 'epoch = "1969-06-28T00:00:00 TDB"\n' * (body is MOON)
    return (
        f'name = "{name}"\n{body}{rest}[time]\n{epoch}end = {end}\nsamples = {samples}\n'
        # a run that may be stopped isn't refused where the disk is too small for all of it
        f"[integrator]\n{integrator}\n[limits]\nwall_time = 3600\n[output]\ntimeline = false\n{output}\n"
    )


FREQUENT = Tuning(Pacing(chunk_seconds=0.01, patience=0.03), SegmentLimits(bytes=400_000, seconds=0.03))
"""Segments some thirty times a second instead of once in thirty seconds."""
_CHUNKS = Tuning(Pacing(chunk_seconds=0.01), SegmentLimits(bytes=1_500_000))
"""Segments of one or two chunks, which they end with."""


def tuning_of(name: str) -> Tuning:
    """How often the runs of a scene save."""
    return _CHUNKS if name == "double_chunks" else FREQUENT


class Undisturbed:
    """Each scene run once with nothing in its way, when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._found: dict[str, tuple[xarray.Dataset, float, int]] = {}

    def __getitem__(self, name: str) -> xarray.Dataset:
        return self._of(name)[0]

    def seconds(self, name: str) -> float:
        """That it takes."""
        return self._of(name)[1]

    def size(self, name: str) -> int:
        """Of the disk at its fullest, bytes: all segments, and the dataset beside them."""
        return self._of(name)[2]

    def _of(self, name: str) -> tuple[xarray.Dataset, float, int]:
        if name not in self._found:
            rigidsim.run(rigidsim.parse(text_of(name)), out=self._folder / "warm", force=True)  # compiles
            started = time.monotonic()
            run = rigidsim.run(rigidsim.parse(text_of(name)), out=self._folder)
            seconds = time.monotonic() - started
            with run.dataset as dataset:
                whole = dataset.load()
            size = whole.nbytes + run.folder.dataset.stat().st_size
            self._found[name] = whole, seconds, size
            steps = run.summary["cost"]["steps"]
            print(f"{name}, undisturbed: {seconds:.2f} s, {steps} steps", flush=True)
        return self._found[name]


def same(one: xarray.Dataset, other: xarray.Dataset, rows: int | None = None) -> str:
    """The first variable in which datasets differ in any bit, over as many rows; empty where none does."""
    variables = set(one.variables) | set(other.variables)
    for name in sorted(map(str, variables)):
        if rows is not None and (name not in one or "time" not in one[name].dims):
            continue
        if name not in one or name not in other:
            return f"{name} is missing"
        a, b = one[name].values, other[name].values
        if rows is not None:
            a, b = a[:rows], b[:rows]
        if a.dtype == np.float64:
            a, b = np.ascontiguousarray(a).view(np.int64), np.ascontiguousarray(b).view(np.int64)
        if not np.array_equal(a, b):
            return name
    return ""
