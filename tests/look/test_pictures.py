"""Ready scenes in the real viewer, without a screen: nothing fails, and body and trails are in the picture.

Skipped where there is no Vulkan driver (Mesa's software driver will do).
"""

import io
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun")

from support import cases

import rigidsim
from rigidsim.look.film import HeadlessViewer, NoGraphics, vulkan_drivers
from rigidsim.look.timeline import write_timeline
from rigidsim.look.timeline.drawn import DrawnRun
from rigidsim.look.timeline.writing import build_blueprint, recording_to

pytestmark = [
    pytest.mark.skipif(not vulkan_drivers(), reason="no Vulkan driver: apt-get install mesa-vulkan-drivers"),
    pytest.mark.optimised,  # ready scenes are long
]

Ready = Callable[..., rigidsim.Run]
CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.toml"))
ROWS = 3000


@pytest.fixture(params=cases(CONFIGS, [], daily=4), ids=lambda path: path.stem)
def run(request: pytest.FixtureRequest, ready: Ready) -> rigidsim.Run:
    return ready(request.param)


def opened(path: Path) -> HeadlessViewer:
    try:
        return HeadlessViewer(path, size=(1200, 700)).__enter__()
    except NoGraphics as reason:
        pytest.skip(str(reason))


def space_picture(viewer: HeadlessViewer, share: float) -> np.ndarray:
    """The leading view in space, (height, width, 3), once it no longer changes."""
    from matplotlib.image import imread

    views = [view for view in viewer.client.get_state().views if view.view_class == "3D"]
    # The disc as its planet sees it stands before the scene, whose tab is then hidden.
    leading = min(
        views, key=lambda view: (not view.origin.startswith("/face"), not view.origin.startswith("/scene"))
    )
    viewer.seek(share)
    before = b""
    for _ in range(40):
        time.sleep(0.25)
        now = bytes(viewer.client.take_screenshot(leading.view_id))
        if now == before:
            break
        before = now
    return np.asarray(imread(io.BytesIO(before))[..., :3], dtype=np.float64)


def test_a_ready_scene_is_seen_whole(run: rigidsim.Run, tmp_path: Path) -> None:
    """No view reports a fault; what body, arrows and trails add to the empty stage is in the frame."""
    with run.dataset as dataset:
        write_timeline(dataset, tmp_path / "full.rrd", rows=ROWS)
        _write_empty(dataset, tmp_path / "empty.rrd")
    pictures = []
    for name in ("full", "empty"):
        viewer = opened(tmp_path / f"{name}.rrd")
        try:
            pictures.append(space_picture(viewer, 0.6))
            if name == "full":
                faults = [(v.name, r.summary) for v in viewer.client.get_state().views for r in v.reports]
                assert faults == []
        finally:
            viewer.__exit__()
    full, empty = pictures
    added = np.abs(full - empty).max(axis=2) > 0.08
    assert added.mean() > 0.004  # some hundred points of the screen
    rows, columns = np.nonzero(added)
    height, width = added.shape
    # the title stands above; nothing reaches the frame, which would be cut
    assert columns.min() > 2
    assert columns.max() < width - 3
    assert rows.max() < height - 3


def _write_empty(dataset: rigidsim.Run, path: Path) -> None:
    """The same stage without body, arrows and trails."""
    drawn = DrawnRun.of(dataset, ROWS)
    with recording_to(path, "empty", len(drawn.seconds), build_blueprint(drawn)) as recording:
        stages = [
            replace(stage, parts=[part for part in stage.parts if "around/" in part.path])
            for stage in drawn.picture.stages
        ]
        bare = replace(drawn, picture=replace(drawn.picture, stages=stages))
        bare.draw(recording)
