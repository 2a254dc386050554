"""Loads in a reader's terms, as ``check``, ``plan`` and ``info`` show them."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from rigidsim import parse
from rigidsim.session.understood import told_loads
from rigidsim.solve.problem import prepare

Config = Callable[..., str]
Command = Callable[..., Any]
EARTH = 'gravitational_parameter = "3.986004418e14 m^3/s^2"\n'
TOP = 'shape = "cone"\nmass = 0.3\nradius = 0.03\nheight = 0.05\nreference = "apex"'


def told(
    load: str, *, body: str = "principal_moments = [1, 2, 2.5]\nmass = 4", initial: str = "", more: str = ""
) -> str:
    text = (
        f'name = "told"\n{more}\n[body]\n{body}\n[initial]\nangular_velocity = [0, 0, 2]\n{initial}\n'
        f"[time]\nend = 1\nsamples = 2\n[[loads]]\n{load}\n"
    )
    (line,) = told_loads(prepare(parse(text)))
    return line


def gradient(where: str, strength: str = EARTH) -> str:
    return told(f'kind = "gravity_gradient"\n{strength}{where}')


FLYING = 'position = ["7000 km", 0, 0]\nvelocity = [0, "{} km/s", 0]'
SAID = {
    "circle": (
        lambda: gradient('orbit = {semi_major_axis = "6950 km", inclination = "51.6 deg"}'),
        # 3/2 G M / R^3 (C - A) = 1.5 * 3.986e14 / 6.95e6^3 * 1.5
        "gravity gradient of the Earth (G M 3.986e+14 m^3/s^2), on a circular orbit of 6950 km, 571.9 km "
        "above its surface, period 96.1 min, inclination 51.6 deg; at the start the source is at +X of the "
        "body, and the body at -X of the source; torque up to 2.672e-06 N m",
    ),
    "top": (
        lambda: told('kind = "uniform_gravity"', body=TOP),
        # 0.3 kg * 9.80665 m/s^2 * 3/4 * 0.05 m
        "uniform gravity, 9.80665 m/s^2 down along -Z: torque about the fixed point up to 0.1103 N m",
    ),
    "damping": (
        lambda: told('kind = "viscous_torque"\ncoefficients = [0.1, 0, 0.01]'),
        "viscous torque, 0.1, 0, 0.01 kg m^2/s: damps the rates by 1/e in about x 10 s, z 4.167 min",
    ),
    "torque": (
        lambda: told('kind = "torque"\ncomponents = ["0", "k*cos(t)", "0.3"]', more="parameters.k = 0.4"),
        # |L| = 2.5 kg m^2 * 2 rad/s, over 0.5 N m
        "torque [0, k*cos(t), 0.3] N m in body axes: 0.5 N m at the start, which in 10 s would add up to the "
        "angular momentum",
    ),
    "magnet": (
        lambda: told('kind = "magnetic_dipole"\nmoment = [0, 0, 0.5]\nfield = ["30 uT", 0, 0]'),
        "magnetic dipole of 0.5 A m^2 in a uniform field of 3e-05 T: torque up to 1.5e-05 N m",
    ),
}


@pytest.mark.parametrize(("line", "expected"), SAID.values(), ids=SAID)
def test_each_kind_describes_itself(line: Callable[[], str], expected: str) -> None:
    assert line() == expected


def test_check_plan_and_info_show_it_and_run_does_not(config: Config, rigidsim_command: Command) -> None:
    text = config(
        initial="angular_velocity = [0, 0, 1e-3]",
        rest=f'[[loads]]\nkind = "gravity_gradient"\n{EARTH}orbit = {{semi_major_axis = 6950}}',
    )
    said = "gravity gradient of the Earth (G M 3.986e+14 m^3/s^2), on a circular orbit of 6950 m, below its"
    warning = "[[loads]] number 1 orbit.semi_major_axis: given 6950 without a unit"
    ran = rigidsim_command("run", text)
    assert f"rigidsim: warning: free.toml: {warning}" in ran.stderr
    assert "load " not in ran.stdout
    for command in (("check", text), ("plan", text), ("info", "runs/free")):
        shown = " ".join(rigidsim_command(*command).stdout.split())
        assert f"load {said}" in shown
        assert f"warning {warning}" in shown
        told_json = json.loads(rigidsim_command(*command, "--json").stdout)
        assert told_json["loads"][0].startswith(said)
        assert "length_without_unit" in told_json["warning_codes"]


def test_rotors_and_own_states_are_on_lines_of_their_own(config: Config, rigidsim_command: Command) -> None:
    text = config(
        rest='[[rotors]]\nname = "wheel"\naxis = [0, 0, 1]\nmoment = 0.01\n'
        '[[states]]\nname = "turned"\nderivative = "wz"\n'
    )
    assert rigidsim_command("run", text).exit_code == 0
    for command in (("check", text), ("plan", text), ("info", "runs/free")):
        lines = rigidsim_command(*command).stdout.splitlines()
        assert any(line.startswith("rotor    wheel: 0.01 kg m^2 about") for line in lines)
        assert 'state    turned: from 0, changes by "wz"' in lines
        assert not any(line.startswith("load ") for line in lines)
        told_json = json.loads(rigidsim_command(*command, "--json").stdout)
        assert [line.split()[0] for line in told_json["loads"]] == ["rotor", "state"]
