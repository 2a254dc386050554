"""CK and binary PCK of runs, read back by SPICE: attitude and angular velocity between the rows, to 1e-12."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spiceypy
from scipy.spatial.transform import Rotation
from support import config, run_text

import rigidsim
from rigidsim.formats.registry import Naming
from rigidsim.workflows.export import export

SATELLITE = config(
    "principal_moments = [1, 1.5, 2.2]",
    "angular_velocity = [0.01, 0.03, 0.12]\nquaternion = [0.5, 0.1, -0.7, 0.4]",
    time='epoch = "2029-04-13T21:46:00 TDB"\nend = 500\nsamples = 11',
    more='[frame]\naxes = "ICRF"',
    name="sat",
)


@contextmanager
def loaded(*files: Path) -> Iterator[None]:
    for file in files:
        spiceypy.furnsh(str(file))
    try:
        yield
    finally:
        for file in files:
            spiceypy.unload(str(file))


def written(text: str, kind: str, tmp_path: Path, *settings: str, **naming: str) -> tuple[Any, list[Path]]:
    run = run_text(text, *settings, tmp_path)
    return run, export(run, kind, out=tmp_path / f"out.{kind}", force=True, naming=Naming(**naming))


def told(file: Path) -> str:
    """Comments of a kernel, in one line."""
    handle = spiceypy.dafopr(str(file))
    try:
        return " ".join(" ".join(spiceypy.dafec(handle, 100, 200)[1]).split())
    finally:
        spiceypy.dafcls(handle)


def agrees(
    text: str, settings: tuple[str, ...], files: list[Path], ahead: Fraction, frame: str,
    *, turn: Rotation | None = None, count: int = 300
) -> None:  # fmt: skip
    """SPICE's matrices and rates are the run's, sampled anew at random times that both know exactly."""
    numbers = np.random.default_rng(5)
    time = rigidsim.parse(text, overrides=settings).config.time
    way = 1 if time.end.rational > time.start.rational else -1
    first, last = (float(ahead + x.rational) for x in (time.start, time.end)[::way])
    unit = max(np.spacing(abs(x)) for x in (first, last, last - first))
    steps = np.unique(numbers.integers(1, int((last - first) / unit), count))
    dates = [Fraction(first) + int(k) * Fraction(unit) for k in steps]
    dates = dates[::way]
    times = ", ".join(f'"{float(date - ahead)!r}"' for date in dates)
    removed = "time.samples=", "time.end="
    found = run_text(text, *settings, *removed, f"time.times=[{times}]").dataset
    body = Rotation.from_quat(found.quaternion.values[:, [1, 2, 3, 0]])
    body = body if turn is None else turn * body
    rate = body.apply(found.angular_velocity.values)
    with loaded(*files):
        parts = [spiceypy.xf2rav(spiceypy.sxform("J2000", frame, float(date))) for date in dates]
        plain = [spiceypy.pxform(frame, "J2000", float(date)) for date in dates]
    away = (Rotation.from_matrix(np.array([m.T for m, _ in parts])).inv() * body).magnitude().max()
    assert away < 1e-12
    assert (Rotation.from_matrix(np.array(plain)).inv() * body).magnitude().max() < 1e-12
    size = np.linalg.norm(rate, axis=1).max()
    assert np.linalg.norm(np.array([w for _, w in parts]) - rate, axis=1).max() < 1e-12 * size


@pytest.fixture(scope="module")
def sat(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The satellite's run with its announced error."""
    return run_text(SATELLITE, "output.estimate=true", tmp_path_factory.mktemp("runs"))


T2029 = Fraction(924083160)
SLOW = ('initial.angular_velocity=["1e-8 rad/s", "2e-8 rad/s", "2.6e-6 rad/s"]', 'time.end="3652 day"',
        'time.epoch="1985-06-28T00:00:00 TDB"')  # fmt: skip
TURNED = Rotation.from_rotvec([np.radians(84381.406 / 3600), 0, 0])


@pytest.mark.parametrize(
    ("kind", "settings", "ahead", "says"),
    [
        ("ck", ("time.start=-250.5", "time.end=0.5", "time.samples=3"), T2029, ""),
        ("ck", ("time.start=0.5", "time.end=-250.5", "time.samples=3"), T2029, ""),
        pytest.param("pck", ("time.end=-250",), T2029, "", marks=pytest.mark.slow),
        pytest.param("pck", ('frame.axes="ecliptic J2000"',), T2029, "84381.406", marks=pytest.mark.slow),
        pytest.param("pck", SLOW, Fraction(-457963200), "", marks=pytest.mark.slow),
    ],
)
def test_spice_reads_the_run(
    kind: str, settings: tuple[str, ...], ahead: Fraction, says: str, tmp_path: Path
) -> None:
    before = spiceypy.ktotal("ALL")
    _, files = written(SATELLITE, kind, tmp_path, *settings)
    assert spiceypy.ktotal("ALL") == before
    assert not list(tmp_path.glob(".*"))
    turn = TURNED if "ecliptic" in settings[0] else None
    agrees(SATELLITE, settings, files, ahead, "SAT", turn=turn)
    assert says in told(files[0])
    assert files[0].stat().st_size < 4e6


@pytest.mark.parametrize("kind", ["aem", "oem"])
def test_rows_of_messages_ascend_in_runs_into_the_past(kind: str, tmp_path: Path) -> None:
    flying = SATELLITE.replace("[initial]", "[initial]\nposition = [7e6, 0, 0]\nvelocity = [0, 7e3, 0]")
    run, (file, *_) = written(flying, kind, tmp_path, "time.end=-500", "body.mass=1")
    keys = dict(re.findall(r"^(\S+) = (.*)$", file.read_text(), re.M))
    cells = re.findall(r"^(2029\S+) (.*)$", file.read_text(), re.M)
    dates = [date for date, _ in cells]
    assert [keys["START_TIME"], *dates, keys["STOP_TIME"]] == sorted([*dates, dates[0], dates[-1]])
    assert dates[-1] == "2029-04-13T21:46:00"
    found = np.array([list(map(float, numbers.split())) for _, numbers in cells])[::-1]
    known = run.dataset
    if kind == "aem":
        apart = Rotation.from_quat(found).inv() * Rotation.from_quat(known.quaternion.values[:, [1, 2, 3, 0]])
        assert apart.magnitude().max() < 1e-14
    else:
        np.testing.assert_allclose(found[:, :3] * 1e3, known.position.values, rtol=1e-14)


@pytest.mark.parametrize(
    ("kind", "settings", "naming", "said"),
    [
        ("ck", ["time.epoch="], {}, "--epoch"),
        ("ck", [], {"object_name": "IAU_MOON"}, "which SPICE has already"),
        ("pck", [], {"object_id": "nobody"}, "--object-id"),
        ("ck", ["time.end=1e-6"], {}, "epoch nearer to J2000"),
    ],
)
def test_what_cant_be_written_is_refused(
    kind: str, settings: list[str], naming: dict[str, str], said: str, sat: Any, tmp_path: Path
) -> None:
    run = run_text(SATELLITE, *settings, tmp_path) if settings else sat
    with pytest.raises(rigidsim.RigidsimError, match=said):
        export(run, kind, out=tmp_path / f"out.{kind}", naming=Naming(**naming))
    assert not list(tmp_path.glob("out*"))
