"""Epoch, axes and names for messages, which no number of a run contains and none of which is invented."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Context, Decimal, localcontext
from typing import Any, get_args

import mpmath

from rigidsim.errors import RigidsimError
from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.frame import ECLIPTIC, EQUATOR, OBLIQUITY, SpaceAxes
from rigidsim.scene.rotations import product
from rigidsim.scene.validation_messages import nearest, shown

_BITS = 160  # far beyond the 16 digits of a message
_WIDE = Context(prec=60)


@dataclass(frozen=True)
class Naming:
    """Values that a run's config may have left open.

    Attributes:
        epoch: time zero of the scene, as in ``[time] epoch``; empty for the config's.
        axes: the scene's space axes, as in ``[frame] axes``, or another name that sender and receiver agree
            on (capitals, digits and underscores); empty for the config's.
        object_name: name of the body; empty for the run's name.
    """

    epoch: str = ""
    axes: str = ""
    object_name: str = ""
    object_id: str = "UNKNOWN"
    center: str = "UNKNOWN"


@dataclass(frozen=True)
class Labels:
    """Epoch and axes that a message names, with remarks for its comments.

    ``turn``: cosine and sine of the angle about X from the message's axes to the scene's, and of half of it;
    None if the standard knows the scene's.
    """

    epoch: Epoch
    frame: str
    notes: list[str]
    turn: tuple[Decimal, Decimal, Decimal, Decimal] | None = None

    def attitude(self, quaternion: list[Decimal]) -> list[Decimal]:
        """Quaternions w x y z from body axes to the message's axes, given those to the scene's."""
        if self.turn is None:
            return quaternion
        with localcontext(_WIDE):
            return product([*self.turn[2:], Decimal(0), Decimal(0)], quaternion)

    def vector(self, components: list[Decimal]) -> list[Decimal]:
        """A vector in the scene's axes resolved along the message's."""
        if self.turn is None:
            return components
        (x, y, z), (cosine, sine) = components, self.turn[:2]
        with localcontext(_WIDE):
            return [x, cosine * y - sine * z, sine * y + cosine * z]


def labels(naming: Naming, attributes: Mapping[str, Any]) -> Labels:
    """Epoch and axes of a message, from the options given and the run's own attributes."""
    epoch = named_epoch(naming, attributes)
    axes = _axes(naming.axes, str(attributes.get("axes", "")))
    note = f"{epoch} is time zero of the scene"
    if axes != ECLIPTIC:
        return Labels(epoch, axes, [note])
    arcsec = float(OBLIQUITY) * 180 / math.pi * 3600
    words = f"turned about X by the obliquity to {EQUATOR}: {arcsec:.3f} arcsec (IAU 2006)"
    context = mpmath.MPContext()
    context.prec = _BITS
    angle = OBLIQUITY.at(context)
    c, s, c_half, s_half = (
        Decimal(mpmath.nstr(f(x), 45)) for x in (angle, angle / 2) for f in (context.cos, context.sin)
    )
    notes = [note, f"its space axes, {axes}, were {words}"]
    return Labels(epoch, EQUATOR, notes, (c, s, c_half, s_half))


def named_epoch(naming: Naming, attributes: Mapping[str, Any]) -> Epoch:
    """Date of time 0, from the run or from an option."""
    given, known = naming.epoch, str(attributes.get("epoch", ""))
    try:
        epoch = parse_epoch(given) if given else None
    except ValueError as error:
        raise RigidsimError(f"--epoch: {error}") from None
    if not known and epoch is None:
        raise RigidsimError(
            "the run doesn't say what its time 0 is, which a message must: give [time] epoch in the config, "
            'or --epoch "2029-04-13T21:46:00 TDB" here (scales TDB, TT and UTC)'
        )
    if known and epoch is not None and str(epoch) != known:
        raise RigidsimError(f"--epoch: given {epoch}, but time 0 of the run is {known}; leave the option out")
    return epoch or parse_epoch(known)


def _axes(given: str, known: str) -> str:
    names = get_args(SpaceAxes)
    if not given and not known:
        raise RigidsimError(
            "the run doesn't say what its space axes are, which a message must: give [frame] axes in the "
            f"config, or --axes here ({', '.join(names)}, or a name in capitals that sender and receiver "
            "agree on); csv needs none"
        )
    if known and given and given != known:
        raise RigidsimError(
            f'--axes: given {shown(given)}, but the run\'s axes are "{known}"; leave the option out'
        )
    near = nearest(given, names)
    if given and given not in names and (near or not re.fullmatch(r"[A-Z][A-Z0-9_]{0,60}", given)):
        raise RigidsimError(
            f"--axes: given {shown(given)}{near}; allowed: {', '.join(names)}, or another name in capitals, "
            "digits and underscores"
        )
    return given or known
