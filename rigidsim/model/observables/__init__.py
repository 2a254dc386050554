"""Observables and invariants: everything that can be recorded, as expressions of the state.

One module per subject. Importing this package registers the observables in the order of the dataset.
"""

from rigidsim.model.observables.axes import (
    AXES,
    CLIMATE,
    ORBIT,
    POINT_MASSES,
    POLE,
    RESONANT_ANGLE,
    ROTATION,
)
from rigidsim.model.observables.mechanical import MECHANICAL, PARTS, TOP, TOPS, WATCHED
from rigidsim.model.observables.observable import (
    Angle as Angle,
)
from rigidsim.model.observables.observable import (
    Observable as Observable,
)
from rigidsim.model.observables.observable import (
    always as always,
)
from rigidsim.model.observables.observable import (
    continuous_angles as continuous_angles,
)
from rigidsim.model.observables.observable import (
    only_when_named as only_when_named,
)
from rigidsim.model.observables.observable import (
    register_all,
)
from rigidsim.model.observables.pair import PAIR

register_all(*MECHANICAL, *AXES, *ROTATION, *POLE, *ORBIT, *TOP, *POINT_MASSES, *PARTS, *PAIR, *CLIMATE)
register_all(RESONANT_ANGLE, *TOPS, *WATCHED)
