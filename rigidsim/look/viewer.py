"""The viewer of rerun-sdk: a timeline opened in it, or a running run followed as it goes on."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    import xarray

LOOPBACK = "127.0.0.1"  # rerun's own default would listen on every interface
WEB_PORT, DATA_PORT = 9090, 9876
"""Ports of 127.0.0.1 on which the browser page and its recording are served: rerun's own."""
INTERRUPTED = 130
_POLL_SECONDS, _ANSWER_SECONDS, _CLOSING_SECONDS = 1.0, 20.0, 3.0
QUIET = {"CI": "1"}  # the one variable that keeps the viewer from sending usage statistics (0.41)


class NoDisplay(RuntimeError):
    """Raised if there is no screen for a window."""


def open_viewer(path: Path, *, web: bool = False) -> int:
    """Open a recording (`.rrd`) in the viewer, or with `web` serve it on 127.0.0.1 only and print the
    address, and wait until it is closed; returns its exit code, 130 after Ctrl-C. No usage statistics are
    sent.

    Raises:
    FileNotFoundError: no such file, or no viewer in the installed rerun-sdk.
    NoDisplay: a window is asked for where there is no screen.
    """
    with _running([str(existing(path))], DATA_PORT, ["--port", "auto"], web=web) as process:
        try:
            return _ended(process)
        except KeyboardInterrupt:
            return INTERRUPTED


def follow(read: Callable[[], tuple[xarray.Dataset | None, bool]], *, web: bool = False) -> int:
    """Open the viewer on a run that goes on, and keep it up to date until the run or the viewer ends.

    `read` returns the dataset saved so far (None before there is one), and whether the run goes on; all else
    is as for ``open_viewer``. ``RuntimeError`` if the viewer ended before it listened.
    """
    port = free_port()
    with _running([], port, ["--port", str(port), "--expect-data-soon"], web=web) as process:
        # Ctrl-C ends the viewer, too: what was on its way there would be complained of, and `process` reports
        # enough. rerun looks at this when it is loaded
        os.environ.setdefault("RUST_LOG", "off")
        from rigidsim.look.timeline.writing import live_recording

        try:
            _wait_for(process, port)
            with live_recording(f"rerun+http://{LOOPBACK}:{port}/proxy") as recording:
                going_on = True
                while going_on and process.poll() is None:
                    dataset, going_on = read()
                    if dataset is not None:
                        with dataset:
                            recording.update(dataset)
                    with suppress(subprocess.TimeoutExpired):
                        process.wait(_POLL_SECONDS if going_on else 0.0)
            return _ended(process)
        except KeyboardInterrupt:
            return INTERRUPTED
        except RuntimeError:
            with suppress(subprocess.TimeoutExpired):  # sent while the viewer was being closed
                return _ended(process, _CLOSING_SECONDS)
            raise


@contextmanager
def _running(
    recording: Sequence[str], port: int, windowed: Sequence[str], *, web: bool
) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer in a window, or for a browser."""
    if not web and not has_display():
        raise NoDisplay(
            "there is no display here (neither DISPLAY nor WAYLAND_DISPLAY is set); --web serves the viewer "
            "to a browser on this machine (on another one through a tunnel: ssh -L 9090:127.0.0.1:9090 "
            "-L 9876:127.0.0.1:9876 HOST), and --png, --gif or --mp4 FILE draw without one"
        )
    command, quiet = [*recording, *windowed], dict[str, Any]()
    if web:  # only errors are reported
        command = [*recording, "--serve-web", "--port", str(port), "--web-viewer-port", str(WEB_PORT)]
        quiet = {"RUST_LOG": os.environ.get("RUST_LOG", "warn")}
    with running(command, **quiet) as (process, _):
        if web:
            # dark, as the page's colours are made for
            source = quote(f"rerun+http://{LOOPBACK}:{port}/proxy", safe="")
            page = f"http://{LOOPBACK}:{WEB_PORT}?theme=dark&url={source}"
            print(f"open {page} in a browser on this machine; Ctrl-C ends it", flush=True)
        yield process


@contextmanager
def running(
    arguments: Sequence[str], *, own_home: bool = False, **environment: str
) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """A viewer that is ended with the context, and given a place for temporary files that goes with it, where
    it would leave a folder for its catalogue; with a separate home, without the user's settings, whose log
    is the file that comes with it.
    """
    command = [str(viewer_binary()), *arguments, "--bind", LOOPBACK]
    with tempfile.TemporaryDirectory(prefix="rigidsim-viewer-") as scratch, ExitStack() as files:
        environment |= QUIET | {"TMPDIR": scratch}
        log, output = Path(scratch) / "viewer.log", dict[str, Any]()
        if own_home:
            environment |= dict.fromkeys(("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"), scratch)
            output = dict.fromkeys(("stdout", "stderr"), files.enter_context(log.open("wb")))
        process = subprocess.Popen(command, env=os.environ | environment, **output)
        try:
            yield process, log
        finally:
            process.terminate()
            process.wait()


def has_display() -> bool:
    """Whether a window can be opened; assumed on systems other than Linux."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _ended(process: subprocess.Popen[bytes], timeout: float | None = None) -> int:
    """The exit code of a viewer once it has ended, 130 if Ctrl-C reached it first."""
    code = process.wait(timeout)
    return INTERRUPTED if code == -signal.SIGINT else code


def _wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    """Wait until a viewer takes recordings."""
    until = time.monotonic() + _ANSWER_SECONDS
    while time.monotonic() < until:
        if process.poll() is not None:
            raise RuntimeError(f"the viewer ended with exit code {process.returncode}")
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.1)
    raise RuntimeError(f"the viewer didn't answer within {_ANSWER_SECONDS:g} s")


def viewer_binary() -> Path:
    """Path of the viewer in the installed rerun-sdk; ``FileNotFoundError`` where it isn't."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise FileNotFoundError("the rerun viewer isn't installed: pip install rerun-sdk")
    folder = Path(found.origin).parent
    for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun"):  # each system has one of them
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"the rerun viewer isn't in {folder}: reinstall rerun-sdk")


def existing(path: Path) -> Path:
    """The path of a recording; ``FileNotFoundError`` if there is none."""
    if not Path(path).is_file():
        raise FileNotFoundError(f"no timeline at {path}: run with [output] timeline = true")
    return Path(path)


def free_port() -> int:
    """A port of 127.0.0.1 that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
