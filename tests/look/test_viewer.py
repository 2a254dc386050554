"""The viewer that came with rerun-sdk."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

from rigidsim.look import viewer
from rigidsim.look.timeline import write_timeline

Build = Callable[..., xarray.Dataset]


@pytest.mark.slow  # the viewer starts
def test_picture_of_a_run_shows_the_body_and_its_plots(
    symmetric_top: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.image import imread

    write_timeline(symmetric_top(), tmp_path / "t.rrd")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    try:
        viewer.screenshot(tmp_path / "t.rrd", tmp_path / "t.png", size=(1200, 700), at=0.6)
    except viewer.NoGraphics as reason:
        pytest.skip(str(reason))
    assert not list(temporary.iterdir())
    picture = imread(tmp_path / "t.png")[..., :3]
    height, width = picture.shape[:2]
    scene = picture[int(0.1 * height) : int(0.6 * height), : int(0.5 * width)]
    plots = picture[int(0.1 * height) : int(0.9 * height), int(0.6 * width) :]
    # Background, panels and text are grey; the disk, the arrows and the curves are not.
    for part, least in ((scene, 0.02), (plots, 0.002)):
        colorful = np.ptp(part, axis=2) > 0.2
        assert colorful.mean() > least


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no timeline at .*nothing\.rrd"):
        viewer.open_viewer(tmp_path / "nothing.rrd")
    with pytest.raises(FileNotFoundError, match="no timeline at"):
        viewer.screenshot(tmp_path / "nothing.rrd", tmp_path / "x.png")


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


def test_no_driver_is_said_plainly(
    symmetric_top: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "t.rrd").write_bytes(b"")
    monkeypatch.setattr(viewer, "vulkan_drivers", lambda: [])
    with pytest.raises(viewer.NoGraphics, match="mesa-vulkan-drivers"):
        viewer.screenshot(tmp_path / "t.rrd", tmp_path / "t.png")


def test_importing_the_package_loads_neither_rerun_nor_matplotlib() -> None:
    code = (
        "import sys, rigidsim.look.viewer, rigidsim.look.live, rigidsim.look.figure_names; "
        "print(sorted({'rerun', 'matplotlib', 'xarray', 'pyarrow'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
