"""Tables of the planets' orbits, against DOP853 and the ephemeris from which they start."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import cases

import rigidsim
from rigidsim.workflows import orbits
from rigidsim.workflows.orbits import PLANETS, write_orbits

here = pytest.mark.skipif(
    find_spec("rebound") is None or find_spec("numba") is None, reason="needs rigidsim[orbits]"
)
AU, LIGHT, TILT = 149597870.7, 299792.458, np.radians(84381.406 / 3600)
YEAR = 365.25
FAMILY = ["sun", *PLANETS]


@pytest.fixture(scope="module")
def bodies() -> tuple[np.ndarray, np.ndarray]:
    """G M, and places with velocities at J2000, au and days, ecliptic, by jplephem."""
    de421 = pytest.importorskip("de421")
    jplephem = pytest.importorskip("jplephem")
    kernel = jplephem.Ephemeris(de421)
    names = {"earth": "earthmoon"}
    turn = np.array(
        [[1, 0, 0], [0, np.cos(TILT), np.sin(TILT)], [0, -np.sin(TILT), np.cos(TILT)]]
    )  # from the equator to the ecliptic
    state = []
    for name in FAMILY:
        place, velocity = kernel.position_and_velocity(names.get(name, name), 2451545.0)
        state.append([turn @ place.ravel() / AU, turn @ velocity.ravel() / AU])
    strengths = [
        kernel.GMS,
        kernel.GM1,
        kernel.GM2,
        kernel.GMB,
        *(getattr(kernel, f"GM{n}") for n in range(4, 9)),
    ]
    return np.array(strengths), np.array(state)


def elements(state: np.ndarray, strengths: np.ndarray, body: int) -> np.ndarray:
    """Eccentricity, inclination, node and longitude of perihelion, about the Sun."""
    place, velocity = state[body] - state[0]
    momentum, mu = np.cross(place, velocity), strengths[0] + strengths[body]
    e = np.cross(velocity, momentum) / mu - place / np.linalg.norm(place)
    x, y, z = momentum / np.linalg.norm(momentum)
    node = np.arctan2(x, -y)
    across = np.cross([x, y, z], [np.cos(node), np.sin(node), 0])
    argument = np.arctan2(e @ across, e @ [np.cos(node), np.sin(node), 0])
    return np.array([np.linalg.norm(e), np.arccos(z), node, node + argument])


def slopes(_: float, flat: np.ndarray, strengths: np.ndarray) -> np.ndarray:
    """Newton's gravity, the relativistic potential of the Sun, and the quadrupole of Earth and Moon."""
    place, velocity = flat.reshape(2, 9, 3)
    apart = place[None] - place[:, None]
    far = np.linalg.norm(apart, axis=2) + np.eye(9)
    pull = (strengths[None, :, None] * apart / far[:, :, None] ** 3).sum(axis=1)
    for body in range(1, 9):
        along, r = apart[0, body], far[0, body]
        more = 6 * strengths[0] ** 2 / (LIGHT / AU * 86400) ** 2 / r**4
        if FAMILY[body] == "earth":
            share = 81.30057 / 82.30057**2 * (384400 / AU) ** 2
            more += 0.75 * 0.8525 * strengths[0] * share / r**5
        pull[body] -= more * along
        pull[0] += more * along * strengths[body] / strengths[0]
    return np.concatenate([velocity, pull]).ravel()


def rows(path: Path) -> np.ndarray:
    lines = [line for line in path.read_text().splitlines() if line[0] in "-0123456789"]
    found = np.array([list(map(float, line.split(","))) for line in lines])
    found[:, 2:] = np.radians(found[:, 2:])
    return found


@here
@pytest.mark.parametrize("sign", cases([-1, 1], [-1]))
def test_elements_are_those_of_another_integrator(
    bodies: tuple[np.ndarray, np.ndarray], tmp_path: Path, sign: int
) -> None:
    strengths, state = bodies
    found = write_orbits(PLANETS, f"{sign * 2} yr", every="1 yr", window=0, out=tmp_path)
    assert found.complete
    start = state.transpose(1, 0, 2)
    start = start - (strengths @ start.transpose(1, 0, 2).reshape(9, 6) / strengths.sum()).reshape(2, 1, 3)
    for planet in PLANETS:
        table = rows(tmp_path / f"{planet}.csv")
        np.testing.assert_array_equal(table[:, 0], sign * np.arange(-3.0, 6))
    end = sign * 2 * YEAR
    late = solve_ivp(slopes, [0, end], start.ravel(), "DOP853", args=(strengths,), rtol=1e-12, atol=1e-14).y[
        :, -1
    ]
    for moment, row in ((start, 3), (late.reshape(2, 9, 3), 5)):
        for body, planet in enumerate(PLANETS, 1):
            got = rows(tmp_path / f"{planet}.csv")[row, 1:]
            known = elements(moment.transpose(1, 0, 2), strengths, body)
            ahead = np.abs(np.exp(1j * got[2:]) - np.exp(1j * known[2:]))
            assert np.abs(got[:2] - known[:2]).max() < 2e-9, planet
            assert ahead[0] * np.sin(known[1]) < 2e-9
            assert ahead[1] * known[0] < 2e-9


@here
@pytest.mark.slow
@pytest.mark.unoptimised
def test_rows_are_averages_with_weights_of_hann(tmp_path: Path) -> None:
    (tmp_path / "mean").mkdir()
    write_orbits(["saturn"], "-20000 day", every="500 day", window=0, out=tmp_path)
    write_orbits(["saturn"], "-20000 day", every="5000 day", window="10000 day", out=tmp_path / "mean")
    fine, means = rows(tmp_path / "saturn.csv"), rows(tmp_path / "mean" / "saturn.csv")
    weights = np.hanning(23)[1:-1] / np.hanning(23).sum()
    turning = fine[:, 1] * np.exp(1j * fine[:, 4]), np.sin(fine[:, 2] / 2) * np.exp(1j * fine[:, 3])
    at = int(np.flatnonzero(np.isclose(fine[:, 0] * YEAR, -10000))[0])
    perihelion, node = ((x[at - 10 : at + 11] * weights).sum() for x in turning)
    mean = means[np.isclose(means[:, 0] * YEAR, -10000)][0]
    expected = [abs(perihelion), 2 * np.arcsin(abs(node)), np.angle(node), np.angle(perihelion)]
    np.testing.assert_allclose(mean[1:], expected, rtol=0, atol=1e-9)


@here
def test_a_scene_reads_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_orbits(["mars"], "-400 yr", every="100 yr", window=0)
    Path("mars.toml").write_text(
        'name = "mars"\n[body]\npreset = "mars"\n[initial]\neuler_angles = [0, "25 deg", 0]\n'
        'angular_velocity = [0, 0, "7.088e-5 rad/s"]\n[[loads]]\nkind = "gravity_gradient"\n'
        'gravitational_parameter = "1.327e20 m^3/s^2"\n'
        'satellite_orbit = {table = "mars.csv", semi_major_axis = "1.5237 au"}\n[model]\n'
        'level = "orbit_averaged"\norder = 1\nstart = "mean"\n[time]\nend = "-400 yr"\nsamples = 3\n'
        '[output]\ntimeline = false\nestimate = false\nrecord = ["orbit_eccentricity"]\n'
    )
    found = rigidsim.run("mars.toml", out=None).dataset.orbit_eccentricity.values
    np.testing.assert_allclose(found, rows(Path("mars.csv"))[[3, 5, 7], 1], rtol=0, atol=1e-10)


@here
def test_interrupted_tables_are_continued_with_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"planets": ["earth", "mars"], "end": "-400 yr", "every": "20 yr", "window": "50 yr"}
    (tmp_path / "whole").mkdir()
    whole = write_orbits(**asked, out=tmp_path / "whole")
    left_text, rows_left = orbits.left_text, [0]

    def until_ctrl_c(*given: float) -> str:
        rows_left[0] -= 1
        if not rows_left[0]:
            raise KeyboardInterrupt
        return left_text(*given)

    monkeypatch.setattr(orbits, "left_text", until_ctrl_c)
    for seconds, rows_left[0] in ((0.0, 2), (1e9, 3), (0.0, 9)):  # the second loses its rows again
        monkeypatch.setattr(orbits, "SAVED_EVERY", seconds)
        assert not write_orbits(**asked, out=tmp_path, resume=True).complete
    assert len(rows(tmp_path / "mars.csv")) == 11
    for more, says in (
        ({}, "--resume|resume=True"),
        ({"every": "10 yr", "resume": True}, "was begun with every 20 yr, given 10 yr"),
    ):
        with pytest.raises(rigidsim.RigidsimError, match=says):
            write_orbits(**(asked | more), out=tmp_path)
    found = write_orbits(**asked, out=tmp_path, resume=True)
    assert (found.rows, found.axes, found.complete) == (whole.rows, whole.axes, True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["earth.csv", "mars.csv", "whole"]
    for name in ("earth.csv", "mars.csv"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


REFUSED = {
    "plutoid": ({"planets": ["plutoid"]}, 'given "plutoid"; allowed: mercury'),
    "eart": ({"planets": ["eart"]}, 'did you mean "earth"?'),
    "no time": ({"end": 0}, "a time other than J2000"),
    "unit": ({"end": "-1 kg"}, "--end: "),
    "rows": ({"every": "-1 kyr"}, "positive lengths of time are allowed"),
    "window": ({"window": "-1 kyr"}, "a window of 0 for osculating elements"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_orbit_is_refused(case: str, tmp_path: Path) -> None:
    given, says = REFUSED[case]
    with pytest.raises(rigidsim.RigidsimError) as caught:
        write_orbits(**({"planets": ["earth"], "end": "-1 kyr", "out": tmp_path} | given))
    assert says in str(caught.value)


@here
@pytest.mark.parametrize(
    ("kernel", "says"), [("de999", "which is no installed package"), ("./x.bsp", "isn't there")]
)
def test_a_kernel_that_does_not_suffice_is_refused(kernel: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(rigidsim.RigidsimError, match="--kernel: given") as caught:
        write_orbits(["earth"], "-1 kyr", kernel=kernel, out=tmp_path)
    assert says in str(caught.value)


@pytest.mark.skipif(find_spec("rebound") is not None, reason="REBOUND is there")
def test_without_rebound_it_says_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(rigidsim.RigidsimError, match=r'pip install "rigidsim\[orbits\]"'):
        write_orbits(["earth"], "-1 kyr", out=tmp_path)
