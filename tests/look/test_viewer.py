"""The viewer that came with rerun-sdk."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

from rigidsim.look import viewer
from rigidsim.look.timeline import write_comparison

Build = Callable[..., xarray.Dataset]


def test_viewer_listens_on_this_machine_only_and_sends_no_statistics(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "t.rrd").write_bytes(b"")
    commands: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], env: dict[str, str]) -> None:
            commands.append(command)
            assert env["CI"] == "1"

        def wait(self, timeout: float | None = None) -> int:
            return 7

        def terminate(self) -> None:
            pass

    monkeypatch.setattr(subprocess, "Popen", Process)
    monkeypatch.setenv("DISPLAY", ":0")
    assert viewer.open_viewer(tmp_path / "t.rrd") == 7
    assert viewer.open_viewer(tmp_path / "t.rrd", web=True) == 7
    for command in commands:
        assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert "--serve-web" in commands[1]
    assert "--serve-web" not in commands[0]


# ---- several runs in one recording, and a run that grows while it is looked at

Read = Callable[[Path, str], dict[str, np.ndarray]]


def test_runs_side_by_side_share_a_clock_and_show_how_far_they_are_apart(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    one, other = symmetric_top(count=1001), symmetric_top(count=501)  # each second time of the first
    apart = 1e-9
    turned = other["quaternion"].values @ _turn_about_z(apart).T
    other = other.assign(quaternion=(("time", "quaternion_component"), turned))
    assert write_comparison([("a", one), ("b", other)], tmp_path / "t.rrd") == 1502
    first, second = (read_back(tmp_path / "t.rrd", f"/run{k}/scene/body") for k in (0, 1))
    assert (len(first["time"]), len(second["time"])) == (1001, 501)
    np.testing.assert_array_equal(first["time"][::2], second["time"])
    difference = read_back(tmp_path / "t.rrd", "/plots/difference")["Scalars:scalars"]
    at_samples = 10 ** difference[::2]
    # a chord of unit quaternions is known to a few units in the last place of 1
    np.testing.assert_allclose(at_samples, apart, rtol=0, atol=1e-14)
    # between samples the other's is interpolated: the arc misses by (rate dt)^2 / 8 of a turn at most
    assert (10 ** difference[1::2]).max() < (2 * 0.04) ** 2 / 8


def _turn_about_z(angle: float) -> np.ndarray:
    """What a quaternion w x y z becomes with a rotation about Z after it."""
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    return np.array([[c, 0, 0, -s], [0, c, -s, 0], [0, s, c, 0], [s, 0, 0, c]])
