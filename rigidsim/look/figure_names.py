"""Names of all figures with one line on what each shows, for help texts and messages, without any import."""

OVERVIEW = "overview"  # the page that suits the scene
SPECTRUM = "spectrum"  # of a run's analysis

FIGURES: dict[str, str] = {
    OVERVIEW: "the page that suits the scene: leading figures, drifts, numbers of the motion (default)",
    "polar_motion": "the spin axis about the figure axis: circle, period, m1 and m2 over time",
    "pole_path": "path of the figure axis in space, and about its mean motion if the axis precesses",
    "nutation": "nutation ellipse: the pole about its mean motion",
    "obliquity": "obliquity and longitude of the node, less their mean or secular part",
    "climate": "obliquity, climatic precession within the eccentricity, and insolation over time",
    "libration": "libration, or roll, pitch and yaw, over time; the source seen from the body",
    "pair": "yaw, distance and period of two rigid bodies over time; path of the second one",
    "pointing": "angle of a body axis from the oncoming air, or from the Sun or the planet, over time",
    "tip": "a top's centre of mass, or `[output] tip`, seen from above, its tilt and precession over time",
    "polhode": "polhode on the surfaces of energy and momentum, separatrix, Poinsot's rolling",
    "momentum_sphere": "the momentum's sphere in the body, levels of energy, stable and unstable spins",
    "rotors": "rates of the rotors, and their axes from the angular momentum, over time",
    "herpolhode": "path of the angular velocity on the invariable plane",
    "path": "path of the centre of mass",
    "rates": "angular velocity over time",
    "core": "axis and rate of a fluid core relative to the mantle, over time",
    "published": "the rotation from a published orientation to the attitude, over time",
    "attitude": "Euler angles, or the body's z axis in space, and the nutation angle, over time",
    "wobble": "turns of a free symmetric body's wobble in space, and of its spin, over time",
    "states": "user-defined states ([[states]]) over time",
    "sensitivity": "derivatives of attitude, rates and position by numbers of the config, over time",
    SPECTRUM: "amplitude spectra of the main signals, with labelled lines (analyses the run first)",
    "drift": "drifts of invariants over the band that rounding explains",
}
