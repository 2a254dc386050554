"""Random scenes with rotors, a fluid core, and states of one's own: controllers, filters, slosh."""

import math
from collections.abc import Sequence

from experiments.random_scenes import Draw, orbit


def rotors(draw: Draw, moments: Sequence[float]) -> None:
    """One to three, free, at a fixed rate or driven, with momenta of a hundredth to thirty of the body's."""
    size = draw.mass * draw.length**2
    for k in range(int(draw.random.integers(1, 4))):
        moment = float(0.025 * min(moments) * draw.between(0.02, 1)) * size
        rate = draw.decades(-2, 1.5) * size / draw.time / moment * (1 if draw.sometimes(0.5) else -1)
        axis = [float(x) for x in draw.direction()]
        draw.more += ["[[rotors]]", f'name = "w{k}"', f"axis = {axis}", f"moment = {moment!r}"]
        draw.more.append(f"rate = {rate!r}")
        kind = draw.random.choice(["free", "fixed", "driven"])
        if kind == "fixed":
            draw.more.append("fixed = true")
        if kind == "driven":
            limit = size / draw.time**2 * draw.decades(-3, -1.3)
            draw.parameters += [f"k{k} = {limit!r}", f"n{k} = {draw.between(0.1, 2) / draw.time!r}"]
            law = draw.random.choice(
                [f"sin(n{k}*t)", f"-wx/n{k}", "qx*qw", f"-rate_w{k}/{abs(rate)!r}", f"tanh((wz-wx)/n{k})"]
            )
            draw.more.append(f'torque = "k{k}*({law})"')


def gyrostat(draw: Draw) -> None:
    """A third of them on an orbit."""
    moments = draw.moments()
    draw.body(moments, turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.between(0.1, 2))
    rotors(draw, moments)
    if draw.sometimes(0.3):
        _orbit(draw)


def heavy_gyrostat(draw: Draw) -> None:
    """A top with wheels; in a third of them the body and its first wheel are symmetric about one axis."""
    moments = draw.moments()
    if draw.sometimes(0.3):
        moments[1] = moments[0] = max(moments[0], 0.6 * moments[2])
        draw.body(moments, [0, 0, draw.between(0.2, 1)])
    else:
        draw.body(moments, draw.direction() * draw.between(0.2, 1))
    draw.start(draw.direction() * draw.between(0.5, 3))
    draw.gravity(draw.decades(-2, 0))
    rotors(draw, moments)


def gyrostat_in_flight(draw: Draw) -> None:
    """Six degrees of freedom about an attractor."""
    moments = draw.moments()
    draw.body(moments)
    distance, motion = draw.decades(1.5, 3), draw.between(0.05, 0.4)
    speed, tilt = motion * distance * draw.between(0.9, 1.1), draw.between(0, 3)
    draw.fly(draw.direction() * draw.between(0.1, 2), distance, speed, tilt, motion**2 * distance**3)
    rotors(draw, moments)


def fluid_core(draw: Draw) -> None:
    """A core of any size, with friction in half of them, as fast as the body in some; a third on an orbit."""
    moments = draw.moments()
    draw.body(moments, turned=draw.sometimes(0.3))
    # at most what leaves a mantle with positive second moments of mass
    most = 2 * float(min(moments.sum() / 2 - moments)) / float(max(moments))
    core = [f"moment = {draw.between(0.01, 0.95) * most!r}", f"flattening = {draw.decades(-4, -0.7)!r}"]
    if draw.sometimes(0.5):
        core.append(f'friction = "{draw.decades(-5, -0.5) / draw.time!r} s^-1"')
    rates = draw.direction() * draw.between(0.1, 2)
    if draw.sometimes(0.6):
        own = (rates + draw.direction() * draw.decades(-4, 0.3)) / draw.time
        core.append(f"angular_velocity = {[float(x) for x in own]}")
    draw.lines.append(f"core = {{{', '.join(core)}}}")
    draw.start(rates)
    if draw.sometimes(0.3):
        _orbit(draw)


def _orbit(draw: Draw) -> None:
    draw.source(1e3 * draw.length, draw.between(0.05, 0.4) / draw.time, 0.1)


def state(draw: Draw, name: str, derivative: str, initial: float = 0.0) -> None:
    """``[[states]]``, of one's own."""
    draw.more += ["[[states]]", f'name = "{name}"', f'derivative = "{derivative}"', f"initial = {initial!r}"]


def controller(draw: Draw) -> None:
    """A law of attitude, rate and integral, by torques or by wheels, with limits in half of them, against a
    steady or slowly changing disturbance.
    """
    moments = draw.moments()
    size = draw.mass * draw.length**2
    draw.body(moments)
    draw.start(draw.direction() * draw.decades(-3, 0))
    torque = size / draw.time**2
    stiffness = draw.decades(-2, 0)
    draw.parameters += [
        f"k = {torque * stiffness!r}",
        f"d = {torque * draw.time * math.sqrt(stiffness) * draw.between(0.05, 2)!r}",
        f"i = {torque / draw.time * stiffness * draw.between(0.001, 0.1)!r}",
        f"most = {torque * stiffness * draw.between(0.05, 0.5)!r}",
        f"p = {torque * stiffness * draw.decades(-3, -1.5)!r}",
        f"n = {draw.between(0.05, 1) / draw.time!r}",
    ]
    limited, wheels = draw.sometimes(0.5), draw.sometimes(0.5)
    laws = []
    for axis in "xyz":
        law = f"2*k*qw*q{axis} + d*w{axis} + i*sum_{axis}"
        laws.append(f"max(-most, min(most, {law}))" if limited else law)
        state(draw, f"sum_{axis}", f"2*qw*q{axis}")
    if wheels:
        moment = 0.02 * float(min(moments)) * size
        for k, (axis, law) in enumerate(zip("xyz", laws, strict=True)):
            unit = [float(j == k) for j in range(3)]
            draw.more += ["[[rotors]]", f'name = "w{axis}r"', f"axis = {unit}", f"moment = {moment!r}"]
            draw.more += [f'torque = "{law}"', f"rate = {draw.between(-10, 10) / draw.time!r}"]
    else:
        draw.load("torque", f"components = {[f'-({law})' for law in laws]}".replace("'", '"'))
    draw.load(
        "torque", 'components = ["p", "p*sin(n*t)", "-p/3"]', f'frame = "{"body" if limited else "space"}"'
    )


def lagging(draw: Draw) -> None:
    """Filtered rates, an actuator that lags behind its command, an oscillator, a count of angle."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.between(0.2, 2))
    torque = draw.mass * draw.length**2 / draw.time**2
    draw.parameters += [
        f"k = {torque * draw.time * draw.decades(-3, -1)!r}",
        f"lag = {draw.time * draw.decades(-1, 1)!r}",
        f"n = {draw.between(0.3, 3) / draw.time!r}",
        f"p = {torque * draw.decades(-3, -1)!r}",
    ]
    state(draw, "seen", "(wx - seen)/lag", draw.between(-1, 1) / draw.time)
    state(draw, "push", "(p*sin(n*t) - push)/lag")
    state(draw, "angle", "wz")
    components = ["-k*seen", "push", "0"]
    if draw.sometimes(0.5):
        state(draw, "one", "n*two", draw.decades(-3, 3))
        state(draw, "two", "-n*one")
        components[2] = "p*sin(angle + one)"
    draw.load("torque", f"components = {components}".replace("'", '"'))


def slosh(draw: Draw) -> None:
    """One or two damped pendulums that swing against the body, or a wheel on a spring; a quarter of them on
    an orbit.
    """
    moments = draw.moments()
    draw.body(moments)
    draw.start(draw.direction() * draw.between(0.2, 2))
    size = draw.mass * draw.length**2
    components = ["0", "0", "0"]
    for k in range(int(draw.random.integers(1, 3))):
        axis = "xyz"[k]
        draw.parameters += [
            f"j{k} = {0.1 * size * float(min(moments)) * draw.decades(-2, 0)!r}",
            f"n{k} = {draw.decades(-1, 0.7) / draw.time!r}",
            f"c{k} = {draw.decades(-3, -0.5) / draw.time!r}",
        ]
        state(draw, f"slosh{k}", f"swing{k} - w{axis}", draw.between(-0.1, 0.1))
        back = f"n{k}^2*sin(slosh{k})" if draw.sometimes(0.5) else f"n{k}^2*slosh{k}"
        state(draw, f"swing{k}", f"-{back} - c{k}*(swing{k} - w{axis})", draw.between(-0.1, 0.1) / draw.time)
        components[k] = f"j{k}*({back} + c{k}*(swing{k} - w{axis}))"
    draw.load("torque", f"components = {components}".replace("'", '"'))
    if draw.sometimes(0.25):
        _orbit(draw)


def laws(draw: Draw) -> None:
    """States of one's own in the torque: filters, slosh, an integral behind limits, a phase that grows, an
    oscillator of its own.
    """
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.between(0.1, 2))
    size = draw.mass * draw.length**2 / draw.time**2
    draw.parameters += [
        f"k = {size * draw.decades(-2.5, -0.7)!r}",
        f"n = {draw.decades(-1, 0.7) / draw.time!r}",
        f"most = {size * draw.decades(-2, -0.5)!r}",
    ]
    start, place = draw.between(-0.3, 0.3), int(draw.random.integers(5))
    torque, states = [
        ('["-k*a/n", "0.3*k*a/n", "0"]', [("a", "n*(wx - a)", 0.0), ("b", "n*(a - b)", 0.0)]),
        ('["k*a", "0", "0.2*k*b"]', [("a", "b*n", start), ("b", "-n*a - 0.05*n*b + 0.1*wy", 0.0)]),
        (
            '["max(-most, min(most, -k*(2*qw*qx + wx/n + 0.1*a)))", "-0.1*k*wy/n", "0"]',
            [("a", "2*n*qw*qx", 0.0)],
        ),
        ('["k*sin(a)", "0", "0.5*k*cos(a/3)"]', [("a", "n + wx^2/n", start)]),
        ('["k*a", "0.3*k*b*qx*qw", "0"]', [("a", "n*b", 1.0), ("b", "n*((1 - a^2)*b - a)", start)]),
    ][place]
    draw.load("torque", f"components = {torque}")
    for name, derivative, initial in states:
        state(draw, name, derivative, initial)


def moving_mass(draw: Draw) -> None:
    """Moments that change with time and with a state that follows the motion; in half of them mass leaves and
    takes its momentum along.
    """
    moments, size = draw.moments(), draw.mass * draw.length**2
    draw.body(moments)
    draw.start(draw.direction() * draw.between(0.2, 2))
    leaving = draw.sometimes(0.5)
    draw.parameters += [
        f"n = {draw.between(0.05, 1) / draw.time!r}",
        f"lag = {draw.time * draw.between(0.5, 5)!r}",
    ]
    state(draw, "drawn", "1/lag/300" if leaving else "(sin(wx*lag)^2 - drawn)/lag")
    parts = [draw.between(0.01, 0.08) * float(min(moments)) * size for _ in range(3)]
    varying = [f"{m * size!r} - {part!r}*drawn" for m, part in zip(map(float, moments), parts, strict=True)]
    if not leaving:
        varying[1] += f" + {parts[1]!r}*sin(n*t)/3"
    (place,) = (k for k, line in enumerate(draw.lines) if line.startswith("principal_moments"))
    draw.lines[place] = f"principal_moments = {varying}".replace("'", '"')
    if leaving:
        exit_point = [float(x) * draw.length for x in draw.direction()]
        rate = draw.mass / draw.time * draw.decades(-4, -2.5)
        draw.load("mass_loss", f'rate = "{rate!r}"', f"exit_point = {exit_point}")


def magnetic(draw: Draw) -> None:
    """B-dot by the body's rates, or by a filter of the field, on an inclined orbit in a dipole's field."""
    draw.body(draw.moments())
    draw.start(draw.direction() * draw.between(0.3, 2))
    size, axis = draw.mass * draw.length**2, 1e3 * draw.length
    motion = draw.between(0.02, 0.2) / draw.time
    field = 1e-5
    gain = size / draw.time / field**2 * draw.decades(-4, -1.5)
    draw.parameters += [f"k = {gain!r}", f"lag = {draw.time * draw.between(0.2, 2)!r}"]
    moment = ["-k*(wz*by - wy*bz)", "-k*(wx*bz - wz*bx)", "-k*(wy*bx - wx*by)"]
    if draw.sometimes(0.5):
        for name in "xyz":
            state(draw, f"f{name}", f"(b{name} - f{name})/lag")
        moment = [f"-k*(b{name} - f{name})/lag" for name in "xyz"]
    draw.load(
        "magnetic_dipole",
        f"moment = {moment}".replace("'", '"'),
        f"source_moment = [0, 0, {-field * axis**3 / 1e-7!r}]",
        orbit(axis, eccentricity=0.05, inclination=draw.between(0.5, 2), period=2 * math.pi / motion),
    )
