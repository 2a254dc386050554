"""Where heyoka's series put the Sun and the Moon, against an almanac, and the torque that follows."""

import heyoka as hy
import numpy as np
import pytest
from support import config, run_text

from rigidsim.model.placements import MEAN_DISTANCE, source_position

SATELLITE = (
    "principal_moments = [1, 2, 2.5]",
    "angular_velocity = [0, 0, 0]\nquaternion = [0.7, 0.4, 0.5, 0.3]",
    'kind = "gravity_gradient"\ngravitational_parameter = 1.32712440018e20\n',
)


def at(body: str, seconds: float) -> tuple[float, float, float]:
    """Ecliptic longitude and latitude (degrees) and distance (m)."""
    direction, nearness = source_position(body, hy.time)
    function = hy.cfunc([*direction, nearness], [hy.make_vars("none")], compact_mode=True)
    x, y, z, inverse = function([0.0], time=seconds)
    assert x * x + y * y + z * z == pytest.approx(1, abs=1e-14)
    return (
        np.degrees(np.arctan2(y, x)) % 360,
        np.degrees(np.arcsin(z)),
        float(MEAN_DISTANCE[body] / inverse),
    )


def test_the_sun_and_the_moon_at_j2000() -> None:
    """2000 January 1, 12 h: Sun at 280.37 deg and 0.98333 au; Moon at 223.32 deg, 5.17 deg, 402,449 km
    (Astronomical Almanac 2000; the last printed digit).
    """
    longitude, latitude, distance = at("sun", 0.0)
    assert longitude == pytest.approx(280.37, abs=0.02)
    assert latitude == pytest.approx(0, abs=0.001)
    # VSOP2013 has the barycentre of Earth and Moon, up to 4,670 km from the Earth, and the digit's half
    assert distance / 149597870700 == pytest.approx(0.98333, abs=4.67e6 / 1.496e11 + 5e-6)
    longitude, latitude, distance = at("moon", 0.0)
    assert longitude == pytest.approx(223.32, abs=0.02)
    assert latitude == pytest.approx(5.17, abs=0.01)
    assert distance == pytest.approx(402_449e3, abs=5e3)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_the_sun_comes_round_in_a_sidereal_year_and_the_moon_in_a_sidereal_month() -> None:
    begin, end = at("sun", 0.0)[0], at("sun", 86400 * 365.256363)[0]
    assert abs(end - begin) < 0.02  # perturbations of the Earth's place by the Moon: some 10 arcsec
    months = 20
    begin, end = at("moon", 0.0)[0], at("moon", months * 86400 * 27.321661)[0]
    assert abs((end - begin + 180) % 360 - 180) < 15  # inequalities of up to 7.5 degrees at either end


@pytest.mark.slow
def test_the_torque_of_the_ephemeris_is_that_of_the_place() -> None:
    """The Sun nearly stands still in an hour: a fixed source in its place gives the same motion."""
    longitude, latitude, distance = at("sun", 1800.0)
    lon, lat = np.radians(longitude), np.radians(latitude)
    vector = distance * np.array([np.cos(lon) * np.cos(lat), np.sin(lon) * np.cos(lat), np.sin(lat)])
    b, a = (
        run_text(config(SATELLITE[0], SATELLITE[1], SATELLITE[2] + place, "end = 3600\nsamples = 3"))
        .dataset["angular_velocity"].values[-1]
        for place in ('ephemeris = "sun"', f"position = {vector.tolist()}")
    )  # fmt: skip
    # the Sun moves by 7e-4 rad in the hour, 4e-4 rad to either side of the fixed place
    assert np.abs(a - b).max() < 1e-3 * np.abs(a).max()
    assert np.abs(a).max() > 0


@pytest.mark.slow
def test_time_zero_is_the_epoch() -> None:
    """A scene that begins a day after J2000 by its epoch is the one that begins then by its clock; without an
    epoch time zero is J2000, and the dataset says so.
    """
    text = config(SATELLITE[0], SATELLITE[1], SATELLITE[2] + 'ephemeris = "sun"', "end = 3600\nsamples = 2")
    later = ["time.start=86400", "time.end=90000"]
    epochs = {
        "clock": later,
        "epoch": ["time.epoch=2000-01-02T12:00:00 TDB"],
        "J2000": [*later, "time.epoch=J2000"],
        # TT - UTC was 64.184 s; TDB - TT is -1e-4 s
        "UTC": ["time.epoch=2000-01-02T11:58:55.816 UTC"],
    }
    found = {name: run_text(text, f"name={name}", *changes).dataset for name, changes in epochs.items()}
    assert {data.attrs["axes"] for data in found.values()} == {"ecliptic J2000"}
    assert found["clock"].attrs["epoch"] == found["J2000"].attrs["epoch"] == "2000-01-01T12:00:00 TDB"
    assert found["epoch"].attrs["epoch"] == "2000-01-02T12:00:00 TDB"
    rates = {name: data["angular_velocity"].values[-1] for name, data in found.items()}
    np.testing.assert_array_equal(rates["clock"], rates["J2000"])
    # the same times in two roundings: 1e-11 s of 9e4 s, in which the Sun moves by 2e-18 rad
    np.testing.assert_allclose(rates["epoch"], rates["clock"], rtol=1e-12)
    # an ephemeris' argument is in TDB: 64 s off, the Sun would be 1.3e-5 rad elsewhere
    np.testing.assert_allclose(rates["UTC"], rates["clock"], rtol=1e-10)
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(rates["UTC"], rates["clock"], rtol=1e-13)
