"""Lanes of states over time: events, changes of chart, and how a run ended."""

from dataclasses import dataclass

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.solids import Array, rotation_matrix
from rigidsim.look.stages.parts import PALE, PULL, Color

MOST_EVENTS = 2000  # largest number of events of one kind in a lane; of more, the first are shown
CHART_LEFT = 0.5  # singular factor below which the solver leaves a chart of Euler angles
_SHADES: tuple[Color, Color] = ((92, 148, 235), (240, 190, 60))


@dataclass(frozen=True)
class States:
    """One lane of states: when they begin (changes,), s, their names, and colours by name."""

    name: str
    seconds: Array
    values: list[str]
    colors: dict[str, Color]


def states_of(dataset: xarray.Dataset, start: float, end: float) -> list[States]:
    """Lanes: one for each event, which changes colour when it happens, and one for a run that was stopped,
    from the first to the last sample's time, s.
    """
    lanes = []
    for name in events_of(dataset):
        times = np.asarray(dataset[f"{name}_time"].values, dtype=np.float64)[:MOST_EVENTS]
        values = [f"before {name}", *(f"{name} {k + 1}" for k in range(len(times)))]
        colors = {value: PALE if k == 0 else _SHADES[k % 2] for k, value in enumerate(values)}
        lanes.append(States(name, np.append(start, times), values, colors))
    status = str(dataset.attrs.get("status", ""))
    if status and status not in ("finished", "running"):
        words = status.replace("_", " ")
        colors = {"running": _SHADES[0], words: PULL}
        lanes.append(States("run", np.array([start, end]), list(colors), colors))
    return lanes


def charts_of(dataset: xarray.Dataset) -> list[States]:
    """A lane for a run in Euler angles that shows which of its two sequences carried it.

    A chart is left at the first step after which its singular factor is below ``CHART_LEFT``. Of steps a
    dataset knows nothing: a change is shown at the first sample from which it is certain, and one that lies
    between two sparse samples isn't seen.
    """
    asked, partner = (
        str(dataset.attrs.get(f"euler_{word}", "")) for word in ("sequence", "partner_sequence")
    )
    attitude = signals.values(dataset, "quaternion")
    if not (asked and partner) or attitude is None:
        return []
    turned = rotation_matrix(attitude)
    # of an intrinsic sequence i j k the entry (i, k) is the cosine or sine that its middle angle leaves
    entries = [turned[:, "xyz".index(name[0]), "xyz".index(name[2])] for name in (asked, partner)]
    near = [np.sqrt(np.maximum(1 - entry**2, 0.0)) < CHART_LEFT for entry in entries]
    first = int(near[0][0])
    chart, changes = first, [0]
    for row in np.flatnonzero(near[0] | near[1]):
        if near[chart][row]:
            chart = 1 - chart
            changes.append(int(row))
    begins = signals.seconds(dataset)[np.array(changes[: MOST_EVENTS + 1])]
    values = [(asked, partner)[(first + k) % 2] for k in range(len(begins))]
    return [States("chart", begins, values, dict(zip((asked, partner), _SHADES, strict=True)))]


def events_of(dataset: xarray.Dataset) -> list[str]:
    """Names of the events whose times the dataset has."""
    names = []
    for name in (*map(str, dataset.data_vars), *map(str, dataset.coords)):
        variable = dataset[name]
        event = str(variable.attrs.get("event", ""))
        if event and name == f"{event}_time" and variable.dims == (event,) and variable.shape[0]:
            names.append(event)
    return names
