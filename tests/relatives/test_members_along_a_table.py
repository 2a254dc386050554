"""Sweeps of averaged motions along one table, whose members pass its rows together: against DOP853 without a
table, the same members one by one, and a sweep that was interrupted.
"""

import random
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import config, first_seed, seeds

import rigidsim

pytestmark = pytest.mark.unoptimised

YEAR, SPIN, RATIO = 365.25 * 86400, 7.292115e-5, 0.0033
SUN, AU, MOON, NEAR, LEAN, ROUND = 1.327e20, 1.496e11, 4.9028e12, 3.844e8, np.radians(5.1), 0.05
PACE = np.pi / 648000  # rad of an arcsec
SLOWING, RECEDING = -2.705994e-10, -1.4516496e-10  # a year, of the Earth's rotation and the Moon's motion


def elements(lines: np.ndarray, year: np.ndarray | float) -> list[np.ndarray]:
    """k, h, q, p as sums of lines (rate, size of k and h, size of q and p, phase)."""
    angles = np.multiply.outer(year, lines[:, 0] * PACE) + lines[:, 3]
    return [(size * turn(angles)).sum(axis=-1) for size in lines[:, 1:3].T for turn in (np.cos, np.sin)]


def truth(lines: np.ndarray, years: np.ndarray, sun: float, tilt: float, tides: float | None) -> np.ndarray:
    """Spin axes (years, 3) by s' = w (K (1 - e^2)^(-3/2) + K_moon r^-3) (n.s) s x n."""
    size = 1.5 * RATIO / SPIN * YEAR
    moon = size * MOON / NEAR**3 * (1 - 1.5 * np.sin(LEAN) ** 2) * (1 - ROUND**2) ** -1.5

    def slope(year: float, s: np.ndarray) -> np.ndarray:
        k, h, q, p = elements(lines, year)
        chi = np.sqrt(1 - q * q - p * p)
        n = np.array([2 * p * chi, -2 * q * chi, 1 - 2 * (q * q + p * p)])
        rate = size * sun / AU**3 * (1 - k * k - h * h) ** -1.5
        if tides is not None:
            rate = (1 + tides * SLOWING * year) * (rate + moon * (1 + 2 * tides * RECEDING * year))
        return rate * (n @ s) * np.cross(s, n)

    begin = [0, -np.sin(tilt), np.cos(tilt)]
    return solve_ivp(slope, [0, years[-1]], begin, "DOP853", years, rtol=1e-12, atol=1e-14).y.T


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_members_in_lanes_follow_the_equations(seed: int, tmp_path: Path) -> None:
    draw, way = random.Random(seed), random.Random(seed).choice([-1, 1])
    row = draw.choice([500.0, 2000.0, 8000.0, 16000.0])  # of the longest more than one step
    even, tidal = draw.random() < 0.6, draw.random() < 0.5
    lines = np.array([[draw.uniform(-3, 3), 0.02, 0.01, draw.uniform(0, 6)] for _ in range(4)])
    years = np.arange(-4, draw.randint(12, 40)) * row
    years += 0 if even else np.array([draw.uniform(-0.2, 0.2) * row for _ in years])
    k, h, q, p = elements(lines, way * years)
    rows = np.transpose(
        [way * years, np.hypot(k, h), 2 * np.arcsin(np.hypot(q, p)), np.arctan2(p, q), np.arctan2(h, k)]
    )
    table = "\n".join(", ".join(f"{x:.16g}" for x in cells) for cells in (rows[::way]).tolist())
    every, count = years[-5] / 20 * draw.uniform(0.9, 1), draw.randint(3, 6)
    # with the Moon, whose place isn't known, no model is measured, which takes seconds for each member
    announced, tight = seed > first_seed() and (tidal or seed % 10 == 7), draw.random() < 0.5
    suns, tilts, tides = (
        [draw.uniform(*ends) for _ in range(count)] for ends in ((0.9 * SUN, 1.1 * SUN), (0.3, 1.2), (0, 2))
    )
    loads = f'kind = "gravity_gradient"\nname = "sun"\ngravitational_parameter = {SUN}\n'
    loads += f'orbit = {{table = "orbit.csv", semi_major_axis = {AU}}}'
    more = '[model]\nlevel = "orbit_averaged"\norder = 1\nstart = "mean"\n[sweep]\nmode = "zip"\ntile = 2\n'
    more += 'keep = ["series", "final"]\n'
    more += f'axes."loads[0].gravitational_parameter" = {{values = {suns}}}\n'
    more += f'axes."initial.euler_angles[1]" = {{values = {tilts}, name = "lean"}}\n'
    if tidal:
        loads += f'\n[[loads]]\nkind = "gravity_gradient"\nname = "moon"\ngravitational_parameter = {MOON}\n'
        loads += (
            f'orbit = {{plane_of = "sun", node = "averaged", semi_major_axis = {NEAR}, inclination = {LEAN}, '
        )
        loads += f"eccentricity = {ROUND}}}"
        more += f'axes."tides.dissipation" = {{values = {tides}, name = "dissipation"}}\n'
        more += '[tides]\nmodel = "linear"\nraised_by = ["moon"]\n'
    text = config(
        body=f"principal_moments = [{8e37 * (1 - RATIO)!r}, {8e37 * (1 - RATIO)!r}, 8e37]\nmass = 6e24",
        initial=f"angular_velocity = [0, 0, {SPIN}]\neuler_angles = [0, 0.4, 0]",
        loads=loads,
        time=f'end = "{way * every * 19.7} yr"\nevery = "{every} yr"',
        output='record = ["momentum_axis", "precession"]',
        more=more
        + "[tables.\"orbit.csv\"]\ntext = '''\ntime [yr], eccentricity, inclination, ascending_node, "
        f"longitude_of_periapsis\n{table}\n'''\n",
        integrator="tolerance = 1e-16" if announced and tight else "",
        estimate=announced,
        name="members",
    )
    found = rigidsim.sweep(rigidsim.parse(text), out=tmp_path / "lanes")
    assert found.summary["engines"] == {"batch of 16": count}
    alone = rigidsim.sweep(
        rigidsim.parse(text, overrides=["sweep.batch=false"]), out=tmp_path / "alone"
    ).dataset
    seen = found.dataset.load()
    times = np.broadcast_to(seen.time.values, seen.precession.shape)
    # an interpolation's error is of the sixth order in what the fastest line turns from row to row
    missed = (np.abs(lines[:, 0]).max() * PACE * row * (1 if even else 1.4)) ** 6
    for member in range(count):
        axes = seen.momentum_axis.values[member]
        known = truth(
            lines, times[member] / YEAR, suns[member], tilts[member], tides[member] if tidal else None
        )
        assert np.abs(axes - known).max() < missed + 1e-10
        assert np.abs(axes - alone.momentum_axis.values[member]).max() < 1e-13
        assert np.abs(seen.precession.values[member] - alone.precession.values[member]).max() < 1e-12
    if announced:
        more = ["sweep.batch=false", "output.estimate=false", 'integrator.precision="quadruple"']
        more.append('integrator.tolerance="auto"')
        exact = rigidsim.sweep(rigidsim.parse(text, overrides=more), out=tmp_path / "exact").dataset
        wrong = np.abs(seen.momentum_axis.values - exact.momentum_axis.values).max(axis=(1, 2))
        assert (wrong <= 3 * seen.attitude_error.values).all()
        assert (seen.attitude_error.values < 10 * alone.attitude_error.values).all()
        np.testing.assert_array_equal(seen.warnings.values, alone.warnings.values)
        # measured from samples that differ by rounding
        np.testing.assert_allclose(seen.modelling_error.values, alone.modelling_error.values, rtol=1e-4)
    rigidsim.sweep(rigidsim.parse(text), out=tmp_path / "parts", tiles=(1, 2))
    again = rigidsim.sweep(rigidsim.parse(text), out=tmp_path / "parts").dataset.load()
    for name in ("momentum_axis", "precession", "steps", "attitude_error"):
        np.testing.assert_array_equal(seen[name].values, again[name].values)
