"""What isn't modelled, and what takes its place: told to whom asks for it by name (``docs/scope.md``)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

PAGE = "docs/scope.md"


@dataclass(frozen=True)
class OutOfScope:
    """Something that users ask for by one of its names.

    Attributes:
        said: that it isn't modelled.
        names: words that loads and keys of it are called by: whole ones, in lower case, in the singular.
        instead: what to do about it, with the keys that do it.
    """

    said: str
    names: tuple[str, ...]
    instead: str


OUT_OF_SCOPE = (
    OutOfScope(
        "bodies that bend aren't modelled",
        (
            "flexible", "flexibility", "flex", "bending", "beam", "membrane", "appendage", "vibration",
            "stiffness", "deformable", "mode_shape", "modal",
        ),
        "write each mode as an oscillator in [[states]] whose reaction is a torque; tides and spin "
        "are [body] elasticity",
    ),
    OutOfScope(
        "bodies joined together aren't modelled",
        (
            "joint", "hinge", "multibody", "chain", "tether", "gimbal", "pendulum", "constraint",
            "double_pendulum",
        ),
        "wheels are [[rotors]]; parts that move on a known way are expressions in [body] "
        "principal_moments; a small pendulum is two of [[states]]; for chains take a multibody "
        "program such as MuJoCo or Drake",
    ),
    OutOfScope(
        "contact isn't modelled",
        (
            "contact", "collision", "collide", "impact", "bounce", "ground", "floor", "wall", "rolling",
            "sliding", "slip", "normal_force", "restitution", "landing", "berthing", "docking",
            "rattleback", "tippe_top",
        ),
        "find or end at the moment of contact with [[events]]; a body may turn about a fixed point "
        "([body] reference); stiff springs are a force of an expression; for contact take MuJoCo or "
        "Drake",
    ),
    OutOfScope(
        "friction between bodies isn't modelled",
        (
            "friction", "coulomb", "stiction", "bearing",
        ),
        "viscous_torque is linear in the rates; dry friction of a bearing is a torque such as "
        '"-k*sign(wz)"; of a rotor in its own torque',
    ),
    OutOfScope(
        "the flow of liquids isn't modelled",
        (
            "slosh", "sloshing", "fuel", "propellant", "liquid", "fluid", "tank", "cfd", "ocean",
        ),
        "a swinging liquid is a damped pendulum in [[states]] (rigidsim new slosh), a planet's liquid"
        " core [body] core, mass that leaves mass_loss; for free surfaces take a CFD program",
    ),
    OutOfScope(
        "engines have no load of their own",
        (
            "thruster", "thrust", "engine", "rcs", "burn", "jet", "rocket", "nozzle",
        ),
        'a thruster is a force with a point, or a torque, of expressions such as "5*pulse(t, 10, 12)"'
        " (rigidsim new thrusters); the mass that it uses is mass_loss",
    ),
    OutOfScope(
        "the flow of air isn't modelled",
        (
            "aerodynamic", "aerodynamics", "aero", "lift", "wing", "magnus", "buoyancy", "parachute",
            "propeller", "turbulence", "boomerang", "frisbee",
        ),
        "write force and torque as expressions; in flight, vrx vry vrz are the velocity relative to a"
        " rotating atmosphere and altitude the height",
    ),
    OutOfScope(
        "relativity isn't modelled",
        (
            "relativity", "relativistic", "post_newtonian", "ppn", "geodetic", "geodesic", "lense_thirring",
            "frame_dragging", "gravitational_wave",
        ),
        "compare with published rates less their geodetic precession (19.2 mas a year for the Earth, "
        "6.7 for Mars); small torques may be added as expressions; orbits of a kernel are "
        "relativistic already",
    ),
    OutOfScope(
        "close encounters of many bodies aren't modelled",
        (
            "nbody", "n_body", "encounter", "planetesimal", "swarm", "merger",
        ),
        "[[bodies]] are point masses that keep their distance; integrate others with REBOUND or take "
        "a kernel, and give their orbit as [ephemeris] or as a table of elements",
    ),
    OutOfScope(
        "a second rigid body isn't modelled",
        (
            "binary", "full_two_body", "f2bp", "secondary", "mutual_potential", "polyhedron", "shape_model",
            "mesh",
        ),
        "one of them turns, and its partner is a point mass ([[bodies]] with coupling) or has a "
        "figure (J2); irregular bodies are [body] gravity_field",
    ),
    OutOfScope(
        "heat isn't modelled",
        (
            "thermal", "temperature", "yarkovsky", "yorp", "heat", "thermal_expansion", "conduction",
        ),
        "torques and forces from elsewhere enter as expressions",
    ),
    OutOfScope(
        "sensors and chance aren't modelled",
        (
            "noise", "random", "stochastic", "gyro", "star_tracker", "sensor", "imu", "kalman",
            "white_noise",
        ),
        "motions are deterministic; spread values by [sweep] with uniform or normal axes, and filter "
        "the dataset",
    ),
    OutOfScope(
        "charges and quanta aren't modelled",
        (
            "charge", "electric", "electrostatic", "lorentz", "quantum", "plasma", "spin_half",
            "molecular_dynamics",
        ),
        "write the torque as an expression; a magnetised body is magnetic_dipole",
    ),
)  # fmt: skip


def scope_answer(name: str) -> str:
    """``; contact isn't modelled: ... (docs/scope.md)`` for a name of such a thing, otherwise empty."""
    found = next((item for item in _named(name)), None)
    return f"; {found.said}: {found.instead} ({PAGE})" if found else ""


def _named(name: str) -> Iterator[OutOfScope]:
    """What a name speaks of: the whole of it first, then its words."""
    words = re.findall(r"[a-z0-9]+", name.lower()[:100])
    for form in ("_".join(words), *words):
        for item in OUT_OF_SCOPE:
            if form in item.names or form.removesuffix("s") in item.names:
                yield item
