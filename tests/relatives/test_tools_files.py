"""Trajectories as simulators, robots and trajectory tools write them, by writers of our own; the motion is
SciPy's of a free body.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import seeds, unoptimised_code

import rigidsim
from rigidsim.workflows.compare.as_run import open_any

BEGIN = 1_703_000_000_123_456_789  # ns since 1970
DATE = "2023-12-19T15:33:20.123456789 UTC"
END, ROWS = 6.0, 61


class Motion:
    """Of a body without torques."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.moments = np.array([1.0, rng.uniform(1.3, 1.8), 2.0])
        self.start = Rotation.random(random_state=int(rng.integers(2**31)))
        self.rates_begun = rng.uniform(-1, 1, 3)
        w, x, y, z = np.roll(self.start.as_quat(), 1)
        self.times = np.linspace(0, END, ROWS)

        def slopes(_: float, y: np.ndarray) -> np.ndarray:
            q, w = y[:4], y[4:]
            turn = np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))]) / 2
            return np.concatenate([turn, -np.cross(w, self.moments * w) / self.moments])

        found = solve_ivp(
            slopes, (0, END), [w, x, y, z, *self.rates_begun], "DOP853", self.times, rtol=3e-14, atol=1e-15
        )
        self.attitude = Rotation.from_quat(np.roll(found.y[:4].T, -1, axis=1))
        self.rates = found.y[4:].T
        self.places = np.outer(self.times, rng.uniform(-1, 1, 3))

    def text(self, more: str = "") -> str:
        w, x, y, z = np.roll(self.start.as_quat(), 1).tolist()
        return (
            f'name = "body"\n[body]\nprincipal_moments = {self.moments.tolist()}\n[initial]\n'
            f"quaternion = {[w, x, y, z]}\nangular_velocity = {self.rates_begun.tolist()}\n"
            f'[time]\nepoch = "{DATE}"\nend = {END + 2}\nsamples = 2\n[output]\ntimeline = false\n'
            f"estimate = false\n{more}"
        )


def table(path: Path, names: str, rows: list[list[object]], separator: str = ",") -> Path:
    lines = [separator.join(x if isinstance(x, str) else repr(x) for x in row) for row in rows]
    path.write_text("\n".join([*filter(None, [names]), *lines, ""]))
    return path


def joined(*parts: np.ndarray) -> list[list[object]]:
    return [[x.item() for x in row] for row in np.column_stack(parts)]


def stamps(m: Motion) -> list[int]:
    return [BEGIN + round(t * 1e9) for t in m.times.tolist()]


def tum(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    rows = joined(m.places, m.attitude.as_quat())
    # microseconds, as doubles of Unix time hold them
    times = [f"{s // 10**9}.{s % 10**9:09d}" for s in stamps(m)]
    head = "# timestamp tx ty tz qx qy qz qw" if rng.integers(2) else ""
    name = str(rng.choice(["it.txt", "it.tum"]))
    return table(folder / name, head, [[t, *row] for t, row in zip(times, rows, strict=True)], " ")


def euroc(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    bias = rng.normal(size=(ROWS, 3))
    rows = joined(m.places, np.roll(m.attitude.as_quat(), 1, axis=1), 0 * m.places, bias, bias)
    head = "#timestamp"
    for stem, axes, unit in (
        ("p_RS_R", "xyz", "m"), ("q_RS", "wxyz", ""), ("v_RS_R", "xyz", "m s^-1"),
        ("b_w_RS_S", "xyz", "rad s^-1"), ("b_a_RS_S", "xyz", "m s^-2"),
    ):  # fmt: skip
        head += "".join(f",{stem}_{axis} [{unit}]" for axis in axes)
    return table(folder / "data.csv", head, [[s, *r] for s, r in zip(stamps(m), rows, strict=True)])


def ros(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    rows = joined(m.places, m.attitude.as_quat(), 0 * m.places, m.rates)
    if rng.integers(2):
        head = "%time,field.header.seq,field.header.stamp,field.header.frame_id"
        names = ("field.pose.pose.position", "field.pose.pose.orientation", "field.twist.twist.linear")
        names = (*names, "field.twist.twist.angular")
        first = [[s + 12345678, n, s, "odom"] for n, s in enumerate(stamps(m))]
        dot = "."
    else:
        head, first, dot = "__time", [[f"{s // 10**9}.{s % 10**9:09d}"] for s in stamps(m)], "/"
        names = ("/odom/pose/position", "/odom/pose/orientation", "/odom/twist/linear", "/odom/twist/angular")
    for stem, axes in zip(names, ("xyz", "xyzw", "xyz", "xyz"), strict=True):
        head += "".join(f",{stem}{dot}{axis}" for axis in axes)
    return table(folder / "odom.csv", head, [[*a, *b] for a, b in zip(first, rows, strict=True)])


def mujoco(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    q, joint = np.roll(m.attitude.as_quat(), 1, axis=1), rng.integers(2)
    qpos = np.column_stack([m.places, q]) if joint else q
    qvel = np.column_stack([0 * m.places, m.rates]) if joint else m.rates
    if rng.integers(2):
        np.savez(folder / "it.npz", time=m.times, qpos=qpos, qvel=qvel)
        return folder / "it.npz"
    names = [f"qpos_{n}" for n in range(qpos.shape[1])] + [f"qvel_{n}" for n in range(qvel.shape[1])]
    return table(folder / "it.csv", ",".join(["time", *names]), joined(m.times, qpos, qvel))


def basilisk(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    sigma, omega = m.attitude.as_mrp(), m.rates
    if rng.integers(2):
        np.savez(folder / "it.npz", **{"time [ns]": np.round(m.times * 1e9).astype(np.int64),
                 "sigma_BN": sigma, "omega_BN_B": omega, "r_BN_N": m.places})  # fmt: skip
        return folder / "it.npz"
    names = ["time_s", *(f"sigma_BN_{n}" for n in range(3)), *(f"omega_BN_B_{n}" for n in range(3))]
    return table(folder / "it.csv", ",".join(names), joined(m.times, sigma, omega))


def drake(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    body, world = str(rng.choice(["book", "$world_FreeBody", "cube_1"])), m.attitude.apply(m.rates)
    rows = joined(m.times, np.roll(m.attitude.as_quat(), 1, axis=1), m.places, world, 0 * m.places)
    names = [
        f"{body}_{x}" for x in ("qw", "qx", "qy", "qz", "x", "y", "z", "wx", "wy", "wz", "vx", "vy", "vz")
    ]
    return table(folder / "it.csv", ",".join(["time", *names]), rows)


def forty_two(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    table(folder / "time.42", "", joined(m.times), " ")
    table(folder / "wbn.42", "", joined(m.rates), " ")
    if rng.integers(2):
        table(folder / "PosN.42", "", joined(m.places), " ")
    return table(folder / "qbn.42", "", joined(m.attitude.as_quat()), " ")


def vectors(m: Motion, folder: Path, rng: np.random.Generator) -> Path:
    stem, unit = str(rng.choice(["rotvec", "rotation_vector", "rvec"])), str(rng.choice(["rad", "deg"]))
    form = m.attitude.as_rotvec() if unit == "rad" else np.degrees(m.attitude.as_rotvec())
    if rng.integers(2):
        stem, unit, form = str(rng.choice(["mrp", "sigma"])), "", m.attitude.as_mrp()
    names = [f"{stem}_{n}" + f" [{unit}]" * bool(unit) for n in (1, 2, 3)]
    names += ["wx", "wy", "wz"]
    return table(folder / "it.csv", ",".join(["t", *names]), joined(m.times, form, m.rates))


WRITERS: dict[str, Callable[[Motion, Path, np.random.Generator], Path]] = {
    "TUM": tum, "EuRoC": euroc, "ROS": ros, "MuJoCo": mujoco, "Basilisk": basilisk, "Drake": drake,
    "42": forty_two, "vectors": vectors,
}  # fmt: skip


@pytest.mark.parametrize("seed", seeds(1, 240))
def test_every_command_reads_the_file(seed: int, tmp_path: Path) -> None:
    """A file of one tool after the other."""
    name = list(WRITERS)[seed % len(WRITERS)]
    rng = np.random.default_rng(seed)
    motion = Motion(rng)
    path = WRITERS[name](motion, tmp_path, rng)
    data = f'[[fit.data]]\nfile = "{path.name}"\nobservable = "{{}}"\nsigma = 1e-6\n'
    rated = name not in ("TUM", "EuRoC")
    more = '[fit]\nparameters = ["initial.attitude", "initial.angular_velocity"]\n' + data.format(
        "quaternion"
    )
    more += data.format("angular_velocity") * (rated and name != "Drake")  # whose rates are along space axes
    (tmp_path / "body.toml").write_text(motion.text(more))
    with unoptimised_code():
        found = rigidsim.compare(rigidsim.parse(motion.text()), path)
        assert found.attitude_error.largest < 2e-9, (found.convention, path.read_bytes()[:400])
        assert found.verdict == "agrees"
        assert (found.rate_error is not None) == rated
        if name == "42":
            with pytest.raises(rigidsim.ConfigError, match="of several files, of which a fit copies one"):
                rigidsim.fit(tmp_path / "body.toml")
        else:
            fitted = rigidsim.fit(tmp_path / "body.toml")
            assert all(one.rms < 1e-8 for one in fitted.data), fitted.data
    shown = open_any(path).dataset
    read = Rotation.from_quat(np.roll(shown.quaternion.values, -1, axis=1))
    apart = (read.inv() * motion.attitude).magnitude()
    assert apart.max() < 1e-9
    assert np.abs(shown.time.values - shown.time.values[0] - motion.times).max() < 1e-9


@pytest.mark.parametrize("seed", seeds(1, 30))
def test_a_late_clock_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = Motion(rng)
    late, first = rng.uniform(-100, 100), int(rng.integers(0, 20))
    rows = slice(first, first + 30)
    given = {"t": motion.times[rows] + late, "q": motion.attitude.as_quat()[rows]}
    if rng.integers(2):
        given["w"] = np.degrees(motion.rates[rows])
    with unoptimised_code():
        found = rigidsim.compare(rigidsim.parse(motion.text()), given, offset="estimate")
        assert found.attitude_error.largest < 1e-8, found.told
        assert any(f"{-late:.6f}"[:8] in note for note in found.told), (late, found.told)
        known = rigidsim.compare(rigidsim.parse(motion.text()), given, offset=f"{-late!r} s")
        assert known.attitude_error.largest < 1e-8


@pytest.mark.parametrize("seed", seeds(1, 30))
def test_a_start_elsewhere_is_shown_as_keys(seed: int) -> None:
    motion = Motion(np.random.default_rng(seed))
    given = {"t": motion.times, "q": motion.attitude.as_quat()} | ({"w": motion.rates} if seed % 2 else {})
    other = rigidsim.parse(motion.text(), overrides=["initial.quaternion=[1, 0, 0, 0]"])
    known = {"order": "xyzw", "direction": "body_to_space", "offset": "none"}
    with unoptimised_code():
        found = rigidsim.compare(other, given, convention=known)
    assert found.verdict == "undecided"
    [note] = [one for one in found.told if "near the experiment's start" in one]
    q, w = (np.fromstring(x, sep=",") for x in re.findall(r"\[(.*?)\]", note))
    assert (Rotation.from_quat(np.roll(q, -1)).inv() * motion.start).magnitude() < 1e-8
    assert np.abs(w - motion.rates_begun).max() < (1e-8 if seed % 2 else 0.01)
    assert note.endswith("roughly") != bool(seed % 2)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_an_experiments_own_times_are_no_unix_time() -> None:
    motion = Motion(np.random.default_rng(3))
    text = motion.text().replace("end = 8.0", "start = 1700000000\nend = 1700000008")
    given = {"t": motion.times + 1.7e9, "q": motion.attitude.as_quat()}
    with unoptimised_code():
        found = rigidsim.compare(rigidsim.parse(text), given)
    assert found.attitude_error.largest < 1e-6  # times of doubles
    assert not any("Unix" in note for note in found.told)


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    motion = Motion(rng)
    experiment = rigidsim.parse(motion.text())
    q = motion.attitude.as_quat()

    def refused(given: object, message: str, **options: object) -> None:
        with pytest.raises(rigidsim.RigidsimError, match=message):
            rigidsim.compare(experiment, given, **options)  # type: ignore[arg-type]

    two = {f"{body}_{x}": q[:, n] for body in ("one", "two") for n, x in enumerate(("qx", "qy", "qz", "qw"))}
    refused({"t": motion.times, **two}, "attitudes of several bodies, one, two; keep the columns of one")
    path = table(tmp_path / "eight.txt", "", joined(motion.times, 3 * np.ones((ROWS, 7))), " ")
    refused(path, "eight.txt: line 1 holds numbers; put a line of names above")
    path = table(tmp_path / "qbn.42", "", joined(q), " ")
    refused(path, "needs time.42 next to it, in which 42 writes the time; copy it there")
    table(tmp_path / "time.42", "", joined(motion.times[1:]), " ")
    refused(path, "qbn.42: has 61 rows, where time.42 has 60; write both again")
    path = table(tmp_path / "wbn.42", "", joined(q[:, :3]), " ")
    refused(path, "of a run of 42 the file of quaternions, qbn.42, is read")
    turn = Rotation.from_euler("z", 5 * motion.times[:20, None]).as_quat()
    still = {"t": motion.times[:20] + 7, "q": turn, "w": np.tile([0, 0, 5.0], (20, 1))}
    spin = ["initial.quaternion=[1, 0, 0, 0]", "initial.angular_velocity=[0, 0, 5]"]
    experiment = rigidsim.parse(motion.text(), overrides=spin)
    refused(still, "s fit equally well, since this motion repeats itself; give", offset="estimate")
    long = {"t": 10 * motion.times, "q": q, "w": motion.rates}
    refused(long, "longer than the experiment by 52 s; set a later .time. end", offset="estimate")
    refused(still, 'offset: .*a time, "first" or "estimate" is allowed', offset="soon")


# --- two bodies ---------------------------------------------------------------------------------------------

PAIR = """name = "pair"
body = {shape = "ellipsoid", mass = 5.24e11, semi_axes = [431, 419, 310]}
loads = [{kind = "mutual_gravity"}]
time = {end = 1e4, every = 250}
output = {timeline = false, estimate = false}
[initial]
angular_velocity = SPIN
[[rigid_bodies]]
name = "moonlet"
shape = "ellipsoid"
mass = 4.8e9
semi_axes = [103, 79, 66]
position = [1190, 0, 0]
angular_velocity = [0, 1e-6, 1.46e-4]
velocity = SPEED
"""


def gubas(run: rigidsim.Run, folder: Path, rng: np.random.Generator, slip: float) -> Path:
    """As GUBAS writes the motion of a run, in binary or as a table; ``slip``: of the second body, rad."""
    data = run.dataset
    second = {x: data[f"rigid_body_{x}"].values[:, 0] for x in ("quaternion", "position", "velocity")}
    a = Rotation.from_quat(np.roll(data["quaternion"].values, -1, axis=1))
    b = Rotation.from_quat(np.roll(second["quaternion"], -1, axis=1)) * Rotation.from_rotvec([0, slip, 0])
    place, speed = (a.inv().apply(second[x]) for x in ("position", "velocity"))
    spin, other = data["angular_velocity"].values, data["rigid_body_angular_velocity"].values[:, 0]
    relative, turn = ((x).as_matrix().reshape(-1, 9) for x in (a.inv() * b, a))
    times = data["time"].values
    if rng.integers(2):
        named, timed = folder / "output_x" / "x_out.bin", folder / "output_t" / "t_out.bin"
        for path in (named, timed):
            path.parent.mkdir()
        seen = (a.inv() * b).apply(other)
        np.column_stack([place / 1e3, speed / 1e3, spin, seen, turn, relative]).astype("<f8").tofile(named)
        times.astype("<f8").tofile(timed)
        return named
    rows = joined(times, place, speed, spin, other, relative, turn, 0 * times)
    return table(folder / "LagrangianStateOut_40000.0_0.0_30.0_4_3_it.csv", "", rows)


@pytest.mark.parametrize("seed", seeds(1, 10))
def test_states_of_gubas_are_compared(seed: int, tmp_path: Path) -> None:
    """Or a run of both bodies; the motion is in 80 bits, and a second body that is turned is seen."""
    rng = np.random.default_rng(seed)
    speed = np.array([0, 0.173, 0]) + rng.uniform(-2e-3, 2e-3, 3)
    spin = np.array([0, 0, 7.7e-4]) + rng.uniform(-4e-5, 4e-5, 3)
    scene = rigidsim.parse(PAIR.replace("SPEED", str(speed.tolist())).replace("SPIN", str(spin.tolist())))
    run = rigidsim.run(scene, changes={"integrator.precision": "extended"}, out=None)
    slip = float(rng.choice([0.0, 1e-6]))
    found = rigidsim.compare(scene, gubas(run, tmp_path, rng, slip) if slip or rng.integers(3) else run)
    assert found.verdict == ("undecided" if slip else "agrees"), found.why
    assert found.attitude_error.largest == pytest.approx(slip, abs=3e-12, rel=1e-4)
    assert found.position_error < 1e-7
    assert found.rate_error < 1e-14
    assert found.local_defects.largest < 1e-12
    drifts = {x.name: x.largest for x in found.drifts}
    assert drifts.keys() >= {"energy", "angular_momentum"}
    assert max(drifts.values()) < 1e-13 + 1e-3 * slip


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("x_out.bin", "8 bytes.", "needs t_out.bin next to it"),
        ("FHamiltonianStateOut_1.csv", "1,2\n", "holds momenta; give LagrangianStateOut_1.csv"),
        ("LagrangianStateOut_1.csv", "1,2\n", "has 2 numbers in a row, where GUBAS writes 32"),
        ("LagrangianStateOut_1.csv", "t,x\n", "rows of 32 numbers are allowed"),
    ],
)
def test_other_files_of_gubas_are_refused(name: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(rigidsim.RigidsimError, match=words):
        rigidsim.compare("didymos", tmp_path / name)
