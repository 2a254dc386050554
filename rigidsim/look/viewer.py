"""Opening a timeline in the viewer of rerun-sdk, and pictures of it without a screen."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

LOOPBACK = "127.0.0.1"  # rerun's own default would listen on every interface
WEB_PORT, DATA_PORT = 9090, 9876
"""Ports of 127.0.0.1 on which the browser page and its recording are served: rerun's own."""
INTERRUPTED = 130
QUIET = {"CI": "1"}  # the one variable that keeps the viewer from sending usage statistics (0.41)


class NoGraphics(RuntimeError):
    """Raised if the machine has no Vulkan driver with which the headless viewer could draw."""


class NoDisplay(RuntimeError):
    """Raised if there is no screen for a window."""


NO_DISPLAY = (
    "there is no display here (neither DISPLAY nor WAYLAND_DISPLAY is set); --web serves the viewer to a "
    "browser on this machine (on another one through a tunnel: ssh -L 9090:127.0.0.1:9090 "
    "-L 9876:127.0.0.1:9876 HOST), and --png, --gif or --mp4 FILE draw without one"
)


def has_display() -> bool:
    """Whether a window can be opened; assumed on systems other than Linux."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(path: Path, *, web: bool = False) -> int:
    """Open a recording in the viewer and wait until it is closed. No usage statistics are sent.

    Args:
        path: a `.rrd` file.
        web: serve the viewer on 127.0.0.1 only, until Ctrl-C; it prints the address to open.

    Returns:
        The viewer's exit code; 130 after Ctrl-C, which for `web` is the way to end it.

    Raises:
        FileNotFoundError: no such file, or no viewer in the installed rerun-sdk.
        NoDisplay: a window is asked for where there is no screen.
    """
    recording = _existing(path)
    if not web and not has_display():
        raise NoDisplay(NO_DISPLAY)
    command = [str(viewer_binary()), str(recording), "--bind", LOOPBACK]
    command += _served(DATA_PORT) if web else ["--port", "auto"]
    with _running(command, _terse() if web else QUIET) as process:
        if web:
            print(web_words(DATA_PORT), flush=True)
        try:
            return ended(process)
        except KeyboardInterrupt:
            return INTERRUPTED


@contextmanager
def _running(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that is ended with the context.

    It makes a folder for its catalogue where temporary files go and leaves it there when it is ended, so that
    it is given a place that goes with it.
    """
    with tempfile.TemporaryDirectory(prefix="rigidsim-viewer-") as scratch:
        process = subprocess.Popen(command, env={**os.environ, **environment, "TMPDIR": scratch})
        try:
            yield process
        finally:
            process.terminate()
            process.wait()


def ended(process: subprocess.Popen[bytes], timeout: float | None = None) -> int:
    """Wait for a viewer; returns its exit code, 130 if Ctrl-C reached it first.

    Raises:
        TimeoutExpired: of subprocess, after so many seconds.
    """
    code = process.wait(timeout)
    return INTERRUPTED if code == -signal.SIGINT else code


@contextmanager
def empty_viewer(*, web: bool = False) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A viewer that waits for recordings, and the port of 127.0.0.1 on which it takes them; it is ended with
    the context.

    Raises:
        FileNotFoundError: no viewer in the installed rerun-sdk.
        NoDisplay: a window is asked for where there is no screen.
    """
    if not web and not has_display():
        raise NoDisplay(NO_DISPLAY)
    port = _free_port()
    command = [str(viewer_binary()), "--bind", LOOPBACK]
    command += _served(port) if web else ["--port", str(port), "--expect-data-soon"]
    with _running(command, _terse() if web else QUIET) as process:
        if web:
            print(web_words(port), flush=True)
        yield process, port


def _served(port: int) -> list[str]:
    return ["--serve-web", "--port", str(port), "--web-viewer-port", str(WEB_PORT)]


def _terse() -> dict[str, str]:
    """Environment of a viewer that reports only errors."""
    return {"RUST_LOG": os.environ.get("RUST_LOG", "warn"), **QUIET}


def web_words(port: int) -> str:
    """The page's address, dark as its colours are made for, and how to end it.

    Args:
        port: port on which the recording is served.
    """
    source = quote(f"rerun+http://{LOOPBACK}:{port}/proxy", safe="")
    page = f"http://{LOOPBACK}:{WEB_PORT}?theme=dark&url={source}"
    return f"open {page} in a browser on this machine; Ctrl-C ends it"


def wait_for(process: subprocess.Popen[bytes], port: int, seconds: float) -> None:
    """Wait until a viewer takes recordings.

    Raises:
        RuntimeError: the viewer ended, or isn't ready within so many seconds.
    """
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if process.poll() is not None:
            raise RuntimeError(f"the viewer ended with exit code {process.returncode}")
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.1)
    raise RuntimeError(f"the viewer didn't answer within {seconds:g} s")


def screenshot(
    path: Path,
    png: Path,
    *,
    size: tuple[int, int] = (1600, 900),
    timeout: float = 120.0,
    at: float = 0.0,
) -> Path:
    """Picture of a recording in the viewer, drawn without a screen.

    Args:
        path: a `.rrd` file.
        png: the picture to write.
        size: width and height of the window in points; the picture may have more pixels.
        timeout: seconds to wait for the viewer.
        at: where in the run, 0 to 1 of the timeline that the page opens on.

    Returns:
        `png`.

    Raises:
        FileNotFoundError, NoGraphics, RuntimeError: as for ``HeadlessViewer``.
    """
    with HeadlessViewer(path, size=size, timeout=timeout) as viewer:
        viewer.seek(at)
        Path(png).write_bytes(viewer.settled_picture())
    return Path(png)


class HeadlessViewer:
    """The viewer without a screen, with a recording open in it and its time at rest; a context manager.

    Args:
        path: a `.rrd` file.
        size: width and height of the window in points.
        timeout: seconds until everything is given up.

    Attributes:
        client: client of rerun, for what isn't offered here.
        timeline: timeline that the page opened on.
        start, end: its first and last integer.

    Raises (on entering):
        FileNotFoundError: no such recording, or no viewer.
        NoGraphics: no Vulkan driver; Mesa's software driver will do
            (Debian: `apt-get install mesa-vulkan-drivers`).
        RuntimeError: the viewer failed or took longer than `timeout`.
    """

    def __init__(self, path: Path, *, size: tuple[int, int] = (1600, 900), timeout: float = 120.0) -> None:
        self._path = _existing(path)
        self._size = size
        self._deadline = time.monotonic() + timeout
        self.client: Any = None
        self.timeline = ""
        self.start = self.end = 0

    def __enter__(self) -> Self:
        if not vulkan_drivers():
            raise NoGraphics(
                "no Vulkan driver found: a headless picture needs one, for example Mesa's lavapipe "
                "(apt-get install mesa-vulkan-drivers)"
            )
        self._home = tempfile.TemporaryDirectory()
        self._port = _free_port()
        command = [str(viewer_binary()), str(self._path.resolve()), "--headless"]
        command += ["--bind", LOOPBACK, "--port", str(self._port)]
        command += ["--window-size", f"{self._size[0]}x{self._size[1]}"]
        # A home of its own: none of the user's settings, and nothing left among temporary files.
        home = self._home.name
        environment = os.environ | QUIET | {"TMPDIR": home}
        environment |= {"HOME": home, "XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home}
        self._log = Path(home) / "viewer.log"
        with self._log.open("wb") as output:
            self.process = subprocess.Popen(command, env=environment, stdout=output, stderr=output)
        try:
            self._open()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait()
        self._home.cleanup()

    def seek(self, share: float) -> None:
        """Go to a place in the run, 0 to 1, and stay there."""
        self.seek_tick(self.start + round(share * (self.end - self.start)))

    def seek_tick(self, tick: int) -> None:
        """Go to a time of the timeline, as its integer, and stay there."""
        # Integers of any timeline pass through `sequence` as they are.
        self.client.set_time(self.timeline, sequence=tick, play_state="paused")

    def picture(self) -> bytes:
        """PNG of the window as it is."""
        return bytes(self.client.take_screenshot())

    def settled_picture(self) -> bytes:
        """PNG of the window once it no longer changes: plots are read, and the opening notes have gone."""
        settled, last = time.monotonic() + 4.0, b""
        while time.monotonic() < self._deadline:
            time.sleep(0.4)
            picture = self.picture()
            if picture == last and time.monotonic() > settled:
                return picture
            last = picture
        raise self._failure("its picture never came to rest")

    def _open(self) -> None:
        """Wait until the recording is loaded.

        The viewer's own --screenshot-to fires after a few frames, before the plots have been read.
        """
        from rerun.experimental import ViewerClient

        reason = "no answer in time"
        while time.monotonic() < self._deadline:
            if self.process.poll() is not None:
                raise self._failure(f"it ended with exit code {self.process.returncode}")
            time.sleep(0.2)
            try:
                self.client = self.client or ViewerClient.connect(
                    f"rerun+http://{LOOPBACK}:{self._port}/proxy"
                )
                state = self.client.get_state()
            except Exception as problem:  # not listening yet; the client has no error of its own kind
                reason, self.client = f"no answer in time ({problem})", None
                continue
            opened = [r for r in state.recordings if r.current_timeline and r.current_time is not None]
            if not state.loading and opened:
                found = next(t for t in opened[0].timelines if t.name == opened[0].current_timeline)
                self.timeline, self.start, self.end = found.name, found.start or 0, found.end or 0
                self.seek(0.0)
                return
        raise self._failure(reason)

    def _failure(self, what: str) -> Exception:
        said = self._log.read_text(errors="replace").strip()[-800:]
        if "No graphics adapter" in said:
            return NoGraphics(f"the Vulkan driver doesn't work: {said}")
        return RuntimeError(f"the viewer made no picture: {what}. It said: {said}")


def vulkan_drivers() -> list[Path]:
    """Manifests of the installed Vulkan drivers (Linux), empty when there are none."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [Path(name) for name in named.split(os.pathsep) if Path(name).is_file()]
    folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"]
    return [file for folder in folders for file in sorted(Path(folder).glob("*.json"))]


def viewer_binary() -> Path:
    """Path of the viewer in the installed rerun-sdk.

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
