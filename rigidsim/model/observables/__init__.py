"""Observables and invariants: everything that can be recorded, as expressions of the state.

One module per subject. Importing this package registers the observables in the order of the dataset.
"""

from rigidsim.model.observables import mechanical  # noqa: F401, I001  (enters what it defines)
from rigidsim.model.observables import axes, rotation, orbit, top, point_masses, parts, climate  # noqa: F401
from rigidsim.model.observables.observable import (
    Angle as Angle,
    Observable as Observable,
    always as always,
    continuous_angles as continuous_angles,
    only_when_named as only_when_named,
    register_all,
)

register_all(orbit.RESONANT_ANGLE)  # the last of the dataset
