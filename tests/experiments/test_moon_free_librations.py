"""The fits of free librations, on motions made of them."""

import numpy as np
import pytest


def test_the_start_is_de421s() -> None:
    pytest.importorskip("de421")
    from experiments import moon_free_librations as study

    attitude, rates = study.start()
    assert attitude.T @ attitude == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.norm(rates) == pytest.approx(0.22997, abs=2e-4)
    assert study.circular()[0] == pytest.approx(1045.3, abs=0.1)
