"""What every load, formulation, observable, start and format promises, in a few scenes that combine them.

A scene with all of them runs, resumes bit for bit, has the members of its sweep, and announces errors that
are true, in each precision. What a load does is compared with closed forms and other integrators elsewhere.
"""

from functools import cache
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from support import EPSILON, angle_between, assert_announced, cases, config, loaded, run_text, same_bits, wide

import rigidsim
from rigidsim.formats import FORMATS
from rigidsim.formats.registry import Naming, format_named
from rigidsim.scene.choices import FORMULATIONS
from rigidsim.scene.registry import LOADS
from rigidsim.scene.starts import ATTITUDES, RATES

BOX = "[[body.surfaces]]\nsize = [1, 0.8, 0.6]\nposition = [0.1, 0, 0.2]\nspecular = 0.1\ndiffuse = 0.2\n"
FLIGHT = config(
    f"principal_moments = [1, 1.2, 1.5]\nmass = 2\n{BOX}",
    "position = [3, 0, 0]\nvelocity = [0, 0.6, 0.1]\nangular_velocity = [0.3, 1.0, 0.5]\n"
    "quaternion = [0.9, 0.28, -0.35, 0.2]",
    [
        'kind = "central_gravity"\nname = "earth"\ngravitational_parameter = 1\nradius = 0.5\n'
        "atmosphere_rate = [0, 0, 0.1]\nfigure = {J2 = 0.01, radius = 0.5, pole = [0, 0, 1]}",
        'kind = "central_gravity"\ngravitational_parameter = 0.5\nposition = [0, 9, 0]\n'
        'gravity_field = {radius = 1, C = {"2,2" = 0.1}, S = {"2,2" = 0.2}, pole = [0, 0, 1], rate = 0.3}',
        'kind = "drag"\ndensity = 0.01\naltitude = 2\nscale_height = 1',
        'kind = "viscous_torque"\ncoefficients = [0.001, 0.002, 0.003]',
        'kind = "force"\ncomponents = ["0", "0.01*cos(t)", "0.02"]\nframe = "body"\npoint = [0.1, 0, 0.3]',
    ],
    more='[[events]]\nname = "burn"\ntime = 3.3\naction = "impulse"\naxes = "body"\n'
    "velocity = [0.05, 0, 0.1]\n"
    "angular_impulse = [0, 0.1, 0]\n",
)
SATELLITE = config(
    "principal_moments = [1, 1.2, 1.5]\nmass = 2\n"
    "core = {moment = 0.1, flattening = 0.01, friction = 0.003}\n"
    'gravity_field = {radius = 1, C = {"3,0" = -0.01, "3,1" = 0.02}, S = {"3,2" = 0.01}}\n' + BOX,
    "pole = [0.3, 1.1]\nprime_meridian = 0.4\nspin_period = 6",
    [
        'kind = "gravity_gradient"\nname = "earth"\ngravitational_parameter = 1\ndegree = 3\n'
        "orbit = {semi_major_axis = 4, eccentricity = 0.1, inclination = 0.3}",
        'kind = "gravity_gradient"\nname = "sun"\ngravitational_parameter = "1.32712440018e20 m^3/s^2"\n'
        'orbit = {semi_major_axis = "1 au"}',
        'kind = "radiation_pressure"\nlight = "sun"',
        'kind = "magnetic_dipole"\nmoment = ["-0.1*(bx - 0.2)", "0.01", "0.02"]\nfield = [0.3, 0, -0.4]',
        'kind = "eddy_currents"\nconductivity = 100\nradius = 0.5\nfield = [0.1, 0, 0.2]',
        'kind = "hysteresis_rod"\nname = "rod"\naxis = [0, 1, 1]\nvolume = 1e-6\ncoercivity = 1e5\n'
        "remanence = 0.05\nsaturation = 0.1",
    ],
    more='[frame]\naxes = "EME2000"\n',
)
SPINNER = config(
    'principal_moments = ["1 - 0.01*burnt", "1.2 - 0.01*min(burnt, 0.5)", "1.5 - 0.02*burnt"]',
    "angular_momentum = [0.5, 0.4, 1.2]\neuler_angles = [0.2, 1.1, 0.7]",
    [
        'kind = "mass_loss"\nrate = "0.1*k"\nexit_point = [0, 0, -1]',
        'kind = "torque"\ncomponents = ["-0.1*step(t - 1.5)", "0.05*abs(wx)", "0"]',
    ],
    more='[[states]]\nname = "burnt"\nunit = "kg"\nderivative = "0.1*k"\n[parameters]\nk = 1\n'
    '[[rotors]]\nname = "wheel"\naxis = [1, 2, 2]\nmoment = 0.1\nrate = 2\n'
    '[[rotors]]\nname = "motor"\naxis = [0, 1, 0]\nmoment = 0.2\nrate = 1\ntorque = "-0.1*wy"\n'
    '[[rotors]]\nname = "gyro"\naxis = [0, 0, 1]\nmoment = 0.1\nrate = 2\nfixed = true\n'
    'gimbal = [1, 1, 0]\ngimbal_angle = 0.3\ngimbal_rate = "0.2*cos(t)"\n'
    '[[events]]\nname = "half"\nexpression = "wx"\n',
)
ELASTIC = config(
    'principal_moments = [1, 1.2, 1.5]\nelasticity = {love_number = 0.3, radius = "2 mm", delay = 0.01}',
    "obliquity = 0.4\nnode_longitude = 0.3\nprime_meridian = 0.2\nspin_period = 6",
    'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 4}',
    more='[frame]\naxes = "EME2000"\n',
)
TOP = config(
    "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 1]",
    "angular_velocity = [0.3, 0.2, 3.0]\neuler_angles = [0.2, 1.1, 0.7]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -2]',
)
PENDULUM = config(
    "principal_moments = [1, 2, 3]\nmass = 1\ncenter_of_mass = [0, 0.5, 0]",
    "angular_velocity = [0, 0, 0.4]\neuler_angles = [0, 0, 0.5]",
    'kind = "uniform_gravity"\nacceleration = [0, -2, 0]',
)
DAMPED = config(
    loads='kind = "viscous_torque"\ncoefficients = [0.01, 0.02, 0.03]',
    output='record = ["angular_velocity", "energy"]',
)
PAIR = config(
    'shape = "cuboid"\nmass = 3e10\nsize = [0.6, 0.5, 0.4]',
    "quaternion = [0.9, 0.28, -0.35, 0.2]\nangular_velocity = [0.3, 1.0, 0.5]",
    [
        'kind = "mutual_gravity"\ndegree = 4',
        'kind = "viscous_torque"\ncoefficients = [1e6, 2e6, 3e6]',
        'kind = "gravity_gradient"\ngravitational_parameter = 0.5\norbit = {semi_major_axis = 9}',
    ],
    more='[[events]]\nname = "hit"\ntime = 3.3\naction = "impulse"\nbody = "moon"\naxes = "rtn"\n'
    "velocity = [0.01, 0.03, 0.02]\nangular_velocity = [0.1, 0, 0]\n"
    '[[rigid_bodies]]\nname = "moon"\nshape = "cylinder"\nmass = 1e10\nradius = 0.2\nheight = 0.7\n'
    "euler_angles = [0.3, 0.5, 0.2]\nangular_velocity = [0.2, -0.3, 0.6]\n"
    "position = [2, 0.1, 0.3]\nvelocity = [0.1, 1.1, 0.2]\n",
)
SCENES = {
    name: text.replace("end = 3", "end = 12")
    for name, text in {
        "flight": FLIGHT, "satellite": SATELLITE, "spinner": SPINNER, "elastic": ELASTIC, "top": TOP,
        "pendulum": PENDULUM, "damped": DAMPED, "pair": PAIR,
    }.items()
}  # fmt: skip
MAIN = ("flight", "satellite", "spinner", "elastic", "top", "pair")
VARIED: dict[str, dict[str, list[Any]]] = {
    "flight": {"loads[0].gravitational_parameter": [0.9, 1.1], "events[0].velocity[2]": [0.0, 0.1]},
    "satellite": {
        "body.core.moment": [0.05, 0.1],
        "body.core.flattening": [0.0, 0.02],
        "body.core.friction": [0.0, 0.1],
        'body.gravity_field.C."3,1"': [0.01, 0.03],
        'body.gravity_field.S."3,2"': [0.0, 0.02],
        "loads[0].orbit.eccentricity": [0.05, 0.2],
    },
    "spinner": {
        "parameters.k": [0.0, 2.0],
        "rotors[0].rate": [-1, 3],
        "rotors[0].moment": [0.1, 0.2],
        "states[0].initial": [0.0, 0.1],
        "initial.euler_angles[1]": [0.5, 1],
    },
    "elastic": {"body.elasticity.love_number": [0.1, 0.3], "body.elasticity.delay": [0.005, 0.01]},
    "pair": {
        "rigid_bodies[0].mass": [5e9, 2e10],
        "rigid_bodies[0].velocity[1]": [1.0, 1.2],
        "rigid_bodies[0].height": [0.5, 0.8],
        "body.size[0]": [0.6, 0.7],
    },
    "top": {"body.center_of_mass[2]": [0.5, 2], "body.principal_moments[2]": [0.5, 1.5]},
}
"""Keys of each scene's sweep, with their values in each member."""
CASES = [(name, precision, "quaternion") for precision in ("double", *EPSILON) for name in MAIN]
CASES += [(name, "double", given) for name in MAIN for given in ("rotation_matrix", "euler_angles")]
CASES += [("top", "double", "canonical"), ("pendulum", "double", "planar"), ("damped", "double", "rates")]
CASES = list(dict.fromkeys(CASES))
USUAL = [("satellite", "double", "quaternion"), ("top", "extended", "quaternion")]
USUAL += [("pendulum", "double", "planar"), ("pair", "double", "quaternion")]
FORMULATED = {name for name in FORMULATIONS if name != "rodrigues"}  # which tests of extensions register
EXACT = {"single": "double", "double": "extended", "extended": "quadruple"}
"""A precision beside which the errors of another are seen."""


def settings(precision: str, formulation: str) -> list[str]:
    return [f'integrator.precision="{precision}"', f'integrator.formulation="{formulation}"']


def made(scene: str, precision: str, how: str = "quaternion", *, estimate: bool = False) -> rigidsim.Run:
    """The run that all tests of a scene share."""
    return _made(hy.taylor_adaptive.__name__, scene, precision, how, estimate)


@cache
def _made(code: str, scene: str, precision: str, how: str, estimate: bool) -> rigidsim.Run:
    """``code`` is that of long tests, or what compiles fast, whose rounding differs."""
    return run_text(SCENES[scene], *settings(precision, how), estimate=estimate)


def test_the_scenes_have_every_entry_of_the_registries() -> None:
    texts = [rigidsim.parse(text).to_dict() for text in SCENES.values()]
    assert {load["kind"] for text in texts for load in text.get("loads", [])} == set(LOADS["kind"])
    assert {key for text in texts for load in text.get("loads", []) for key in load} >= set(LOADS["beside"])
    assert {key for text in texts for key in text["body"]} >= set(LOADS["body"])
    assert {key for text in texts for key in text} >= set(LOADS["table"])
    assert {key for text in texts for key in text["initial"]} >= {*ATTITUDES, *RATES} - {"apm"}  # a file
    assert {how for _, _, how in CASES} == FORMULATED


@pytest.mark.parametrize(("case"), cases(CASES, USUAL, daily=5), ids="-".join)
def test_a_run_that_was_stopped_twice_has_the_same_bits(case: tuple[str, str, str], tmp_path: Path) -> None:
    whole = made(*case)
    assert whole.status == "finished"
    assert [code for code in whole.summary["warning_codes"] if code != "attitude_uncertain"] == []
    steps = whole.summary["cost"]["steps"]
    guard = f"limits.max_steps={max(1, (steps - 1) // 2)}"
    run = run_text(SCENES[case[0]], *settings(*case[1:]), guard, out=tmp_path)
    sessions = 1
    while run.status == "stopped: max_steps":
        assert 0 < run.dataset.sizes["time"] < 49
        run = rigidsim.resume(tmp_path / "scene")
        sessions += 1
    assert sessions >= 3
    assert run.summary["cost"]["sessions"] == sessions
    same_bits(run, whole)


@pytest.mark.parametrize("scene", cases(MAIN, ["top"]))
def test_members_of_a_sweep_are_single_runs(scene: str, tmp_path: Path) -> None:
    axes = "".join(f"axes.'{key}' = {{values = {values}}}\n" for key, values in VARIED[scene].items())
    swept = SCENES[scene] + f'[sweep]\nmode = "zip"\nkeep = ["final"]\n{axes}'
    members = rigidsim.sweep(rigidsim.parse(swept), out=tmp_path).dataset
    for number in range(2):
        changes = [f"{key}={values[number]}" for key, values in VARIED[scene].items()]
        alone = loaded(run_text(SCENES[scene], *changes)).isel(time=-1)
        for name in ("quaternion", "angular_velocity"):  # a batch rounds otherwise
            found = members[f"{name}_final"].values[number]
            np.testing.assert_allclose(found, alone[name].values, rtol=0, atol=1e-13)


@pytest.mark.parametrize("precision", cases(EXACT, []))
def test_announced_errors_are_true(precision: str) -> None:
    announced, true = [], []
    for scene in MAIN:
        run = made(scene, precision, estimate=True)
        announced.append(run.summary["accuracy"]["estimated_attitude_error"])
        runs = (made(scene, given) for given in (precision, EXACT[precision]))
        one, other = (wide(run.dataset, "quaternion") for run in runs)
        true.append(float(angle_between(one, other).max()))  # the announced one is the largest of the run
    assert_announced(announced, true)


@pytest.mark.parametrize(
    "case", cases([c for c in CASES if c[2] != "quaternion"], USUAL[2:3], daily=3), ids="-".join
)
def test_formulations_agree(case: tuple[str, str, str]) -> None:
    scene, precision, _ = case
    runs = (made(scene, precision, how) for how in ("quaternion", case[2]))
    one, other = (wide(run.dataset, "angular_velocity") for run in runs)
    assert np.abs(one - other).max() <= 1000 * max(EPSILON[precision], 2.0**-63)


@pytest.mark.parametrize("name", cases(FORMATS[:-2], ["csv"], daily=3))  # the last two: test_deep_time
def test_every_format_takes_a_resumed_run(name: str, tmp_path: Path) -> None:
    if name in ("parquet", "zarr"):
        pytest.importorskip({"parquet": "pyarrow"}.get(name, name))
    scene = "flight" if name == "oem" else "top"  # the others take smooth motions, or any
    run_text(SCENES[scene], "limits.max_steps=5", out=tmp_path)
    rigidsim.resume(tmp_path / "scene", overrides=["limits.max_steps=1000"])
    given = {
        "epoch": "2020-01-01T00:00:00 TDB",
        "axes": "EME2000",
        "object_name": "BODY",
        "object_id": "-999",
    }
    naming = Naming(**{key: value for key, value in given.items() if key in format_named(name).names})
    paths = rigidsim.export(tmp_path / "scene", name, tmp_path / f"scene.{name}", naming=naming)
    assert paths
    assert all(path.exists() for path in paths)
