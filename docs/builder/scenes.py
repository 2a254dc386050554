"""Scenes that play in the browser, in the gallery and on the first page: recordings, and rerun's viewer.

The viewer is the one that rerun-sdk brings, and the site serves it itself: nothing is fetched from elsewhere,
neither when the site is built nor when it is read (``_static/viewer/index.html`` forbids it to the browser).
It is loaded when somebody presses a button.
"""

from __future__ import annotations

import gzip
import os
import re
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLAYED = (
    "aerostable_cubesat",
    "heavy_top_nutating",
    "intermediate_axis",
    "intermediate_axis_with_wheel",
    "tossed_plate",
)
ROWS = 1500  # of a recording: 1.0 to 1.4 MB
PAGES = ("index.md", "gallery.md")
"""With timelines that get a button."""
FOLDER = "scenes"
"""Of the recordings, in the site."""
_VIEWER = {"re_viewer.js": "re_viewer.js", "re_viewer_bg.wasm": "re_viewer_wasm.bin"}
"""What the viewer consists of, and its names in the site; the second is packed to a third by gzip."""
_SECONDS = 30.0  # until the viewer answers, on a busy machine
_PICTURE = re.compile(r"^!\[Its timeline\]\(\S*?/(\w+)_timeline\.png\)$", re.MULTILINE)
_BUTTON = """{picture}

```{{raw}} html
<p class="player"><button type="button" data-recording="{folder}/{name}.rrd">Play in the browser</button></p>
```"""


def with_buttons(text: str) -> str:
    """A page with a button below the timeline of each scene that plays."""

    def replaced(found: re.Match[str]) -> str:
        if found[1] not in PLAYED:
            return found[0]
        return _BUTTON.format(picture=found[0], folder=FOLDER, name=found[1])

    return _PICTURE.sub(replaced, text)


def record(site: Path, names: tuple[str, ...] = PLAYED) -> None:
    """Run scenes, and write their recordings into the site."""
    import rigidsim
    from rigidsim.look.timeline import write_timeline

    (site / FOLDER).mkdir(parents=True, exist_ok=True)
    for name in names:
        config = ROOT / "configs" / f"{name}.toml"
        run = rigidsim.run(config, out=None, changes={"output.timeline": False})
        write_timeline(run.dataset, site / FOLDER / f"{name}.rrd", rows=ROWS, part="player")


def put_viewer(folder: Path) -> None:
    """Put rerun's viewer into a folder of the site, as its own program serves it on this machine.

    Raises:
        RuntimeError: it doesn't answer.
    """
    from rigidsim.look.viewer import LOOPBACK, QUIET, free_port, viewer_binary

    folder.mkdir(parents=True, exist_ok=True)
    port = free_port()
    command = [str(viewer_binary()), "--serve-web", "--bind", LOOPBACK]
    command += ["--port", str(free_port()), "--web-viewer-port", str(port)]
    with tempfile.TemporaryDirectory() as scratch:
        environment = {**os.environ, **QUIET, "TMPDIR": scratch, "RUST_LOG": "error"}
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        try:
            for served, name in _VIEWER.items():
                content = _fetched(f"http://{LOOPBACK}:{port}/{served}", process)
                packed = gzip.compress(content, 6, mtime=0) if name.endswith(".bin") else content
                (folder / name).write_bytes(packed)
        finally:
            process.terminate()
            process.wait()


def _fetched(address: str, process: subprocess.Popen[bytes]) -> bytes:
    """What a program of this machine serves, once it does."""
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    until = time.monotonic() + _SECONDS
    while process.poll() is None and time.monotonic() < until:
        try:
            with direct.open(address) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.URLError:
            time.sleep(0.1)
    raise RuntimeError("the viewer of rerun-sdk doesn't serve its page; build with --code-only to do without")
