"""Opening a timeline in the viewer of rerun-sdk."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

LOOPBACK = "127.0.0.1"  # rerun's own default would listen on every interface
WEB_PORT, DATA_PORT = 9090, 9876
"""Ports of 127.0.0.1 on which the browser page and its recording are served: rerun's own."""
INTERRUPTED = 130
QUIET = {"CI": "1"}  # the one variable that keeps the viewer from sending usage statistics (0.41)


class NoDisplay(RuntimeError):
    """Raised if there is no screen for a window."""


NO_DISPLAY = (
    "there is no display here (neither DISPLAY nor WAYLAND_DISPLAY is set); --web serves the viewer to a "
    "browser on this machine (on another one through a tunnel: ssh -L 9090:127.0.0.1:9090 "
    "-L 9876:127.0.0.1:9876 HOST), and --png, --gif or --mp4 FILE draw without one"
)


def open_viewer(path: Path, *, web: bool = False) -> int:
    """Open a recording (`.rrd`) in the viewer and wait until it is closed. No usage statistics are sent.

    Args:
        web: serve the viewer on 127.0.0.1 only, until Ctrl-C; it prints the address to open.

    Returns:
        The viewer's exit code; 130 after Ctrl-C, which for `web` is the way to end it.

    Raises:
        FileNotFoundError: no such file, or no viewer in the installed rerun-sdk.
        NoDisplay: a window is asked for where there is no screen.
    """
    with _running([str(existing(path))], DATA_PORT, ["--port", "auto"], web=web) as process:
        try:
            return ended(process)
        except KeyboardInterrupt:
            return INTERRUPTED


@contextmanager
def empty_viewer(*, web: bool = False) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A viewer that waits for recordings, and the port of 127.0.0.1 on which it takes them; it is ended with
    the context.

    Raises:
        FileNotFoundError, NoDisplay: as for ``open_viewer``.
    """
    port = free_port()
    with _running([], port, ["--port", str(port), "--expect-data-soon"], web=web) as process:
        yield process, port


@contextmanager
def _running(
    recording: Sequence[str], port: int, windowed: Sequence[str], *, web: bool
) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that is ended with the context.

    It makes a folder for its catalogue where temporary files go and leaves it there when it is ended, so that
    it is given a place that goes with it.
    """
    if not web and not has_display():
        raise NoDisplay(NO_DISPLAY)
    command = [str(viewer_binary()), *recording, "--bind", LOOPBACK]
    environment = os.environ | QUIET
    if web:  # only errors are reported
        command += ["--serve-web", "--port", str(port), "--web-viewer-port", str(WEB_PORT)]
        environment |= {"RUST_LOG": os.environ.get("RUST_LOG", "warn")}
    else:
        command += windowed
    with tempfile.TemporaryDirectory(prefix="rigidsim-viewer-") as scratch:
        process = subprocess.Popen(command, env={**environment, "TMPDIR": scratch})
        try:
            if web:
                print(web_words(port), flush=True)
            yield process
        finally:
            process.terminate()
            process.wait()


def has_display() -> bool:
    """Whether a window can be opened; assumed on systems other than Linux."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def ended(process: subprocess.Popen[bytes], timeout: float | None = None) -> int:
    """Wait for a viewer; returns its exit code, 130 if Ctrl-C reached it first.

    Raises:
        TimeoutExpired: of subprocess, after so many seconds.
    """
    code = process.wait(timeout)
    return INTERRUPTED if code == -signal.SIGINT else code


def web_words(port: int) -> str:
    """The page's address, dark as its colours are made for, and how to end it; its recording is on a port."""
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


def existing(path: Path) -> Path:
    """The path of a recording.

    Raises:
        FileNotFoundError: there is none.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"no timeline at {path}: run with [output] timeline = true")
    return Path(path)


def free_port() -> int:
    """A port of 127.0.0.1 that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
