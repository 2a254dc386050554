"""Positions of bodies by kernels, against jplephem and mpmath, and the torques of such sources."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import de421
import numpy as np
import pytest
from jplephem.ephem import Ephemeris
from kernel_scenes import HEAVY, LANDING, TURNED, moon
from mpmath import mp
from support import run_text

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


@pytest.mark.parametrize(("precision", "bound"), [("quadruple", 1e-32)])
@pytest.mark.slow
@pytest.mark.unoptimised
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


BAD = {
    "kernel": ('ephemeris.kernel="de999"', "no installed package"),
    "no epoch": ("time.epoch=", "[time] epoch: missing; [ephemeris] needs the date of time 0"),
    "too early": ('time.epoch="1890-01-01T00:00:00 TDB"', "from 1899-12-04 to 2200-02-01 (TDB)"),
    "host": ('body.host="mon"', 'given "mon"; did you mean "moon"'),
    "two places": ("loads[0].position=[1, 0, 0]", "given position and source; exactly one of orbit"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_refused(name: str) -> None:
    setting, words = BAD[name]
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(MOON.format(times=[0, 1.0]), setting)
    assert words in str(caught.value)
