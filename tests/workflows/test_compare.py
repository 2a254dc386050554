"""``rigidsim.compare``: trajectories of other integrators and of other bodies, in other conventions."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import xarray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import cases, config

import rigidsim
from experiments import compare_conventions
from rigidsim.workflows.compare.as_run import open_any

MOMENTS = np.array([1.0, 2.0, 2.5])
START = np.array([0.3, 1.0, -0.4])
QUATERNION = np.array([0.8, 0.2, -0.4, 0.4])  # w x y z, of norm one
END = 12.0


@pytest.fixture(scope="module")
def experiment() -> rigidsim.Experiment:
    return made()


def made() -> rigidsim.Experiment:
    start = f"angular_velocity = {START.tolist()}\nquaternion = {QUATERNION.tolist()}"
    time = f"end = {END}\nsamples = 3"
    return rigidsim.parse(config(f"principal_moments = {MOMENTS.tolist()}", start, time=time, name="free"))


def slopes(_: float, y: np.ndarray) -> np.ndarray:
    q, w = y[:4], y[4:]
    turn = np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))]) / 2
    return np.concatenate([turn, -np.cross(w, MOMENTS * w) / MOMENTS])


def theirs(tolerance: float = 1e-12, rows: int = 241) -> Any:
    """Times, quaternions w x y z and rates by an independent integrator."""
    times = np.linspace(0, END, rows)
    start = np.concatenate([QUATERNION, START])
    found = solve_ivp(slopes, (0, END), start, "DOP853", times, rtol=tolerance, atol=tolerance).y.T
    return times, found[:, :4], found[:, 4:]


def by_steps(step: float) -> Any:
    """The same by the classical Runge-Kutta method."""
    y, rows = np.concatenate([QUATERNION, START]), []
    for n in range(round(END / step) + 1):
        rows.append([n * step, *y])
        y = compare_conventions.classical(slopes, y, step)
    found = np.array(rows)
    return found[:, 0], found[:, 1:5], found[:, 5:]


def test_errors_of_steps_and_tolerances_are_integration_errors(experiment: rigidsim.Experiment) -> None:
    times, q, w = by_steps(0.05)
    found = rigidsim.compare(experiment, {"t": times, "q": q, "w": w})
    assert found.verdict == "integration_error"
    exact = theirs(1e-13, rows=len(times))[1]
    unit = q / np.linalg.norm(q, axis=1)[:, None]
    signs = np.sign(np.einsum("ij,ij->i", unit, exact))[:, None]
    true = (4 * np.arcsin(np.linalg.norm(unit * signs - exact, axis=1) / 2)).max()
    assert found.attitude_error.largest == pytest.approx(true, rel=0.01)
    times, q, w = theirs(1e-7)
    assert rigidsim.compare(experiment, {"t": times, "q": q, "w": w}).verdict == "integration_error"


def test_a_file_is_read_as_a_run(tmp_path: Path) -> None:
    """Its convention is the one in which the attitude turns at its rates, at any order or direction."""
    times, q, w = theirs(1e-10)
    body = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    written = {
        "inverse": ("q0,q1,q2,q3", body.inv().as_quat()[:, [3, 0, 1, 2]], w),
        "degrees": ("q1,q2,q3,q4", body.as_quat(), w * 180 / np.pi),
        "euler": ("phi,theta,psi", body.as_euler("ZXZ", degrees=True), body.apply(w)),
    }
    for name, (columns, attitude, rates) in written.items():
        path = tmp_path / f"{name}.csv"
        table = np.column_stack([times, attitude, rates, times**2])
        np.savetxt(path, table, "%.17g", ",", header=f"t,{columns},wx,wy,wz,more", comments="")
        read = open_any(path).dataset
        same = np.abs(np.einsum("ij,ij->i", read["quaternion"].values, q))
        assert same == pytest.approx(np.linalg.norm(q, axis=1), abs=1e-12)
        assert read["angular_velocity"].values == pytest.approx(w, abs=1e-12)
        assert read["more"].values == pytest.approx(times**2)
    found = rigidsim.analyse(tmp_path / "inverse.csv", "angular_velocity.z", lines=1)
    assert len(found.signals) == 1
    table = np.column_stack([times, body.as_euler("ZXZ")])
    np.savetxt(path, table, delimiter=",", header="t,phi,theta,psi", comments="")
    with pytest.raises(rigidsim.RigidsimError, match="without angular velocities its convention"):
        _ = open_any(path).dataset


@pytest.mark.slow
@pytest.mark.unoptimised
def test_the_missing_acceleration_is_told(experiment: rigidsim.Experiment) -> None:
    """What brakes the experiment's body and not theirs: at rows of unequal distances, and with rates."""
    braked = experiment.with_overrides(['loads=[{kind="viscous_torque",coefficients=[0.001,0.001,0.001]}]'])
    times, q, w = theirs()
    kept = np.sort(np.random.default_rng(1).permutation(len(times))[:160])
    kept[0] = 0
    found = rigidsim.compare(braked, {"t": times[kept], "q": q[kept]})
    assert found.verdict == "wrong_model"
    assert found.local_defects is not None
    true = float(np.sqrt(np.mean(np.sum((0.001 * w / MOMENTS) ** 2, 1))))
    assert found.local_defects.missing_acceleration == pytest.approx(true, rel=0.1)
    rated = rigidsim.compare(braked, {"t": times, "q": q, "w": w})
    assert rated.verdict == "wrong_model"
    assert rated.local_defects is not None
    assert rated.local_defects.missing_acceleration == pytest.approx(true, rel=0.1)


SEQUENCES = ["zxz", "zyz", "xyx", "xzx", "yxy", "yzy", "zyx", "xyz", "xzy", "yxz", "yzx", "zxy"]
TRAJECTORY = theirs(1e-13, rows=61)


@settings(deadline=None, max_examples=3, suppress_health_check=[HealthCheck.too_slow])
@given(
    sequence=st.sampled_from(["", *SEQUENCES]), fixed=st.booleans(), inverse=st.booleans(),
    last=st.booleans(), degrees=st.booleans(), space=st.booleans(),
    offset=st.sampled_from(["", "space", "body"]), seed=st.integers(0, 2**31),
)  # fmt: skip
def test_conventions_are_found(
    sequence: str, fixed: bool, inverse: bool, last: bool, degrees: bool, space: bool, offset: str, seed: int
) -> None:
    """SciPy writes the attitude in the convention, and it is read back: every digit, or another reading that
    gives the same motion.
    """
    times, q, w = TRAJECTORY
    body = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    written, rates = body, w
    turn = Rotation.random(random_state=seed)
    if offset == "space":
        written = turn * body
    elif offset == "body":
        written, rates = body * turn, turn.inv().apply(w)
    if space:
        rates = written.apply(rates)
    written = written.inv() if inverse else written
    unit = 180 / np.pi if degrees else 1.0
    table: dict[str, Any] = {"t": times, "w": rates * unit}
    if sequence:
        letters = sequence if fixed else sequence.upper()
        table["euler"] = np.array([one.as_euler(letters, degrees=degrees) for one in written])
    else:
        given_last = written.as_quat()
        table["q"] = given_last if last else given_last[:, [3, 0, 1, 2]]
    found = rigidsim.compare(made(), table)
    assert found.verdict == "agrees"
    assert found.attitude_error.largest < 1e-9
    assert found.rate_error is not None
    assert found.rate_error < 1e-9
    if not sequence:
        told = found.convention
        assert told.order == ("xyzw" if last else "wxyz")
        assert told.direction == ("space_to_body" if inverse else "body_to_space")
        assert told.rate_axes == ("space" if space else "body")
        assert told.offset == (offset or "none")


def write(path: Path, times: np.ndarray, q: np.ndarray, w: np.ndarray, form: str = "%.17g") -> Path:
    table = np.column_stack([times, q, w])
    np.savetxt(path, table, form, ",", header="t,qw,qx,qy,qz,wx,wy,wz", comments="")
    return path


def test_a_body_that_stands_still_does_not_agree_with_one_that_tumbles(
    experiment: rigidsim.Experiment,
) -> None:
    """ "1 0 0 0" has no decimals, which isn't to say that its attitude is known to half a unit."""
    times = np.arange(13.0)
    still = {"t": times, "q": np.tile([1.0, 0, 0, 0], (13, 1)), "w": np.zeros((13, 3))}
    found = rigidsim.compare(experiment, still)
    assert found.attitude_error.largest > 2
    assert found.verdict != "agrees"


@pytest.mark.parametrize("suffix", cases(["csv", "parquet", "nc"], ["csv"]))
def test_files(experiment: rigidsim.Experiment, tmp_path: Path, suffix: str) -> None:
    times, q, w = theirs(1e-12)
    path = tmp_path / f"theirs.{suffix}"
    if suffix == "csv":  # whose few digits are no error
        write(path, times, q, w, "%.6f")
    elif suffix == "parquet":
        pytest.importorskip("pyarrow")
        pandas.DataFrame(
            np.column_stack([times, q, w]), columns=["t", "qw", "qx", "qy", "qz", "wx", "wy", "wz"]
        ).to_parquet(path)
    else:
        dims = {"quaternion": (("time", "part"), q), "angular_velocity": (("time", "axis"), w)}
        xarray.Dataset(dims, {"time": times}).to_netcdf(path, engine="h5netcdf")
    figure = tmp_path / "seen.png" if suffix == "csv" else None
    found = rigidsim.compare(experiment, path, out=tmp_path / "seen.h5", figure=figure)
    assert found.verdict == "agrees"
    assert found.attitude_error.largest < (1e-9 if suffix != "csv" else 1e-5)
    assert (1e-7 < found.resolution < 1e-5) == (suffix == "csv")
    assert figure is None or figure.stat().st_size > 20_000
    with xarray.open_dataset(tmp_path / "seen.h5") as saved:
        assert saved["attitude_error"].attrs["units"] == "rad"
        assert saved.attrs["verdict"] == found.verdict


def test_a_kernel(experiment: rigidsim.Experiment, tmp_path: Path) -> None:
    """A CK that rigidsim exports is read at times between its rows, and comes back to rounding errors."""
    pytest.importorskip("spiceypy")
    dated = experiment.with_overrides(['time.epoch="J2000"', 'frame.axes="ICRF"', "time.samples=31"])
    rigidsim.run(dated, out=tmp_path)
    path, clock = rigidsim.export(tmp_path / "free", "ck", tmp_path / "free.bc")
    found = rigidsim.compare(dated, path, kernels=[clock])
    assert found.attitude_error.largest < 1e-12
    assert found.rate_error is not None
    assert found.rate_error < 1e-12
    assert found.convention.rate_axes == "space"
    with pytest.raises(rigidsim.RigidsimError, match="as --kernels FILE"):
        rigidsim.compare(dated, path)
    with pytest.raises(rigidsim.RigidsimError, match="date of time 0"):
        rigidsim.compare(experiment, path, kernels=[clock])


def at(row: int, value: float, values: np.ndarray) -> np.ndarray:
    """Values with a row multiplied."""
    return np.where(np.arange(len(values))[:, None] == row, value * values, values)


BROKEN = {
    "not finite": (lambda t, q, w: (t, at(7, np.nan, q), w), "line 9: qw is no finite"),
    "twice": (lambda t, q, w: (np.where(t == t[5], t[4], t), q, w), "line 7 has the time of the row before"),
    "unsorted": (
        lambda t, q, w: (np.roll(t, 1), q, w),
        "line 3 is earlier than the row before .*sort the rows",
    ),
    "none": (lambda t, q, w: (t[:0], q[:0], w[:0]), "no rows; a line of names"),
    "no rotation": (lambda t, q, w: (t, at(3, 2.0, q), w), "line 5: a quaternion of norm 2"),
    "far before": (lambda t, q, w: (t - 5e4, q, w), "far before the experiment"),
}


def test_what_cannot_be_used_is_refused(experiment: rigidsim.Experiment, tmp_path: Path) -> None:
    good, path = theirs(1e-6, rows=21), tmp_path / "broken.csv"
    files: list[tuple[Any, str]] = [
        ({"t": [0.0, 1, 2], "wx": [0.0, 1, 2]}, "no attitude"),
        ({"q": np.ones((4, 4))}, "no time"),
        (tmp_path / "x.csv", "no such"),
    ]
    for name, content, told in (
        ("empty.csv", "", "empty"),
        ("bare.csv", "0,1,0,0,0\n1,1,0,0,0\n", "line of names"),
        ("odd.xyz", "?", "no known kind"),
    ):
        (tmp_path / name).write_text(content)
        files.append((tmp_path / name, told))
    for given_file, told in files:
        with pytest.raises(rigidsim.RigidsimError, match=told):
            rigidsim.compare(experiment, given_file)
    for broken, told in BROKEN.values():
        with pytest.raises(rigidsim.RigidsimError, match=told):
            rigidsim.compare(experiment, write(path, *broken(*good)))
