"""Scenes under a kernel, for tests: a Moon, a satellite, and the solar system as point masses."""

from collections.abc import Mapping

KEPT = ("0.999369252102309314", "0.999596982633729229", 1)
"""Moments of DE421's Moon over the largest."""
STRENGTHS = {"earth": 398600436233339.6, "sun": 1.3271244004127942e20}
"""m^3/s^2, of DE421."""
HEAVY = "principal_moments = [8.79e34, 8.7920e34, 8.7955e34]"
LIGHT = f'principal_moments = ["{KEPT[0]}", "{KEPT[1]}", {KEPT[2]}]'
START = "euler_angles = [0.005, 0.38, 1.29]\nangular_velocity = [1e-8, -2e-8, 2.6617e-6]"
TURNED = "quaternion = [0.9, 0.1, 0.2, 0.3]\nangular_velocity = [1e-8, -2e-8, 2.6617e-6]"
LANDING = "1969-07-20T12:00:00 TDB"  # 1.5 days before an edge of the Moon's blocks


def moon(
    kernel: str = "de421",
    sources: Mapping[str, float | None] | tuple[str, ...] = ("earth", "sun"),
    *,
    body: str = LIGHT,
    start: str = START,
    epoch: str = "1969-06-28T00:00:00 TDB",
    time: str = 'end = "40 day"\nevery = "1 day"',
) -> str:
    """The Moon as a rigid body.

    Args:
        sources: of gravity gradients, with gravitational parameters (None: the kernel's).
        body, start, time: further lines of ``[body]``, ``[initial]`` and ``[time]``.
    """
    given = sources if isinstance(sources, Mapping) else dict.fromkeys(sources)
    loads = "".join(
        f'[[loads]]\nkind = "gravity_gradient"\nsource = "{name}"\n'
        + ("" if strength is None else f"gravitational_parameter = {strength!r}\n")
        for name, strength in given.items()
    )
    return (
        f'name = "moon"\n[body]\nhost = "moon"\n{body}\n[initial]\n{start}\n'
        f'[ephemeris]\nkernel = "{kernel}"\n{loads}[time]\nepoch = "{epoch}"\n{time}\n'
        "[output]\ntimeline = false\n"
    )


def satellite(sources: tuple[str, ...] = ("earth", "moon", "sun")) -> str:
    """A satellite of the Earth on a high orbit, ten days."""
    loads = "".join(f'[[loads]]\nkind = "central_gravity"\nsource = "{name}"\n' for name in sources)
    return (
        'name = "satellite"\n[body]\nprincipal_moments = [1, 2, 2.5]\nmass = 10\nhost = "earth"\n[initial]\n'
        'position = ["42164 km", 0, 0]\nvelocity = [0, "3.0747 km/s", "0.1 km/s"]\n'
        'angular_velocity = [1e-4, 0, 2e-4]\n[ephemeris]\nkernel = "de421"\n'
        f'{loads}[time]\nepoch = "{LANDING}"\nend = "10 day"\nsamples = 3\n'
    )


def system(names: tuple[str, ...] = ("sun", "earth", "moon", "jupiter")) -> str:
    """The Moon, which turns, among point masses that start where DE421 has them; ten days."""
    bodies = "".join(f'[[bodies]]\nname = "{name}"\nephemeris = true\n' for name in names)
    return (
        f'name = "system"\n[body]\n{HEAVY}\nhost = "moon"\n[initial]\n'
        f'angular_velocity = [0, 0, 2.6617e-6]\n[ephemeris]\nkernel = "de421"\n{bodies}'
        '[[loads]]\nkind = "gravity_gradient"\norbit = {body = "earth"}\n'
        f'[time]\nepoch = "{LANDING}"\nend = "10 day"\nsamples = 3\n'
    )
