"""AEM and OEM by writers of our own, from rotations of scipy and annex F of CCSDS 504.0-B-2."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import seeds, unoptimised_code

import rigidsim
from rigidsim.formats.registry import Naming
from rigidsim.formats.trajectories import read_trajectory
from rigidsim.scene.epochs import parse_epoch
from rigidsim.workflows.compare.as_run import open_any

SPACE = ["EME2000", "J2000", "ICRF", "GCRF", "ICRF3", "eme2000"]
BODY = ["SC_BODY_1", "SC_BODY", "SC BODY 2", "GYRO_1", "STARTRACKER_1", "INSTRUMENT_A"]
SEQUENCES = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ"]
OLD = ["QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/RATE", "EULER_ANGLE", "EULER_ANGLE/RATE", "SPIN",
       "SPIN/NUTATION"]  # fmt: skip
NEW = ["QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/ANGVEL", "EULER_ANGLE", "EULER_ANGLE/DERIVATIVE",
       "EULER_ANGLE/ANGVEL", "SPIN", "SPIN/NUTATION", "SPIN/NUTATION_MOM"]  # fmt: skip
XML = {
    "QUATERNION": "quaternionEphemeris", "QUATERNION/DERIVATIVE": "quaternionDerivative",
    "QUATERNION/ANGVEL": "quaternionAngVel", "QUATERNION/RATE": "quaternionEulerRate",
    "EULER_ANGLE": "eulerAngle", "EULER_ANGLE/DERIVATIVE": "eulerAngleDerivative",
    "EULER_ANGLE/RATE": "eulerAngleRate", "EULER_ANGLE/ANGVEL": "eulerAngleAngVel", "SPIN": "spin",
    "SPIN/NUTATION": "spinNutation", "SPIN/NUTATION_MOM": "spinNutationMom",
}  # fmt: skip


OBLIQUITY = np.radians(84381.406 / 3600)


class Top:
    """A symmetric top without torques: closed form, about a momentum in any direction."""

    def __init__(self, rng: np.random.Generator, tilt: float | None = None) -> None:
        self.to_space = Rotation.random(random_state=int(rng.integers(2**31)))
        self.tilt = rng.uniform(0.2, 1.2) if tilt is None else tilt
        self.nutation, self.spin = rng.uniform(0.05, 0.2) * rng.choice([-1, 1], 2)  # rad/s
        self.begin = rng.uniform(0, 6, 2)

    def attitude(self, times: np.ndarray) -> Rotation:
        """Body to space."""
        angles = [
            self.begin[0] + self.nutation * times,
            0 * times + self.tilt,
            self.begin[1] + self.spin * times,
        ]
        return self.to_space * Rotation.from_euler("ZXZ", np.stack(angles, axis=1))

    def rates(self, times: np.ndarray) -> np.ndarray:
        """Along body axes, rad/s."""
        momentum = self.attitude(times).inv().apply(self.to_space.apply([0, 0, 1]))
        return self.nutation * momentum + self.spin * np.array([0, 0, 1])


class Aem:
    """A random message of a top, with what it should be read as."""

    def __init__(self, rng: np.random.Generator, kind: str = "") -> None:
        self.rng = rng
        self.version = 1 if rng.integers(2) else 2
        if kind:
            self.version = 2
        self.kind = kind or str(rng.choice(OLD if self.version == 1 else NEW))
        self.xml = bool(rng.integers(2))
        self.top = Top(rng, tilt=0.0 if self.kind == "SPIN" else None)
        self.scale = str(rng.choice(["UTC", "TAI", "TT", "TDB", "GPS"]))
        start = datetime(2024, 3, 1) + timedelta(seconds=int(rng.integers(10**8)) / 100 - 3e5)
        self.segments = int(rng.integers(1, 4))
        self.times = np.cumsum(rng.integers(50, 200, 12 * self.segments)) / 100  # s
        self.dates = [start + timedelta(seconds=float(t)) for t in self.times]
        space, body = str(rng.choice(SPACE)), str(rng.choice(BODY))
        self.frames = [space, body] if rng.integers(2) else [body, space]
        self.direction = str(rng.choice(["A2B", "B2A"])) if self.version == 1 else "A2B"
        source = self.frames[0] if self.direction == "A2B" else self.frames[1]
        self.from_space = source == space
        if "SPIN" in self.kind and not self.from_space:
            self.frames, self.from_space = self.frames[::-1], True
        self.sequence = str(rng.choice(SEQUENCES))
        self.first = bool(rng.integers(2)) and self.version == 1
        self.of_source = bool(rng.integers(2))
        if self.kind.endswith("RATE"):
            while len(set(self.sequence)) < 3:  # whose rates have an order
                self.sequence = str(rng.choice(SEQUENCES))

    def numbers(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """By name, in the order of a row."""
        turn, rates = self.top.attitude(times), self.top.rates(times)
        lead = turn if self.from_space else turn.inv()
        seen = rates if self.from_space else -turn.apply(rates)  # the target's, along its axes
        components = np.degrees(lead.apply(seen) if self.of_source else seen)
        attitude, _, rate = self.kind.partition("/")
        found: dict[str, np.ndarray] = {}
        if attitude == "QUATERNION":
            x, y, z, w = lead.as_quat().T
            found = {"Q1": x, "Q2": y, "Q3": z, "QC": w}
            if rate == "DERIVATIVE":
                vector = np.stack([x, y, z], axis=1)
                change = 0.5 * (w[:, None] * seen + np.cross(vector, seen))
                found |= {f"Q{n + 1}_DOT": change[:, n] for n in range(3)}
                found["QC_DOT"] = -0.5 * np.sum(vector * seen, axis=1)
        elif attitude == "EULER_ANGLE":
            angles = lead.as_euler(self.sequence, degrees=True)
            found = {f"ANGLE_{n + 1}": angles[:, n] for n in range(3)}
            if rate == "DERIVATIVE":
                after, before = (self.lead(times + h).as_euler(self.sequence) for h in (1e-5, -1e-5))
                change = np.degrees((after - before + np.pi) % (2 * np.pi) - np.pi) / 2e-5
                found |= {f"ANGLE_{n + 1}_DOT": change[:, n] for n in range(3)}
        else:
            axis = lead.apply([0, 0, 1])
            alpha, delta = np.arctan2(axis[:, 1], axis[:, 0]), np.arcsin(np.clip(axis[:, 2], -1, 1))
            zero = Rotation.from_euler("ZX", np.stack([alpha + np.pi / 2, np.pi / 2 - delta], axis=1))
            phase = np.unwrap((zero.inv() * lead).as_euler("ZYX")[:, 0])
            spin = 0 * alpha + (self.top.spin if rate else self.top.spin + self.top.nutation)
            named = {"ALPHA": alpha, "DELTA": delta, "ANGLE": phase, "ANGLE_VEL": spin}
            found = {f"SPIN_{key}": np.degrees(value) for key, value in named.items()}
            h = self.top.to_space.apply([0, 0, 1])
            if rate == "NUTATION_MOM":
                found["MOMENTUM_ALPHA"] = 0 * alpha + np.degrees(np.arctan2(h[1], h[0]))
                found["MOMENTUM_DELTA"] = 0 * alpha + np.degrees(np.arcsin(h[2]))
                found["NUTATION_VEL"] = 0 * alpha + np.degrees(self.top.nutation)
            elif rate == "NUTATION":
                inside = lead.inv().apply(h)
                found["NUTATION"] = np.degrees(np.arccos(np.clip(inside[:, 2], -1, 1)))
                found["NUTATION_PER"] = 0 * alpha + 2 * np.pi / self.top.nutation
                found["NUTATION_PHASE"] = np.degrees(np.arctan2(-inside[:, 1], inside[:, 0]))
        if rate in ("ANGVEL", "RATE"):
            names = [f"ANGVEL_{axis}" if rate == "ANGVEL" else f"{axis}_RATE" for axis in "XYZ"]
            if rate == "RATE" and attitude == "EULER_ANGLE" and not self.xml:  # in the order of the sequence
                names = [f"{axis}_RATE" for axis in self.sequence]
                components = components[:, ["XYZ".index(axis) for axis in self.sequence]]
            found |= {name: components[:, n] for n, name in enumerate(names)}
        return found

    def lead(self, times: np.ndarray) -> Rotation:
        turn = self.top.attitude(times)
        return turn if self.from_space else turn.inv()

    def date(self, moment: datetime) -> str:
        text = moment.strftime("%Y-%jT%H:%M:%S.%f" if self.rng.integers(2) else "%Y-%m-%dT%H:%M:%S.%f")
        return text + ("Z" if self.scale == "UTC" and self.rng.integers(2) else "")

    def keys(self) -> dict[str, str]:
        old, (attitude, _, rate) = self.version == 1, self.kind.partition("/")
        found = {
            "OBJECT_NAME": "TOP", "OBJECT_ID": "2024-001A", "CENTER_NAME": "EARTH",
            "REF_FRAME_A": self.frames[0], "REF_FRAME_B": self.frames[1], "TIME_SYSTEM": self.scale,
            "ATTITUDE_TYPE": self.kind.lower() if self.xml else self.kind,
        }  # fmt: skip
        if old:
            found["ATTITUDE_DIR"] = self.direction
        if old and attitude == "QUATERNION":
            found["QUATERNION_TYPE"] = "FIRST" if self.first else "LAST"
        if attitude == "EULER_ANGLE":
            numbered = self.sequence.translate(str.maketrans("XYZ", "123"))
            found["EULER_ROT_SEQ"] = numbered if old else self.sequence
        if rate in ("ANGVEL", "RATE"):
            letter = "A" if self.of_source == (self.direction == "A2B") else "B"
            named = f"REF_FRAME_{letter}"
            found["ANGVEL_FRAME" if rate == "ANGVEL" else "RATE_FRAME"] = (
                named if old or self.rng.integers(2) else found[named]
            )
        return found

    def state(self, date: str, row: dict[str, float]) -> str:
        """A row, in KVN or XML."""
        if not self.xml:
            names = list(row)
            if self.first and "QC" in names:
                for n in range(0, len(names) - len(names) % 4, 4):
                    names[n : n + 4] = [names[n + 3], *names[n : n + 3]]
            return " ".join([date, *(repr(float(row[name])) for name in names)])
        leaves = []
        for n, (name, value) in enumerate(row.items()):
            text = repr(float(value))
            if self.version == 1 and name.startswith("ANGLE_"):
                leaves.append(f'<rotation{n + 1} angle="{self.sequence[n]}_ANGLE">{text}</rotation{n + 1}>')
            elif name.endswith("RATE"):
                leaves.append(
                    f'<rotation{n % 3 + 1} rate="{name}" units="deg/s">{text}</rotation{n % 3 + 1}>'
                )
            else:
                leaves.append(f"<{name}>{text}</{name}>")
        tag = XML[self.kind]
        return f"<attitudeState><{tag}><EPOCH>{date}</EPOCH>{''.join(leaves)}</{tag}></attitudeState>"

    def text(self) -> str:
        every = self.numbers(self.times)
        blocks = []
        for rows in np.split(np.arange(len(self.times)), self.segments):
            states = [self.state(self.date(self.dates[n]), {k: v[n] for k, v in every.items()}) for n in rows]
            if self.xml:
                about = "".join(f"<{key}>{value}</{key}>" for key, value in self.keys().items())
                blocks.append(
                    f"<segment><metadata>{about}</metadata><data>{''.join(states)}</data></segment>"
                )
            else:
                about = "\n".join(f"{key} = {value}" for key, value in self.keys().items())
                rows_of = "\n".join(["DATA_START", "COMMENT 1 2", *states, "DATA_STOP"])
                blocks.append(f"META_START\n{about}\nMETA_STOP\n\n{rows_of}\n")
        if self.xml:
            root = f'<aem id="CCSDS_AEM_VERS" version="{self.version}.0">'
            return f'<?xml version="1.0"?>\n{root}<header/><body>{"".join(blocks)}</body></aem>'
        return f"CCSDS_AEM_VERS = {self.version}.0\nORIGINATOR = ME\n{''.join(blocks)}"

    def check(self, path: Path) -> None:
        """Attitudes to 1e-12 rad; rates to 1e-10 deg/s, or to 1e-6 where ours are differences."""
        path.write_text(self.text())
        found = read_trajectory(path)
        columns = found.columns
        read = Rotation.from_quat(np.stack([columns[name] for name in ("qx", "qy", "qz", "qw")], axis=1))
        apart = (read.inv() * self.top.attitude(self.times)).magnitude()
        assert apart.max() < 1e-7 if "SPIN" in self.kind else apart.max() < 1e-12, self.text()[:900]
        assert found.settled
        for date, moment in zip(found.epochs, self.dates, strict=True):
            assert date == parse_epoch(f"{moment.isoformat()} {self.scale}")
        number = int(self.rng.integers(self.segments))
        rows = np.split(np.arange(len(self.times)), self.segments)[number]
        inside = self.dates[int(self.rng.choice(rows))].isoformat()
        one = read_trajectory(path.with_name(f"{path.name}#{self.rng.choice([str(number + 1), inside])}"))
        assert np.array_equal([float(date.since(found.epochs[0])) for date in one.epochs],
                              [float(found.epochs[n].since(found.epochs[0])) for n in rows])  # fmt: skip
        assert all(np.array_equal(one.columns[x], columns[x][rows]) for x in ("qw", "qx", "qy", "qz"))
        if self.kind in ("QUATERNION", "EULER_ANGLE"):
            assert "wx" not in columns
            return
        rates = np.stack([columns[name] for name in ("wx", "wy", "wz")], axis=1)
        expected = np.degrees(self.top.rates(self.times))
        close = 1e-6 if self.kind == "EULER_ANGLE/DERIVATIVE" or "SPIN" in self.kind else 1e-10
        assert np.abs(rates - expected).max() < close, (self.text()[:900], found.notes)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_attitudes_and_rates_are_those_that_were_written(seed: int, tmp_path: Path) -> None:
    """Ten messages a seed: both versions, KVN and XML, all types, directions, frames, clocks, segments."""
    rng = np.random.default_rng(seed)
    for n in range(10):
        Aem(rng).check(tmp_path / f"{n}.aem")


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_rates_of_version_1_as_derivatives_are_known_by_the_motion(seed: int, tmp_path: Path) -> None:
    """QUATERNION/RATE and EULER_ANGLE/RATE as derivatives of Euler angles, as Orekit writes them."""
    rng = np.random.default_rng(seed)
    given = Aem(rng, "EULER_ANGLE/DERIVATIVE")
    given.version, given.xml, given.kind = 1, False, "EULER_ANGLE/RATE"
    given.direction, given.of_source = "A2B", False
    given.times = np.linspace(0, 6, 12 * given.segments)  # closer together
    given.dates = [given.dates[0] + timedelta(seconds=round(float(t), 6)) for t in given.times]
    given.times = np.array([(date - given.dates[0]).total_seconds() for date in given.dates])
    plain = given.numbers

    def derivatives(times: np.ndarray) -> dict[str, np.ndarray]:
        given.kind = "EULER_ANGLE/DERIVATIVE"
        found = plain(times)
        given.kind = "EULER_ANGLE/RATE"
        return found

    given.numbers = derivatives  # type: ignore[method-assign]
    path = tmp_path / "them.aem"
    path.write_text(given.text())
    found = read_trajectory(path)
    if any("left out" in note for note in found.notes):  # near the singularity angles jump
        return
    assert found.notes == (
        "rates were taken as derivatives of the Euler angles, at which the attitude turns",
    )
    rates = np.stack([found.columns[name] for name in ("wx", "wy", "wz")], axis=1)
    assert np.abs(rates - np.degrees(given.top.rates(given.times))).max() < 1e-4


def oem(rng: np.random.Generator, path: Path, xml: bool) -> tuple[list[str], np.ndarray]:
    """Write an orbit in several segments with covariances; dates and numbers in m and m/s."""
    segments, dates, rows = [], [], []
    start = datetime(2024, 12, 30) + timedelta(seconds=int(rng.integers(86400)))
    more, form = bool(rng.integers(2)), str(rng.choice(["%Y-%jT%H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f"]))
    for _ in range(int(rng.integers(2, 5))):
        states, lines = [], []
        for _ in range(int(rng.integers(2, 6))):
            start += timedelta(milliseconds=int(rng.integers(1, 10**6)))
            date = start.strftime(form)
            numbers = [*rng.uniform(-7e3, 7e3, 3), *rng.uniform(-7, 7, 3)]
            given = [*numbers, *(rng.uniform(-1, 1, 3) if more else ())]
            dates.append(start.isoformat())
            rows.append(numbers)
            lines.append(" ".join([date, *map(repr, map(float, given))]))
            names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT", "X_DDOT", "Y_DDOT", "Z_DDOT")
            leaves = (f"<{name}>{float(x)!r}</{name}>" for name, x in zip(names, given, strict=False))
            states.append(f"<stateVector><EPOCH>{date}</EPOCH>{''.join(leaves)}</stateVector>")
        about = {
            "OBJECT_NAME": "TOP", "OBJECT_ID": "2024-001A", "CENTER_NAME": "EARTH", "REF_FRAME": "EME2000",
            "TIME_SYSTEM": "TAI", "START_TIME": lines[0].split()[0], "STOP_TIME": date,
        }  # fmt: skip
        covariance = [list(map(repr, map(float, rng.uniform(0, 1, n)))) for n in range(1, 7)]
        if xml:
            elements = "".join(f"<{key}>{value}</{key}>" for key, value in about.items())
            matrix = (
                f"<covarianceMatrix><EPOCH>{date}</EPOCH><CX_X>{covariance[0][0]}</CX_X></covarianceMatrix>"
            )
            data = "".join(states) + matrix * int(rng.integers(3))
            segments.append(f"<segment><metadata>{elements}</metadata><data>{data}</data></segment>")
        else:
            head = "\n".join(f"{key} = {value}" for key, value in about.items())
            block = "\n".join([f"EPOCH = {date}", "COV_REF_FRAME = RTN", *map(" ".join, covariance)])
            many = "\n".join([block] * int(rng.integers(1, 3)))
            after = f"COVARIANCE_START\n{many}\nCOVARIANCE_STOP\n" if rng.integers(2) else ""
            segments.append(f"META_START\n{head}\nMETA_STOP\n" + "\n".join(lines) + f"\n{after}")
    if xml:
        text = f'<oem id="CCSDS_OEM_VERS" version="2.0"><header/><body>{"".join(segments)}</body></oem>'
    else:
        text = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2024-01-01T00:00:00\nORIGINATOR = ME\n" + "".join(
            segments
        )
    path.write_text(text)
    return dates, np.array(rows) * 1e3


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_orbits_keep_all_their_segments(seed: int, tmp_path: Path) -> None:
    """Four messages a seed, with 2 to 4 segments, most with covariances; ``oem`` reads the same of KVN."""
    rng = np.random.default_rng(seed)
    for n in range(4):
        path, xml = tmp_path / f"{n}.oem", bool(n % 2)
        dates, expected = oem(rng, path, xml)
        found = read_trajectory(path)
        read = np.stack([found.columns[name] for name in ("x", "y", "z", "vx", "vy", "vz")], axis=1)
        assert np.abs(read / expected - 1).max() < 1e-15
        assert [str(date) for date in found.epochs] == [str(parse_epoch(f"{date} TAI")) for date in dates]
        assert found.axes == "EME2000"
        about = found.in_axes("ecliptic J2000").columns
        places = np.stack([about[name] for name in "xyz"], axis=1)
        turned = Rotation.from_euler("x", -OBLIQUITY).apply(expected[:, :3])
        assert np.abs(places - turned).max() < 1e-8  # m, at 1e7 m
        if not xml:
            lines = path.read_text().splitlines()
            row = int(rng.integers(len(dates)))
            assert repr(float(expected[row, 0] / 1e3))[:12] in lines[int(found.row(row).split()[1]) - 1]
            theirs = pytest.importorskip("oem").OrbitEphemerisMessage.open(path)
            states = [[*state.position, *state.velocity] for state in theirs.states]
            assert np.abs(np.array(states) * 1e3 / expected - 1).max() < 1e-15


SCENE = """
name = "top"
[body]
principal_moments = [1, 1, {c!r}]
[initial]
quaternion = {q}
angular_velocity = {w}
[frame]
axes = "{axes}"
[time]
epoch = "{epoch}"
end = {end!r}
samples = 2
[output]
timeline = false
estimate = false
"""
FIT = """
[fit]
parameters = ["initial.attitude", "initial.angular_velocity"]
[[fit.data]]
file = "top.aem"
observable = "quaternion"
sigma = "1e-9 rad"
[[fit.data]]
file = "top.aem"
observable = "angular_velocity"
sigma = "1e-9 rad/s"
"""


def wrong_way(text: str) -> str:
    """The same message with its frames exchanged."""
    for one, other in (("REF_FRAME_A =", "REF_FRAME_B ="), ("REF_FRAME_A>", "REF_FRAME_B>")):
        text = text.replace(one, "@").replace(other, one).replace("@", other)
    return text


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_every_command_reads_the_same(seed: int, tmp_path: Path) -> None:
    """``compare``, ``fit`` and what ``view`` and ``plot`` show, about the equator or the ecliptic, for a free
    top in its closed form; and none agrees with the message the wrong way round.
    """
    rng = np.random.default_rng(seed)
    kinds = ["QUATERNION/DERIVATIVE", "QUATERNION/ANGVEL", "EULER_ANGLE/ANGVEL"]
    given = Aem(rng, str(rng.choice(kinds)))
    moment, top = rng.uniform(0.6, 1.8), given.top
    top.spin = top.nutation * np.cos(top.tilt) * (1 / moment - 1)
    axes = str(rng.choice(["EME2000", "ICRF", "ecliptic J2000"]))
    turn = Rotation.from_euler("x", -OBLIQUITY if axes.startswith("ecl") else 0.0)
    start, zero = given.dates[0] - timedelta(seconds=given.times[0]), np.zeros(1)
    x, y, z, w = (turn * top.attitude(zero)).as_quat()[0].tolist()
    scene = SCENE.format(
        c=moment, q=[w, x, y, z], w=top.rates(zero)[0].tolist(), axes=axes,
        epoch=f"{start.isoformat()} {given.scale}", end=float(given.times[-1]) + 1,
    )  # fmt: skip
    path = tmp_path / "top.aem"
    path.write_text(given.text())
    found = rigidsim.compare(rigidsim.parse(scene), path)
    assert found.attitude_error.largest < 1e-9
    assert found.rate_error is not None
    assert found.rate_error < 1e-9
    assert found.convention.direction == "body_to_space"

    shown: Any = open_any(path).dataset
    read = Rotation.from_quat(shown.quaternion.values[:, [1, 2, 3, 0]])
    assert (read.inv() * top.attitude(given.times)).magnitude().max() < 1e-12
    assert np.abs(shown.angular_velocity.values - top.rates(given.times)).max() < 1e-12
    assert shown.attrs["epoch"] == str(parse_epoch(f"{given.dates[0].isoformat()} {given.scale}"))

    (tmp_path / "top.toml").write_text(scene + FIT)
    fitted = rigidsim.fit(rigidsim.load(tmp_path / "top.toml"))
    assert [one.rms < 1e-9 for one in fitted.data] == [True, True]

    path.write_text(wrong_way(path.read_text()))
    assert rigidsim.compare(rigidsim.parse(scene), path).verdict != "agrees"
    (about,) = set(given.frames) & set(SPACE)
    path.write_text(given.text().replace(about, "MARS_IAU"))
    with pytest.raises(rigidsim.RigidsimError, match="attitudes and orbits about one of EME2000"):
        rigidsim.fit(rigidsim.load(tmp_path / "top.toml"))


def changed(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new)


WRONG = {
    "no direction": (changed("ATTITUDE_DIR = A2B\n", ""), "line 2: ATTITUDE_DIR is missing; allowed: A2B"),
    "a direction in version 2": (
        lambda text: text.replace("VERS = 1.0", "VERS = 2.0").replace("A2B", "B2A"),
        "line 2: ATTITUDE_DIR = B2A; allowed: A2B",
    ),
    "the scalar's place": (changed("QUATERNION_TYPE = LAST\n", ""), "line 2: QUATERNION_TYPE is missing"),
    "two frames of space": (changed("= SC_BODY_1", "= ICRF"), "one frame of space and one of the body"),
    "another clock": (changed("= TAI", "= MET"), "line 2: TIME_SYSTEM = MET; allowed: TDB, TT, TAI"),
    "no clock": (changed("TIME_SYSTEM = TAI\n", ""), "line 2: TIME_SYSTEM is missing; allowed"),
    "Z of another clock": (changed("00:02", "00:02Z"), "line 15: .*where the scale is TAI; name one"),
    "an unknown type": (changed("= QUATERNION\n", "= DCM\n"), "line 2: ATTITUDE_TYPE = DCM; allowed: QUAT"),
    "a number too few": (changed("2 0 0 0 1", "2 0 0 1"), "line 15: holds 3 numbers; 4 are needed: Q1"),
    "no number": (changed("2 0 0 0 1", "2 0 0 0 one"), "line 15: one of 0 0 0 one is no number"),
    "no date": (changed("2024-061T00:00:02", "2024-161T00:61:02"), "line 15: .*a date such as"),
    "a foreign line": (changed("DATA_STOP", "0 0 0 1"), 'line 17: "0 0 0 1"; a keyword with ='),
    "another object": (
        lambda text: text + text[text.index("META_START") :].replace("= TOP", "= CONE"),
        "segments of different objects or centres",
    ),
    "other frames": (
        lambda text: text + text[text.index("META_START") :].replace("EME2000", "LVLH"),
        "segments in different frames, EME2000, LVLH",
    ),
    "torn XML": (lambda text: "<aem>" + text, "is no XML"),
    "no rows": (lambda text: text[: text.index("2024-061")], "holds no data lines"),
}  # fmt: skip
PLAIN = """CCSDS_AEM_VERS = 1.0
META_START
OBJECT_NAME = TOP
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
ATTITUDE_DIR = A2B
TIME_SYSTEM = TAI
ATTITUDE_TYPE = QUATERNION
QUATERNION_TYPE = LAST
META_STOP
COMMENT nothing turns
DATA_START
2024-061T00:00:00 0 0 0 1
2024-061T00:00:01 0 0 0 1
2024-061T00:00:02 0 0 0 1
2024-061T00:00:03 0 0 0 1
DATA_STOP
"""


BLOCKS = {
    "QUATERNION": ("QUAT", "quaternionState"),
    "EULER_ANGLE": ("EULER", "eulerAngleState"),
    "SPIN": ("SPIN", "spin"),
}
OLD_ELEMENTS = {"eulerAngleState": "eulerElementsThree", "spin": "eulerElementsSpin"}


def apm(given: Aem) -> str:
    """A message of the first row: rates in a block of their own as the standard has them."""
    row, keys = {name: values[0] for name, values in given.numbers(given.times).items()}, given.keys()
    old, (attitude, _, rate) = given.version == 1, given.kind.partition("/")
    mark, element = BLOCKS[attitude]
    rng, numbers = given.rng, {name: repr(float(value)) for name, value in row.items()}
    frames = {key: keys[key] for key in ("REF_FRAME_A", "REF_FRAME_B")}
    turned = keys.get("EULER_ROT_SEQ", "")
    own = frames | ({"EULER_ROT_SEQ": turned} if turned else {})
    apart = [name for name in row if name.startswith("ANGVEL") or name.endswith("RATE")]
    inside = {name: text for name, text in numbers.items() if name not in apart}
    beside = {name: numbers[name] for name in apart}
    names = {key: value for key, value in keys.items() if key in ("OBJECT_NAME", "OBJECT_ID", "TIME_SYSTEM")}
    date = given.date(given.dates[0])
    blocks = [(mark, element, own, inside)]
    if rate == "ANGVEL":
        along = {"ANGVEL_FRAME": keys["ANGVEL_FRAME"]}
        if rng.integers(2):  # between the same frames, the other way
            other = dict(zip(frames, reversed(frames.values()), strict=True))
            letter = "AB".find(keys["ANGVEL_FRAME"][-1]) if keys["ANGVEL_FRAME"] in frames else -1
            along = along if letter < 0 else {"ANGVEL_FRAME": f"REF_FRAME_{'BA'[letter]}"}
            negative = {name: repr(-float(text)) for name, text in beside.items()}
            blocks.append(("ANGVEL", "angularVelocity", other | along, negative))
        else:
            blocks.append(("ANGVEL", "angularVelocity", frames | along, beside))
    if old:
        frame = keys.get("RATE_FRAME", "").replace("REF_FRAME", "EULER_FRAME")
        blocks = [(mark, element, own | {"REF_DIR": given.direction}, inside)]
        if rate == "RATE" and attitude == "EULER_ANGLE":
            blocks[0][2]["RATE_FRAME"] = frame
            inside |= beside
        elif rate == "RATE":
            about = frames | {"EULER_ROT_SEQ": "312", "REF_DIR": given.direction, "RATE_FRAME": frame}
            blocks.append(("EULER", "eulerElementsThree", about, beside))

    def renamed(key: str, mark: str) -> str:
        prefix = {"QUAT": "Q"}.get(mark, mark)
        return key.replace("REF_", f"{prefix}_") if old and mark != "ANGVEL" else key

    lines, elements = [], []
    for mark, element, about, texts in blocks:
        items = [(renamed(key, mark), value) for key, value in about.items()]
        if old and "ANGLE_1" in texts:  # named by their axes
            axes = ["XYZ"["123".index(n)] for n in turned]
            plain = [(f"{axis}_ANGLE", texts[f"ANGLE_{n}"]) for n, axis in enumerate(axes, 1)]
            plain += [(name, text) for name, text in texts.items() if not name.startswith("ANGLE_")]
        else:
            plain = list(texts.items())
        units = "" if rng.integers(2) or mark == "QUAT" else " [deg/s]"
        body = [f"{key} = {value}" for key, value in items]
        body += [f"{key} = {value}{units if 'ANGVEL' in key else ''}" for key, value in plain]
        lines += body if old else [f"{mark}_START", "COMMENT a block", *body, f"{mark}_STOP"]
        leaves = [f"<{key}>{value}</{key}>" for key, value in items]
        for key, value in plain:
            n = next(
                (n for n, x in enumerate(turned, 1) if old and key == f"{'XYZ'['123'.index(x)]}_ANGLE"), 0
            )
            leaves.append(
                f'<rotation{n} angle="{key}" units="deg">{value}</rotation{n}>'
                if n
                else f"<{key}>{value}</{key}>"
            )
        tag = OLD_ELEMENTS.get(element, element) if old else element
        elements.append(f"<{tag}>{''.join(leaves)}</{tag}>")
    if given.xml:
        about = "".join(f"<{key}>{value}</{key}>" for key, value in names.items())
        return (
            f'<apm id="CCSDS_APM_VERS" version="{given.version}.0"><body><segment>'
            f"<metadata>{about}</metadata><data><EPOCH>{date}</EPOCH>{''.join(elements)}<inertia><IXX>1</IXX></inertia></data></segment>"
            "</body></apm>"
        )
    head = [f"CCSDS_APM_VERS = {given.version}.0", *(f"{key} = {value}" for key, value in names.items())]
    tail = [] if old else ["MAN_START", "MAN_TOR_X = 1 [N*m]", "MAN_STOP", "MAN_START", "MAN_STOP"]
    return "\n".join([*head, f"EPOCH = {date}", *lines, *tail, ""])


@pytest.mark.parametrize("seed", seeds(2, 60))
def test_parameter_messages_are_starts_and_data(seed: int, tmp_path: Path) -> None:
    """Four APM a seed of both versions, in KVN and XML, with all types, directions, frames and clocks."""
    rng = np.random.default_rng(seed)
    for _ in range(4):
        given = Aem(rng)
        while given.version == 1 and len(set(given.sequence)) < 3:
            given = Aem(rng)
        path = tmp_path / "top.apm"
        path.write_text(apm(given))
        first = given.times[:1]
        columns = read_trajectory(path).columns
        read = Rotation.from_quat(np.stack([columns[name] for name in ("qx", "qy", "qz", "qw")], axis=1))
        assert (read.inv() * given.top.attitude(first)).magnitude()[0] < 1e-7, path.read_text()
        rates = "" if "wx" in columns else "angular_velocity = [0, 0, 1]"
        text = f'name = "top"\n[body]\nprincipal_moments = [1, 1, 1]\n[initial]\napm = "top.apm"\n{rates}\n'
        (tmp_path / "top.toml").write_text(f"{text}[time]\nend = 1\nsamples = 2\n[output]\ntimeline = false")
    begun = rigidsim.load(tmp_path / "top.toml")
    shown = rigidsim.run(begun, out=None).dataset
    read = Rotation.from_quat(np.roll(shown.quaternion.values[0], -1))
    assert (read.inv() * given.top.attitude(first)[0]).magnitude() < 1e-7
    if not rates:
        close = 1e-8 if "DERIVATIVE" in given.kind or "SPIN" in given.kind else 1e-12
        assert np.abs(shown.angular_velocity.values[0] - given.top.rates(first)[0]).max() < close
    assert shown.attrs["epoch"] == str(parse_epoch(f"{given.dates[0].isoformat()} {given.scale}"))


ORBIT = """
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 3.986004418e14
satellite_orbit = {semi_major_axis = 7e6, inclination = 0.9}
"""


@pytest.mark.parametrize("seed", seeds(2, 30))
def test_a_message_against_a_local_frame_is_a_start(seed: int, tmp_path: Path) -> None:
    """On a circle, at the node: axes and rate of the frame in closed form; all types and directions."""
    rng = np.random.default_rng(seed)
    given = Aem(rng)
    while given.version == 1 and len(set(given.sequence)) < 3:
        given = Aem(rng)
    space = next(one for one in given.frames if one in SPACE)
    named = str(rng.choice(["LVLH", "LVLH_ROTATING", "RSW_ROTATING", "RTN", "VVLH", "rsw rotating"]))
    (tmp_path / "top.apm").write_text(apm(given).replace(space, named))
    up, ahead, normal = np.eye(3)[0], np.array([0, np.cos(0.9), np.sin(0.9)]), [0, -np.sin(0.9), np.cos(0.9)]
    columns = [ahead, -np.array(normal), -up] if "V" in named else [up, ahead, np.array(normal)]
    known = Rotation.from_matrix(np.stack(columns, axis=1)) * given.top.attitude(given.times[:1])[0]
    rated = given.kind not in ("QUATERNION", "EULER_ANGLE")
    rates = given.top.rates(given.times[:1])[0] if rated else np.zeros(3)
    rates += known.inv().apply(np.sqrt(3.986004418e14 / 7e6**3) * np.array(normal))
    text = 'name = "top"\n[body]\nprincipal_moments = [1, 1, 1.4]\n[initial]\napm = "top.apm"\n'
    text += ("" if rated else "angular_velocity = [0, 0, 0]\n") + "[time]\nend = 1\nsamples = 2\n"
    (tmp_path / "top.toml").write_text(f"{text}[output]\ntimeline = false\nestimate = false\n{ORBIT}")
    shown = rigidsim.run(rigidsim.load(tmp_path / "top.toml"), out=None).dataset
    read = Rotation.from_quat(np.roll(shown.quaternion.values[0], -1))
    assert (read.inv() * known).magnitude() < 1e-7
    close = 1e-8 if "DERIVATIVE" in given.kind or "SPIN" in given.kind else 1e-12
    assert np.abs(shown.angular_velocity.values[0] - rates).max() < close
    fit = (
        '[fit]\nparameters = ["initial.attitude"]\n[[fit.data]]\nfile = "it.csv"\nobservable = "quaternion"\n'
    )
    rows = np.column_stack([shown.time, shown.quaternion])
    np.savetxt(tmp_path / "it.csv", rows, "%.17g", ",", header="time,qw,qx,qy,qz", comments="")
    (tmp_path / "top.toml").write_text((tmp_path / "top.toml").read_text() + f"{fit}sigma = 1e-6\n")
    with unoptimised_code():
        found = rigidsim.fit(rigidsim.load(tmp_path / "top.toml"))
    assert np.abs([one.value for one in found.parameters]).max() < 1e-8
    ours = "rsw" if "V" in named else "lvlh"
    other = (tmp_path / "top.toml").read_text().replace("apm =", f'relative_to = "{ours}"\napm =')
    (tmp_path / "top.toml").write_text(other)
    with pytest.raises(rigidsim.ConfigError, match=f'relative_to: given "{ours}", but top.apm is against'):
        rigidsim.run(rigidsim.load(tmp_path / "top.toml"), out=None)


def test_a_fit_begins_at_a_message(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    given, late = Aem(rng, "QUATERNION/ANGVEL"), Rotation.from_rotvec([1e-3, -2e-3, 1e-3])
    given.xml = given.of_source = False
    top, times = given.top, np.linspace(0, 5, 20)
    top.spin = top.nutation * np.cos(top.tilt) * (1 / 1.4 - 1)
    (tmp_path / "top.apm").write_text(apm(given))
    begun = top.attitude(given.times[:1])
    turned = begun * late * begun.inv() * top.attitude(given.times[0] + times)
    rows = np.column_stack([times, np.roll(turned.as_quat(), 1, axis=1)])
    np.savetxt(tmp_path / "it.csv", rows, delimiter=",", header="time,qw,qx,qy,qz", comments="")
    (tmp_path / "top.toml").write_text(
        'name = "top"\n[body]\nprincipal_moments = [1, 1, 1.4]\n[initial]\napm = "top.apm"\n[time]\nend = 6\n'
        'samples = 2\n[fit]\nparameters = ["initial.attitude", "initial.angular_velocity"]\n[[fit.data]]\n'
        'file = "it.csv"\nobservable = "quaternion"\nsigma = 1e-6\n'
    )
    with pytest.raises(rigidsim.ConfigError, match=r"initial\.angular_velocity"):  # which the message gives
        rigidsim.fit(rigidsim.load(tmp_path / "top.toml"))
    text = (tmp_path / "top.toml").read_text().replace(', "initial.angular_velocity"', "")
    (tmp_path / "top.toml").write_text(text)
    found = rigidsim.fit(rigidsim.load(tmp_path / "top.toml"))
    assert [one.value for one in found.parameters] == pytest.approx([1e-3, -2e-3, 1e-3], abs=1e-9)


STATE = """CCSDS_APM_VERS = 1.0
TIME_SYSTEM = TAI
EPOCH = 2024-061T00:00:00
EULER_FRAME_A = EME2000
EULER_FRAME_B = SC_BODY_1
EULER_DIR = A2B
EULER_ROT_SEQ = 312
Z_ANGLE = 10 [deg]
X_ANGLE = 20
Y_ANGLE = 30
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("10 [deg]", "10 [rad]", r"line 8: Z_ANGLE in \[rad\]; allowed: deg"),
        ("= 312", "= 313", "EULER_ROT_SEQ = ZXZ, of whose angles two would have one name"),
        ("Y_ANGLE", "X_ANGLE", "X_ANGLE is there twice; leave one of them"),
        ("Z_ANGLE = 10 [deg]\nX_ANGLE = 20\nY_ANGLE = 30\n", "", "it has no attitude; a quaternion"),
        ("Y_ANGLE = 30\n", "", "has no ANGLE_3, which is needed"),
        ("EULER_DIR = A2B\n", "", "ATTITUDE_DIR is missing; allowed: A2B, B2A"),
        ("EME2000", "ITRF-97", "its attitude is against ITRF-97; allowed: EME2000, GCRF, ICRF"),
        ("Y_ANGLE = 30", "Y_ANGLE 30", 'line 10: "Y_ANGLE 30"; a keyword with = is allowed'),
        ("Y_ANGLE = 30", "Y_ANGLE = 30", "has no rates; give angular_velocity"),
    ],
)
def test_a_message_that_is_no_start_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "top.apm").write_text(STATE.replace(old, new))
    (tmp_path / "top.toml").write_text(
        'name = "top"\n[body]\nprincipal_moments = [1, 1, 1]\n[initial]\napm = "top.apm"\n[time]\nend = 1'
    )
    with pytest.raises(rigidsim.ConfigError, match=message):
        rigidsim.run(rigidsim.load(tmp_path / "top.toml"), out=None)


@pytest.mark.parametrize("seed", seeds(2, 60))
def test_messages_of_all_types_are_written(seed: int, tmp_path: Path) -> None:
    """An AEM and an APM, read word by word."""
    rng = np.random.default_rng(seed)
    top, axes = Top(rng), str(rng.choice(["EME2000", "ecliptic J2000"]))
    x, y, z, w = top.attitude(np.zeros(1)).as_quat()[0].tolist()
    scale, clock = rng.choice(["TAI", "UTC", "GPS", "TT"], 2)
    scene = SCENE.format(
        c=1.5, q=[w, x, y, z], w=top.rates(np.zeros(1))[0].tolist(), axes=axes,
        epoch=f"2024-03-01T00:00:00.25 {scale}", end=6.0,
    ).replace("samples = 2", "samples = 13")  # fmt: skip
    run = rigidsim.run(rigidsim.parse(scene), out=tmp_path)
    kinds = ["quaternion", "quaternion/derivative", "quaternion/angvel", "euler_angle/angvel", "spin"]
    kind, old = str(rng.choice(kinds)), bool(rng.integers(2))
    sequence, source = str(rng.choice(SEQUENCES)).lower(), str(rng.choice(["space", "body"]))
    source = "space" if kind == "spin" else source
    options = {"type": kind, "sequence": sequence, "from": source, "time": str(clock)}
    own = {"aem": {"segment": "2 s", "version": "1" if old else "2"}, "apm": {}}
    naming = {n: Naming(message=options | m) for n, m in own.items()}
    [aem] = rigidsim.export(run, "aem", tmp_path / "top.aem", naming=naming["aem"])
    [one] = rigidsim.export(run, "apm", tmp_path / "top.apm", naming=naming["apm"])
    dataset = run.dataset
    turn = Rotation.from_euler("x", OBLIQUITY if axes.startswith("ecl") else 0.0)
    body = turn * Rotation.from_quat(np.roll(dataset.quaternion.values, -1, axis=1))
    lead, rates = (body, dataset.angular_velocity.values) if source == "space" else (
        body.inv(), -dataset.angular_velocity.values
    )  # fmt: skip
    text = aem.read_text()
    assert text.count("META_START") == 3
    said = dict(line.split(" = ") for line in text.splitlines() if " = " in line)
    assert said["CCSDS_AEM_VERS"] == ("1.0" if old else "2.0")
    assert (said.get("ATTITUDE_DIR"), said.get("QUATERNION_TYPE")) == (
        ("A2B" if old else None, "LAST" if old and kind.startswith("q") else None)
    )
    assert said["ATTITUDE_TYPE"] == kind.upper().replace("ANGVEL", "RATE" if old else "ANGVEL")
    if kind.startswith("euler"):
        numbered = sequence.translate(str.maketrans("xyz", "123"))
        assert said["EULER_ROT_SEQ"] == (numbered if old else sequence.upper())
    if kind.endswith("angvel"):
        along = said[said["RATE_FRAME"]] if old else said["ANGVEL_FRAME"]
        assert along == "SC_BODY_1"
    rows = {
        line.split()[0]: [float(x) for x in line.split()[1:]]
        for line in text.splitlines()
        if line[:2] == "20"
    }
    assert len(rows) == 13
    zero = parse_epoch(f"2024-03-01T00:00:00.25 {scale}")
    for n, (date, row) in enumerate(rows.items()):
        assert parse_epoch(date, str(clock)).since(zero) == n / 2
        numbers = np.array(row)
        if kind.startswith("euler"):
            written = Rotation.from_euler(sequence.upper(), numbers[:3], degrees=True)
        elif kind == "spin":
            written = Rotation.from_euler("ZXZ", numbers[:3] * [1, -1, 1] + [90, 90, 0], degrees=True)
            assert np.radians(numbers[3]) == pytest.approx(rates[n][2], abs=1e-15)
        else:
            written = Rotation.from_quat(numbers[:4])
        assert (written.inv() * lead[n]).magnitude() < 1e-14
        if kind.endswith("angvel"):  # along body axes
            assert np.abs(np.radians(numbers[-3:]) - rates[n]).max() < 1e-15
        if kind.endswith("derivative"):
            x, y, z, w = numbers[:4]
            target = rates[n] if source == "space" else body[n].apply(rates[n])
            change = 0.5 * np.append(w * target + np.cross([x, y, z], target), -np.dot([x, y, z], target))
            assert np.abs(numbers[4:] - change).max() < 1e-15
    keys = dict(line.split(" = ") for line in one.read_text().splitlines() if " = " in line)
    names = ["ANGLE_1", "ANGLE_2", "ANGLE_3"] if kind.startswith("euler") else ["Q1", "Q2", "Q3", "QC"]
    if kind == "spin":
        names = ["SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", "SPIN_ANGLE_VEL"]
    assert [float(keys[name]) for name in names] == numbers[: len(names)].tolist()
    assert keys["EPOCH"] == date
    ends = [keys["REF_FRAME_A"], keys["REF_FRAME_B"]]
    assert ends == ["EME2000", "SC_BODY_1"][:: 1 if source == "space" else -1]


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_read_is_refused_with_its_line(name: str, tmp_path: Path) -> None:
    change, message = WRONG[name]
    path = tmp_path / "top.aem"
    path.write_text(PLAIN)
    assert read_trajectory(path).row(2) == "line 15"
    path.write_text(change(PLAIN))
    with pytest.raises(rigidsim.RigidsimError, match=message):
        read_trajectory(path)


def test_one_segment_of_a_message_is_fitted_and_shown(tmp_path: Path) -> None:
    """Of two segments, the second belongs to another motion."""
    path = tmp_path / "top.aem"
    given = Aem(np.random.default_rng(4), "QUATERNION")
    given.xml, given.segments, given.scale, given.version = False, 1, "TAI", 2
    given.frames, given.from_space = ["EME2000", "SC_BODY_1"], True
    given.times = np.linspace(0, 6, 13)
    given.dates = [datetime(2024, 3, 1) + timedelta(seconds=float(t)) for t in given.times]
    top = given.top
    top.spin = top.nutation * np.cos(top.tilt) * (1 / 1.4 - 1)
    x, y, z, w = top.attitude(np.zeros(1)).as_quat()[0].tolist()
    scene = SCENE.format(c=1.4, q=[w, x, y, z], w=top.rates(np.zeros(1))[0].tolist(), axes="EME2000",
                         epoch="2024-03-01T00:00:00 TAI", end=7.0)  # fmt: skip
    other = given.text()[given.text().index("META_START") :].replace("2024-03-01", "2024-03-02")
    path.write_text(given.text().replace("-061T", "-03-01T") + other.replace("-061T", "-062T"))
    fit = '[fit]\nparameters = ["initial.attitude"]\n[[fit.data]]\nfile = "top.aem"\nsegment = "1"\n'
    (tmp_path / "top.toml").write_text(scene + fit + 'observable = "quaternion"\nsigma = 1e-6\n')
    with unoptimised_code():
        [data] = rigidsim.fit(rigidsim.load(tmp_path / "top.toml")).data
    assert (data.rows, data.rms < 1e-9) == (13, True)
    assert open_any(f"{path}#2024-03-01T00:00:01").dataset.sizes["time"] == 13
    for name, message in {
        "top.aem#3": "given segment 3 of a message with 2 segments; 1 to 2 is allowed",
        "top.aem#2024-03-01T01:00:00": "which is in none; its 2 segments: 2024-03-01T00:00:00",
        "top.aem#last": "given the segment 'last'; a number from 1 is allowed, or a date",
        "it.csv#2": "given segment 2, which an AEM or OEM alone has; remove it",
    }.items():
        (tmp_path / "it.csv").write_text("t,qw,qx,qy,qz\n0,1,0,0,0\n1,1,0,0,0\n")
        with pytest.raises(rigidsim.RigidsimError, match=message):
            rigidsim.compare(rigidsim.parse(scene), tmp_path / name)


def test_a_row_that_ends_a_segment_and_begins_the_next_counts_once(tmp_path: Path) -> None:
    path = tmp_path / "top.aem"
    path.write_text(
        PLAIN + PLAIN[PLAIN.index("META_START") :].replace("T00:00:0", "T00:00:1").replace("10 0", "03 0")
    )
    found = read_trajectory(path)
    assert len(found.epochs) == 7
    assert (found.row(3), found.row(4)) == ("line 16", "line 30")
    assert "first row, at the time of the row before, was left out" in found.notes[0]
