"""CK and binary PCK of runs, read back by SPICE: attitude and angular velocity between the rows, to 1e-12."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spiceypy
from scipy.spatial.transform import Rotation
from support import EAGER, run_text

import rigidsim
from rigidsim.formats.registry import Naming
from rigidsim.scene.epochs import parse_epoch
from rigidsim.workflows.export import export

SATELLITE = """
name = "sat"
[body]
principal_moments = [1, 1.5, 2.2]
[initial]
angular_velocity = [0.01, 0.03, 0.12]
quaternion = [0.5, 0.1, -0.7, 0.4]
[frame]
axes = "ICRF"
[time]
epoch = "2029-04-13T21:46:00 TDB"
end = 500
samples = 11
"""


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
    *, turn: Rotation | None = None, count: int = 300, bound: float = 1e-12,
) -> None:  # fmt: skip
    """SPICE's matrices and rates are the run's, sampled anew at random times that both know exactly."""
    numbers = np.random.default_rng(5)
    first, last = (float(ahead + x) for x in _span(text, settings))
    unit = max(np.spacing(abs(x)) for x in (first, last, last - first))
    steps = np.unique(numbers.integers(1, int((last - first) / unit), count))
    dates = [Fraction(first) + int(k) * Fraction(unit) for k in steps]
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
    assert away < bound
    assert (Rotation.from_matrix(np.array(plain)).inv() * body).magnitude().max() < bound
    size = np.linalg.norm(rate, axis=1).max()
    assert np.linalg.norm(np.array([w for _, w in parts]) - rate, axis=1).max() < max(bound, 1e-12) * size


def _span(text: str, settings: tuple[str, ...]) -> tuple[Fraction, Fraction]:
    config = rigidsim.parse(text, overrides=settings).config.time
    return config.start.rational, config.end.rational


@pytest.mark.parametrize("kind", ["ck", "pck"])
@pytest.mark.parametrize(
    ("settings", "ahead"),
    [
        ((), Fraction(924083160)),
        (('time.epoch="1969-06-28T00:00:00 TDB"',), Fraction(-962884800)),
        (('time.epoch="J2000"', "initial.angular_velocity=[1, 30, 120]", "time.end=2"),
         Fraction(0)),
        (("time.start=-250.5", "time.end=0.5", "time.samples=3"), Fraction(924083160)),
        pytest.param(('integrator.precision="quadruple"',), Fraction(924083160), marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_spice_reads_the_run(kind: str, settings: tuple[str, ...], ahead: Fraction, tmp_path: Path) -> None:
    _, files = written(SATELLITE, kind, tmp_path, *settings)
    agrees(SATELLITE, settings, files, ahead, "SAT")


@pytest.mark.parametrize("kind", ["ck", "pck"])
def test_ecliptic_axes_are_turned_to_the_equator(kind: str, tmp_path: Path) -> None:
    setting = 'frame.axes="ecliptic J2000"'
    _, files = written(SATELLITE, kind, tmp_path, setting)
    turn = Rotation.from_rotvec([np.radians(84381.406 / 3600), 0, 0])
    agrees(SATELLITE, (setting,), files, Fraction(924083160), "SAT", turn=turn)
    assert "84381.406" in told(files[0])


def test_a_date_in_utc_is_known_to_a_double_of_seconds(tmp_path: Path) -> None:
    setting = 'time.epoch="2020-04-13T21:46:00 UTC"'
    _, files = written(SATELLITE, "ck", tmp_path, setting)
    agrees(SATELLITE, (setting,), files, parse_epoch("2020-04-13T21:46:00 UTC").since_j2000(), "SAT")


@pytest.mark.slow
def test_long_and_short_spans(tmp_path: Path) -> None:
    """Ten years of a body of the Moon's rate, and an eighth of a second."""
    slow = ('initial.angular_velocity=["1e-8 rad/s", "2e-8 rad/s", "2.6e-6 rad/s"]', 'time.end="3652 day"',
            'time.epoch="1985-06-28T00:00:00 TDB"')  # fmt: skip
    _, files = written(SATELLITE, "pck", tmp_path, *slow)
    agrees(SATELLITE, slow, files, Fraction(-457963200), "SAT")
    assert files[0].stat().st_size < 4e6
    short = ("time.end=0.125",)
    _, files = written(SATELLITE, "ck", tmp_path, *short)
    agrees(SATELLITE, short, files, Fraction(924083160), "SAT", count=40)


def test_a_body_about_the_earths_pole_has_a_pck(tmp_path: Path) -> None:
    """In the ecliptic's axes, since the angles aren't defined at the equator's own pole."""
    settings = ("initial.quaternion=[1, 0, 0, 0]", "initial.angular_velocity=[0, 0, 0.1]")
    _, files = written(SATELLITE, "pck", tmp_path, *settings)
    agrees(SATELLITE, settings, files, Fraction(924083160), "SAT")
    assert "relative to ECLIPJ2000" in told(files[0])


def test_what_the_comments_say(tmp_path: Path) -> None:
    run, files = written(
        SATELLITE, "ck", tmp_path, "output.estimate=true", object_id="-82", object_name="my craft"
    )
    text = told(files[0])
    error = run.dataset.attrs["attitude_error"]
    assert f"as the run announces it: {error:.2g} rad" in text
    assert run.dataset.attrs["config_sha256"] in text
    assert f"rigidsim {run.dataset.attrs['version_rigidsim']}" in text
    assert "frame MY_CRAFT relative to J2000" in text
    assert "body: -82" in text
    assert "2029-04-13T21:46:00 TDB is time zero" in text
    assert "at most" in text
    with loaded(*files):
        number = spiceypy.namfrm("MY_CRAFT")
        assert spiceypy.frinfo(number)[0] == -82


def test_kernels_of_different_runs_can_be_loaded_together(tmp_path: Path) -> None:
    _, one = written(SATELLITE, "ck", tmp_path, 'name="one"')
    one = [file.rename(file.with_stem("one")) for file in one]
    _, two = written(SATELLITE, "ck", tmp_path, 'name="two"', "initial.quaternion=[1, 0, 0, 0]")
    with loaded(*one, *two):
        both = [spiceypy.pxform("J2000", name, 924083200.0) for name in ("ONE", "TWO")]
    assert np.abs(both[0] - both[1]).max() > 0.1


def test_nothing_is_left_of_it(tmp_path: Path) -> None:
    before = spiceypy.ktotal("ALL")
    written(SATELLITE, "pck", tmp_path)
    assert spiceypy.ktotal("ALL") == before
    assert not list(tmp_path.glob(".*"))


TORQUE = '[[loads]]\nkind = "torque"\ncomponents = ["0.01*abs(sin(t/10))", "0", "0"]\n'


@pytest.mark.parametrize(
    ("kind", "settings", "naming", "said"),
    [
        ("ck", ["time.epoch="], {}, "--epoch"),
        ("ck", ["frame.axes="], {}, "--axes"),
        ("ck", ["frame.axes="], {"axes": "MYFRAME"}, "SPICE doesn't know"),
        ("pck", ['output.record=["angular_velocity"]'], {}, "recorded no quaternion"),
        ("ck", [], {"object_name": "IAU_MOON"}, "which SPICE has already"),
        ("ck", [], {"object_name": "a name that is far too long for it"}, "shorter name"),
        ("pck", [], {"object_id": "nobody"}, "--object-id"),
        (
            "pck",
            ["initial.angular_velocity=[0.02, 0.1, 0.001]", "time.end=20000"],
            {},
            "format ck",
        ),
        ("ck", ["initial.angular_velocity=[0, 0, 1e7]", "time.end=1e-3"], {}, "apart"),
        ("ck", ["time.end=1e-6"], {}, "epoch nearer to J2000"),
    ],
)
def test_what_cant_be_written_is_refused(
    kind: str, settings: list[str], naming: dict[str, str], said: str, tmp_path: Path
) -> None:
    with pytest.raises(rigidsim.RigidsimError, match=said):
        written(SATELLITE, kind, tmp_path, *settings, **naming)
    assert not list(tmp_path.glob("out*"))


def test_without_spiceypy_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spiceypy", None)
    with pytest.raises(rigidsim.RigidsimError, match=re.escape('pip install "rigidsim[spice]"')):
        written(SATELLITE, "ck", tmp_path)


@pytest.mark.slow
def test_kinks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(rigidsim.RigidsimError, match="kinks"):
        written(SATELLITE + TORQUE, "ck", tmp_path)


def test_existing_files_and_unfinished_runs_are_refused(tmp_path: Path) -> None:
    run, files = written(SATELLITE, "ck", tmp_path)
    files[0].unlink()
    with pytest.raises(rigidsim.RigidsimError, match=r"out\.tsc: exists"):
        export(run, "ck", out=files[0])
    with pytest.raises(rigidsim.RigidsimError, match="that of a file beside it"):
        export(run, "ck", out=files[1], force=True)
    part = run_text(SATELLITE, 'name="part"', "limits.max_steps=5", "time.end=5000", tmp_path, tuning=EAGER)
    with pytest.raises(rigidsim.RigidsimError, match="max_steps"):
        export(part, "ck", out=tmp_path / "part.bc")
