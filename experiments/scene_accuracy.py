"""How accurate are the ready scenes?

Question: for every config of configs/, how far is the attitude of a run in double precision from the same
scene in 80-bit arithmetic (rounding errors 2048 times smaller), in each formulation; how large are the
drifts; and what had the run's own summary announced?

Held against: the round-off law (eps/2) sqrt(steps) |w| t / sqrt 3 (Brouwer 1937), tripled, for stable
motions; and what is announced.

Run: python -m experiments.scene_accuracy [NAME ...]      prints a Markdown table
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import rigidsim
from rigidsim.accuracy.error_law import round_off_law
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import try_setting

EPSILON = 2.0**-52
CONFIGS = Path(__file__).parents[1] / "configs"
RECORD = 'output.record=["angular_velocity", "quaternion"]'
FORMULATIONS = ("quaternion", "rotation_matrix", "euler_angles")


def run(path: Path, out: str, *overrides: str) -> rigidsim.Run:
    """One variant of a ready scene."""
    settings = ["output.timeline=false", RECORD, *overrides]
    return rigidsim.run(rigidsim.load(path, overrides=settings), out=out, force=True)


def quaternions(result: rigidsim.Run) -> np.ndarray:
    """Of unit length."""
    with result.dataset as dataset:
        return unit(dataset["quaternion"].values.astype(np.longdouble))


def better(path: Path) -> np.ndarray:
    """The same in 80-bit arithmetic; in code that compiles in a tenth of the time."""
    trial = try_setting(rigidsim.load(path), Setting("extended"), compact=True)
    return unit(sum((part.astype(np.longdouble) for part in trial.attitudes), np.longdouble(0)))


def unit(values: np.ndarray) -> np.ndarray:
    """Without the error of the norm."""
    return values / np.sqrt((values * values).sum(axis=1))[:, None]


def largest_angle(p: np.ndarray, q: np.ndarray) -> float:
    """Largest angle (rad) between two histories of attitudes."""
    chord = np.minimum(np.sqrt(((p - q) ** 2).sum(axis=1)), np.sqrt(((p + q) ** 2).sum(axis=1)))
    return float((4 * np.arcsin(chord / 2)).max())


def rows(path: Path, out: str) -> list[str]:
    """The table's rows of one scene."""
    reference = better(path)
    found = []
    for formulation in FORMULATIONS:
        overrides = [f'integrator.formulation="{formulation}"']
        if formulation == "euler_angles" and ("sleeping" in path.stem or "earth" in path.stem):
            overrides.append('integrator.euler_sequence="xyz"')  # they start in the singularity of zxz
        result = run(path, out, *overrides)
        error = largest_angle(quaternions(result), reference)
        accuracy, cost = result.summary["accuracy"], result.summary["cost"]
        with result.dataset as dataset:
            rate = float(np.linalg.norm(dataset["angular_velocity"].values, axis=1).max())
            duration = float(dataset["time"][-1] - dataset["time"][0])
        law = round_off_law(EPSILON, cost["steps"], rate, duration)
        drift = max(row["largest_drift"] / row["bound"] for row in result.summary["invariants"].values())
        found.append(
            f"| {path.stem} | {formulation} | {cost['steps']} | {error:.1e} | {3 * law:.1e} | "
            f"{accuracy['amplification']:.2g} | {accuracy['estimated_attitude_error']:.1e} | {drift:.1e} |"
        )
    return found


def main() -> None:
    """Print the table."""
    wanted = sys.argv[1:]
    print(
        "| scene | formulation | steps | attitude error, rad | 3 x law | amplification | announced | "
        "largest drift / (50 eps sqrt(steps)) |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    )
    with tempfile.TemporaryDirectory() as out:
        for path in sorted(CONFIGS.glob("*.toml")):
            averaged = rigidsim.load(path).config.model.level != "full"  # which have no attitude
            if not averaged and (not wanted or path.stem in wanted):
                print("\n".join(rows(path, out)), flush=True)


if __name__ == "__main__":
    main()
