"""Files of gravity fields: ICGEM and SHADR, read exactly, cut to what is asked for, or refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

G = 6.67430e-11
MASS, RADIUS = 7e22, 1.7e6
# unnormalized degree 2 of the moments, which files have
MOMENTS = (0.3930 * MASS * RADIUS**2, 0.3931 * MASS * RADIUS**2, 0.3933 * MASS * RADIUS**2)
C20, C22 = -0.00025, 0.000025
HIGHER = {
    (3, 0): (-8.4e-6, 0.0),
    (3, 1): (2.8e-5, 5.9e-6),
    (3, 2): (4.8e-6, 1.7e-6),
    (3, 3): (1.7e-6, -2.5e-7),
}
HIGHER |= {(4, m): (1e-6 / (m + 1), -2e-7 * (m > 0)) for m in range(5)}
ROWS = {(0, 0): (1.0, 0.0), (2, 0): (C20, 0.0), (2, 1): (0.0, 0.0), (2, 2): (C22, 0.0)} | HIGHER


def factor(n: int, m: int) -> float:
    """Fully normalized coefficients are smaller by it."""
    return float(np.sqrt((1 if m == 0 else 2) * (2 * n + 1) * _factorial(n - m) / _factorial(n + m)))


def _factorial(n: int) -> int:
    return 1 if n < 2 else n * _factorial(n - 1)


def gfc(
    norm: str = "norm fully_normalized", rows: dict | None = None, more: str = "", mark: str = "e"
) -> str:
    full = "unnormalized" not in norm  # the default of the format
    lines = [
        f"gfc {n} {m} {c / (factor(n, m) if full else 1):.17e} {s / (factor(n, m) if full else 1):.17e} 0 0"
        for (n, m), (c, s) in (rows or ROWS).items()
    ]
    body = "\n".join(lines).replace("e", mark)
    return (
        f"A field that was made up\nbegin_of_head ===\nproduct_type gravity_field\nmodelname lumps\n"
        f"earth_gravity_constant {G * MASS:.17e}\nradius {RADIUS:.1f}\nmax_degree 4\nerrors formal\n{norm}\n"
        f"tide_system zero_tide\nend_of_head ===\n{body}\n{more}"
    )


def tab(normalization: int = 1, longitude: str = "0.0") -> str:
    lines = [
        f" {n}, {m}, {c / (factor(n, m) if normalization else 1):.17e}, "
        f"{s / (factor(n, m) if normalization else 1):.17e}, 0, 0"
        for (n, m), (c, s) in ROWS.items()
        if n
    ]
    head = f" {RADIUS / 1000:.6e}, {G * MASS / 1e9:.17e}, 0.1, 4, 4, {normalization}, {longitude}, 0.0"
    return head + "\r\n" + "\r\n".join(lines) + "\r\n"


def text(field: str, degree: int = 4, body: str = "", mass: float = MASS) -> str:
    moments = ", ".join(map(repr, MOMENTS))
    body = body or f"principal_moments = [{moments}]"
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 4e14\nposition = [2e8, 1e8, 3e8]\n'
    load += f"degree = {degree}"
    return config(
        f"{body}\nmass = {mass!r}\ngravity_field = {field}",
        "angular_velocity = [1e-6, 2e-6, 3e-6]\nquaternion = [0.5, 0.1, -0.7, 0.3]",
        load,
        "end = 1e5\nsamples = 3",
    )


def listed(rows: dict = HIGHER) -> str:
    cosines, sines = (
        ", ".join(f'"{n},{m}" = {row[i]!r}' for (n, m), row in rows.items() if not i or m) for i in (0, 1)
    )
    return f"{{radius = {RADIUS!r}, C = {{{cosines}}}, S = {{{sines}}}}}"


def saved(folder: Path, field: str, name: str = "lumps.gfc", **more: object) -> rigidsim.Experiment:
    (folder / name).write_text(field, newline="")
    keys = ", ".join(f"{key} = {value}" for key, value in more.items())
    given = f'{{file = "{name}"{", " + keys if keys else ""}}}'
    (folder / "scene.toml").write_text(text(given))
    return rigidsim.load(folder / "scene.toml")


def final(experiment: rigidsim.Experiment) -> np.ndarray:
    return run_text(experiment.text).dataset.angular_velocity.values[-1]


@pytest.mark.parametrize(
    "field",
    [
        pytest.param(field, id=name, marks=[pytest.mark.slow] * late)
        for late, name, field in (
            (0, "gfc", gfc("errors formal", mark="D")),
            (1, "unnormalized", gfc("norm unnormalized")),
            (1, "tab", tab()),
            (0, "tab unnormalized", tab(0)),
        )
    ],
)
def test_a_file_is_the_field_that_it_lists(tmp_path: Path, field: str) -> None:
    found, expected = final(saved(tmp_path, field)), final(rigidsim.parse(text(listed())))
    without = final(rigidsim.parse(text(listed(), degree=2)))
    assert np.abs(found - expected).max() < 1e-15 * np.abs(expected).max() * 4
    assert np.abs(expected - without).max() > 1e-12 * np.abs(expected).max()


def test_the_text_belongs_to_the_config_to_the_degree_that_is_asked(tmp_path: Path) -> None:
    field = gfc(rows=ROWS | {(5, 0): (1e-7, 0.0)}).replace("max_degree 4", "max_degree 5")
    experiment = saved(tmp_path, field)
    assert "gfc 4 4" in experiment.text
    assert "gfc 5 0" not in experiment.text
    again = rigidsim.parse(experiment.text)
    (tmp_path / "lumps.gfc").unlink()
    assert final(again).tolist() == final(experiment).tolist()
    with pytest.raises(ConfigError, match=r"no row of degree 5, order 0.*remove that table"):
        prepare(again.replace({"loads[0].degree": 5}))


def test_every_digit_is_kept(tmp_path: Path) -> None:
    """In 40 digits a file is the list of its unnormalized numbers, to the last digit."""
    digits = "1.234567890123456789012345678901234567890e-5"
    rows = {**HIGHER, (3, 0): (0.0, 0.0)}
    field = gfc("norm unnormalized", ROWS | {(3, 0): (0.0, 0.0)})
    field = re.sub(r"gfc 3 0 \S+", f"gfc 3 0 {digits}", field)
    by_file = prepare(saved(tmp_path, field).replace({"integrator.precision": 40}))
    by_hand = prepare(
        rigidsim.parse(text(listed(rows).replace('"3,0" = 0.0', f'"3,0" = {digits}'))).replace(
            {"integrator.precision": 40}
        )
    )
    keys = by_hand.scene.body.gravity.coefficients
    there = by_file.scene.body.gravity.coefficients
    assert there[3, 0, False] == keys[3, 0, False]
    assert (
        by_file.scene.context.nstr(there[3, 0, False], 40)
        == "0.00001234567890123456789012345678901234567890"[:-1]
    )


REFUSED = {
    "another normalization": (gfc("norm half"), "has norm half"),
    "degree 2 of another body": (
        gfc(rows=ROWS | {(2, 0): (-0.001, 0.0)}),
        "whose C20 is -0.001 (unnormalized), but the inertia tensor makes it -0.00025",
    ),
    "another mass": (gfc().replace(f"{G * MASS:.17e}", "4e14"), "is it the field of another body?"),
    "origin elsewhere": (gfc(rows=ROWS | {(1, 0): (1e-5, 0.0)}), "its origin isn't the centre of mass"),
    "cut short": (gfc(rows=dict(list(ROWS.items())[:-1])), "has no row of degree 4, order 4"),
    "time-variable": (gfc(more="gfct 3 1 1e-6 0 20000101\n"), "time-variable terms aren't read"),
    "too low": (gfc().replace("max_degree 4", "max_degree 3"), "ends at degree 3, and degree 4 is asked for"),
    "no field": ("degree,order,C,S\n2,0,1,1\n", "is neither ICGEM (a header up to end_of_head) nor SHADR"),
    "SHADR of another meridian": (tab(longitude="15.0"), "refers to a longitude of 15.0 deg"),
}


@pytest.mark.parametrize("which", REFUSED)
def test_a_bad_file_is_refused_with_the_reason(tmp_path: Path, which: str) -> None:
    field, message = REFUSED[which]
    with pytest.raises(ConfigError, match=re.escape(message)):
        prepare(saved(tmp_path, field))
