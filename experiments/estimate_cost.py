"""What does the estimate of a run's errors cost? Some scenes of all kinds, from a millisecond on.

Each scene is integrated and then estimated as in a run, with nothing written; "run" is the CPU time of
compiling and integrating it, without the dataset. Wanted: at most 50 ms below a second; above, 5 % of the run
in the median, and 40 % where errors grow by more than time makes them. Times depend on what else the machine
does: compare two states of the code in turn, on the same machine.

Run: python -m experiments.estimate_cost [--full] [--only WORD]
heyoka's caches of compiled code, in memory and on disk, are emptied before each scene: everything is compiled
as for a new one. "again" is the same estimate with what it needs compiled, as of a scene that was run before.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import heyoka
import numpy as np

import rigidsim
from rigidsim.session.diagnostics import Diagnostics
from rigidsim.session.recorder import SampleStatistics
from rigidsim.solve.assembly import assemble, sampler
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.problem import prepare
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import SampleReceiver

SHORT = 1.0
"""Seconds of an integration, below which what counts is milliseconds."""
_FRESH = "ESTIMATE_COST_FRESH"
_ORBIT = """kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1, eccentricity = %s, inclination = 0.5}"""
_TORQUE = 'kind = "torque"\ncomponents = ["0.01*sin(0.3*t)", "0.02*cos(0.5*t)", "0"]'
_DRY = 'kind = "torque"\ncomponents = ["-0.01*sign(wx)", "-0.002*abs(wy)*wy", "0"]'
_FALL = 'kind = "central_gravity"\ngravitational_parameter = 1'
_TUMBLING = "principal_moments = [1, 2, 2.5]", "angular_velocity = [0.5, 0.25, 1]"
_PLATE = (
    "principal_moments = [1, 1.5, 2.4]\nmass = 1\ncenter_of_mass = [0.1, 0.2, 0.5]",
    "euler_angles = [0.1, 0.9, 0.2]\nangular_velocity = [1, 1, 2]",
)
_WEIGHT = 'kind = "uniform_gravity"\nacceleration = [0, 0, -1]'
_SPINNING = "principal_moments = [1, 1.5, 2]", "angular_velocity = [0.02, 0.03, 1]"


@dataclass(frozen=True)
class Measured:
    """CPU seconds; ``again``: of the estimate once what it needs is compiled; ``amplified``:
    whether errors were found to grow by more than time makes them."""

    name: str
    steps: int
    build: float
    integration: float
    estimate: float
    again: float
    announced: float
    amplified: bool
    how: str

    @property
    def run(self) -> float:
        """Without the estimate."""
        return self.build + self.integration

    @property
    def short(self) -> bool:
        """Whether milliseconds are what counts."""
        return self.integration < SHORT

    @property
    def row(self) -> str:
        """Of the table."""
        share = f"{self.estimate / self.run:.1%}" if not self.short else ""
        return (
            f"| {self.name} | {self.steps} | {1e3 * self.build:.0f} | {1e3 * self.integration:.1f} "
            f"| {1e3 * self.estimate:.1f} | {1e3 * self.again:.1f} | {share} | {self.announced:.1e} |"
        )


def scene(body: Sequence[str], load: str, end: float, integrator: str = "", samples: int = 200) -> str:
    """A config; body: of it and its start."""
    return "\n".join(
        [
            'name = "cost"',
            "[body]",
            body[0],
            "[initial]",
            *body[1:],
            *(["[[loads]]", load] if load else []),
            f"[time]\nend = {end}\nsamples = {samples}",
            "[integrator]",
            integrator,
            '[output]\nrecord = ["quaternion", "angular_velocity"]\ntimeline = false',
        ]
    )


def scenes(*, full: bool = False) -> dict[str, str]:
    """By name; the longest take tens of seconds."""
    falling = ["principal_moments = [1, 1.3, 1.6]\nmass = 1", "angular_velocity = [0.1, 0.2, 0.3]"]
    falling += ["position = [100, 0, 0]\nvelocity = [0, 0.06, 0.03]"]
    found = {
        "torque in time, 1 ms": scene(_TUMBLING, _TORQUE, 100),
        "torque in time, 10 ms": scene(_TUMBLING, _TORQUE, 3e3),
        "torque in time, 50 ms": scene(_TUMBLING, _TORQUE, 2e4),
        "torque in time, 0.5 s": scene(_TUMBLING, _TORQUE, 2e5),
        "satellite, 1 ms": scene(_SPINNING, _ORBIT % 0.01, 100),
        "satellite, 10 ms": scene(_SPINNING, _ORBIT % 0.01, 1e3),
        "satellite, 0.1 s": scene(_SPINNING, _ORBIT % 0.01, 1e4),
        "chaotic satellite": scene(_TUMBLING, _ORBIT % 0.1, 1e4),
        "free fall, six degrees": scene(falling, _FALL, 2e4),
        "free body (closed form)": scene(_TUMBLING, "", 2e4),
        "loose tolerance": scene(_TUMBLING, _TORQUE, 3e3, "tolerance = 1e-8"),
        "Euler angles": scene(_TUMBLING, _TORQUE, 3e3, 'formulation = "euler_angles"'),
        "canonical": scene(_PLATE, _WEIGHT, 1e3, 'formulation = "canonical"'),
        "single": scene(_TUMBLING, _TORQUE, 3e3, 'precision = "single"'),
        "extended": scene(_TUMBLING, _TORQUE, 1e3, 'precision = "extended"'),
        "dry friction, 20": scene(_TUMBLING, _DRY, 20),
        "dry friction, 200": scene(_TUMBLING, _DRY, 200),
    }
    if full:
        found |= {
            "torque in time, 2 s": scene(_TUMBLING, _TORQUE, 1e6),
            "satellite, 3 s": scene(_SPINNING, _ORBIT % 0.01, 3e5),
            "torque in time, 10 s": scene(_TUMBLING, _TORQUE, 3e6),
            "chaotic satellite, long": scene(_TUMBLING, _ORBIT % 0.1, 2e5),
            "extended, long": scene(_TUMBLING, _TORQUE, 1e5, 'precision = "extended"'),
        }
    return found


class _Watched(SampleReceiver):
    """What a run keeps of its samples for the estimate."""

    def __init__(self, trail: SampleTrail) -> None:
        self.trail = trail

    def take(self, block: SampleBlock) -> None:
        self.trail.take(block)


def measure(name: str, text: str) -> Measured:
    """Integrate a scene and estimate its errors."""
    prepared = prepare(rigidsim.parse(text))
    heyoka.llvm_state.clear_memcache()
    heyoka.llvm_state.clear_diskcache()
    started = time.process_time()
    parts = assemble(prepared)
    watched = _Watched(SampleTrail(prepared.precision))
    loop = sampler(prepared, parts, watched)
    built = time.process_time()
    progress = loop.run()
    ended = time.process_time()
    diagnostics = Diagnostics(prepared, progress, SampleStatistics())
    found = diagnostics.estimated(watched.trail, parts.corrected).estimate
    estimated = time.process_time()
    diagnostics.estimated(watched.trail, parts.corrected)
    again = time.process_time()
    assert found is not None
    return Measured(
        name,
        progress.steps,
        built - started,
        ended - built,
        estimated - ended,
        again - estimated,
        found.leading,
        found.amplification > 1,
        found.how,
    )


def table(measured: Sequence[Measured]) -> list[str]:
    """Markdown, and what is wanted."""
    head = "| scene | steps | build, ms | integration, ms | estimate, ms | again, ms | of the run "
    head += "| announced, rad |"
    lines = [head, "| --- " * 8 + "|", *(one.row for one in measured), ""]
    below = [1e3 * one.estimate for one in measured if one.short]
    for title, amplified in (("growing as time makes them", False), ("growing by more", True)):
        above = [one for one in measured if not one.short and one.amplified == amplified]
        if above:
            shares = [f"{x:.1%}" for x in _spread([one.estimate / one.run for one in above])]
            lines.append(f"Above a second, errors {title}: {_words(shares, len(above))}")
    again = [1e3 * one.again for one in measured if one.short]
    if below:
        words = _words([f"{x:.0f} ms" for x in _spread(again)], len(again))
        lines.append(f"The same again, compiled: {words}")
        lines.append(f"Below a second: {_words([f'{x:.0f} ms' for x in _spread(below)], len(below))}")
    return lines


def _spread(values: Sequence[float]) -> list[float]:
    return [float(x) for x in np.quantile(values, [0.5, 0.9, 1.0])]


def _words(values: Sequence[str], count: int) -> str:
    return f"median {values[0]}, 90 % {values[1]}, largest {values[2]} of {count} runs"


def main(argv: Sequence[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m experiments.estimate_cost")
    parser.add_argument("--full", action="store_true", help="with runs of two and ten seconds")
    parser.add_argument("--only", default="", help="scenes with this word in their name")
    arguments = parser.parse_args(argv)
    if _FRESH not in os.environ:
        with tempfile.TemporaryDirectory() as empty:
            given = sys.argv[1:] if argv is None else argv
            command = [sys.executable, __file__, *given]
            environment = {**os.environ, "HEYOKA_CACHE_DIR": empty, _FRESH: "1"}
            return subprocess.run(command, env=environment, check=False).returncode
    chosen = {n: text for n, text in scenes(full=arguments.full).items() if arguments.only in n}
    measure("warming", scene(_TUMBLING, _TORQUE, 1.0))  # what is imported and compiled once
    measured = []
    for name, text in chosen.items():
        measured.append(measure(name, text))
        print(measured[-1].row, flush=True)
    print("\n".join(["", *table(measured)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
