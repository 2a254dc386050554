"""A timeline drawn by the viewer, without a screen, as a picture or a film."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from itertools import chain
from pathlib import Path
from typing import Any, Self

import numpy as np
from PIL import Image

from rigidsim.look.viewer import LOOPBACK, existing, free_port, running

FORMATS = (".png", ".gif", ".mp4")
SIZE = (1600, 900)
FRAMES_PER_SECOND = {".gif": 8, ".mp4": 30}
SECONDS = 6.0
PICTURED_AT = 0.4  # time of a single picture, as a fraction of the run: trails have begun, and curves go on
_GIF_COLORS = 128
_BAR, _CORNER, _ALIKE = 37, 16, 6  # points of the window's bar, of its rounded corners; levels of one colour
_PATIENCE = 120.0  # seconds until a picture is given up


class NoGraphics(RuntimeError):
    """Raised if the machine has no Vulkan driver with which the headless viewer could draw."""


def render(
    path: Path, target: Path, *, seconds: float = SECONDS, progress: Callable[[int, int], None] | None = None,
    at: float = PICTURED_AT, size: tuple[int, int] = SIZE,
) -> Path:  # fmt: skip
    """Draw a recording (``.rrd``) as a PNG picture at a fraction of the run, or a GIF or MP4 film of all of
    it lasting so many seconds, as the suffix of `target` says, which it returns; `progress` receives the
    numbers of frames drawn and in all. ``size``: of the picture, points.

    Raises:
    ValueError: another suffix.
    FileNotFoundError, NoGraphics: see ``HeadlessViewer``.
    RuntimeError: no imageio-ffmpeg for an MP4 film, or the viewer failed.
    """
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"{target}: a picture or film must end in {', '.join(FORMATS)}")
    encoder = _encoder() if suffix == ".mp4" else None
    with HeadlessViewer(path, size=size) as viewer:
        if suffix == ".png":
            viewer.seek(at)
            _without_bar(viewer.settled_picture()).save(target)
            return target
        rate = FRAMES_PER_SECOND[suffix]
        frames = _frames(viewer, max(round(seconds * rate), 2), progress)
        if encoder is None:
            _write_gif(target, frames, rate)
        else:
            _write_mp4(encoder, target, frames, rate)
    return target


def _frames(
    viewer: HeadlessViewer, count: int, progress: Callable[[int, int], None] | None
) -> Iterator[Image.Image]:
    viewer.seek(0.0)
    viewer.settled_picture(5.0)  # the plots are read by then, and the opening notes have gone
    for number in range(count):
        viewer.seek(number / (count - 1))
        yield _without_bar(viewer.picture())
        if progress is not None:
            progress(number + 1, count)


def _without_bar(picture: bytes) -> Image.Image:
    """A picture without the window's bar, for which the viewer leaves room even if it is hidden and empty."""
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    inner = image.crop((_CORNER, 2, image.width - _CORNER, _BAR - 2))
    empty = bool(np.ptp(np.asarray(inner), axis=(0, 1)).max() <= _ALIKE)
    return image.crop((0, _BAR, image.width, image.height)) if empty else image


def _write_gif(target: Path, frames: Iterator[Image.Image], rate: int) -> None:
    first, *rest = (
        frame.quantize(_GIF_COLORS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        for frame in frames
    )
    first.save(target, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0)


def _write_mp4(encoder: Any, target: Path, frames: Iterator[Image.Image], rate: int) -> None:
    first = next(frames)
    size = first.width - first.width % 2, first.height - first.height % 2  # as the codec wants them
    options = {"fps": rate, "codec": "libx264", "quality": 7, "macro_block_size": 2}
    with closing(encoder.write_frames(str(target), size, **options)) as writer:
        writer.send(None)
        for frame in chain([first], frames):
            writer.send(frame.crop((0, 0, *size)).tobytes())


def _encoder() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise RuntimeError(
            "an MP4 film needs imageio-ffmpeg: pip install 'rigidsim[film]'; a GIF needs nothing more"
        ) from None
    return imageio_ffmpeg


class HeadlessViewer:
    """The viewer without a screen, with a recording open in it and its time at rest; a context manager.

    Raises (on entering):
    FileNotFoundError: no such recording, or no viewer.
    NoGraphics: no Vulkan driver; Mesa's software driver will do.
    RuntimeError: the viewer failed or took longer than two minutes.
    """

    def __init__(self, path: Path, *, size: tuple[int, int] = SIZE) -> None:
        self._path, self._size, self._port = existing(path), size, free_port()
        self._deadline = time.monotonic() + _PATIENCE
        self.client: Any = None
        self.timeline = ""  # that the page opened on, and its first and last integer
        self.start = self.end = 0

    def __enter__(self) -> Self:
        if not vulkan_drivers():
            raise NoGraphics(
                "no Vulkan driver found: a headless picture needs one, for example Mesa's lavapipe "
                "(apt-get install mesa-vulkan-drivers)"
            )
        command = [str(self._path.resolve()), "--headless", "--port", str(self._port)]
        command += ["--window-size", f"{self._size[0]}x{self._size[1]}"]
        with ExitStack() as stack:
            self.process, self._log = stack.enter_context(running(command, own_home=True))
            self._open()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def seek(self, share: float) -> None:
        """Go to a place in the run, 0 to 1, and stay there."""
        self.seek_tick(self.start + round(share * (self.end - self.start)))

    def seek_tick(self, tick: int) -> None:
        """Go to a time of the timeline, as its integer, and stay there."""
        # Integers of any timeline pass through `sequence` as they are.
        self._asked(lambda: self.client.set_time(self.timeline, sequence=tick, play_state="paused"))

    def picture(self) -> bytes:
        """PNG of the window as it is."""
        return bytes(self._asked(self.client.take_screenshot))

    def settled_picture(self, least: float = 7.0) -> bytes:
        """PNG of the window once it no longer changes, after so many seconds at least: plots are read then,
        and the opening notes have gone.
        """
        settled, last = time.monotonic() + least, b""
        while time.monotonic() < self._deadline:
            time.sleep(0.4)
            picture = self.picture()
            if picture == last and time.monotonic() > settled:
                return picture
            last = picture
        raise self._failure("its picture never came to rest")

    def _asked(self, question: Callable[[], Any]) -> Any:
        """The viewer's answer, asked again where a busy machine keeps it beyond the client's own patience."""
        until = time.monotonic() + _PATIENCE
        while True:
            try:
                return question()
            except TimeoutError:
                if time.monotonic() > until or self.process.poll() is not None:
                    raise self._failure("no answer in time") from None

    def _open(self) -> None:
        """Wait until the recording is loaded: --screenshot-to fires before the plots have been read."""
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
            except Exception as problem:  # not listening yet; the client has no specific error
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
