"""What isn't modelled, and what has another name here: answers to whoever asks for it (``docs/scope.md``)."""

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
        "engines have no load",
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


NAMED_OTHERWISE = {
    "a second rigid body is one of [[rigid_bodies]], under mutual_gravity (docs/two_bodies.md)": (
        "binary", "full_two_body", "f2bp", "secondary", "mutual_potential", "second_body",
    ),
    "a wheel is one of [[rotors]] (docs/rotors.md)": (
        "reaction_wheel", "momentum_wheel", "wheel", "flywheel", "rotor", "gyrostat", "gyroscope",
        "momentum_bias", "dual_spin", "momentum_exchange",
    ),
    "a wheel on a gimbal is one of [[rotors]] with gimbal and gimbal_rate (docs/rotors.md)": (
        "control_moment_gyro", "control_moment_gyroscope", "cmg", "vscmg", "scmg", "gimballed_wheel",
    ),
    "coils are a magnetic_dipole whose moment is an expression, as in rigidsim new "
    "detumbling_by_magnetorquers (docs/loads/magnetic_dipole.md)": (
        "magnetorquer", "magnetic_torquer", "magnetorquer_rod", "torque_rod", "torque_coil", "coil", "mtq",
        "mtb", "bdot", "b_dot",
    ),
    "a magnet, and a magnetic field, are a magnetic_dipole (docs/loads/magnetic_dipole.md)": (
        "magnet", "magnetic", "magnetic_field", "magnetic_torque", "magnetic_moment", "dipole",
        "residual_dipole", "geomagnetic", "geomagnetic_field", "earth_magnetic_field", "igrf", "wmm",
    ),
    "rods with magnetic hysteresis are a hysteresis_rod (docs/loads/hysteresis_rod.md)": (
        "hysteresis", "hysteresis_damping", "hysteresis_damper", "magnetic_hysteresis",
        "permeable_rod",
    ),
    "the oblateness of a source is figure = {J2 = .., radius = .., pole = ..} of central_gravity and "
    "gravity_gradient (docs/loads/gravity_field.md)": (
        "j2", "j2_gravity", "j2_perturbation", "oblateness", "oblate_gravity", "zonal", "zonal_harmonic",
    ),
    "harmonics of a source are gravity_field of central_gravity (docs/loads/central_gravity.md), of the body "
    "[body] gravity_field (docs/loads/gravity_field.md)": (
        "spherical_harmonic", "harmonic", "geopotential", "gravity_harmonic", "gravity_model", "egm96",
        "egm2008", "non_spherical_gravity", "tesseral", "sectoral", "gravity_field",
    ),
    "a further attracting body is one more gravity_gradient, for its torque, or one of [[bodies]], which a "
    "central_gravity names by orbit = {body = \"NAME\"} (docs/orbits_beside_the_body.md)": (
        "third_body", "third_body_gravity", "third_body_perturbation", "perturber", "point_mass",
        "luni_solar", "lunisolar", "perturbing_body",
    ),
    "the air is a drag on [[body.surfaces]] (docs/loads/drag.md)": (
        "atmospheric_drag", "air_drag", "aerodynamic_drag", "aero_drag", "air_resistance", "atmosphere",
        "air", "nrlmsise", "nrlmsise00", "nrlmsise_00", "free_molecular", "free_molecular_flow",
    ),
    "the push of light is a radiation_pressure on [[body.surfaces]] (docs/loads/radiation_pressure.md)": (
        "solar_radiation_pressure", "srp", "solar_pressure", "solar_radiation", "light_pressure", "radiation",
        "light", "sunlight", "solar_sail", "solar_torque",
    ),
    "uniform_gravity is a weight, central_gravity attracts a body in flight, gravity_gradient turns one on a "
    "given orbit (docs/config.md)": (
        "gravity", "gravitation", "gravitational", "gravitational_torque", "gravitational_force",
    ),
    "a body in flight is attracted by central_gravity (docs/loads/central_gravity.md)": (
        "two_body", "kepler", "keplerian", "newtonian_gravity", "point_gravity", "point_mass_gravity",
        "central_force", "earth_gravity", "inverse_square",
    ),
    "a weight is uniform_gravity (docs/loads/uniform_gravity.md)": (
        "weight", "constant_gravity", "surface_gravity",
    ),
    "tides are raised by each gravity_gradient on a body with [body] elasticity (docs/elastic_bodies.md)": (
        "tide", "tidal", "tidal_torque", "tidal_dissipation",
    ),
    "damping is viscous_torque, or a ring of liquid among [[rotors]], as in rigidsim new "
    "gravity_gradient_boom (docs/loads/viscous_torque.md)": (
        "damping", "damper", "viscous_damping", "nutation_damper", "rate_damping", "viscous_damper",
    ),
    "currents in the body are eddy_currents (docs/loads/eddy_currents.md)": (
        "eddy", "eddy_current", "eddy_current_damping", "eddy_torque", "foucault_current",
    ),
    "a control law is a torque or a force of expressions (docs/loads/torque.md), with [[states]] for its "
    "memory (docs/own_states.md)": (
        "controller", "control", "control_torque", "pd", "pid", "pd_control", "pid_control",
        "attitude_control", "actuator", "motor", "spring", "spring_torque",
    ),
    "a torque in body or space axes is torque (docs/loads/torque.md)": (
        "constant_torque", "body_torque", "external_torque", "applied_torque", "disturbance_torque",
        "space_torque",
    ),
    "a force at a point of the body is force (docs/loads/torque.md)": (
        "external_force", "applied_force", "body_force", "constant_force",
    ),
    "a start against the local frame of an orbit is relative_to in [initial], \"lvlh\" or \"rsw\" "
    "(docs/starts.md)": (
        "lvlh", "vvlh", "rtn", "ric", "rsw", "rsw_frame", "ntw", "tnw", "hill", "orbital_frame",
        "local_orbital", "lvlh_frame", "local_vertical", "local_frame", "nadir",
    ),
    "mass that leaves is mass_loss (docs/loads/mass_loss.md)": (
        "jet_damping", "mass_flow", "mass_change", "mass_depletion", "propellant_mass_loss",
    ),
}  # fmt: skip
"""What loads and frames of a start are called elsewhere, by the answer; names as in ``OutOfScope``."""


def scope_answer(name: str) -> str:
    """``; contact isn't modelled: ... (docs/scope.md)`` for a name of such a thing, otherwise empty."""
    found = next((item for item in _named(name)), None)
    return f"; {found.said}: {found.instead} ({PAGE})" if found else ""


def other_name(name: str) -> str:
    """``; a wheel is one of [[rotors]] (docs/rotors.md)`` for what has another name here, otherwise empty."""
    whole = "_".join(_words(name))
    forms = whole, whole.removesuffix("s")
    return next(
        (f"; {said}" for said, names in NAMED_OTHERWISE.items() if any(x in names for x in forms)), ""
    )


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", name.lower()[:100])


def _named(name: str) -> Iterator[OutOfScope]:
    """What a name speaks of: the whole of it first, then its words."""
    words = _words(name)
    for form in ("_".join(words), *words):
        for item in OUT_OF_SCOPE:
            if form in item.names or form.removesuffix("s") in item.names:
                yield item
