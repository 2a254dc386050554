"""Starts against the local frame of an orbit: axes and their turning by differences of own formulas, with
SciPy's rotations for the sequences.
"""

import random
from pathlib import Path

import mpmath
import numpy as np
import pytest
from kepler import on_ellipse, turned
from scipy.spatial.transform import Rotation
from support import config, loaded, run_text, seeds, unoptimised_code

import rigidsim

mp = mpmath.mp.clone()
mp.prec = 200
GM, J2, RADIUS = "3.986004418e14", 1.08e-3, 6378137
SEQUENCES = ["xyx", "xzx", "yxy", "yzy", "zxz", "zyz", "xyz", "xzy", "yxz", "yzx", "zxy", "zyx"]
BODY = "principal_moments = [0.01, 0.02, 0.025]\nmass = 4"


def crossed(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(v):
    return [x / mp.sqrt(mp.fdot(v, v)) for x in v]


def kepler(draw):
    """The config's lines, and the satellite's place and its plane's normal over time."""
    a, e = draw.uniform(6.8e6, 5e7), draw.choice([0, draw.uniform(0, 0.7)])
    angles = [draw.uniform(0, 3), *(draw.uniform(0, 6) for _ in range(3))]
    rates = [draw.choice([0, draw.uniform(-1e-5, 1e-5)]) for _ in range(2)]
    names = ("inclination", "ascending_node", "periapsis", "mean_anomaly", "node_rate", "periapsis_rate")
    pairs = zip(names, [*angles, *rates], strict=True)
    table = ", ".join(f"{name} = {value!r}" for name, value in pairs)
    load = f'kind = "gravity_gradient"\ngravitational_parameter = {GM}\n'
    load += f"satellite_orbit = {{semi_major_axis = {a!r}, eccentricity = {e!r}, {table}}}"
    axis, e, tilt, node, periapsis, mean, *rates = map(mp.mpf, (a, e, *angles, *rates))

    def at(t):
        found = mean + mp.sqrt(mp.mpf(GM) / axis**3) * t
        vectors = [on_ellipse(mp, axis, e, found), [0, 0, 1]]
        turns = (periapsis + rates[1] * t, 3), (tilt, 1), (node + rates[0] * t, 3)
        return [turned(mp, v, *turns) for v in vectors]

    if not draw.randrange(3):
        columns = "semi_major_axis", "eccentricity", *names[:4]
        rows = [
            (t, float(axis), float(e), angles[0], angles[1] + float(rates[0]) * t,
             angles[2] + float(rates[1]) * t, angles[3] + float(mp.sqrt(mp.mpf(GM) / axis**3)) * t)
            for t in range(-600, 601, 15)
        ]  # fmt: skip
        lines = [", ".join(("time", *columns)), *(", ".join(map(repr, row)) for row in rows)]
        load = load[: load.index("satellite_orbit")] + 'satellite_orbit = {table = "it.csv"}\n'
        load += '[tables."it.csv"]\ntext = """\n' + "\n".join(lines) + '\n"""'
    return "", load, at


def masses(draw):
    """The same of one of three point masses, about the first of the others."""
    generator = np.random.default_rng(draw.randrange(10**9))
    strengths, places = [1e13, 4e14, 5e13], generator.normal(size=(3, 3)) * 1e8
    speeds = generator.normal(size=(3, 3)) * 1e3
    bodies = "".join(
        f'[[bodies]]\nname = "{name}"\ngravitational_parameter = {strength}\nposition = {place.tolist()}\n'
        f"velocity = {speed.tolist()}\n"
        for name, strength, place, speed in zip("abc", strengths, places, speeds, strict=True)
    )
    load = f'kind = "gravity_gradient"\norbit = {{body = "b"}}\n{bodies}'
    r, v = ([[mp.mpf(x) for x in row] for row in rows.tolist()] for rows in (places, speeds))

    def pull(n):
        found = [mp.zero] * 3
        for k in {0, 1, 2} - {n}:
            apart = [x - y for x, y in zip(r[k], r[n], strict=True)]
            size = strengths[k] / mp.sqrt(mp.fdot(apart, apart)) ** 3
            found = [x + size * y for x, y in zip(found, apart, strict=True)]
        return found

    r, v, a = ([x - y for x, y in zip(pair[0], pair[1], strict=True)] for pair in (r, v, (pull(0), pull(1))))
    return "", load, moving(r, v, a)


def moving(r, v, a):
    """Place and normal of a motion by its first terms."""

    def at(t):
        there = [x + t * y + t * t / 2 * z for x, y, z in zip(r, v, a, strict=True)]
        return there, crossed(there, [y + t * z for y, z in zip(v, a, strict=True)])

    return at


def flight(draw):
    """The same of a body that flies about an oblate Earth, by the acceleration at the start."""
    generator = np.random.default_rng(draw.randrange(10**9))
    r = generator.normal(size=3)
    r *= draw.uniform(6.8e6, 1e7) / np.linalg.norm(r)
    v = np.cross(generator.normal(size=3), r)
    v *= draw.uniform(6e3, 9e3) / np.linalg.norm(v)
    v += 0.1 * r / np.linalg.norm(r)
    load = f'kind = "central_gravity"\ngravitational_parameter = {GM}\n'
    load += f"figure = {{J2 = {J2}, radius = {RADIUS}, pole = [0, 0, 1]}}"
    r, v = ([mp.mpf(float(x)) for x in vector] for vector in (r, v))
    far, mu = mp.sqrt(mp.fdot(r, r)), mp.mpf(GM)
    size = mp.mpf(str(J2)) * 3 / 2 * (RADIUS / far) ** 2
    bulge = [size * (k - 5 * r[2] ** 2 / far**2) for k in (1, 1, 3)]
    pull = [-mu / far**3 * x * (1 + more) for x, more in zip(r, bulge, strict=True)]

    lines = "position = [{}, {}, {}]\nvelocity = [{}, {}, {}]\n".format(*(repr(float(x)) for x in (*r, *v)))
    return lines, load, moving(r, v, pull)


def axes(word, place, normal):
    """Of the frame, as columns."""
    up, normal = unit(place), unit(normal)
    if word == "ned":
        east = unit(crossed([0, 0, 1], up))
        return [crossed(up, east), east, [-x for x in up]]
    if word in ("lvlh", "vvlh"):
        right, down = ([-x for x in v] for v in (normal, up))
        return [crossed(right, down), right, down]
    return [up, crossed(normal, up), normal]


@pytest.mark.parametrize("seed", seeds(3, 60))
def test_attitude_and_rates_count_from_the_frame(seed: int) -> None:
    draw = random.Random(seed)
    word, sequence = draw.choice(["lvlh", "lvlh", "vvlh", "rsw", "rtn", "ric", "ned"]), draw.choice(SEQUENCES)
    lines, load, at = draw.choice([kepler, kepler, flight, masses])(draw)
    angles = [draw.uniform(-3, 3), draw.uniform(0.2, 1.3), draw.uniform(-3, 3)]
    rates = [draw.uniform(-1e-2, 1e-2) for _ in range(3)]
    lines += f'relative_to = "{word}"\neuler_angles = {angles}\nangular_velocity = {rates}'
    text = config(
        body=BODY + '\nhost = "a"' * ("[[bodies]]" in load), initial=lines, loads=load,
        time="end = 1\nsamples = 2",
        integrator=f'euler_sequence = "{sequence}"\nprecision = "{draw.choice(["double", "quadruple"])}"',
        output='record = ["quaternion", "angular_velocity", "roll_pitch_yaw"]',
    )  # fmt: skip
    with unoptimised_code():
        made = run_text(text)
    dataset, start = loaded(made), made.summary["start"]
    assert start["relative_euler_angles_deg"] == pytest.approx(np.degrees(angles), abs=1e-12)
    frame = np.array([[float(x) for x in axis] for axis in axes(word, *at(mp.zero))]).T
    slopes = [mp.diff(lambda t, n=n: axes(word, *at(t))[n // 3][n % 3], 0) for n in range(9)]
    change = np.array(list(map(float, slopes))).reshape(3, 3).T
    turning = frame.T @ change  # of the frame about its own axes, as a tensor
    relative = Rotation.from_euler(sequence.upper(), angles)
    expected = rates + relative.inv().apply([turning[2, 1], turning[0, 2], turning[1, 0]])
    found = Rotation.from_quat(np.roll(dataset.quaternion.values[0], -1))
    assert (found.inv() * Rotation.from_matrix(frame) * relative).magnitude() < 1e-14
    # the body's own extent pulls it aside by 1e-16 of the rate; angles in tables are doubles, and count
    # (1 - e)^-3 times
    assert np.abs(dataset.angular_velocity.values[0] - expected).max() < 4e-14 * np.abs(expected).max()
    if word in ("lvlh", "vvlh"):
        yaw, pitch, roll = relative.as_euler("ZYX")
        assert dataset.roll_pitch_yaw.values[0] == pytest.approx([roll, pitch, yaw], abs=2e-14)


ATTRACTION = f'kind = "gravity_gradient"\ngravitational_parameter = {GM}\n'
REST = ATTRACTION + 'satellite_orbit = {semi_major_axis = "7000 km", eccentricity = 0.2, inclination = 0.9}'
START = 'relative_to = "lvlh"\neuler_angles = [0.3, 0.8, 0.5]\nangular_velocity = [0, 0.001, 0]'
FALL = START + "\nposition = [7e6, 0, 0]\nvelocity = [10, 0, 0]"


def test_all_digits_of_the_precision_are_in_the_rates() -> None:
    with unoptimised_code():
        dataset = loaded(run_text(config(
            body=BODY, initial='relative_to = "lvlh"\nangular_velocity = [0, 0, 0]', loads=REST,
            time="end = 1\nsamples = 2", integrator='precision = "quadruple"',
            output='record = ["angular_velocity"]',
        )))  # fmt: skip
    found = dataset.angular_velocity.values[0], dataset.angular_velocity_lo.values[0]
    a, e = mp.mpf(7000000), mp.mpf("0.2")  # at the pericentre
    expected = -mp.sqrt(mp.mpf(GM) / a**3) * mp.sqrt(1 - e * e) / (1 - e) ** 2
    assert abs(mp.mpf(found[0][1]) + mp.mpf(found[1][1]) - expected) < 1e-31 * abs(expected)
    assert not found[0][[0, 2]].any()


@pytest.mark.slow
@pytest.mark.unoptimised
def test_numbers_stay_relative_where_they_are_varied(tmp_path: Path) -> None:
    """Derivatives, a sweep and a fit, against starts with other numbers."""

    def text(phi=0.3, psi=0.5, output="", more=""):
        start = START.replace("0.3", repr(phi)).replace("0.5", repr(psi))
        return config(
            body=BODY, initial=start, loads=REST, time="end = 40\nsamples = 3", output=output, more=more
        )

    def slope(key):
        ahead, behind = (
            loaded(run_text(text(**{key: value + step}))).angular_velocity.values
            for value in ({"phi": 0.3, "psi": 0.5}[key],)
            for step in (1e-4, -1e-4)
        )
        return (ahead - behind) / 2e-4

    keys = 'sensitivity = ["initial.euler_angles[0]", "initial.attitude[2]"]\nrecord = ["angular_velocity"]'
    swept = '[sweep]\nkeep = ["final"]\naxes."initial.euler_angles[0]" = {values = [0.3, 0.31]}'
    fitted = '[fit]\nparameters = ["initial.attitude", "initial.angular_velocity"]\n[[fit.data]]\n'
    fitted += 'file = "it.csv"\nobservable = "quaternion"\ncolumns = ["qw", "qx", "qy", "qz"]\nsigma = 1e-6'
    with unoptimised_code():
        found = loaded(run_text(text(output=keys))).angular_velocity_sensitivity.values
        for n, key in enumerate(("phi", "psi")):  # in the sequence zxz psi turns about body z
            expected = slope(key)
            assert np.abs(found[:, n] - expected).max() < 1e-7 * np.abs(expected).max()
        moved = loaded(run_text(text(phi=0.31)))
        members = rigidsim.sweep(rigidsim.parse(text(more=swept)), out=tmp_path)
        final = loaded(members).angular_velocity_final.values
        assert np.abs(final[1] - moved.angular_velocity.values[-1]).max() < 1e-14
        rows = np.column_stack([moved.time, moved.quaternion])
        np.savetxt(tmp_path / "it.csv", rows, delimiter=",", header="time,qw,qx,qy,qz", comments="")
        (tmp_path / "it.toml").write_text(text(more=fitted))
        fit = rigidsim.fit(tmp_path / "it.toml")
    rates = [one.value for one in fit.parameters[3:]]
    assert rates == pytest.approx([0, 0.001, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("initial", "load", "said"),
    [
        (START, "", 'given "lvlh", but no load has a source that the body goes round; give'),
        (START, f"{ATTRACTION}position = [7e6, 0, 0]", "no load has a source that the body goes round"),
        (START, f'{ATTRACTION}ephemeris = "sun"', "how its source moves isn't known"),
        (START.replace("lvlh", "lvhl"), REST, "did you mean"),
        (START.replace("velocity", "momentum"), REST, "angular_momentum: given with relative_to"),
        ('relative_to = "rsw"\nequilibrium = "relative"', REST, "equilibrium: given with relative_to"),
        (FALL, ATTRACTION.replace("gravity_gradient", "central_gravity"), "the normal of the orbit"),
    ],
)  # fmt: skip
def test_starts_without_a_frame_are_refused(initial: str, load: str, said: str) -> None:
    epoch = '\nepoch = "J2000"' if "ephemeris" in load else ""
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(config(body=BODY, initial=initial, loads=load, time=f"end = 1\nsamples = 2{epoch}"))
    assert said in str(caught.value)
