"""A load from outside the package: a class that is registered by one line is a kind of ``[[loads]]``.

Everything above the tests is what its author writes. It is checked, planned, recorded and reproduced like
rigidsim's own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from equations import CLOSE, derivative
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.model.loads import InSI, Load, Term
from rigidsim.scene.fields import Moment, Rate
from rigidsim.scene.registry import LoadFields, Setting, register_load
from rigidsim.solve.problem import prepare


class SpringFields(LoadFields):
    """A torque that turns the body's z axis towards the space axis X: -stiffness times the cosine."""

    kind: Literal["torsion_wire"]
    inertia: Moment
    frequency: Rate


class TorsionWire(Load):
    """Potential -k R_Xz with k = inertia frequency^2."""

    Fields = SpringFields
    title = "torsion_wire"
    reads = frozenset({"attitude"})
    conservative = True

    def __init__(self, stiffness: Any) -> None:
        self.stiffness = stiffness

    @classmethod
    def resolve(cls, fields: SpringFields, around: Setting) -> TorsionWire:
        if fields.inertia.sign <= 0:
            raise around.fault("inertia", f"given {float(fields.inertia):g}; a positive number is allowed")
        return cls(fields.inertia.at(around.context) * fields.frequency.at(around.context) ** 2)

    def torque(self, m: InSI) -> list[Term]:
        k, zero = self.stiffness, m.scene.context.zero
        return [([-k, zero, zero], m.matrix[0][1]), ([zero, k, zero], m.matrix[0][0])]

    def potential(self, m: InSI) -> Any:
        return -m.number(self.stiffness) * m.matrix[0][2]

    def amplitude(self, scene: Any) -> Any:
        return 2 * self.stiffness


def register() -> None:
    register_load(TorsionWire)


# --- the tests ----------------------------------------------------------------------------------------------

WIRE = 'kind = "torsion_wire"\ninertia = "2 kg m^2"\nfrequency = "30 rpm"'
STIFFNESS = 2 * np.pi**2


def test_a_load_with_fields_is_usable_in_a_config(runs: Path) -> None:
    text = config(loads=WIRE, output='record = ["quaternion", "energy", "potential_energy"]')
    system = prepare(rigidsim.parse(text)).system
    w, q = np.array([0.3, 1.0, 0.5]), np.array([1.0, 0, 0, 0])
    rates = derivative(system, np.concatenate([w, q]))[:3]
    moments = np.array([1, 2, 2.5])
    torque = np.array([0, STIFFNESS, 0])  # z x X = Y
    expected = (np.cross(moments * w, w) + torque) / moments
    np.testing.assert_allclose(rates, expected, rtol=0, atol=CLOSE * STIFFNESS)

    run = run_text(text, out=runs)
    row = run.summary["invariants"]["energy"]
    assert 0 < row["largest_drift"] <= row["bound"]
    assert "angular_momentum" not in run.summary["invariants"]
    qw, qx, qy, qz = run.dataset["quaternion"].values.T
    along = 2 * (qx * qz + qw * qy)
    potential = run.dataset["potential_energy"].values
    np.testing.assert_allclose(potential, -STIFFNESS * along, rtol=0, atol=CLOSE * STIFFNESS)
    # unlike a load given at the call, it is in the config: the run can be reproduced from that alone
    assert run.summary["bit_for_bit"]["claim"] is True
    assert rigidsim.verify(run.folder.path).identical


def test_its_keys_are_checked_like_any_others() -> None:
    with pytest.raises(ConfigError, match=r"number 1 inertia.*given -1; a positive number is allowed"):
        prepare(rigidsim.parse(config(loads=WIRE.replace('"2 kg m^2"', "-1"))))
    with pytest.raises(ConfigError, match=r'frequncy.*"?frequency"?'):
        rigidsim.parse(config(loads=WIRE.replace("frequency", "frequncy")))
    with pytest.raises(ConfigError, match="torsion_wire"):  # the nearest of all kinds, this one among them
        rigidsim.parse(config(loads=WIRE.replace("torsion_wire", "torsion_wires")))
