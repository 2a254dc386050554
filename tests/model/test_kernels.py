"""Positions of bodies by kernels, against jplephem and mpmath, and the torques of such sources."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import de421
import numpy as np
import pytest
from equations import skew
from jplephem.ephem import Ephemeris
from kernel_scenes import HEAVY, LANDING, TURNED, moon
from mpmath import mp
from scipy.integrate import DOP853
from support import matrices, run_text

import rigidsim
from rigidsim.scene.parts_of_values import parts_in

EPOCH = 2440423.0  # 1969-07-20T12:00 TDB
SOURCES = ("earth", "sun", "venus")
MOON = moon(sources=SOURCES, body=HEAVY, start=TURNED, epoch=LANDING, time='end = "57 day"\ntimes = {times}')
KERNEL = Ephemeris(de421)


def at_random(count: int, days: float = 57) -> list[float]:
    """Times of samples, s, some of them at the edges of blocks; jplephem loses no digit of such days."""
    found = np.random.default_rng(5).integers(0, int(days * 1024), count) / 1024
    return [86400 * day for day in [0.0, *sorted({*map(float, found), 1.5, 5.5, 49.5})]]


def seen(source: str, seconds: float) -> np.ndarray:
    """Vector from the Moon, m, by jplephem."""
    days = seconds / 86400

    def place(name: str) -> np.ndarray:
        return np.asarray(KERNEL.position(name, EPOCH, days))[:, 0]

    moon = place("moon")
    share = KERNEL.EMRAT / (1 + KERNEL.EMRAT)
    if source == "earth":
        return -1000 * moon
    return 1000 * (place(source) - place("earthmoon") - share * moon)


def polynomial(name: str, seconds: Any) -> mp.matrix:
    """Position (km) by a package's file of coefficients, which count exactly."""
    given = np.load(Path(str(de421.__file__)).parent / f"jpl-{name}.npy", mmap_mode="r")
    length = Fraction(int(KERNEL.jomega - KERNEL.jalpha), len(given))
    days = mp.mpf(EPOCH - KERNEL.jalpha) + mp.mpf(seconds) / 86400
    block = int(days // length)
    u = 2 * (days - block * length.numerator / mp.mpf(length.denominator)) / length.numerator - 1
    return mp.matrix(
        [mp.fsum(mp.mpf(float(c)) * mp.chebyt(k, u) for k, c in enumerate(row)) for row in given[block]]
    )


def test_positions_are_those_of_jplephem() -> None:
    times = at_random(40)
    found = run_text(MOON.format(times=times)).dataset["source_position"]
    assert list(found["source"].values) == list(SOURCES)
    for source in SOURCES:
        places = found.sel(source=source).values
        wanted = np.array([seen(source, t) for t in times])
        error = np.linalg.norm(places - wanted, axis=1) / np.linalg.norm(wanted, axis=1)
        assert error.max() < 1e-15, source


@pytest.mark.parametrize(("precision", "bound"), [("double", 1e-15), ("quadruple", 1e-32)])
def test_positions_are_the_kernels_polynomials(precision: str, bound: float) -> None:
    # at an edge both blocks hold, which the fit has made continuous to 1e-15 alone
    times = [t for t in at_random(6, 20) if t < 20 * 86400 and (t / 86400 - 1.5) % 4]
    with mp.workdps(50):
        changes = f"integrator.precision={precision}", "time.end=20 day"
        dataset = run_text(MOON.format(times=times), *changes).dataset
        ratio, parts = mp.mpf(float(KERNEL.EMRAT)), parts_in(dataset, "source_position")
        for row, time in enumerate(times):
            moon, both = polynomial("moon", time), polynomial("earthmoon", time)
            own = both + moon * (ratio / (1 + ratio))
            wanted = [-moon, polynomial("sun", time) - own, polynomial("venus", time) - own]
            for n, place in enumerate(wanted):
                found = [mp.fsum(float(dataset[x].values[row, n, i]) for x in parts) for i in range(3)]
                assert mp.norm(mp.matrix(found) - 1000 * place) < bound * 1000 * mp.norm(place), (n, time)


def test_the_motion_is_that_of_the_momentum_under_the_torques_of_bare_positions() -> None:
    """The momentum and the rotation matrix in space axes, with numpy's own positions, by DOP853."""
    dataset = run_text(MOON.format(times=[0, 40 * 86400.0]), "time.end=40 day").dataset
    moments = np.array([8.79e34, 8.7920e34, 8.7955e34])
    au, day = KERNEL.AU * 1000, 86400.0
    earth = KERNEL.GMB * KERNEL.EMRAT / (1 + KERNEL.EMRAT)
    given = {"earth": earth, "sun": KERNEL.GMS, "venus": KERNEL.GM2}
    strengths = {name: strength * au**3 / day**2 for name, strength in given.items()}
    unit = 1e5  # s

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        matrix, momentum = y[:9].reshape(3, 3), y[9:]
        torque = np.zeros(3)
        for name, strength in strengths.items():
            x = seen(name, t * unit)
            r = np.linalg.norm(x)
            c = matrix.T @ (x / r)
            torque += matrix @ (3 * strength / r**3 * np.cross(c, moments * c))
        rates = (matrix.T @ momentum) / moments
        return np.concatenate([(matrix @ skew(rates)).ravel(), torque]) * unit

    y = np.concatenate([matrices([0.9, 0.1, 0.2, 0.3]).ravel(), np.zeros(3)])
    y[9:] = y[:9].reshape(3, 3) @ (moments * [1e-8, -2e-8, 2.6617e-6])
    edges = [0, *np.arange(1.5, 40, 4), 40]  # of the blocks, where the positions have kinks of their rounding
    for begin, end in pairwise(edges):
        scale = np.concatenate([np.ones(9), np.full(3, 1e29)])
        solver = DOP853(slope, begin * day / unit, y, end * day / unit, rtol=1e-13, atol=1e-15 * scale)
        while solver.status == "running":
            solver.step()
        y = solver.y
    error = y[:9].reshape(3, 3) - matrices(dataset["quaternion"].values[-1])
    assert np.abs(error).max() < 1e-11


def test_ecliptic_axes_turn_by_the_obliquity() -> None:
    times = [0.0, 1e6]
    given = run_text(MOON.format(times=times)).dataset
    turned = run_text(MOON.format(times=times), 'frame.axes="ecliptic J2000"').dataset
    assert (given.attrs["axes"], turned.attrs["axes"]) == ("ICRF", "ecliptic J2000")
    angle = np.deg2rad(84381.406 / 3600)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    np.testing.assert_allclose(
        turned["source_position"].values, given["source_position"].values @ matrix.T, rtol=1e-13, atol=1e-3
    )


def test_the_dataset_names_the_kernel_and_its_hash() -> None:
    run = run_text(MOON.format(times=[0, 1.0]))
    found = run.dataset.attrs
    assert found["ephemeris_kernel"] == "de421"
    assert found["ephemeris_span"] == "1899-12-04 to 2200-02-01 TDB"
    assert len(found["ephemeris_sha256"]) == 64
    assert run.summary["provenance"]["ephemeris_sha256"] == found["ephemeris_sha256"]
    assert str(Path(str(de421.__file__)).parent) not in str(found)


BAD = {
    "kernel": ('ephemeris.kernel="de999"', "no installed package"),
    "no epoch": ("time.epoch=", "[time] epoch: missing; [ephemeris] needs the date of time 0"),
    "too early": ('time.epoch="1890-01-01T00:00:00 TDB"', "from 1899-12-04 to 2200-02-01 (TDB)"),
    "too long": ('time.end="400 yr"', "change [time] epoch, start or end, or take a longer kernel"),
    "host": ('body.host="mon"', 'given "mon"; did you mean "moon"'),
    "elsewhere": ('body.host="titan"', "others are in SPK files, which [ephemeris] kernel"),
    "no host": ("body.host=", "name that in [body] host"),
    "itself": ('body.host="earth"', 'given "earth", which is the body itself'),
    "two places": ("loads[0].position=[1, 0, 0]", "given position and source; exactly one of orbit"),
    "axes": ('frame.axes="EME2000"', "the bias of 0.02 arcsec"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_refused(name: str) -> None:
    setting, words = BAD[name]
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(MOON.format(times=[0, 1.0]), setting)
    assert words in str(caught.value)
