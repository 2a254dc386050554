"""What does a satellite's day with everything on cost over a bare heyoka script of the same equations?

A spinning CubeSat at 400 km: the Earth's field to degree 4, gravity gradients of Earth and Sun, drag and
light on a box and a panel (sides that turn away end a step), the shadow of a point Sun, a magnet and eddy
currents in a dipole. ``experiments/bare/satellite.py`` writes the same with heyoka alone, without the work
and the drifts that a run has as well. With a sphere nothing turns away, and without the shadow no step ends
on a surface: three rows show what surfaces cost. CPU from the first step to the last sample (1.15 asked) is
the least of several turns, without compiling or estimates; attitudes, rates and positions agree to 1e-9 of
their size.

Run: python -m experiments.satellite_cost [--turns 5] [--hours 24]      exit code 1 if the motions differ
"""

import sys

import numpy as np

from experiments.bare import satellite as bare
from experiments.common import Command, Result, simulate

APART = 1e-9
_QUIET = ("output.estimate=false",)


CASES = {  # what a row tells: plates, shadow
    "sphere in full light": (False, False),
    "sphere, shadow of a point Sun": (False, True),
    "box and panel, shadow": (True, True),
}


def scene(hours: float = 24.0, *, plates: bool = True, shadow: bool = True) -> str:
    """The config of the bare script's satellite, with plates or a sphere for its outside."""

    def table(values: dict[tuple[int, int], float]) -> str:
        return "{" + ", ".join(f'"{n},{m}" = {x!r}' for (n, m), x in values.items()) + "}"

    area = [bare.SPECULAR, bare.DIFFUSE, bare.DRAG]
    outside = "specular = {}\ndiffuse = {}\ndrag_coefficient = {}".format(*area)
    box = f"[[body.surfaces]]\nsize = {list(bare.EDGES)}\n{outside}"
    panel = f"[[body.surfaces]]\nnormal = [0, 0, 1]\narea = {bare.PANEL}\nboth_sides = true"
    ball = f"[[body.surfaces]]\nradius = {bare.BALL}"
    held = f"position = {list(bare.PLACE)}\n{outside}"
    surfaces = "\n".join([box, panel, held] if plates else [ball, held])
    return f"""name = "satellite_cost"
[body]
principal_moments = {list(bare.MOMENTS)}
mass = {bare.MASS}
{surfaces}
[initial]
position = {list(bare.POSITION)}
velocity = {list(bare.VELOCITY)}
angular_velocity = {list(bare.RATES)}
quaternion = {list(bare.QUATERNION)}
[[loads]]
kind = "central_gravity"
name = "earth"
gravitational_parameter = {bare.MU}
radius = {bare.RADIUS}
atmosphere_rate = [0, 0, {bare.SPIN}]
[loads.gravity_field]
radius = {bare.RADIUS}
C = {table(bare.C)}
S = {table(bare.S)}
pole = [0, 0, 1]
rate = {bare.SPIN}
[[loads]]
kind = "drag"
density = {bare.DENSITY}
altitude = {bare.ALTITUDE}
scale_height = {bare.HEIGHT}
[[loads]]
kind = "gravity_gradient"
name = "sun"
gravitational_parameter = {bare.SUN}
orbit = {{semi_major_axis = {bare.FAR}, inclination = {bare.TILT!r}}}
[[loads]]
kind = "radiation_pressure"
light = "sun"
shadow = {str(shadow).lower()}
[[loads]]
kind = "magnetic_dipole"
moment = {list(bare.MAGNET)}
source_moment = {list(bare.DIPOLE)}
[[loads]]
kind = "eddy_currents"
magnetic_tensor = {list(bare.CONDUCTOR)}
source_moment = {list(bare.DIPOLE)}
[time]
end = {3600 * hours}
samples = 1441
[output]
record = ["quaternion", "angular_velocity", "position"]
"""


def apart(ours: Result, theirs: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest differences at any sample over the largest size; of the attitude in rad."""
    one, other = ours.values("quaternion"), theirs["quaternion"]
    chord = np.minimum(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1))
    found = {"attitude": float(2 * chord.max())}
    for name in ("angular_velocity", "position"):
        gap = np.linalg.norm(ours.values(name) - theirs[name], axis=1).max()
        found[name] = float(gap / np.linalg.norm(theirs[name], axis=1).max())
    return found


@Command
def campaign(turns: int = 5, hours: float = 24.0) -> int:
    """Print the table; 1 if the motions differ."""
    print("| | CPU, s | of the script, s | ratio | steps | of the script | ratio |")
    print("| --- " * 7 + "|")
    largest = 0.0
    for name, (plates, shadow) in CASES.items():
        script, ours, theirs = bare.Satellite(plates=plates, shadow=shadow), [], []
        for _ in range(turns):
            run = simulate(scene(hours, plates=plates, shadow=shadow), *_QUIET)
            ours.append(run.summary["cost"]["cpu_by_phase"]["integrate_and_record"])
            found = script.integrate(hours)
            theirs.append(found["seconds"])
        seconds, steps = (min(ours), min(theirs)), (run.steps, found["steps"])
        cells = [f"{x:.4g} | {y:.4g} | {x / y:.3g}" for x, y in (seconds, steps)]
        gaps = apart(run, found)
        print(f"| {name} | {' | '.join(cells)} |")
        print("apart by " + ", ".join(f"{gap:.1e} ({key})" for key, gap in gaps.items()), file=sys.stderr)
        largest = max(largest, *gaps.values())
    return int(not largest < APART)
