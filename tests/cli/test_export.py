"""Exports hold every number of the run, in files that other tools read."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

import rigidsim

Config = Callable[..., str]
Command = Callable[..., Any]
FLIGHT = {
    "body": "principal_moments = [1, 2, 2.5]\nmass = 2",
    "initial": "angular_velocity = [0.3, 1.0, 0.5]\nposition = [1, 2, 3]\nvelocity = [0.5, 0, 7]",
    "loads": 'kind = "uniform_gravity"',
}


@pytest.fixture(scope="module")
def finished() -> dict[str, Path]:
    """Folders of runs by the texts of their configs: most tests export the same few."""
    return {}


@pytest.fixture
def run_once(
    finished: dict[str, Path], rigidsim_command: Command, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], None]:
    """Puts the run of a config below ``runs``, which is integrated where no test has done so."""

    def run(config: str) -> None:
        text, folder = Path(config).read_text(), Path("runs", Path(config).stem)
        if text not in finished:
            assert rigidsim_command("run", config, "--force").exit_code == 0
            finished[text] = tmp_path_factory.mktemp("finished") / "run"
            shutil.copytree(folder, finished[text])
        elif not folder.exists():
            shutil.copytree(finished[text], folder)

    return run


@pytest.fixture
def exported(
    config: Config, run_once: Callable[[str], None], rigidsim_command: Command
) -> Callable[..., Path]:
    """Runs a small flight and exports it; returns the file."""

    def export(file_format: str, integrator: str = "", *options: str) -> Path:
        name = config("throw", time="end = 2\nsamples = 9", integrator=integrator, **FLIGHT)
        run_once(name)
        result = rigidsim_command("export", "runs/throw", "--format", file_format, *options)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[0] == f"throw.{file_format}"
        return Path(f"throw.{file_format}")

    return export


def exact(dataset: Any, name: str, row: int, column: int) -> Decimal:
    """The sum of a value and its residuals, with every digit."""
    with localcontext() as context:
        context.prec = 2000
        parts = [name, f"{name}_lo", f"{name}_lo2"]
        values = [Decimal(float(dataset[p].values[row, column])) for p in parts if p in dataset]
        return sum(values, Decimal(0))


def test_csv_holds_every_digit(exported: Callable[..., Path]) -> None:
    path = exported("csv", 'precision = "quadruple"')
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    rows = [dict(zip(names, line.split(","), strict=True)) for line in lines[1:]]
    with rigidsim.open_run("runs/throw").dataset as dataset:
        assert len(rows) == dataset.sizes["time"] == 9
        for row in range(9):
            for column, axis in enumerate("wxyz"):
                told = Decimal(rows[row][f"quaternion_{axis}"])
                true = exact(dataset, "quaternion", row, column)
                # nearer than half the last bit: it rounds back to the same number
                assert abs(told - true) <= abs(true) / 2**113
    assert "velocity_X [m s-1]" in path.read_text().split("time,")[0]


def test_parquet_holds_values_and_residuals(exported: Callable[..., Path]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(exported("parquet", 'precision = "quadruple"'))
    with rigidsim.open_run("runs/throw").dataset as dataset:
        for part in ("", "_lo", "_lo2"):
            column = table[f"angular_velocity{part}_y"].to_numpy()
            expected = dataset[f"angular_velocity{part}"].sel(body_axis="y")
            np.testing.assert_array_equal(column, expected)
    assert table.schema.field("energy").metadata[b"units"] == b"J"


def test_zarr_is_the_dataset(exported: Callable[..., Path]) -> None:
    pytest.importorskip("zarr")
    path = exported("zarr", 'precision = "extended"')
    with xarray.open_zarr(path) as store, rigidsim.open_run("runs/throw").dataset as dataset:
        assert set(store.variables) == set(dataset.variables)
        for name in dataset.variables:
            np.testing.assert_array_equal(store[name].values, dataset[name].values)
            assert store[name].attrs == dataset[name].attrs
        assert store.attrs["config"] == dataset.attrs["config"]


def test_angles_are_exported_in_the_unit_asked_for(
    exported: Callable[..., Path], rigidsim_command: Command
) -> None:
    """Rounded once, and named: in the columns of tables, in the attributes of a store."""
    pytest.importorskip("zarr")
    integrator = 'precision = "extended"\nformulation = "euler_angles"'
    path = exported("csv", integrator, "--angle-unit", "arcsec", "--force")
    names, *rows = [line.split(",") for line in path.read_text().splitlines() if not line.startswith("#")]
    assert "euler_angles_theta [arcsec]" not in path.read_text()
    assert "euler_angles_theta_arcsec [arcsec]" in path.read_text()
    told = [Decimal(row[names.index("euler_angles_theta_arcsec")]) for row in rows]
    assert rigidsim_command(
        "export", "runs/throw", "--format", "zarr", "--angle-unit", "turns", "--force"
    ).exit_code == 0  # fmt: skip
    with mpmath.workdps(60), xarray.open_zarr("throw.zarr") as store:
        with rigidsim.open_run("runs/throw").dataset as dataset:
            assert store["euler_angles"].attrs["units"] == "turns"
            assert store["angular_velocity"].attrs["units"] == "rad s-1"
            for row, text in enumerate(told):
                angle = mpmath.mpf(str(exact(dataset, "euler_angles", row, 1)))
                for found, per_turn in ((text, 1296000), (exact(store, "euler_angles", row, 1), 1)):
                    true = angle * per_turn / (2 * mpmath.pi)
                    # half a unit in the last place, and in double what 64 bits leave open beside it
                    assert abs(mpmath.mpf(str(found)) - true) <= abs(true) * 1.01 * 2.0**-64
    alone = ("--format", "csv", "--force", "--variable")
    assert rigidsim_command("export", "runs/throw", *alone, "energy").exit_code == 0
    assert "\ntime,energy\n" in path.read_text()
    assert "given no; allowed: " in rigidsim_command("export", "runs/throw", *alone, "no").output
    refused = rigidsim_command("export", "runs/throw", "--format", "aem", "--angle-unit", "deg")
    assert refused.exit_code != 0
    assert "aem prescribes its units" in refused.output
    refused = rigidsim_command("export", "runs/throw", "--format", "csv", "--angle-unit", "grad", "--force")
    assert "allowed: rad, turns, deg, arcsec, mas" in refused.output


def keywords(text: str) -> dict[str, str]:
    """KEY = VALUE lines, each at most once."""
    pairs = re.findall(r"^([A-Z_]+) = (.+)$", text, re.MULTILINE)
    assert len({key for key, _ in pairs}) == len(pairs)
    return dict(pairs)


def attitudes(text: str) -> np.ndarray:
    """Quaternions x y z w of a message."""
    body = re.search(r"^DATA_START\n(.*)^DATA_STOP$", text, re.MULTILINE | re.DOTALL)
    assert body is not None
    return np.array([[float(x) for x in line.split()[1:]] for line in body[1].splitlines()])


def states(text: str) -> np.ndarray:
    """Positions and velocities of a message."""
    rows = [line.split() for line in text.split("META_STOP")[1].splitlines() if line.strip()]
    return np.array([[float(x) for x in row[1:]] for row in rows])


def test_an_attitude_message_turns_the_space_axes_into_the_body_axes(exported: Callable[..., Path]) -> None:
    """CCSDS 504.0-B-2: Q1 Q2 Q3 QC is the rotation of frame A onto frame B, QC = cos(half the angle)."""
    text = exported("aem", "", "--epoch", "2020-02-28T23:59:59.5 TT", "--axes", "ICRF").read_text()
    header = keywords(text)
    assert header["CCSDS_AEM_VERS"] == "2.0"
    assert (header["REF_FRAME_A"], header["REF_FRAME_B"]) == ("ICRF", "SC_BODY_1")
    assert header["ATTITUDE_TYPE"] == "QUATERNION"
    assert header["TIME_SYSTEM"] == "TT"
    assert header["START_TIME"] == "2020-02-28T23:59:59.5"
    assert header["STOP_TIME"] == "2020-02-29T00:00:01.5"
    assert all(len(line) <= 254 and line.isascii() for line in text.splitlines())
    with rigidsim.open_run("runs/throw").dataset as dataset:
        expected = dataset.quaternion.values[:, [1, 2, 3, 0]]
    assert np.abs(attitudes(text) - expected).max() < 1e-15  # 16 digits are what the standard allows


def test_an_orbit_message_is_in_kilometres(exported: Callable[..., Path], rigidsim_command: Command) -> None:
    text = exported("oem", "", "--epoch", "2016-12-31T23:59:59 UTC", "--axes", "LAB_1").read_text()
    header = keywords(text)
    assert (header["TIME_SYSTEM"], header["REF_FRAME"]) == ("UTC", "LAB_1")
    assert header["STOP_TIME"] == "2017-01-01T00:00:00"  # 2 s later: a leap second was between them
    assert "2016-12-31T23:59:60.75 " in text
    with rigidsim.open_run("runs/throw").dataset as dataset:
        expected = np.hstack([dataset.position.values, dataset.velocity.values]) / 1000
    np.testing.assert_allclose(states(text), expected, rtol=1e-15, atol=1e-18)
    options = ("--format", "csv", "--epoch", "2016-12-31T23:59:59 UTC")
    assert rigidsim_command("export", "runs/throw", *options).exit_code == 0
    assert "\n1.75,2016-12-31T23:59:60.75," in Path("throw.csv").read_text()


SKY = '[frame]\naxes = "ecliptic J2000"\n'
TIMED = 'end = 2\nsamples = 9\nepoch = "2029-04-13T21:46:00 TDB"'


def test_the_config_says_epoch_and_axes_and_the_ecliptic_is_turned_to_the_equator(
    config: Config, rigidsim_command: Command
) -> None:
    """CCSDS knows no ecliptic. x_equator = (x, y cos e - z sin e, y sin e + z cos e), with the obliquity e of
    IAU 2006, 84381.406 arcsec: also for body axes, the columns of the attitude's matrix.
    """
    assert rigidsim_command("run", config("sky", time=TIMED, rest=SKY, **FLIGHT)).exit_code == 0
    for file_format in ("aem", "oem"):
        assert rigidsim_command("export", "runs/sky", "--format", file_format).exit_code == 0
    attitude, orbit = Path("sky.aem").read_text(), Path("sky.oem").read_text()
    for text, frame in ((attitude, "REF_FRAME_A"), (orbit, "REF_FRAME")):
        header = keywords(text)
        assert (header[frame], header["TIME_SYSTEM"]) == ("EME2000", "TDB")
        assert header["STOP_TIME"] == "2029-04-13T21:46:02"
        assert "turned about X by the obliquity to EME2000: 84381.406 arcsec (IAU 2006)" in text
    e = np.radians(84381.406 / 3600)
    turn = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]])
    with rigidsim.open_run("runs/sky").dataset as dataset:
        assert dataset.attrs["axes"] == "ecliptic J2000"
        assert dataset.attrs["epoch"] == "2029-04-13T21:46:00 TDB"
        parts = dataset.position.values / 1000, dataset.velocity.values / 1000
        expected = np.hstack([part @ turn.T for part in parts])
        matrices = Rotation.from_quat(dataset.quaternion.values[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(states(orbit), expected, rtol=0, atol=1e-17)
    found = Rotation.from_quat(attitudes(attitude)).as_matrix()
    np.testing.assert_allclose(found, turn @ matrices, rtol=0, atol=2e-15)  # a few roundings of each


EVENTFUL = '[[events]]\nname = "half"\nexpression = "t - 0.125"\n'


@pytest.fixture
def sky(config: Config, run_once: Callable[[str], None], rigidsim_command: Command) -> xarray.Dataset:
    """A flight with an epoch, axes and an event, exported to the formats of text; its dataset."""
    text = config("sky", time=TIMED, rest=SKY.replace("ecliptic J2000", "EME2000") + EVENTFUL, **FLIGHT)
    run_once(text)
    for file_format in ("csv", "aem", "oem"):
        assert rigidsim_command("export", "runs/sky", "--format", file_format).exit_code == 0
    with rigidsim.open_run("runs/sky").dataset as dataset:
        return dataset.load()


@pytest.mark.slow
def test_independent_readers_read_orbit_messages(sky: xarray.Dataset) -> None:
    """Epochs, frames and numbers as ``oem`` sees them."""
    moments = [str(moment)[:23] for moment in sky.date.values]
    state = np.hstack([sky.position.values, sky.velocity.values]) / 1000
    oem = pytest.importorskip("oem").OrbitEphemerisMessage.open("sky.oem")
    assert (oem.segments[0].metadata["REF_FRAME"], oem.segments[0].metadata["TIME_SYSTEM"]) == (
        "EME2000",
        "TDB",
    )
    assert [str(s.epoch)[:23] for s in oem.states] == moments
    assert {s.epoch.scale for s in oem.states} == {"tdb"}
    found = [[*s.position, *s.velocity] for s in oem.states]
    np.testing.assert_allclose(found, state, rtol=1e-15, atol=1e-18)


def test_an_independent_reader_reads_attitude_messages(sky: xarray.Dataset) -> None:
    """``brahe``; not ``ccsds-ndm`` 3.1, which raises a KeyError on every AEM 2.0 with quaternions (it looks
    for the field by the name of version 1), and would take the scalar for the first of the four.
    """
    brahe = pytest.importorskip("brahe.ccsds")
    segment = brahe.AEM.from_file("sky.aem").segments[0]
    frames = (segment.ref_frame_a, segment.ref_frame_b, segment.time_system)
    assert tuple(map(str, frames)) == ("EME2000", "SC_BODY_1", "TDB")
    found = [[q.w, q.x, q.y, q.z] for q in (row.quaternion for row in segment.states)]
    expected = sky.quaternion.values / np.linalg.norm(sky.quaternion.values, axis=1)[:, None]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)  # it normalises
    assert str(segment.states[1].epoch) == "2029-04-13 21:46:00.250 TDB"


def test_events_are_tables_of_their_own(sky: xarray.Dataset) -> None:
    rows = [line for line in Path("sky.half.csv").read_text().splitlines() if line[:1].isdigit()]
    assert [float(row.split(",")[0]) for row in rows] == sky.half_time.values.tolist()
    assert len(rows) == 1


def test_what_a_format_can_not_hold_is_said(config: Config, rigidsim_command: Command) -> None:
    rates = config("rates", rest='record = ["angular_velocity"]')
    assert rigidsim_command("run", rates).exit_code == 0
    for file_format, what in (("aem", "quaternion"), ("oem", "position")):
        result = rigidsim_command("export", "runs/rates", "--format", file_format)
        assert result.exit_code == 2
        assert what in result.output
        assert not Path(f"rates.{file_format}").exists()
    result = rigidsim_command("export", "runs/rates", "--format", "xml")
    assert result.exit_code == 2
    assert "csv, parquet, zarr, aem, oem" in result.output
    result = rigidsim_command("export", "runs/rates", "--format", "aem", "--epoch", "yesterday")
    assert result.exit_code == 2


def test_no_message_names_what_nobody_said(
    config: Config, run_once: Callable[[str], None], rigidsim_command: Command
) -> None:
    run_once(config("plain", time="end = 2\nsamples = 9"))
    run_once(config("sky", time=TIMED, rest=SKY))
    refusals = {
        ("plain",): "doesn't say what its time 0 is, which a message must: give [time] epoch in the config",
        ("plain", "--epoch", "J2000"): "what its space axes are, which a message must: give [frame] axes",
        ("plain", "--epoch", "2020-01-01"): '--epoch: given "2020-01-01", without its time scale',
        ("plain", "--epoch", "J2000", "--axes", "ecliptic"): 'did you mean "ecliptic J2000"?',
        ("plain", "--epoch", "J2000", "--axes", "EME200"): 'did you mean "EME2000"?',
        ("sky", "--epoch", "J2000"): "given 2000-01-01T12:00:00 TDB, but time 0 of the run is 2029-04-13",
        ("sky", "--axes", "EME2000"): 'but the run\'s axes are "ecliptic J2000"; leave the option out',
    }
    for (name, *options), phrase in refusals.items():
        result = rigidsim_command("export", f"runs/{name}", "--format", "aem", *options)
        assert result.exit_code == 2
        assert phrase in result.output
        assert not Path(f"{name}.aem").exists()
