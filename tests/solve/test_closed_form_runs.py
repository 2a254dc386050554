"""The closed forms are solutions: they agree with high-precision integrations that know nothing of them."""

import math
import random
from typing import Any

import pytest
from closed_scenes import DOWN, EXTREMES, LIMITS, TILTED, against_integration, principal, scene_over, top
from support import cases

SPAN = 8  # internal units of time: the fastest rate is at most 1


def allowed(epsilon: float) -> float:
    """What rounding in some tens of steps may grow to: a perturbation grows by e at most in the time 1/rate
    (a top's or a pendulum's instability included, whose rate is among those that set the unit), and half that
    of a frequency makes a phase.
    """
    return 30 * epsilon * SPAN * math.exp(SPAN)


def random_scene(seed: int) -> dict[str, Any]:
    """A body and a start, of any kind, as arguments of ``scene``."""
    rng = random.Random(seed)
    a, b = rng.uniform(0.1, 1), rng.uniform(0.1, 1)
    c = rng.uniform(abs(a - b), a + b)
    kind = rng.choice(["principal", "points", "top"])
    given: dict[str, Any] = {
        "rates": [rng.uniform(-1, 1) for _ in range(3)],
        "quaternion": [rng.uniform(-1, 1) for _ in range(4)],
    }
    if kind == "principal":
        given["body"] = principal(rng.sample([a, b, c], 3))
    elif kind == "points":  # principal axes that aren't the body axes
        points = [
            f"{{mass = {rng.uniform(0.1, 1)!r}, position = {[rng.uniform(-1, 1) for _ in range(3)]}}}"
            for _ in range(4)
        ]
        given["body"] = f"points = [{', '.join(points)}]"
    else:
        moments = [a, a, rng.uniform(0, 2 * a)]
        axis = rng.randrange(3)
        arm = [0.0, 0.0, rng.uniform(-1, 1)]
        turned = [[v[(i - axis + 2) % 3] for i in range(3)] for v in (moments, arm)]
        given["body"] = f"{principal(turned[0])}\nmass = 1\ncenter_of_mass = {turned[1]}"
        given["gravity"] = [rng.uniform(-1, 1) for _ in range(3)]
    return given


# 40 digits have epsilon 2^-134: allowed(2^-134) is 3e-35, and 1e-36 is asked for
@pytest.mark.parametrize("seed", cases(range(112), range(3), daily=4))
def test_random_bodies_agree_with_an_integration_in_forty_digits(seed: int) -> None:
    assert against_integration(scene_over(SPAN, **random_scene(seed), precision=40)) <= 1e-36


@pytest.mark.parametrize("name", cases(LIMITS, list(LIMITS)[::4]))
def test_limits_agree_with_an_integration_in_forty_digits(name: str) -> None:
    assert against_integration(scene_over(SPAN, **EXTREMES[name], precision=40)) <= 1e-36


@pytest.mark.parametrize("name", cases([n for n in EXTREMES if n not in LIMITS], [], daily=4))
def test_extremes_agree_with_an_integration_in_forty_digits(name: str) -> None:
    assert against_integration(scene_over(SPAN, **EXTREMES[name], precision=40)) <= 1e-36


@pytest.mark.parametrize(
    ("precision", "epsilon"), [("single", 2**-23), ("double", 2**-52), ("extended", 2**-63), (25, 1e-25)]
)
def test_every_precision_gives_its_own_digits(precision: Any, epsilon: float) -> None:
    given = {"body": top(1, 0.5), "rates": [0.1, 0.2, 3], "quaternion": TILTED, "gravity": DOWN}
    assert against_integration(scene_over(SPAN, **given, precision=precision)) <= allowed(epsilon)
