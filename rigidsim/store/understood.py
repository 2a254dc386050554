"""What was understood of a config, as ``plan``, ``run`` and ``info`` show it: body, start and time."""

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
        euler_sequence, euler_angles_deg: the attitude as intrinsic angles, as given where these were given.
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
    """When a motion starts and ends, and its samples.

    Attributes:
        every_s: from one sample to the next; None where their times are listed.
        epoch: what time 0 is; empty where nothing says it.
        unit: by which the config calls times; empty where it names none.
    """

    start_s: FiniteNumber
    end_s: FiniteNumber
    samples: StrictInt
    every_s: FiniteNumber | None
    epoch: Text = ""
    unit: Text = ""
