"""Opening a timeline in the viewer of rerun-sdk, and pictures of it without a screen."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

LOOPBACK = "127.0.0.1"  # rerun's own default would listen on every interface
QUIET = {"CI": "1"}  # the one variable that keeps the viewer from sending usage statistics (0.41)


class NoGraphics(RuntimeError):
    """The machine has no Vulkan driver that the headless viewer could draw with."""


def open_viewer(path: Path, *, web: bool = False) -> int:
    """Open a recording in the viewer and wait until it is closed. No usage statistics are sent.

    Args:
        path: a `.rrd` file.
        web: serve the viewer on 127.0.0.1 only, until Ctrl-C; it prints the address to open.

    Returns:
        The viewer's exit code; 130 after Ctrl-C, which for `web` is the way to end it.

    Raises:
        FileNotFoundError: no such file, or no viewer in the installed rerun-sdk.
    """
    command = [str(viewer_binary()), str(_existing(path)), "--bind", LOOPBACK]
    command += ["--serve-web"] if web else ["--port", "auto"]
    process = subprocess.Popen(command, env=os.environ | QUIET)
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        return 130


def screenshot(
    path: Path,
    png: Path,
    *,
    size: tuple[int, int] = (1600, 900),
    timeout: float = 120.0,
    at: float | None = None,
) -> Path:
    """Picture of a recording in the viewer, drawn without a screen.

    Args:
        path: a `.rrd` file.
        png: the picture to write.
        size: width and height of the window in points; the picture may have more pixels.
        timeout: seconds to wait for the viewer.
        at: where in the run, 0 to 1 of the timeline that the page opens on; None: as it opens,
            which is at the end.

    Returns:
        `png`.

    Raises:
        FileNotFoundError: no such recording, or no viewer.
        NoGraphics: no Vulkan driver; Mesa's software driver will do
            (Debian: `apt-get install mesa-vulkan-drivers`).
        RuntimeError: the viewer failed or took longer than `timeout`.
    """
    source = _existing(path)
    if not vulkan_drivers():
        raise NoGraphics(
            "no Vulkan driver found: a headless picture needs one, for example Mesa's lavapipe "
            "(apt-get install mesa-vulkan-drivers)"
        )
    port = _free_port()
    with tempfile.TemporaryDirectory() as home:
        command = [str(viewer_binary()), str(source.resolve()), "--headless"]
        command += ["--bind", LOOPBACK, "--port", str(port)]
        command += ["--window-size", f"{size[0]}x{size[1]}"]
        # A home of its own: none of the user's settings.
        environment = os.environ | QUIET
        environment |= {"HOME": home, "XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home}
        log = Path(home) / "viewer.log"
        with log.open("wb") as output:
            process = subprocess.Popen(command, env=environment, stdout=output, stderr=output)
        try:
            picture = _picture(process, port, time.monotonic() + timeout, at)
        except _Failed as failure:
            said = log.read_text(errors="replace").strip()[-800:]
            if "No graphics adapter" in said:
                raise NoGraphics(f"the Vulkan driver doesn't work: {said}") from None
            raise RuntimeError(f"the viewer made no picture: {failure}. It said: {said}") from None
        finally:
            process.terminate()
            process.wait()
    Path(png).write_bytes(picture)
    return Path(png)


class _Failed(Exception):
    """Why there is no picture."""


def _picture(process: subprocess.Popen[bytes], port: int, deadline: float, at: float | None) -> bytes:
    """PNG of the window once the recording is there and the picture no longer changes.

    The viewer's own --screenshot-to fires after a few frames, before the plots have been read.
    """
    from rerun.experimental import ViewerClient

    client: ViewerClient | None = None
    sought = False
    settled = 0.0  # when the notes that the viewer opens with have gone
    last = b""
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise _Failed(f"it ended with exit code {process.returncode}")
        time.sleep(0.4)
        try:
            client = client or ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
            state = client.get_state()
        except Exception as problem:  # not listening yet; the client has no error of its own kind
            last = b""
            reason = str(problem)
            client = None
            if time.monotonic() + 1 > deadline:
                raise _Failed(f"no answer in time ({reason})") from None
            continue
        opened = [r for r in state.recordings if r.current_timeline and r.current_time is not None]
        if state.loading or not opened:
            continue
        if not sought:
            if at is not None:
                line = next(t for t in opened[0].timelines if t.name == opened[0].current_timeline)
                start, end = line.start or 0, line.end or 0
                # Integers of any timeline pass through `sequence` as they are.
                client.set_time(line.name, sequence=start + round(at * (end - start)), play_state="paused")
            sought, settled = True, time.monotonic() + 4.0
            continue
        picture = client.take_screenshot()
        if picture == last and time.monotonic() > settled:
            return picture
        last = picture
    raise _Failed("it took too long")


def vulkan_drivers() -> list[Path]:
    """Manifests of the installed Vulkan drivers (Linux), empty when there are none."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [Path(name) for name in named.split(os.pathsep) if Path(name).is_file()]
    folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"]
    return [file for folder in folders for file in sorted(Path(folder).glob("*.json"))]


def viewer_binary() -> Path:
    """The viewer inside the installed rerun-sdk.

    Raises:
        FileNotFoundError: rerun-sdk isn't installed, or without its viewer.
    """
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise FileNotFoundError("the rerun viewer isn't installed: pip install rerun-sdk")
    folder = Path(found.origin).parent
    candidates = ["rerun.exe"] if sys.platform == "win32" else ["rerun"]
    if sys.platform == "darwin":
        candidates.insert(0, "Rerun.app/Contents/MacOS/Rerun")
    for name in candidates:
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"the rerun viewer isn't in {folder}: reinstall rerun-sdk")


def _existing(path: Path) -> Path:
    if not Path(path).is_file():
        raise FileNotFoundError(f"no timeline at {path}: run with [output] timeline = true")
    return Path(path)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
