"""Which directions of spin does a body keep, and how long does it take to flip, over the whole sphere?

Method: one sweep over the sphere of directions (``configs/sweeps/flip_sphere.toml``: cells of equal area,
spins of 1 rad/s, moments A, B, C = 1, 2, 3), in batches. Events tell when the rate about the middle axis
changes its sign; from the first to the second is half a period of the rates. Extremes of the samples tell
which component never changes its sign: about the axis of that one the spin goes round for ever.

Held against:
- 2 K(k)/p of Euler's elliptic functions (Whittaker, Analytical Dynamics, section 69) for every cell, by the
  arithmetic-geometric mean in 40 digits, from the very doubles that the run starts with. Tolerance of each
  cell: three times the round-off law of D = L^2 - 2 E B over its value, as in ``flip_period``: the period
  hangs on D, which vanishes on the separatrices, so that the bound grows towards them; and eps t of the
  clock.
- The sign of D tells the axis that is circled: C where it is above zero, A below, B nowhere (Poinsot).
"""

from __future__ import annotations

import tempfile
from typing import Any

import mpmath
import numpy as np
from matplotlib.colors import LogNorm

import rigidsim
from experiments.common import CONFIGS, EPSILON, Answer, Check, Curve, Panel, Picture, Study

CONFIG = CONFIGS / "sweeps" / "flip_sphere.toml"
MOMENTS = (1, 2, 3)


def closed(spin: np.ndarray) -> tuple[float, float, float, mpmath.mpf]:
    """Of one direction: p, L^2, D = L^2 - 2 E B, and 2 K / p."""
    a, b, c = (mpmath.mpf(m) for m in MOMENTS)
    x, y, z = (mpmath.mpf(float(w)) ** 2 for w in spin)
    square, twice = a * a * x + b * b * y + c * c * z, a * x + b * y + c * z
    beyond = square - twice * b
    if beyond < 0:  # L circles the axis of the smallest moment
        a, c = c, a
    squared = (square - twice * a) * (c - b) / (a * b * c)
    complement = (c - a) * beyond / ((square - twice * a) * (c - b))
    p = mpmath.sqrt(squared)
    flip = mpmath.pi / (p * mpmath.agm(1, mpmath.sqrt(complement)))  # K = pi / (2 agm(1, k'))
    return float(p), float(square), float(beyond), flip


@Study
def study(full: bool) -> Answer:
    """The map, the figure, the checks."""
    polar, azimuths = (128, 256) if full else (32, 64)
    settings = [f'sweep.axes."initial.angular_velocity".grid=[{polar}, {azimuths}]']
    with tempfile.TemporaryDirectory() as folder:
        saved = rigidsim.sweep(rigidsim.load(CONFIG, overrides=settings), out=folder)
        with saved.dataset as opened:
            found = opened.load()
        engines = saved.summary["engines"]
    spins, times = found.spin_value.values, found.flip_times.values
    end = float(rigidsim.load(CONFIG).config.time.end)  # type: ignore[arg-type]
    eps = EPSILON["double"]
    with mpmath.workdps(40):
        told = [closed(spin) for spin in spins]
        flips = np.array([float(flip) for *_, flip in told])
        # the difference of two doubles is exact to half their spacing; what it lacks of the closed form isn't
        errors = np.array([
            abs(float(mpmath.mpf(float(second)) - mpmath.mpf(float(first)) - flip))
            for (first, second), (*_, flip) in zip(times, told, strict=True)
        ])  # fmt: skip
    p, square, beyond = (np.array([row[i] for row in told]) for i in range(3))
    steps = found.steps.values * times[:, 1] / end
    walk = 3 * np.sqrt(2) * eps * np.sqrt(steps) * square / np.abs(beyond) / p
    allowed = walk + 2 * eps * times[:, 1]
    lowest, highest = found.angular_velocity_min.values, found.angular_velocity_max.values
    kept = lowest * highest > 0
    expected = np.stack([beyond < 0, np.zeros(len(beyond), dtype=bool), beyond > 0], axis=1)
    wrong = int((kept != expected).any(axis=1).sum())
    missing = int(np.isnan(times[:, 1]).sum())
    relative = errors / flips
    print(f"{len(spins)} directions ({engines}): flips every {flips.min():.3f} to {flips.max():.3f} s")
    print(f"deviation: largest {np.nanmax(errors):.1e} s, relative {np.nanmax(relative):.1e}, median "
          f"{np.nanmedian(relative):.1e}; {np.nanmax(errors / allowed):.2f} of the bound")  # fmt: skip
    figure = picture(spins.reshape(polar, azimuths, 3), flips, errors, allowed, np.abs(beyond) / square)
    source = "2K(k)/p; 3 x round-off of L^2 - 2 E B over its value, over p"
    return [
        Check("directions without two flips", missing, 0, 0.5, "1", f"none dwells for {end:g} s", "absolute"),
        Check("directions that circle another axis", wrong, 0, 0.5, "1", "Poinsot; none may", "absolute"),
        Check("deviation of a flip time over what rounding explains, largest",
              float(np.nanmax(errors / allowed)), 0, 1, "1", source, "absolute"),
    ], figure  # fmt: skip


def picture(
    spins: np.ndarray, flips: np.ndarray, errors: np.ndarray, allowed: np.ndarray, beyond: np.ndarray
) -> Picture:
    """The sphere with the middle axis in its centre, and deviations towards the separatrices."""
    polar, azimuths, _ = spins.shape
    angle = np.linspace(0, 2 * np.pi, 721)
    a, b, c = MOMENTS
    lean = np.sqrt(a * (b - a) / (c * (c - b)))  # w_z / w_x on the separatrices
    named = {"middle axis": (0, 0.33), "smallest": (-np.pi / 2, 0), "−x": (np.pi / 2, 0),
             "largest": (0, 1.3), "−z": (0, -1.3)}  # fmt: skip

    def sphere(axes: Any) -> None:
        fine = 16  # parts of a row, whose edges are straight lines on paper
        latitudes = np.pi / 2 - np.arccos(np.linspace(1, -1, fine * polar + 1))
        longitudes = np.linspace(-np.pi, np.pi, azimuths + 1)
        centred = np.roll(flips.reshape(polar, azimuths), azimuths // 4, axis=1)  # azimuth 90 degrees: +y
        shown = axes.pcolormesh(longitudes, latitudes, np.repeat(centred, fine, axis=0), norm=LogNorm(),
                                cmap="magma", rasterized=True, shading="flat")  # fmt: skip
        for sign in (1, -1):
            x, y = np.cos(angle) / np.hypot(1, lean), np.sin(angle)
            longitude = np.mod(np.arctan2(y, x) + np.pi / 2, 2 * np.pi) - np.pi
            axes.plot(longitude, np.arcsin(sign * lean * x), ".", color="white", markersize=1)
        for name, place in named.items():
            axes.annotate(name, place, ha="center", va="center", fontsize=9,
                          bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.8})  # fmt: skip
        axes.set(xticklabels=[], yticklabels=[])
        bar = axes.figure.colorbar(shown, ax=axes, orientation="horizontal", pad=0.04, shrink=0.75,
                                   label="time from flip to flip (s), at 1 rad/s")  # fmt: skip
        ticks = [tick for tick in (3, 4, 5, 7, 10, 15, 20, 30, 50) if flips.min() <= tick <= flips.max()]
        bar.set_ticks(ticks, labels=[str(tick) for tick in ticks], minor=False)
        bar.ax.minorticks_off()

    order = np.argsort(beyond)
    title = "A spin flips every 2K/p: soon about the stable axes, ever later near the separatrices"
    return Picture(title, "ab", [
        Panel("Directions of the spin in the body; white: separatrices", "", "", more=sphere),
        Panel("One dot a direction", "distance from the separatrices, |L² − 2EB| / L²",
              "deviation of the flip time (s)", [
                  Curve(beyond, np.maximum(errors, 1e-17), "run less closed form", "blue", ".", 0.6),
                  Curve(beyond[order], allowed[order], "what rounding explains (3 x its law)", "orange"),
                  Curve(None, EPSILON["double"], "eps", "grey", ":"),
              ], "xy", legend="upper right"),
    ], (13, 5.6), {"per_subplot_kw": {"a": {"projection": "mollweide"}}})  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(study.main())
