"""What columns are, by their names: as people name them, and as simulators, robots and trajectory tools do.

| tool | columns |
| --- | --- |
| EuRoC | ``p_RS_R_x``, ``q_RS_w``, ``v_RS_R_x`` |
| ROS | ``field.pose.orientation.x``, ``field.twist.twist.angular.x``, ``pose/position/x`` |
| MuJoCo | ``qpos_0`` ... ``qpos_6`` and ``qvel_0`` ... ``qvel_5`` of a free joint, four and three of a ball |
| Basilisk | ``sigma_BN_0``, ``omega_BN_B_0``, ``r_BN_N_0``, ``v_BN_N_0`` |
| Drake | ``BODY_qw`` ..., ``BODY_x``, ``BODY_wx``, ``BODY_vx`` |

Modified Rodrigues Parameters are n tan(angle / 4), rotation vectors n angle (Schaub & Junkins, Analytical
Mechanics of Space Systems, ch. 3).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigidsim.scene.rotations import of_vector
from rigidsim.scene.text_tables import name_and_unit

QUATERNION, MATRIX, ANGLES = "quaternion", "matrix", "angles"
MRP, VECTOR = "Modified Rodrigues Parameters", "rotation vectors"
ATTITUDES = (QUATERNION, MRP, VECTOR, MATRIX, ANGLES)
RATES, POSITIONS, VELOCITIES = "rates", "positions", "velocities"
_Q = r"(?:quaternion|quat|attitude|q)_?"
_MATRIX = r"(?:rotation_?matrix|matrix|dcm|rot|r|m|c|a)_?"
_EULER = r"(?:euler_?angles?|euler|angles?|ang|e|a)_?"
_RATE = r"(?:angular_?velocity|angular_?rate|angvel|body_?rate|omega|gyro|rate|om|w)_?"
_POSITION = r"(?:position|pos|r|p)?_?"
_VELOCITY = r"(?:velocity|vel|v)_?"
_PAIRS = [[f"{i}_?{j}" for i in digits for j in digits] for digits in ("123", "012", "xyz")]
_VECTORS = ("xyz", "123", "012")
_ANGLE_NAMES = [("phi", "theta", "psi"), ("roll", "pitch", "yaw"), ("alpha", "beta", "gamma"),
                ("precession", "nutation", "spin"), ("heading", "pitch", "roll")]  # fmt: skip
_SUFFIX = r"(?:_(?:deg|rad|deg_s|rad_s|degs|rads|rpm|m|s|m_s|body|b))?"
_FRAMES = r"[a-z]{2}_(?:[a-z]_)?"  # of q_RS_w, omega_BN_B_0
_PLAIN: dict[str, list[tuple[str, Sequence[str]]]] = {
    QUATERNION: [(_Q, "wxyz"), ("", "wxyz"), (_Q, "0123"), (_Q, "1234")],
    MATRIX: [(_MATRIX, pairs) for pairs in _PAIRS],
    ANGLES: [*((f"(?:{_EULER})?", n) for n in _ANGLE_NAMES), (_EULER, "123"), (_EULER, "012")],
    RATES: [*((_RATE, letters) for letters in _VECTORS), ("", "pqr")],
    POSITIONS: [(_POSITION, letters) for letters in _VECTORS],
    VELOCITIES: [(_VELOCITY, letters) for letters in _VECTORS],
}
"""Stems and components of the names of columns, the surest ones first."""
_TOOLS: dict[str, list[tuple[str, Sequence[str]]]] = {
    QUATERNION: [
        (rf"q_{_FRAMES}", "wxyz"), ("(?:orientation|rotation|quaternion|quat|q)_?", "wxyz"),
        ("qpos_?", "3456"), ("qpos_?", "0123"),
    ],
    MRP: [
        *((rf"sigma_{_FRAMES}", letters) for letters in _VECTORS), ("sigma_?", "123"),
        *(("mrp_?", letters) for letters in _VECTORS),
    ],
    VECTOR: [("(?:rotvec|rot_?vec|rotation_?vector|rvec|axis_?angle)_?", letters) for letters in _VECTORS],
    RATES: [
        *((rf"(?:omega|w)_{_FRAMES}", letters) for letters in _VECTORS),
        ("(?:angular_velocity_|angular_|omega_?|w)", "xyz"), ("qvel_?", "345"), ("qvel_?", "012"),
    ],
    POSITIONS: [
        *((rf"[rp]_{_FRAMES}", letters) for letters in _VECTORS),
        ("(?:position_|translation_)", "xyz"), ("qpos_?", "012"), ("", "xyz"),
    ],
    VELOCITIES: [*((rf"v_{_FRAMES}", letters) for letters in _VECTORS), ("qvel_?", "012"), ("v", "xyz")],
}  # fmt: skip
"""The same of tools, behind any prefix, such as a message's or a body's."""
_ORDER = (
    (QUATERNION, False), (MATRIX, False), (QUATERNION, True), (ANGLES, False), (MRP, True), (VECTOR, True),
    *((kind, tools) for kind in (RATES, POSITIONS, VELOCITIES) for tools in (False, True)),
)  # fmt: skip
"""What is looked for one after the other, and whether as tools name it."""
_WHOLE = {("qpos_?", "0123"), ("qvel_?", "012")}
"""Of joints: the columns of a ball joint, none beyond; beside a free joint's they are something else."""
_OTHERS = re.compile(r"(.*_)?(bias|std|sigma|cov|covariance|err|error|ref|des|desired|cmd|target|goal)")


@dataclass(frozen=True)
class Columns:
    """Names of a quantity's columns, in the order of its components; ``letters`` of quaternions, if known."""

    names: list[str]
    letters: str = ""


def plain(name: str) -> str:
    """A name in small letters, without a unit in brackets."""
    bare = name_and_unit(name)[0] if name.rstrip()[-1:] in ("]", ")") else name
    return re.sub(r"[^a-z0-9]+", "_", bare.strip().lower()).strip("_")


def columns_of(names: Iterable[str]) -> dict[str, Columns]:
    """What is found among columns: at most one attitude, rates, positions and velocities.

    Raises:
        ValueError: there are attitudes of several bodies.
    """
    by_plain = {plain(name): name for name in names}
    found: dict[str, Columns] = {}
    body: str | None = None
    for kind, tools in _ORDER:
        if kind in found or (kind in ATTITUDES and any(one in found for one in ATTITUDES)):
            continue
        letters = ""
        if tools:
            known = body if kind in ATTITUDES else body or ""
            prefix, chosen = _of_tool(by_plain, kind, known)
            body, letters = prefix if chosen and body is None else body, "wxyz" * (kind == QUATERNION)
        else:
            chosen = next(filter(None, (_components(by_plain, *form) for form in _PLAIN[kind])), [])
            ends = "".join(re.sub(_SUFFIX + "$", "", name)[-1:] for name in chosen)
            letters = ends if kind == QUATERNION and ends == "wxyz" else ""
        named = [by_plain[name] for name in chosen]
        if named and not {*named} & {name for one in found.values() for name in one.names}:
            found[kind] = Columns(named, letters)
    return found


def _components(names: Iterable[str], stem: str, parts: Sequence[str]) -> list[str]:
    """Names of a stem with each of these components, in their order; none unless all are there."""
    found = []
    for part in parts:
        form = re.compile(stem + part + _SUFFIX)
        found.append(max(filter(form.fullmatch, names), key=len, default=""))
    return found if all(found) and len({*found}) == len(parts) else []


def _of_tool(names: Iterable[str], kind: str, body: str | None) -> tuple[str, list[str]]:
    """Prefix and names of a quantity as tools write it: of a body, if it is known, else of the only one."""
    for stem, parts in _TOOLS[kind]:
        groups: dict[str, dict[str, str]] = {}
        for part in (*parts, *([str(len(parts))] if (stem, parts) in _WHOLE else [])):
            form = re.compile(rf"(?:(.*)_)?{stem}{part}{_SUFFIX}")
            for name in names:
                match = form.fullmatch(name)
                biased = kind not in ATTITUDES and match is not None and match[1] == "b"
                if match and not biased and not _OTHERS.fullmatch(match[1] or ""):
                    groups.setdefault(match[1] or "", {}).setdefault(part, name)
        whole = {prefix: [*one.values()] for prefix, one in groups.items() if [*one] == [*parts]}
        if body is None and len(whole) > 1:
            raise ValueError(f"attitudes of several bodies, {', '.join(whole)}; keep the columns of one")
        if body in whole or (whole and (len(whole) == 1 and stem)):
            chosen = body if body in whole else next(iter(whole))
            return chosen or "", whole[chosen or ""]
    return "", []


def quaternions_from(kind: str, values: np.ndarray) -> np.ndarray:
    """Quaternions (rows, 4), w x y z, of Modified Rodrigues Parameters or rotation vectors (rows, 3), rad."""
    if kind == VECTOR:
        return of_vector(values)
    squares = np.sum(values**2, axis=1, keepdims=True)
    return np.concatenate([1 - squares, 2 * values], axis=1) / (1 + squares)
