"""Rods with hysteresis: the model's limiting loop and its energy, and random motions against DOP853."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation
from support import config, loaded, run_text, seeds

import rigidsim

MU_0, GM = 4e-7 * np.pi, 3.986004418e14
ROD = {"coercivity": 12.0, "remanence": 0.004, "saturation": 0.025}


def rod(name: str = "rod", axis: Any = (1, 0, 0), **keys: float) -> str:
    lines = "".join(f"{key} = {float(x)!r}\n" for key, x in {"volume": 1e-6, **ROD, **keys}.items())
    return f'kind = "hysteresis_rod"\nname = "{name}"\naxis = {[float(x) for x in axis]}\n' + lines


def slope(b: Any, h: Any, change: Any, hc: float, br: float, bs: float, q: float = 0.0) -> Any:
    """dB/dt by Flatley & Henretty's formula."""
    k = np.tan(np.pi * br / 2 / bs) / hc
    x = (hc + np.sign(change) * (h - np.tan(np.pi * b / 2 / bs) / k)) / 2 / hc
    return 2 * k * bs / np.pi * np.cos(np.pi * b / 2 / bs) ** 2 * (q + (1 - q) * x**2) * change


def test_a_rod_in_a_strong_field_goes_round_its_limiting_loop() -> None:
    """A heavy wheel turns it once in 2 pi s; the field is 50 times the coercivity."""
    field = f'kind = "magnetic_dipole"\nmoment = [0, 0, 0]\nfield = [{50 * 12 * MU_0}, 0, 0]'
    text = config(
        "principal_moments = [1e3, 1e3, 2e3]", "angular_velocity = [0, 0, 1]",
        loads=[field, rod(reversal_slope=0.3)], time=f"end = {4 * np.pi}\nsamples = 4001",
    )  # fmt: skip
    data = loaded(run_text(text))
    time, b = data.time.values, data.rod.values
    h, k = 600 * np.cos(time), np.tan(np.pi * 0.004 / 0.05) / 12
    late = (time > np.pi) & (np.abs(h) < 100)
    loop = 0.05 / np.pi * np.arctan(k * (h - 12 * np.sign(-np.sin(time))))
    np.testing.assert_allclose(b[late], loop[late], rtol=0, atol=2e-4 * 0.025)


LOOP = "1e-6/mu0*0.05/pi*atan(steep*(bx/mu0 - 12*sign(dbx)))"  # Gerhardt & Palo 2010, times volume / mu_0


@pytest.mark.parametrize("field", [20, *(pytest.param(x, marks=pytest.mark.campaign) for x in (10, 50))])
def test_what_a_minor_loop_loses_beside_the_loop_of_a_published_decay(field: float) -> None:
    """A wheel loses the volume times the loop's area in each turn: with this model, and with a rod that jumps
    between the branches of the limiting loop.
    """
    k = np.tan(np.pi * 0.004 / 0.05) / 12
    b, lost = 0.05 / np.pi * np.arctan(k * field), 0.0
    for n in range(16):  # along H alone, half a cycle after the other
        way = 1 if n % 2 else -1

        def along(h: float, y: np.ndarray, way: int = way) -> list[float]:
            change = slope(y[0], h, way, **dict(zip(("hc", "br", "bs"), ROD.values(), strict=True))) * way
            return [change, h * change]

        done = solve_ivp(along, [-way * field, way * field], [b, 0], rtol=1e-11, atol=1e-15).y
        b, lost = done[0, -1], done[1, -1] + (lost if n == 15 else 0)
    jumping = (
        quad(lambda x: np.arctan(k * (x + 12)) - np.arctan(k * (x - 12)), -field, field)[0] * 0.05 / np.pi
    )
    plain = f'kind = "magnetic_dipole"\nmoment = [0, 0, 0]\nfield = [{field * MU_0}, 0, 0]'
    jumps = plain.replace("[0, 0, 0]", f'["{LOOP}", 0, 0]')
    for loads, known in (([plain, rod()], lost), ([jumps], jumping)):
        text = config(
            "principal_moments = [1, 1, 2]", "angular_velocity = [0, 0, 1]", loads=loads,
            time=f"end = {16 * np.pi!r}\nsamples = 9",
        )  # fmt: skip
        text += f"[parameters]\nsteep = {float(k)!r}\nmu0 = {MU_0!r}\n"
        energy = loaded(run_text(text)).energy.values
        assert energy[-2] - energy[-1] == pytest.approx(1e-6 * known, rel=2e-5)


@pytest.mark.parametrize("seed", seeds(1, 30))
def test_random_satellites_move_as_dop853_does_between_reversals(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = np.array([0.02, 0.03, 0.035]) * rng.uniform(0.9, 1.1)
    w, q = rng.normal(size=3) * 0.05, rng.normal(size=4)
    q /= np.linalg.norm(q)
    rods = [(rng.normal(size=3), rng.uniform(0.2, 1) * 1e-6, rng.uniform(0.8, 2, 3)) for _ in range(2)]
    axes, uniform = np.array([a / np.linalg.norm(a) for a, _, _ in rods]), rng.random() < 0.5
    loops = [(12 * a, 0.004 * b, 0.025 * c) for _, _, (a, b, c) in rods]
    size, source = 7e6, rng.normal(size=3) * 5e22
    rate, direct = np.sqrt(GM / size**3), rng.normal(size=3) * 2e-5
    keys = f"field = {direct.tolist()}"
    if not uniform:
        keys = f"source_moment = {source.tolist()}\ngravitational_parameter = {GM}\n"
        keys += f"satellite_orbit = {{semi_major_axis = {size}}}"
    magnet = rng.normal(size=3) * 0.05
    loads = [f'kind = "magnetic_dipole"\nmoment = {magnet.tolist()}\n{keys}']
    for i, ((axis, volume, _), (hc, br, bs)) in enumerate(zip(rods, loops, strict=True)):
        loads.append(rod(f"rod{i}", axis, volume=volume, coercivity=hc, remanence=br, saturation=bs))
    text = config(
        f"principal_moments = {moments.tolist()}",
        f"angular_velocity = {w.tolist()}\nquaternion = {q.tolist()}", loads=loads,
        time="end = 150\nsamples = 16",
    )  # fmt: skip
    data = loaded(run_text(text))

    def field(t: float) -> tuple[np.ndarray, np.ndarray]:
        """B and its change, space axes."""
        if uniform:
            return direct, np.zeros(3)
        c, s = np.cos(rate * t), np.sin(rate * t)
        u, v = np.array([c, s, 0]), rate * np.array([-s, c, 0])
        b = 3 * (source @ u) * u - source
        return 1e-7 / size**3 * b, 3e-7 / size**3 * ((source @ v) * u + (source @ u) * v)

    def along(t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """B in body axes, and its change there."""
        turned = Rotation.from_quat(np.roll(y[3:7], -1)).inv()
        b, change = (turned.apply(x) for x in field(t))
        return b, change - np.cross(y[:3], b)

    def moving(t: float, y: np.ndarray) -> np.ndarray:
        b, change = along(t, y)
        moment, rates = magnet.copy(), []
        for flux, axis, (_, volume, _), loop in zip(y[7:], axes, rods, loops, strict=True):
            moment += volume * flux / MU_0 * axis
            rates.append(slope(flux, axis @ b / MU_0, axis @ change / MU_0, *loop))
        turn = (np.cross(moments * y[:3], y[:3]) + np.cross(moment, b)) / moments
        qw, qv = y[3], y[4:7]
        spin = np.array([-qv @ y[:3], *(qw * y[:3] + np.cross(qv, y[:3]))]) / 2
        return np.concatenate([turn, spin, rates])

    begun = [
        2 * bs / np.pi * np.arctan(np.tan(np.pi * br / 2 / bs) / hc * (axis @ along(0, [*w, *q])[0] / MU_0))
        for axis, (hc, br, bs) in zip(axes, loops, strict=True)
    ]
    events = [lambda t, y, a=a: a @ along(t, y)[1] for a in axes]
    for event in events:
        event.terminal = True
    time, y = 0.0, np.array([*w, *q, *begun])
    # a longer step of DOP853 would pass over two reversals at once
    samples, found, options = data.time.values, [y], {"rtol": 1e-11, "atol": 1e-14, "max_step": 1.0}
    while len(found) < len(samples):
        done = solve_ivp(moving, [time, 151], y, "DOP853", dense_output=True, events=events, **options)
        found += [done.sol(t) for t in samples[(samples > time) & (samples <= done.t[-1])]]
        # a nanosecond on, past the reversal
        time, y = done.t[-1] + 1e-9, done.y[:, -1] + 1e-9 * moving(done.t[-1] + 1e-9, done.y[:, -1])
    known = np.array(found)
    np.testing.assert_allclose(data.angular_velocity.values, known[:, :3], rtol=0, atol=1e-9)
    for i in range(2):
        np.testing.assert_allclose(data[f"rod{i}"].values, known[:, 7 + i], rtol=0, atol=1e-9)


def test_what_is_no_rod_is_refused() -> None:
    with pytest.raises(rigidsim.ConfigError, match="no magnetic field; add a magnetic_dipole"):
        run_text(config(loads=rod()))
    field = 'kind = "magnetic_dipole"\nmoment = [0, 0, 0]\nfield = [1e-5, 0, 0]'
    with pytest.raises(rigidsim.ConfigError, match=r"remanence: given 0\.03 T; less than the saturation"):
        run_text(config(loads=[field, rod(remanence=0.03)]))
