"""Small experiments for the tests of files."""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture(scope="session")
def free_body() -> Callable[..., str]:
    """Text of an asymmetric free body; a table given by keyword is appended as it stands."""

    def text(
        time: str = "end = 3\nsamples = 49",
        *,
        precision: str = '"double"',
        formulation: str = "auto",
        output: str = "",
        name: str = "free",
    ) -> str:
        return (
            f'name = "{name}"\n'
            "[body]\nprincipal_moments = [1, 2, 2.5]\n"
            "[initial]\nangular_velocity = [0.3, 1.0, 0.5]\neuler_angles = [0.2, 1.1, 0.7]\n"
            f"[time]\n{time}\n"
            f'[integrator]\nprecision = {precision}\nformulation = "{formulation}"\n'
            f"[output]\ntimeline = false\n{output}\n"
        )

    return text
