"""How a config was understood, as ``plan``, ``run`` and ``info`` show it: body, start and time."""

from __future__ import annotations

from pydantic import StrictInt

from rigidsim.store.summary_fields import FiniteNumber, SummaryPart, Text, Three

Four = tuple[FiniteNumber, FiniteNumber, FiniteNumber, FiniteNumber]


class UnderstoodBody(SummaryPart):
    """Where the inertia came from; principal moments (kg m^2) and axes (rows, body axes), mass (kg).

    Attributes:
        center_of_mass: body axes, from the point that the body turns about, m.
    """

    source: Text
    principal_moments: tuple[FiniteNumber, ...]
    principal_axes: tuple[tuple[FiniteNumber, ...], ...]
    mass: FiniteNumber | None
    center_of_mass: Three | None = None


class Start(SummaryPart):
    """The state that a motion starts from.

    Attributes:
        quaternion: w x y z, body to space.
        angular_velocity: body axes, rad/s.
        position, velocity: of the centre of mass, space axes, m and m/s; None unless it moves freely.
    """

    euler_sequence: Text
    euler_angles_deg: Three
    quaternion: Four
    angular_velocity: Three
    position: Three | None = None
    velocity: Three | None = None


class Span(SummaryPart):
    """Start and end of a motion, and its samples.

    Attributes:
        every_s: sampling interval; None if the times are listed.
        epoch: date of time 0; empty if unknown.
        unit: unit of times in the config; empty if it names none.
    """

    start_s: FiniteNumber
    end_s: FiniteNumber
    samples: StrictInt
    every_s: FiniteNumber | None
    epoch: Text = ""
    unit: Text = ""
