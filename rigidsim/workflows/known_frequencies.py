"""Known frequencies of a scene, from its config, with which spectral lines are labelled.

Free bodies and heavy tops have theirs from the closed form (elliptic functions), orbits from their elements,
ephemerides from mean elements, librations and a fluid core from the linearised equations.
"""

from typing import Any

import mpmath

from rigidsim.analysis.labels import Known
from rigidsim.model.carriers import carried_beside
from rigidsim.model.load import loads_of
from rigidsim.model.loads.elasticity import Elasticity
from rigidsim.model.loads.fluid_core import FluidCore
from rigidsim.scene.arithmetic import Vector, apply, dot, transpose
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import find_closed_form
from rigidsim.solve.closed_form.free import AsymmetricFree, SymmetricFree
from rigidsim.solve.closed_form.heavy import HeavyTop
from rigidsim.workflows.free_modes import SYMMETRIC, modes_of_core, spin_change, synchronous_modes

_LIBRATION = 0.08  # relative amount by which a libration of finite amplitude may be slower than a small one
_SPIN = 0.02  # relative amount by which torques may change spin and wobble
OF_ROTATION = ("spin", "wobble", "free_nutation", "free_core_nutation")
"""Frequencies of the rotation, which an averaged motion lacks."""
_CENTURY = 36525 * 86400
_DELAUNAY = {
    "l": "1717915923.2178",
    "lp": "129596581.0481",
    "F": "1739527262.8478",
    "D": "1602961601.2090",
    "Om": "-6962890.5431",
}
"""Arcsec a century: mean anomalies of Moon and Sun, argument of the Moon's latitude, elongation, node of date
(Simon et al. 1994, A&A 282, 663; IERS Conventions 2010, equation 5.43).
"""
_DELAUNAY_ERROR = 40.0  # arcsec a century: how much they change in a century


def known_frequencies(scene: Scene, *, driven: bool = False) -> list[Known]:
    """All known frequencies of a scene, rad/s; loads unknown to the scene leave it no closed form."""
    closed = None if scene.free_flight and scene.loads else find_closed_form(scene, driven=driven)
    if closed is not None:
        found = _of_motion(closed.motion)
        return [Known(k.name, mpmath.ldexp(k.value, -closed.scaling.time), 0.0, k.source) for k in found]
    found = []
    loads = [load for load in loads_of(scene) if load.beside is None]
    elastic = any(isinstance(load, Elasticity) for load in loads)
    cored = [] if elastic else modes_of_core(scene)
    known = (Elasticity, FluidCore) if cored or elastic else ()
    if carried_beside([load for load in loads if not isinstance(load, known)]):
        return []
    orbits = [orbit for load in loads if (orbit := load.orbit) is not None]
    for number, orbit in enumerate(orbits, 1):
        found += _of_orbit(orbit, str(number) if len(orbits) > 1 else "")
    sources = [load.gradient_source for load in loads]
    if any(source is not None and source.placement.lunisolar for source in sources):
        found += _delaunay(scene)
    librations = _librations(scene, orbits[0]) if len(orbits) == 1 == len(loads) else []
    librations = librations or synchronous_modes(
        scene, next((k.value for k in found if k.name == "Om"), None)
    )
    if cored or elastic:  # whose own distortion changes the wobble
        return found + cored + librations
    return found + (librations or _of_spin(scene))


def _of_motion(motion: Any) -> list[Known]:
    if isinstance(motion, HeavyTop):
        elliptic = "closed form of the heavy symmetric top (Whittaker, section 71)"
        alpha, beta, turns = motion.alpha, motion.beta, motion.argument.turn_rate
        if not motion.argument.lattice.periodic:
            return []
        spin = alpha.rate - beta.rate + (alpha.step - beta.step) * turns
        return [
            Known("nutation", 2 * mpmath.pi * turns, 0.0, elliptic),
            Known("precession", motion.precession, 0.0, elliptic),
            Known("spin", spin, 0.0, elliptic),
        ]
    if isinstance(motion, AsymmetricFree):
        if not motion.lattice.periodic:
            return []
        elliptic = "closed form of the free asymmetric body: 4 K / p, and Pi (Landau & Lifshitz, section 37)"
        turns = mpmath.mpf(1) / motion.period
        wobble = 2 * motion.lattice.context.pi * turns
        return [Known("wobble", wobble, 0.0, elliptic), Known("precession", motion.precession, 0.0, elliptic)]
    if isinstance(motion, SymmetricFree):
        if motion.spin_rate == 0:
            return [Known("spin", motion.sum_rate, 0.0, "rotation about a principal axis")]
        exact = "free symmetric body"
        return [
            Known("wobble", abs(motion.spin_rate), 0.0, f"{exact}: (C - A) / A times the axial rate"),
            Known("precession", motion.sum_rate - motion.spin_rate, 0.0, f"{exact}: L / A"),
        ]
    return []


def _of_orbit(orbit: Any, number: str) -> list[Known]:
    """Rates of the mean longitude, of the node and of the longitude of periapsis."""
    longitude = orbit.mean_motion + orbit.periapsis_rate + orbit.node_rate
    found = [Known(f"orbit{number}", longitude, 0.0, "mean longitude of the orbit")]
    if orbit.node_rate != 0:
        found.append(Known(f"node{number}", orbit.node_rate, 0.0, "node of the orbit"))
    if orbit.periapsis_rate != 0:
        apsis = orbit.periapsis_rate + orbit.node_rate
        found.append(Known(f"apsis{number}", apsis, 0.0, "longitude of the orbit's periapsis"))
    return found


def _delaunay(scene: Scene) -> list[Known]:
    context = scene.context
    unit = context.pi / 648000 / _CENTURY
    source = "mean elements of Sun and Moon (IERS Conventions 2010)"
    error = float(_DELAUNAY_ERROR * unit)
    return [Known(name, context.mpf(rate) * unit, 0.0, source, error) for name, rate in _DELAUNAY.items()]


def _librations(scene: Scene, orbit: Any) -> list[Known]:
    """Small oscillations about the equilibrium in a circular orbit near which the body starts; none
    elsewhere.
    """
    context = scene.context
    if not (orbit.circular and orbit.fixed_plane) or scene.free_flight:
        return []
    normal, radial = orbit.normal(context), _towards_source(context, orbit)
    rates = [dot(axis, scene.angular_velocity) for axis in scene.body.principal_axes]
    inwards = transpose(rotation_matrix(scene.quaternion))
    along_normal, along_radius = (
        [dot(axis, apply(inwards, vector)) for axis in scene.body.principal_axes]
        for vector in (normal, radial)
    )
    y = max(range(3), key=lambda i: abs(along_normal[i]))
    z = max((i for i in range(3) if i != y), key=lambda i: abs(along_radius[i]))
    x = 3 - y - z
    n = orbit.mean_motion
    turning = abs(dot(rates, along_normal) - n) < n / 2
    if not (turning and abs(along_normal[y]) > 0.8 and abs(along_radius[z]) > 0.6):
        return []
    moments = scene.body.principal_moments
    source = "small librations on a circular orbit"
    found = []
    pitch = 3 * (moments[x] - moments[z]) / moments[y]
    if pitch > 0:
        found.append(Known("pitch", n * context.sqrt(pitch), _LIBRATION, f"{source}: n sqrt(3 (B - A) / C)"))
    sx = (moments[y] - moments[z]) / moments[x]
    sz = (moments[y] - moments[x]) / moments[z]
    half, product = (1 + 3 * sx + sx * sz) / 2, 4 * sx * sz
    inner = half**2 - product
    if product > 0 and half > 0 and inner > 0:
        squares = (half + context.sqrt(inner), half - context.sqrt(inner))
        quartic = f"{source}: s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz = 0 (roll and yaw)"
        found += [
            Known(f"rollyaw{k}", n * context.sqrt(square), _LIBRATION, quartic)
            for k, square in enumerate(squares, 1)
        ]
    return found


def _towards_source(context: Any, orbit: Any) -> Vector:
    """Direction of the source on a circular orbit at time zero, space axes."""
    node, tilt, along = orbit.ascending_node, orbit.inclination, orbit.periapsis + orbit.mean_anomaly
    c, s = context.cos, context.sin
    return [
        c(node) * c(along) - s(node) * s(along) * c(tilt),
        s(node) * c(along) + c(node) * s(along) * c(tilt),
        s(along) * s(tilt),
    ]


def _of_spin(scene: Scene) -> list[Known]:
    """Spin and wobble of a body that turns about its axis of largest or smallest moment, without torques."""
    context = scene.context
    moments, axes = scene.body.principal_moments, scene.body.principal_axes
    rates = [dot(axis, scene.angular_velocity) for axis in axes]
    order = sorted(range(3), key=lambda i: moments[i])
    for axis, across in ((order[2], order[:2]), (order[0], order[1:])):
        third = rates[axis]
        a, b, c = moments[across[0]], moments[across[1]], moments[axis]
        if abs(third) <= 3 * context.hypot(rates[across[0]], rates[across[1]]):
            continue
        symmetric = abs(a - b) <= SYMMETRIC * c
        change = spin_change(scene, third, rates, axis, [a, b, c])
        source = "initial rate about the principal axis"
        rough, errors = (_SPIN, (0.0, 0.0)) if change is None else (0.0, change)
        where = "body" if symmetric and change is not None else ""
        found = [Known("spin", abs(third), rough, source, float(errors[0] * abs(third)), where)]
        if a > 0 and b > 0 and (c - a) * (c - b) > 0:
            wobble = abs(third) * context.sqrt((c - a) * (c - b) / (a * b))
            source, error = "free nutation: w sqrt((C-A)(C-B)/(A B))", float(errors[1] * wobble)
            found.append(Known("wobble", wobble, rough, source, error, "" if change is None else "body"))
            if change is not None:  # its counterpart, nearly as fast as the spin
                total = abs(third) + (wobble if c > a else -wobble)
                source = "free nutation in space: the spin with the wobble"
                found.append(Known("free_nutation", total, 0.0, source, error + found[0].error, "space"))
        return found
    return []
