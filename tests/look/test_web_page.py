"""The page whose address ``rigidsim view --web`` tells, in a real browser without a screen.

Skipped where there is no Chromium (Debian: ``apt-get install chromium``); WebGL is drawn by its own software.
"""

from __future__ import annotations

import asyncio
import base64
import io
import json
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rerun")
pytest.importorskip("tornado")  # comes with what runs the notebooks of the docs

from tornado import websocket

import rigidsim
from rigidsim.look.stages.parts import MOMENTUM, VELOCITY

ROOT = Path(__file__).parents[2]
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER = next((found for name in NAMES if (found := shutil.which(name))), None)
SIZE = (1400, 850)
PATIENCE = 150.0  # seconds: software draws a frame a second, beside other work

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium: apt-get install chromium"),
]


@contextmanager
def running(command: list[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(command, text=True, **options)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def taken(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Page:
    """A page of the browser, spoken to by its debugging protocol."""

    def __init__(self, connection: Any) -> None:
        self._connection, self._asked = connection, 0
        self.complaints: list[str] = []

    async def do(self, method: str, **given: Any) -> dict[str, Any]:
        self._asked += 1
        await self._connection.write_message(
            json.dumps({"id": self._asked, "method": method, "params": given})
        )
        while True:
            said = json.loads(await self._connection.read_message())
            if said.get("method") == "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(said["params"]["exceptionDetails"])[:500])
            if said.get("id") == self._asked:
                assert "error" not in said, said
                return dict(said["result"])

    async def picture(self) -> np.ndarray:
        """What is seen, (height, width, 3), 0 to 255."""
        from PIL import Image

        shot = await self.do("Page.captureScreenshot", format="png")
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB"), dtype=int)


def near(picture: np.ndarray, color: tuple[int, int, int]) -> int:
    """Points of about a colour."""
    return int((np.abs(picture - np.array(color)).max(axis=2) < 28).sum())


async def seen(address: str, port: int) -> tuple[np.ndarray, list[str]]:
    """The page once arrows and curves are on it, and the errors that its scripts threw."""
    tabs = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{port}/json").read())
    tab = next(tab for tab in tabs if tab["type"] == "page")
    connection = await websocket.websocket_connect(tab["webSocketDebuggerUrl"], max_message_size=100_000_000)
    page = Page(connection)
    await page.do("Runtime.enable")
    await page.do("Page.enable")
    await page.do("Page.navigate", url=address)
    until = time.monotonic() + PATIENCE
    picture = np.zeros((1, 1, 3), dtype=int)
    while time.monotonic() < until:
        await asyncio.sleep(2.0)
        picture = await page.picture()
        if near(picture, MOMENTUM) > 150 and near(picture, VELOCITY) > 150:
            await asyncio.sleep(4.0)
            picture = await page.picture()
            break
    return picture, page.complaints


@pytest.mark.skipif(taken(9090) or taken(9876), reason="the viewer's ports are in use")
def test_the_page_shows_body_arrows_and_plots(tmp_path: Path) -> None:
    run = rigidsim.run(ROOT / "configs" / "intermediate_axis.toml", out=tmp_path)
    view = [sys.executable, "-u", "-m", "rigidsim", "view", str(run.folder.path), "--web"]
    log = tmp_path / "view.log"
    assert BROWSER is not None
    browser = [
        BROWSER, "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--ignore-gpu-blocklist", "--no-first-run", "--disable-background-networking",
        "--remote-debugging-port=0", f"--user-data-dir={tmp_path / 'profile'}",
        f"--window-size={SIZE[0]},{SIZE[1]}", "about:blank",
    ]  # fmt: skip
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with log.open("w") as output, running(view, stdout=output, stderr=output), running(browser, **quiet):
        address = waited_for(lambda: re.search(r"http://\S+\?\S+", log.read_text()))[0]
        port = waited_for(lambda: (tmp_path / "profile" / "DevToolsActivePort").read_text().split())[0]
        picture, complaints = asyncio.run(seen(address, int(port)))
    from PIL import Image

    Image.fromarray(picture.astype(np.uint8)).save(tmp_path / "page.png")  # to be looked at after a failure
    assert complaints == []
    height, width = picture.shape[:2]
    stage, plots = picture[:, : width // 2], picture[: height // 2, width // 2 :]
    assert near(stage, MOMENTUM) > 150  # the arrows of L and of the angular velocity
    assert near(stage, VELOCITY) > 150
    # faces of the book, in the colours of their axes (see `solids`)
    assert sum(near(stage, color) > 400 for color in ((214, 84, 76), (92, 172, 98), (78, 128, 205))) >= 1
    assert sum(near(plots, color) > 50 for color in ((235, 97, 89), (104, 190, 110), (92, 148, 235))) == 3


def waited_for(look: Any, seconds: float = 60.0) -> Any:
    """What `look` finds, once it finds something."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            found = look()
        except OSError:
            found = None
        if found:
            return found
        time.sleep(0.2)
    raise AssertionError("nothing came in time")
