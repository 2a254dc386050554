"""Fits to attitudes in SPICE's CK: rows at the kernel's own times, whatever its type, and from other axes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import config

import rigidsim
from rigidsim.formats.spice import read_rows
from rigidsim.scene.epochs import parse_epoch

spiceypy = pytest.importorskip("spiceypy")

OBJECT, CLOCK = -77000, -77
EPOCH = "2029-04-13T21:46:00 TDB"
AHEAD = parse_epoch(EPOCH).since_j2000()
TICK = 2.0**-10  # s
ATTITUDE, RATE = 1e-3, 1e-4  # sigmas, rad and rad/s
TUMBLING = config(
    "principal_moments = [1, 1.6, 2.2]",
    "angular_velocity = [0.02, 0.1, 0.05]\nquaternion = [0.5, 0.1, -0.7, 0.4]",
    time=f'epoch = "{EPOCH}"\nend = 100\nsamples = 51',
    more='[frame]\naxes = "ecliptic J2000"',
    name="tumbling",
)
FIT = """
[fit]
parameters = ["initial.attitude", "initial.angular_velocity", "body.principal_moments[1]"]
[[fit.data]]
file = "seen.bc"
kernels = ["clock.tsc"]
observable = "quaternion"
sigma = "1e-3 rad"
"""
RATES = FIT.partition("[[fit.data]]")[2].replace("quaternion", "angular_velocity").replace("1e-3", "1e-4")
BOTH = f"{FIT}[[fit.data]]{RATES.replace(' rad', ' rad/s')}"


def clock(path: Path) -> Path:
    """A clock that counts ticks of TDB from time 0 of the experiment on."""
    number, units = -CLOCK, 1_000_000
    rows = {
        f"SCLK_DATA_TYPE_{number}": 1, f"SCLK01_TIME_SYSTEM_{number}": 1, f"SCLK01_N_FIELDS_{number}": 2,
        f"SCLK01_MODULI_{number}": f"{units} 1024", f"SCLK01_OFFSETS_{number}": "0 0",
        f"SCLK01_OUTPUT_DELIM_{number}": 2, f"SCLK_PARTITION_START_{number}": 0,
        f"SCLK_PARTITION_END_{number}": units * 1024,
        f"SCLK01_COEFFICIENTS_{number}": f"0 {int(AHEAD)} 1.0", "SCLK_KERNEL_ID": "@2000-01-01/12:00",
    }  # fmt: skip
    text = "\n".join(f"{name} = ( {value} )" for name, value in rows.items())
    path.write_text(f"KPL/SCLK\n\\begindata\n{text}\n\\begintext\n")
    return path


def packets(attitude: Rotation) -> np.ndarray:
    """Quaternions of SPICE's matrices, which go from the reference to the body."""
    return np.ascontiguousarray(attitude.inv().as_quat()[:, [3, 0, 1, 2]])


def write(path: Path, kind: int, ticks: np.ndarray, attitude: Rotation, rates: Any) -> None:
    """A segment, relative to J2000, added to a file; rates in J2000, or None."""
    there = path.exists()
    handle = spiceypy.dafopw(str(path)) if there else spiceypy.ckopn(str(path), "seen", 0)
    span = (float(ticks[0]), float(ticks[-1]))
    q, has = packets(attitude), rates is not None
    av = rates if has else np.zeros((len(q), 3))
    begins = ticks[[0, len(ticks) // 2]]  # a gap in the middle
    if kind == 1:
        spiceypy.ckw01(handle, *span, OBJECT, "J2000", has, "seen", len(q), ticks, q, av)
    elif kind == 2:
        spiceypy.ckw02(
            handle, ticks[0], ticks[-1] + 8, OBJECT, "J2000", "seen", len(q), ticks, ticks + 8, q, av,
            np.full(len(q), TICK),
        )  # fmt: skip
    elif kind == 3:
        spiceypy.ckw03(handle, *span, OBJECT, "J2000", has, "seen", len(q), ticks, q, av, 2, begins)
    else:
        rows = np.concatenate([q, av], axis=1)
        spiceypy.ckw05(
            handle, 3, 7, *span, OBJECT, "J2000", has, "seen", ticks, rows, TICK, 2, begins
        )  # fmt: skip
    spiceypy.ckcls(handle)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    clock(tmp_path / "clock.tsc")
    return tmp_path


def some(count: int) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """Times in ticks, unevenly, attitudes, and rates in J2000."""
    numbers = np.random.default_rng(3)
    ticks = np.cumsum(numbers.integers(10, 300, count)).astype(float)
    return ticks, Rotation.random(count, rng=numbers), numbers.standard_normal((count, 3))


def rows_of(here: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Times, quaternions and rates, if there are any, of a CK."""
    found = read_rows(here / "seen.bc", [here / "clock.tsc"], parse_epoch(EPOCH), "EME2000").columns
    quaternions = np.stack([found[f"quaternion_{x}"] for x in "wxyz"], axis=1)
    rated = "angular_velocity_x" in found
    rates = np.stack([found[f"angular_velocity_{x}"] for x in "xyz"], axis=1) if rated else None
    return found["time"], quaternions, rates


@pytest.mark.parametrize(
    ("kind", "rated", "count"),
    [(1, True, 100), (1, False, 20), (2, True, 101), (3, True, 250), (3, False, 100), (5, True, 101)],
)
def test_rows_are_those_that_were_written(kind: int, rated: bool, count: int, here: Path) -> None:
    """Of whatever type and length: a directory follows after each hundred times."""
    ticks, attitude, rates = some(count)
    write(here / "seen.bc", kind, ticks, attitude, rates if rated else None)
    times, quaternions, read = rows_of(here)
    np.testing.assert_allclose(times, ticks * TICK, atol=2e-7)  # doubles of seconds since J2000
    again = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]])
    assert (again.inv() * attitude).magnitude().max() < 1e-14
    if not rated and kind in (1, 3, 5):
        assert read is None
    elif rated:
        assert read is not None
        np.testing.assert_allclose(read, attitude.inv().apply(rates), atol=1e-13)


def seen(folder: Path) -> dict[str, float]:
    """A run's attitudes and rates with noise as a CK relative to J2000; and the truth."""
    truth = {"initial.angular_velocity[1]": 0.1003, "body.principal_moments[1]": 1.603}
    run = rigidsim.run(rigidsim.parse(TUMBLING).replace(truth), out=None).dataset
    numbers = np.random.default_rng(11)
    times = run["time"].values
    body = Rotation.from_quat(run["quaternion"].values[:, [1, 2, 3, 0]])
    turn = Rotation.from_rotvec([np.radians(84381.406 / 3600), 0, 0])  # from the ecliptic to the equator
    noisy = Rotation.from_rotvec(ATTITUDE * numbers.standard_normal((len(times), 3))) * turn * body
    rates = run["angular_velocity"].values + RATE * numbers.standard_normal((len(times), 3))
    write(folder / "seen.bc", 3, times / TICK, noisy, noisy.apply(rates))
    return truth


def test_a_fit_to_a_kernel_finds_start_and_moment(here: Path) -> None:
    """From attitudes and rates with noise, relative to other axes than the config's."""
    truth = seen(here)
    found = rigidsim.fit(rigidsim.parse(TUMBLING + BOTH))
    assert found.converged
    assert [one.rows for one in found.data] == [51, 51]
    assert found.scale == pytest.approx(1, abs=0.15)
    for one in found.parameters:
        assert one.sigma is not None
        right = truth.get(one.key, one.start)
        assert abs(one.value - right) < 3 * one.sigma, one.key
    assert found.sigma("initial.attitude[0]") < ATTITUDE
