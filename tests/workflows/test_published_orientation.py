"""Published orientations beside a run: IAU elements and binary PCK frames, against formulas and series."""

import re
from pathlib import Path
from typing import Any

import de421
import numpy as np
import pytest
import spiceypy
from scipy.spatial.transform import Rotation
from support import run_text

from rigidsim.cli.commands.saved import info
from rigidsim.look.figures import figure

IAU = Path(__file__).parents[2] / "configs" / "kernels" / "iau2015.tpc"
DAY, CENTURY = 86400.0, 36525 * 86400.0
TEXT = """
name = "top"
[body]
principal_moments = [1, 1.1, 1.3]
[initial]
angular_velocity = ["1e-6 rad/s", "2e-6 rad/s", "7e-5 rad/s"]
quaternion = [0.5, 0.1, -0.7, 0.4]
[frame]
axes = "ICRF"
[time]
epoch = "1990-03-04T05:06:07 TDB"
end = "30 day"
every = "7 h"
"""
AHEAD = -310200833.0  # of that epoch, s from J2000


def asked(kernel: Path | str = IAU, of: str | None = "mars", text: str = TEXT) -> str:
    """The scene beside a kernel."""
    return f'{text}\n[output]\norientation = "{kernel}"\n' + (f'orientation_of = "{of}"\n' if of else "")


def matrices(dataset: Any, name: str) -> Rotation:
    return Rotation.from_quat(dataset[name].values[:, [1, 2, 3, 0]])


def of_pole(ascension: np.ndarray, declination: np.ndarray, meridian: np.ndarray) -> Rotation:
    """From body axes to the equator's, of angles in degrees."""
    angles = np.stack([90 + ascension, 90 - declination, meridian], axis=1)
    return Rotation.from_euler("ZXZ", angles, degrees=True)


def of_mars(seconds: np.ndarray) -> tuple[np.ndarray, ...]:
    """Right ascension, declination and W of Mars (Archinal et al. 2018), deg."""
    century, day = seconds / CENTURY, seconds / DAY

    def sines(*terms: tuple[float, float, float], shift: float = 0.0) -> Any:
        return sum(a * np.sin(np.radians(b + c * century + shift)) for a, b, c in terms)

    right = 317.269202 - 0.10927547 * century + sines(
        (0.000068, 198.991226, 19139.4819985), (0.000238, 226.292679, 38280.8511281),
        (0.000052, 249.663391, 57420.7251593), (0.000009, 266.183510, 76560.6367950),
        (0.419057, 79.398797, 0.5042615),
    )  # fmt: skip
    north = 54.432516 - 0.05827105 * century + sines(
        (0.000051, 122.433576, 19139.9407476), (0.000141, 43.058401, 38280.8753272),
        (0.000031, 57.663379, 57420.7517205), (0.000005, 79.476401, 76560.6495004),
        (1.591274, 166.325722, 0.5042615), shift=90,
    )  # fmt: skip
    meridian = 176.049863 + 350.891982443297 * day + sines(
        (0.000145, 129.071773, 19140.0328244), (0.000157, 36.352167, 38281.0473591),
        (0.000040, 56.668646, 57420.9295360), (0.000001, 67.364003, 76560.2552215),
        (0.000001, 104.792680, 95700.4387578), (0.584542, 95.391654, 0.5042615),
    )  # fmt: skip
    return right, north, meridian


def write_librations(path: Path, begin: float, days: int) -> Path:
    """DE421's lunar librations from a Julian date on as a binary PCK."""
    given = np.load(Path(str(de421.__file__)).parent / "jpl-librations.npy", mmap_mode="r")
    first = round((begin - 2414992.5) / 8)
    start = ((2414992.5 + 8 * first) - 2451545.0) * DAY
    blocks = np.array(given[first : first + days // 8])
    handle = spiceypy.pckopn(str(path), "test", 0)
    end = start + len(blocks) * 8 * DAY
    spiceypy.pckw02(handle, 31006, "J2000", start, end, "librations", 8 * DAY, len(blocks),
                    blocks.shape[2] - 1, blocks.ravel(), start)  # fmt: skip
    spiceypy.pckcls(handle)
    return path


@pytest.mark.parametrize(
    ("axes", "precision"), [("ICRF", "double"), ("ecliptic J2000", "quadruple"), ("ICRF", "single")]
)
def test_elements_of_the_iau_are_their_formulas(axes: str, precision: str) -> None:
    settings = f'frame.axes="{axes}"', f'integrator.precision="{precision}"'
    before = spiceypy.ktotal("ALL")
    found = run_text(asked(), *settings).dataset
    assert spiceypy.ktotal("ALL") == before
    right, north, meridian = of_mars(AHEAD + found.time.values)
    turned = 1e-9 if precision == "single" else 0.0  # of times that single precision rounds
    for name, degrees in (("right_ascension", right), ("prime_meridian", meridian)):
        away = found[f"published_{name}"].values - np.radians(degrees)
        # W is 1e6 degrees by then, of which SPICE and the formula round a part in 1e16 each
        assert np.abs(np.sin(away / 2)).max() < 1e-11 + turned, name
        assert found[f"published_{name}"].values.min() >= 0
        assert found[f"published_{name}"].values.max() <= 2 * np.pi
    assert np.abs(found.published_declination.values - np.radians(north)).max() < 1e-13
    truth = of_pole(right, north, meridian)
    if axes != "ICRF":
        truth = Rotation.from_rotvec([np.radians(-84381.406 / 3600), 0, 0]) * truth
    assert (truth.inv() * matrices(found, "published_quaternion")).magnitude().max() < 1e-11 + turned
    attitude = matrices(found, "quaternion")
    away = (matrices(found, "published_quaternion").inv() * attitude).as_rotvec()
    size = 1e-6 if precision == "single" else 1e-14
    assert np.abs(found.published_rotation.values - away).max() < size
    assert np.abs(found.published_angle.values - np.linalg.norm(away, axis=1)).max() < size
    poles = [x.apply([0, 0, 1]) for x in (matrices(found, "published_quaternion"), attitude)]
    angle = np.arctan2(np.linalg.norm(np.cross(*poles), axis=1), (poles[0] * poles[1]).sum(axis=1))
    assert np.abs(found.published_pole_angle.values - angle).max() < size
    assert found.attrs["orientation_kernel"] == "iau2015.tpc"
    assert found.attrs["orientation_of"] == "pole and prime meridian of mars"
    assert len(found.attrs["orientation_sha256"]) == 64


def test_a_binary_kernel_is_its_series(tmp_path: Path) -> None:
    kernel = write_librations(tmp_path / "moon.bpc", 2447900.5, 160)
    found = run_text(asked(kernel, None)).dataset
    given = np.load(Path(str(de421.__file__)).parent / "jpl-librations.npy", mmap_mode="r")
    days = 2451545.0 - 2414992.5 + (AHEAD + found.time.values) / DAY
    angles = []
    for day in days.tolist():
        block, rest = divmod(day, 8)
        row = np.asarray(given[int(block)])
        angles.append([np.polynomial.chebyshev.chebval(rest / 4 - 1, series) for series in row])
    truth = Rotation.from_euler("ZXZ", np.array(angles))
    # the date here is a double of days, 5e-11 of a turn of 27 days
    assert (truth.inv() * matrices(found, "published_quaternion")).magnitude().max() < 1e-11
    assert found.attrs["orientation_of"] == "axes 31006"


@pytest.mark.slow
def test_it_is_drawn_and_info_tells_how_far_the_run_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_text(asked(), tmp_path)
    drawn = figure(run.dataset, "published")
    titles = [axes.get_title(loc="left") for axes in drawn.axes]
    assert any("iau2015.tpc" in title for title in titles), titles
    info(tmp_path / "top", as_json=False)
    told = re.search(
        r"published +at most (\S+)° from the attitude in iau2015.tpc, (\S+)°", capsys.readouterr().out
    )
    assert told is not None
    angle = np.degrees(run.dataset["published_angle"])
    assert float(told[1]) == pytest.approx(float(angle.max()), rel=1e-3)
    assert float(told[2]) == pytest.approx(float(angle.mean()), rel=1e-3)
