"""Writes mars_elements.csv: osculating elements of Mars from VSOP2013, for mars_with_table.toml.

    python configs/tables/mars_elements.py

Heliocentric, in the mean ecliptic and equinox of J2000, times from J2000 (TDB): Simon, Francou, Fienga &
Manche 2013 (A&A 557, A49), as heyoka has the series, without terms below 1e-9. The series give a, the mean
longitude, k + i h = e exp(i w) with the longitude of periapsis w, and q + i p = sin(i/2) exp(i node).
"""

from __future__ import annotations

import math
from pathlib import Path

import heyoka as hy
import numpy as np

MARS = 4  # by the series' count
FIRST, LAST, EVERY = -80, 1480, 20  # days
PER_MILLENNIUM = 1 / 365250.0


def main() -> None:
    """Write the table beside this file."""
    time = hy.make_vars("millennia")
    series = [hy.model.vsop2013_elliptic(MARS, n, time_expr=time, thresh=1e-9) for n in range(1, 7)]
    elements = hy.cfunc(series, [time], compact_mode=True)
    lines = [
        "# Mars, heliocentric osculating elements: VSOP2013 (Simon et al. 2013), terms above 1e-9;",
        "# mean ecliptic and equinox of J2000, time from J2000 (TDB). Written by mars_elements.py.",
        "time [day], semi_major_axis [au], eccentricity, inclination [deg], ascending_node [deg], "
        "longitude_of_periapsis [deg], mean_longitude [deg]",
    ]
    for day in range(FIRST, LAST + EVERY, EVERY):
        axis, longitude, k, h, q, p = (float(x) for x in elements(np.array([day * PER_MILLENNIUM])))
        angles = [
            2 * math.asin(math.hypot(q, p)),
            math.atan2(p, q),
            math.atan2(h, k),
            longitude % (2 * math.pi),
        ]
        degrees = ", ".join(f"{math.degrees(x):.11f}" for x in angles)
        lines.append(f"{day}, {axis:.12f}, {math.hypot(k, h):.13f}, {degrees}")
    Path(__file__).with_name("mars_elements.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
