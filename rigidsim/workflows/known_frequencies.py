"""Known frequencies of a scene, from its config, with which spectral lines are labelled.

Free bodies and heavy tops have theirs from the closed form (elliptic functions), orbits from their elements,
ephemerides from mean elements, librations and a fluid core from the linearised equations. A core adds the
free core nutation to the wobble (Poincare 1910; Sasao, Okubo & Saito 1980).
"""

import math
from dataclasses import dataclass
from typing import Any

import mpmath

from rigidsim.analysis.labels import Known
from rigidsim.model.load import loads_of
from rigidsim.model.loads.changing_tensor import Elasticity
from rigidsim.model.loads.inner_bodies import FluidCore, core_of
from rigidsim.model.loads.rigid_bodies import second_body
from rigidsim.model.mechanics import carried_beside
from rigidsim.model.sources import in_body_axes
from rigidsim.scene.arithmetic import Vector, cross, dot, norm
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import find_closed_form
from rigidsim.solve.closed_form.free import AsymmetricFree, SymmetricFree
from rigidsim.solve.closed_form.heavy import HeavyTop

_LONGITUDE, _AXIS = 0.08, 0.04
"""Relative amounts by which amplitude, eccentricity and inclination may change librations in longitude, and
of the figure axis.
"""
_ANOMALY = 0.05  # the same of the time from periapsis to periapsis
_SYMMETRIC = 1e-12  # relative difference of two moments, below which a body is symmetric
_SMALL = 1e-5  # relative change of the frequencies of modes by their own amplitude
_TORQUES = 0.02  # the same of modes and of the spin by torques
_NEAR = 0.3  # of the spin, across it, from which a rotation isn't one about an axis
_IN_STEP = 0.35  # relative difference of the spin's square from a circular orbit's at the distance
_FACING = 0.8  # cosine between a principal axis and the source
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
_SECULAR = {
    "g5": (4.257482, 1e-5), "g2": (7.453, 0.004), "g4": (17.916, 0.04), "g3": (17.368, 0.04),
    "g1": (5.59, 0.04), "g6": (28.2449, 1e-3), "s3": (-18.848, 0.013), "s4": (-17.751, 0.04),
    "s1": (-5.61, 0.04), "s2": (-7.06, 0.04), "s6": (-26.347841, 1e-3),
}  # fmt: skip
"""Arcsec a year: of the planets' perihelia (g) and nodes (s), La2010a (Laskar et al. 2011, A&A 532, A89,
table 6), with a fifth of the most that they may change; the strongest in the Earth's orbit first.
"""
_SUN = 1.32712440041e20  # m^3/s^2
_DELAUNAY_ERROR = 40.0  # arcsec a century: how much they change in a century


def known_frequencies(scene: Scene, *, driven: bool = False) -> list[Known]:
    """All known frequencies of a scene, rad/s; loads unknown to the scene leave it no closed form."""
    closed = None if scene.free_flight and scene.loads else find_closed_form(scene, driven=driven)
    if closed is not None:
        found = _of_motion(closed.motion)
        return [Known(k.name, mpmath.ldexp(k.value, -closed.scaling.time), 0.0, k.source) for k in found]
    found = _of_pair(scene)
    loads = [load for load in loads_of(scene) if load.beside is None]
    elastic = any(isinstance(load, Elasticity) for load in loads)
    cored = [] if elastic or core_of(scene) is None else _of_rotation(scene)
    known = (Elasticity, FluidCore) if cored or elastic else ()
    if carried_beside([load for load in loads if not isinstance(load, known)]):
        return found
    orbits = [orbit for load in loads if (orbit := load.orbit) is not None]
    for number, orbit in enumerate(orbits, 1):
        found += _of_orbit(orbit, str(number) if len(orbits) > 1 else "")
    sources = [load.gradient_source for load in loads]
    if any(source is not None and source.placement.lunisolar for source in sources):
        found += _delaunay(scene)
    found += _of_planets(scene, [source for source in sources if source is not None])
    alone = orbits[0] if len(orbits) == 1 == len(loads) else None
    librations = _librations(scene, alone, next((k.value for k in found if k.name == "Om"), None))
    if cored or elastic:  # whose own distortion changes the wobble
        return found + cored + librations
    return found + (librations or _of_rotation(scene))


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


def _of_pair(scene: Scene) -> list[Known]:
    """Of two bodies: the way from periapsis to periapsis, and the free libration of the second body if it
    turns with the orbit.

    By the linearised equations with moments of second degree, about the circular orbit of the same angular
    momentum in the equator of the first body, with k the sum of (C - A) / m of the first body (A its mean
    moment) and (B + C - 2 A) / m of the second, D = m r^2 + C, S = 3 G m_A (B - A) / r^3, and x and y the
    changes of distance and yaw:

        x'' = -K x - (2 r n C / D) y',    C (1 - C / D) y'' = (2 m r n C / D) x' - S y.
    """
    second = second_body(scene)
    if second is None or second.pair is None:
        return []
    pair, start, mass, root = second.pair, second.start, second.reduced_mass, scene.context.sqrt
    low, high, polar = sorted(second.first.principal_moments)
    a, b, c = sorted(second.body.principal_moments)
    k = (polar - (low + high) / 2) / pair.masses[0] + (b + c - 2 * a) / pair.masses[1]
    moment = norm(scene.context, cross(start.position, start.velocity))
    bound = moment**2 / pair.strength
    if bound**2 <= 6 * k:
        return []
    r = (bound + root(bound**2 - 6 * k)) / 2
    n = moment / r**2
    whole = mass * r**2 + c
    stiff = pair.strength / r**3 * (-2 - 6 * k / r**2) - n**2 + 4 * mass * (r * n) ** 2 / whole
    about = "linearised equations about a circular orbit"
    turning = norm(scene.context, start.rates)
    if not a < b or abs(turning / n - 1) > _IN_STEP:
        return [Known("anomaly", root(stiff), _ANOMALY, f"{about}: from periapsis to periapsis")]
    push, inertia = 3 * pair.constant * pair.masses[0] * (b - a) / r**3, c * (1 - c / whole)
    half = (push + stiff * inertia + mass * (2 * r * n * c / whole) ** 2) / 2
    apart = root(half**2 - inertia * stiff * push)
    squares = sorted(((half + sign * apart) / inertia for sign in (1, -1)), key=lambda x: abs(x - stiff))
    anomaly, libration = (root(square) for square in squares)
    return [
        Known("anomaly", anomaly, _ANOMALY, f"{about}: from periapsis to periapsis, forced libration"),
        Known("libration", libration, _LONGITUDE, f"{about}: free libration"),
    ]


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


def _of_planets(scene: Scene, sources: list[Any]) -> list[Known]:
    """Secular frequencies of the solar system, where an averaged body orbits the Sun by a table."""
    tabulated = (s for s in sources if s.placement.elements()[1] is not None)
    about_sun = any(abs(float(source.gravitational_parameter) / _SUN - 1) < 1e-3 for source in tabulated)
    if not about_sun or scene.config.model.level != "orbit_averaged":
        return []
    unit = math.pi / 648000 / (_CENTURY / 100)
    source = "secular frequencies of the planets (La2010a)"
    return [
        Known(name, rate * unit, 0.0, source, change * unit, kind=name[0])
        for name, (rate, change) in _SECULAR.items()
    ]


def _of_rotation(scene: Scene) -> list[Known]:
    """Spin, wobble and free core nutation of a body that turns about its core's axis, or without a core about
    its axis of largest or smallest moment; none for other motions, and no wobble where it is a libration.
    """
    body, core = scene.body, core_of(scene)
    order = sorted(range(3), key=lambda i: body.principal_moments[i])
    axes = [body.principal_axes[order[i]] for i in (2, 0)] if core is None else [core.axis]
    turning = next(filter(None, (_turning(scene, axis) for axis in axes)), None)
    modes = None if turning is None else _modes(scene, core, turning)
    if turning is None or modes is None:
        return []
    spin, (low, high, polar) = turning.rate if core else abs(turning.rate), turning.moments
    change = _spin_change(scene, turning, cored=core is not None)
    of_spin, of_modes = change or (0.0, _SMALL)
    exact = change is not None and (core is None or core.friction == 0)
    error, rough = float(of_spin * abs(spin)) if exact else 0.0, 0.0 if change else _TORQUES
    turned = "body" if exact and abs(high - low) <= _SYMMETRIC * polar else ""
    source = "initial rate about the principal axis"
    found = [Known("spin", spin, 0.0 if exact else _TORQUES, source, error, turned)]
    source = "free nutation: w sqrt((C-A)(C-B)/(A B))" if core is None else "linearised equations of mantle "
    source += "and core" if core else ""
    for name, (rate, fading) in modes.items():
        own = float(of_modes * abs(rate) + fading)
        if name == "free_core_nutation":
            found.append(Known(name, rate + spin, rough, f"{source}, in space", own))
        elif core is None or not _librations(scene):
            found.append(Known(name, rate if core else abs(rate), rough, source, own, "body" * exact))
            if exact:  # its counterpart, nearly as fast as the spin
                words = f"{source}, in space"
                found.append(Known("free_nutation", rate + spin, 0.0, words, own + error, "space"))
    return found


@dataclass(frozen=True)
class _Turning:
    """A rotation about a principal axis: its rate, rad/s, moments across the axis (the least first) and along
    it, and the square of the rate across relative to that along it.
    """

    rate: Any
    moments: Vector
    tumbling: float


def _turning(scene: Scene, axis: Vector) -> _Turning | None:
    """The rotation about an axis; None where the body turns otherwise."""
    rate = dot(axis, scene.angular_velocity)
    across = norm(scene.context, [w - rate * x for w, x in zip(scene.angular_velocity, axis, strict=True)])
    if abs(rate) * _NEAR <= across:
        return None
    largest = max(range(3), key=lambda i: abs(dot(axis, scene.body.principal_axes[i])))
    moments = scene.body.principal_moments
    low, high = sorted(moments[i] for i in range(3) if i != largest)
    return _Turning(rate, [low, high, moments[largest]], float((across / rate) ** 2))


def _spin_change(scene: Scene, turning: _Turning, *, cored: bool) -> tuple[float, float] | None:
    """Relative errors of the spin about a principal axis as at the start, and of the torque-free wobble.

    None where other torques than gravity gradients act (and torques of a core), or where the amplitude of a
    body without symmetry counts.
    """
    low, high, polar = turning.moments
    tides = scene.context.zero
    for load in loads_of(scene):
        source = load.gradient_source
        if source is not None:
            distance = source.placement.nearest(scene)
            tides += 3 * source.gravitational_parameter / distance**3 / turning.rate**2
        elif not (cored and (load.beside or isinstance(load, FluidCore))):
            return None
    uneven = float(abs(high - low) / polar)
    if uneven > _SYMMETRIC and turning.tumbling > _SMALL:
        return None
    return uneven * (turning.tumbling + float(tides)), _SMALL + float(tides)


def _modes(scene: Scene, core: FluidCore | None, turning: _Turning) -> dict[str, tuple[Any, Any]] | None:
    """Frequencies in body axes (rad/s, with the sense of the spin) of the wobble and of the nearly diurnal
    mode of a core, each with the rate at which friction damps it, of the linearised equations; None where
    those of a core aren't circular or elliptic motions.
    """
    context, spin, (low, high, c) = scene.context, turning.rate, turning.moments
    if core is None:
        stiffness = (c - low) * (c - high)
        if low == 0 or stiffness <= 0:
            return {}
        wobble = abs(spin) * context.sqrt(stiffness / (low * high))
        return {"wobble": (wobble if c > low else -wobble, 0.0)}
    polar, f = core.polar, core.flattening
    core_rate = dot(core.axis, core.at_start(scene))
    a, b, c = low - polar * (1 - f), high - polar * (1 - f), c - polar
    push, drag = polar * f * core_rate, core.friction
    pull = core_rate / (1 - f)
    own = drag / (polar * (1 - f))
    back = pull + spin - core_rate
    matrix = context.matrix(
        [
            [-drag / a, (b - c) * spin / a, drag / a, -push / a],
            [(c - a) * spin / b, -drag / b, push / b, drag / b],
            [own, -pull, -own, back],
            [pull, own, -back, -own],
        ]
    )
    values, vectors = context.eig(matrix)
    found = []
    for n, value in enumerate(values):
        # x + i y of a motion exp(i s t) is larger for the s that has its sense
        x, y = (context.mpc(vectors[i, n]) for i in (2, 3))
        if context.im(value) != 0 and abs(x + 1j * y) >= abs(x - 1j * y):
            found.append((context.im(value), abs(context.re(value))))
    if len(found) != 2:
        return None
    found.sort(key=lambda mode: abs(mode[0] / spin + 1))  # the nearly diurnal one is near -1 spin
    return {"free_core_nutation": found[0], "wobble": found[1]}


def _librations(scene: Scene, alone: Any = None, node_rate: Any = None) -> list[Known]:
    """Small oscillations of a body that turns one axis to the source of a gravity gradient; none for others.

    On a circular orbit, with x towards the source and z along the spin, s^2 = -3 n^2 (B - A) / C in
    longitude, and s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz = 0 for the figure axis with
    sx = (C - A) / B and sz = (C - B) / A (Hughes, Spacecraft Attitude Dynamics, 1986, section 9.2). Where it
    stays in step, the figure axis turns with the wobble in body axes, and by precessing in space (Eckhardt
    1981, The Moon and the Planets 25, 3; for the Moon 2.9, 75 and 81 years: Rambaux & Williams 2011, Celest.
    Mech. Dyn. Astr. 109, 85).

    Args:
        alone: the orbit of the only load. node_rate: of a source that has no orbit, rad/s; None if unknown.
    """
    context, body = scene.context, scene.body
    z = max(range(3), key=lambda i: abs(dot(body.principal_axes[i], scene.angular_velocity)))
    turning = _turning(scene, body.principal_axes[z])
    if turning is None or scene.free_flight:
        return []
    for load in loads_of(scene):
        source = load.gradient_source
        if source is None:
            continue
        place = load.source_at_start(scene)
        distance = norm(context, place)
        towards = in_body_axes(scene, [x / distance for x in place])
        facing = {i: abs(dot(body.principal_axes[i], towards)) for i in range(3) if i != z}
        x = max(facing, key=facing.__getitem__)
        a, b, c = (body.principal_moments[i] for i in (x, 3 - x - z, z))
        in_step = source.gravitational_parameter / distance**3 / turning.rate**2
        if a == 0 or facing[x] < _FACING or abs(in_step - 1) > _IN_STEP:
            continue
        orbit = load.orbit
        n = abs(turning.rate) if orbit is None else orbit.mean_motion + orbit.periapsis_rate + orbit.node_rate
        sx, sz = (c - a) / b, (c - b) / a
        half, product = (1 + 3 * sx + sx * sz) / 2, 4 * sx * sz
        both = half**2 - product
        squares = {"along": 3 * (b - a) / c}
        if both > 0:
            root = context.sqrt(both)
            squares |= {"fast": half + root, "slow": half - root}
        rates = {name: n * context.sqrt(square) for name, square in squares.items() if square > 0}
        if alone is not None and alone.circular and alone.fixed_plane:
            about = "small librations on a circular orbit"
            quartic = f"{about}: s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz = 0 (roll and yaw)"
            words = {"along": f"{about}: n sqrt(3 (B - A) / C)", "fast": quartic, "slow": quartic}
            names = {"along": "pitch", "fast": "rollyaw1", "slow": "rollyaw2"}
            return [Known(names[k], rate, _LONGITUDE, words[k]) for k, rate in rates.items()]
        if not a < b < c:
            continue
        about = "small librations in step with the orbit"
        node = orbit.node_rate if orbit is not None else node_rate or context.zero
        return [
            Known("longitude", rates["along"], _LONGITUDE, f"{about}: n sqrt(3 (B - A) / C)"),
            Known("wobble", rates["slow"], _AXIS, f"{about}, in body axes", frames=(float(n - node),)),
            Known(
                "latitude", n - rates["fast"], _AXIS, f"{about}: precession in space",
                frames=(float(-node), float(n)),
            ),
        ]  # fmt: skip
    return []
