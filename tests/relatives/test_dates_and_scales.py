"""Dates before 1972, and every spelling of a date, against ERFA and whole numbers."""

from datetime import date, datetime, timedelta, timezone
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import erfa
import numpy as np
import pytest
from sgp4.api import Satrec
from support import config, run_text, seeds

import rigidsim
from rigidsim.scene.epochs import parse_epoch
from rigidsim.scene.two_line_elements import checksum

SCENE = config(
    "principal_moments = [10, 14, 19]\nmass = 100",
    "angular_velocity = [0, 0, 0.001]\n{start}",
    time="end = 1\nsamples = 2\n{epoch}",
)
LINES = (
    "1 00005U 58002B   69179.78495062  .00000023  00000-0  28098-4 0  4758",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
STEPS = [date(1961, 8, 1), date(1963, 11, 1), date(1965, 3, 1), date(1968, 2, 1), date(1972, 1, 1)]
EARTH = '[[loads]]\nkind = "central_gravity"\ngravitational_parameter = "3.986004418e14 m^3/s^2"'


def tai_of(day: date, seconds: float) -> Fraction:
    """Seconds of TAI since J2000 of a moment of UTC, in the two doubles of ERFA."""
    clock = int(seconds // 3600), int(seconds % 3600 // 60), seconds % 60
    one, two = erfa.utctai(*erfa.dtf2d("UTC", day.year, day.month, day.day, *clock))
    return (Fraction(one) - 2451545 + Fraction(two)) * 86400


def spelled(day: date, seconds: Decimal, of_year: bool = False) -> str:
    whole = int(seconds)
    head = day.strftime("%Y-%j" if of_year else "%Y-%m-%d")
    return f"{head}T{whole // 3600:02}:{whole % 3600 // 60:02}:{whole % 60 + seconds % 1:012.9f}"


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_utc_before_1972_drifts_as_in_erfa(seed: int) -> None:
    """Fifty moments a seed, a fifth within 10 s of a step: to 1e-9 s, a few units in the last place of the
    doubles that ERFA keeps a date in; and some time later again.
    """
    rng = np.random.default_rng(seed)
    for n in range(50):
        if n % 5:
            day = date(1960, 1, 1) + timedelta(days=int(rng.integers(0, 4383)))
            seconds = Decimal(int(rng.integers(0, 86400 * 10**6))) / 10**6
        else:
            day, after = STEPS[int(rng.integers(0, 5))], int(rng.integers(-10, 10))
            day, seconds = (
                (day, Decimal(after)) if after >= 0 else (day - timedelta(1), Decimal(86399 + after))
            )
        found = parse_epoch(spelled(day, seconds, bool(n % 2)) + ("Z" if n % 3 else " UTC"))
        expected = tai_of(day, float(seconds))
        assert abs((found.julian_date() - 2451545) * 86400 - Fraction("32.184") - expected) < 1e-9
        later = Decimal(int(rng.integers(-(10**8), 10**8)))
        try:
            then = found.after(later)
        except ValueError:  # before 1960
            assert found.julian_date() + Fraction(later) / 86400 < parse_epoch("1960-01-01Z").julian_date()
            continue
        assert abs(float(then.since(found) - Fraction(later))) < 1e-14
        moment = date.fromordinal(then.day)
        if then.ticks < 86400 * 10**14:  # not within a step
            assert abs(tai_of(moment, then.ticks / 1e14) - expected - Fraction(later)) < 1e-9


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_elements_of_the_sixties_are_flown_from_their_own_date(seed: int) -> None:
    """Distance and speed are those of SGP4 at the seconds that ERFA counts from the elements' date."""
    rng = np.random.default_rng(seed)
    year, day, part = int(rng.integers(60, 72)), int(rng.integers(2, 364)), int(rng.integers(0, 10**8))
    lines = [f"{LINES[0][:18]}{year}{day:03}.{part:08}{LINES[0][32:68]}", LINES[1][:68]]
    lines = [line + str(checksum(line + "0")) for line in lines]
    begin = date(1900 + year, 1, 1) + timedelta(days=day - 1)
    off = int(rng.integers(-80000, 80000))
    moment = tai_of(begin, part * 86400 / 1e8) + Fraction("32.184") + off
    whole = int(moment)
    epoch = str(parse_epoch("2000-01-01T12:00 TT").after(Decimal(whole)))
    start = f"tle = {lines}"
    scene = SCENE.format(start=start, epoch=f'epoch = "{epoch}"')
    found = run_text(scene + EARTH).dataset
    error, place, speed = Satrec.twoline2rv(*lines).sgp4_tsince(float(off + whole - moment) / 60)
    assert error == 0
    # SGP4's own minutes keep 1e-9 s of a day, in which it flies 1e-5 m
    for name, vector in (("position", place), ("velocity", speed)):
        size = float(np.linalg.norm(found[name].values[0]))
        assert size == pytest.approx(1e3 * float(np.linalg.norm(vector)), rel=3e-11)


@pytest.mark.parametrize("text", ["1959-12-31T23:59:59Z", "1957-281T00:00:00 UTC", "1961-07-31T23:59:59.96Z"])
def test_there_is_no_utc_before_1960_and_none_in_a_step(text: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=r"UTC is known from 1960-01-01|ended at 23:59:59.95"):
        rigidsim.parse(SCENE.format(start="", epoch=f'epoch = "{text}"'))
    lines = [f"{LINES[0][:18]}59{LINES[0][20:68]}", LINES[1]]
    lines[0] += str(checksum(lines[0] + "0"))
    with pytest.raises(rigidsim.ConfigError, match="from 1960-01-01 on, when UTC began"):
        rigidsim.parse(SCENE.format(start=f"tle = {lines}", epoch="") + EARTH)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_every_spelling_of_an_instant_is_the_same_one(seed: int, tmp_path: Path) -> None:
    """Twelve spellings: exactly the same instant, counted in whole microseconds; in TDB to 1e-5 s, the
    error of TDB - TT. Sample times may be dates, too.
    """
    rng = np.random.default_rng(seed)
    day = date(1972, 1, 1) + timedelta(days=int(rng.integers(0, 19800)))
    micro = int(rng.integers(86400 * 10**6))
    offset = int(erfa.dat(day.year, day.month, day.day, 0.0)) + Fraction("32.184")
    truth = day.toordinal() + Fraction(3442849, 2) + (Fraction(micro, 10**6) + offset) / 86400

    def shifted(by: str | int) -> str:
        total = Fraction(micro, 10**6) + Fraction(by)
        then, rest = day + timedelta(days=int(total // 86400)), total % 86400
        of_year = bool(rng.integers(2))
        return spelled(then, Decimal(rest.numerator) / Decimal(rest.denominator), of_year).rstrip("0")

    minutes = int(rng.integers(-720, 840))
    zone = f"{'-' if minutes < 0 else '+'}{abs(minutes) // 60:02}:{abs(minutes) % 60:02}"
    clock = datetime(day.year, day.month, day.day) + timedelta(microseconds=micro)
    local = (clock + timedelta(minutes=minutes)).replace(tzinfo=timezone(timedelta(minutes=minutes)))
    tai, gps, tt = (str(offset - Fraction(x)) for x in ("32.184", "51.184", "0"))
    ways = [
        f'"{shifted(0)}Z"', f'"{shifted(0)} UTC"', f'"{shifted(0)}Z UTC"', f'"{shifted(60 * minutes)}{zone}"',
        f'"{shifted(tai)} TAI"', f'"{shifted(gps)} GPS"', f'"{shifted(tt)} TT"',
        f'"{clock.isoformat(" ")}Z"', f"{clock.isoformat()}Z", local.isoformat(), local.isoformat(" "),
    ]  # fmt: skip
    experiments = [rigidsim.parse(SCENE.format(start="", epoch=f"epoch = {way}")) for way in ways]
    plain = {"body": {"principal_moments": [1, 2, 3]}, "initial": {"angular_velocity": [0, 0, 1]}}
    experiments.append(
        rigidsim.Experiment.from_dict({**plain, "name": "x", "time": {"epoch": local, "end": 1}})
    )
    for way, experiment in zip([*ways, "datetime"], experiments, strict=True):
        epoch = experiment.config.time.epoch
        assert epoch is not None, way
        assert epoch.julian_date() == truth, way
    ahead = parse_epoch(f"{shifted(tt)} TT").since(parse_epoch(f"{shifted(tt)} TDB"))
    assert float(ahead) == pytest.approx(
        float(erfa.dtdb(2451545.0, float(truth) - 2451545, 0, 0, 0, 0)), abs=1.1e-5
    )

    steps = np.cumsum(rng.integers(1, 5000, 5))
    rows = [f"{shifted(int(step))}Z, {step}" for step in steps]
    (tmp_path / "theirs.csv").write_text("time, n\n" + "\n".join(rows) + "\n")
    text = SCENE.format(start="", epoch=f"epoch = {ways[4]}").replace(
        "end = 1\nsamples = 2", 'times = "theirs.csv"'
    )
    (tmp_path / "dated.toml").write_text(text)
    run = rigidsim.run(
        rigidsim.load(tmp_path / "dated.toml", overrides=["output.timeline=false"]), out=tmp_path / "run"
    )
    counted = []
    for step in steps:
        then = day + timedelta(days=int((Fraction(micro, 10**6) + int(step)) // 86400))
        leaps = erfa.dat(then.year, then.month, then.day, 0.0) - erfa.dat(day.year, day.month, day.day, 0.0)
        counted.append(float(step + leaps))
    assert run.dataset.time.values.tolist() == counted
