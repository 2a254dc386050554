"""Which rigid satellites keep one side towards the planet, over the whole plane of inertia ratios?

Method: moments A, B, C about the axes away from the planet (yaw), along the velocity (roll) and along the
orbit's normal (pitch), on a circular orbit. Each cell of the plane of k_R = (C - A) / B, k_Y = (C - B) / A
starts where it could stay forever, once an orbit about the normal, and a tangent vector is carried along in
the full equations (quaternions). One sweep, in batches: its ``fli`` is the logarithm of the largest growth.

Held against: DeBra & Delp 1961 (J. Astronaut. Sci. 8, 14). With n = 1 the linear motion has the pitch rate
sqrt(-3 k_P), k_P = (B - A) / C, and roll and yaw obey s^4 + (1 + 3 k_R + k_R k_Y) s^2 + 4 k_R k_Y = 0. The
largest real part r tells the growth exp(r t). Cells with r = 0 must not grow by more than e^7: a resonance
that is near lets a vector grow linearly in time (ln 126 = 4.8), and oscillations have amplitudes (e^2). Cells
with r T above 14 must. Between them the orbits are too few to tell, and they are counted. For 14 < r T < 25,
before round-off has driven the motion itself away (e^36 = 1/eps), the growth must be r T to within those 7.
"""

from __future__ import annotations

import tempfile
from fractions import Fraction
from typing import Any

import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from rigidsim.workflows.read import parse
from rigidsim.workflows.sweeps.sweep import sweep

ORBITS = 20
PLAIN = 7.0
"""Logarithm of what a motion without exponential growth may make of a vector; see above."""
CONFIG = """
name = "satellite_stability"
body.principal_moments = [1, 2, 2.5]
[initial]
quaternion = [1, 0, 0, 0]
angular_velocity = [0, 0, 1]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1, eccentricity = 0}
[time]
end = END
samples = 81
[integrator]
formulation = "quaternion"
tolerance = 1e-9
[output]
record = ["angular_velocity"]
estimate = false
[sweep]
keep = ["fli"]
axes."body.principal_moments" = {values = [
MOMENTS
], name = "moments"}
"""


def ratios(side: int) -> list[Fraction]:
    """Middles of cells between -1 and 1."""
    return [Fraction(2 * i + 1, side) - 1 for i in range(side)]


def moments(roll: Fraction, yaw: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """About yaw, roll and pitch axis, that about the roll axis being 1."""
    about_yaw = (1 - roll) / (1 - yaw)
    return about_yaw, Fraction(1), roll + about_yaw


def growth_rate(roll: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Largest real part of the linear motion's exponents, over the mean motion."""
    about_yaw = (1 - roll) / (1 - yaw)
    pitch = (1 - about_yaw) / (roll + about_yaw)
    b, c = 1 + 3 * roll + roll * yaw, 4 * roll * yaw
    root = np.sqrt((b * b - 4 * c).astype(complex))
    squares = np.array([-3 * pitch.astype(complex), (-b + root) / 2, (-b - root) / 2])
    rates = np.abs(np.sqrt(squares).real).max(axis=0)
    return np.asarray(np.where(rates < 1e-7, 0.0, rates))  # the root of what rounding left of a zero


@Study
def study(full: bool) -> Answer:
    """The map, the figure, the checks."""
    side = 96 if full else 32
    cells = [(roll, yaw) for yaw in ratios(side) for roll in ratios(side)]
    rows = ["[" + ", ".join(f'"{m}"' for m in moments(*cell)) + "]" for cell in cells]
    end = 2 * np.pi * ORBITS
    text = CONFIG.replace("END", repr(float(end))).replace("MOMENTS", ",\n".join(rows))
    with tempfile.TemporaryDirectory() as folder:
        saved = sweep(parse(text), out=folder)
        grown = saved.dataset.fli.values.reshape(side, side)
        engines = saved.summary["engines"]
    values = np.array([float(x) for x in ratios(side)])
    roll, yaw = np.meshgrid(values, values)
    rate = growth_rate(roll, yaw) * end
    stable, unstable = rate == 0, rate > 2 * PLAIN
    between = ~stable & ~unstable
    measured = unstable & (rate < 25)
    print(f"{side}x{side} satellites ({engines}): {stable.sum()} stable, {unstable.sum()} unstable, "
          f"{between.sum()} that {ORBITS} orbits don't tell")  # fmt: skip
    wrong = int((stable & ~(grown < PLAIN)).sum()), int((unstable & (grown < PLAIN)).sum())
    apart = float(np.abs(grown - rate)[measured].max())
    gyroscopic = stable & (roll < 0)
    source = "DeBra & Delp 1961"
    figure = picture(values, grown, rate)
    return [
        Check("stable satellites that tumble", wrong[0], 0, 0.5, "1", source, "absolute"),
        Check("unstable satellites that stay", wrong[1], 0, 0.5, "1", source, "absolute"),
        Check("growth over exp(r t), logarithm, largest", apart, 0, PLAIN, "1", source, "absolute"),
        Check("stable cells of DeBra & Delp's small region", int((gyroscopic & (grown < PLAIN)).sum()),
              int(gyroscopic.sum()), 0.5, "1", source, "absolute"),
    ], figure  # fmt: skip


def picture(values: np.ndarray, grown: np.ndarray, rate: np.ndarray) -> Picture:
    """The map with the theory's border, and growth against growth."""

    def shown(axes: Any) -> None:
        image = axes.imshow(np.clip(grown, 0, 40), origin="lower", extent=(-1, 1, -1, 1))
        fine = np.linspace(-0.998, 0.998, 900)
        theory = growth_rate(*np.meshgrid(fine, fine))
        axes.contour(fine, fine, (theory > 0).astype(float), levels=[0.5], colors="white", linewidths=1.0)
        axes.figure.colorbar(image, ax=axes, label="ln of the largest growth (cut at 40)")
        axes.grid(False)

    line, known = np.array([0, 40]), rate < 40
    allowed = [
        Curve(line, line + PLAIN * k, "" if k else "r T", "orange", ":" if k else "-") for k in (-1, 0, 1)
    ]
    return Picture("", "ab", [
        Panel(f"Growth of a displacement over {ORBITS} orbits; white: DeBra & Delp 1961",
              "k_R = (C - A) / B  (A yaw, B roll, C pitch)", "k_Y = (C - B) / A", more=shown),
        Panel("One dot a satellite; dotted: allowed", "r T of the linear motion", "ln of the largest growth",
              [Curve(rate[known], grown[known], "", "blue", ".", 1), *allowed],
              limits={"xlim": (-1, 40), "ylim": (0, 42)}),
    ], (10.5, 5.0), {"width_ratios": [1.25, 1]})  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(study.main())
