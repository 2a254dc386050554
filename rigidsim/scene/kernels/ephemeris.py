"""``[ephemeris]``: the kernel that places sources given by name, and what a scene sees of its bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from typing import Any

from pydantic import Field, StrictStr

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import J2000, Epoch
from rigidsim.scene.fields import ConfigTable
from rigidsim.scene.kernels.reading import DAY, J2000_DATE, Kernel, KernelError, RelativeEphemeris, kernel_of
from rigidsim.scene.kernels.series import exactly
from rigidsim.scene.space_axes import CELESTIAL, ECLIPTIC, ICRF, obliquity, to_ecliptic
from rigidsim.scene.validation_messages import nearest, shown

_METRES = 1000


class EphemerisTable(ConfigTable):
    """``[ephemeris]``: where sources given by name are."""

    kernel: StrictStr = Field(examples=["de421", "./de440.bsp"])
    """an installed package (de405, de421, de423), or the path of an SPK file from the config's folder, with a
    slash or a suffix; its SHA-256 is kept in the dataset
    """


@dataclass(frozen=True, eq=False, repr=False)
class Ephemeris:
    """A kernel as a scene uses it.

    Attributes:
        kernel: where bodies are.
        given: its name or path as the config gives it.
        axes: name of the scene's space axes.
        ahead: date of the scene's time 0: seconds of TDB since J2000.
        run: start and end of the run, s (mpf).
        used: what the scene has seen of it so far.
    """

    kernel: Kernel
    given: str
    axes: str
    ahead: Fraction
    run: tuple[Any, Any]
    used: list[RelativeEphemeris] = field(default_factory=list)

    def refused(self, what: str) -> ConfigError:
        """The error of the kernel's key."""
        return ConfigError(Problem("[ephemeris] kernel", f'given "{self.given}", {what}'))

    def check_body(self, body: str, fault: Callable[[str], ConfigError]) -> None:
        """Refuse a body that the kernel doesn't place."""
        if not self.kernel.known(body):
            bodies = self.kernel.bodies
            raise fault(
                f"given {shown(body)}{nearest(body, bodies)}; {self.kernel.name} has {', '.join(bodies)}; "
                'others are in SPK files, which [ephemeris] kernel names by their path ("./NAME.bsp")'
            )

    def sight(self, source: str, host: str) -> RelativeEphemeris:
        """One body seen from another (empty: the barycentre) over the run.

        Raises:
            ConfigError: the run goes beyond the kernel's span, or the kernel is damaged.
        """
        try:
            found = self.kernel.sight(source, host)
        except KernelError as error:
            raise self.refused(str(error)) from None
        first, last = found.span
        begin, end = sorted(self.run)
        ahead = exactly(begin.context, self.ahead)
        if begin + ahead < exactly(begin.context, first) or end + ahead > exactly(begin.context, last):
            asked = " to ".join(date_of(int(x + ahead)) for x in self.run)
            reach = " to ".join(map(date_of, found.span))
            what = f'which has "{source}" from {reach} (TDB), but the run goes from {asked}; '
            raise self.refused(what + "change [time] epoch, start or end, or take a longer kernel")
        self.used.append(found)
        return found

    def start_of(self, body: str, context: Any) -> tuple[Vector, Vector]:
        """Place and velocity of a body at the start, m and m/s (mpf), space axes, from the barycentre."""
        sight = self.sight(body, "")
        return self.place(context, sight, self.run[0]), self.place(context, sight, self.run[0], 1)

    def place(self, context: Any, sight: RelativeEphemeris, time: Any, order: int = 0) -> Vector:
        """Vector (mpf, m, space axes) of a sight at a time of the scene (mpf, s), or a derivative of it."""
        found = [_METRES * x for x in sight.at(context, time + exactly(context, self.ahead), order)]
        return to_ecliptic(found, obliquity(context)) if self.axes == ECLIPTIC else found


def resolve_ephemeris(
    table: EphemerisTable | None, axes: str | None, epoch: Epoch | None, run: tuple[Any, Any], source: str
) -> Ephemeris | None:
    """The ephemeris of a config; None without one. ``source`` is where the config is, if it is a file.

    Raises:
        ConfigError: it can't be read, or lacks a date or axes.
    """
    if table is None:
        return None
    if epoch is None:
        what = 'missing; [ephemeris] needs the date of time 0, such as "2000-01-01T12:00:00 TDB" or "J2000"'
        raise ConfigError(Problem("[time] epoch", what))
    if axes not in (None, ECLIPTIC, *CELESTIAL):
        what = (
            f'given "{axes}", which differs from the kernel\'s axes by the bias of 0.02 arcsec of the frame '
        )
        what += f'J2000; "{ICRF}" (the default here), "GCRF" or "{ECLIPTIC}" is allowed'
        raise ConfigError(Problem("[frame] axes", what))
    try:
        kernel = kernel_of(table.kernel, source)
    except KernelError as error:
        raise ConfigError(Problem("[ephemeris] kernel", f'given "{table.kernel}", {error}')) from None
    return Ephemeris(kernel, table.kernel, axes or ICRF, epoch.since_j2000(), run)


def host_of(ephemeris: Ephemeris | None, host: str | None, masses: Sequence[str]) -> str:
    """The body of the kernel that ``[body] host`` names; empty where it names one of ``[[bodies]]``, or none.

    Raises:
        ConfigError: neither has it.
    """
    if ephemeris is None or host is None or host in masses:
        return ""

    def fault(what: str) -> ConfigError:
        also = f", [[bodies]] are {', '.join(masses)}" if masses else ""
        return ConfigError(Problem("[body] host", what + also))

    ephemeris.check_body(host, fault)
    return host


def date_of(seconds: Fraction | int) -> str:
    """Date of a time in seconds since J2000 (TDB), or its Julian date past the years that have one."""
    try:
        whole = J2000.after(Decimal(round(seconds)))
    except (ValueError, OverflowError):
        return f"JD {float(J2000_DATE + Fraction(seconds) / DAY):.1f}"
    text = whole.calendar()
    return text.removesuffix("T00:00:00")
