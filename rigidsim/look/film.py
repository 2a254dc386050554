"""A timeline drawn by the viewer, without a screen, as a picture or a film."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rigidsim.look.viewer import HeadlessViewer

FORMATS = (".png", ".gif", ".mp4")
SIZE = (1600, 900)
GIF_WIDTH = 1000
FRAMES_PER_SECOND = {".gif": 12, ".mp4": 30}
SECONDS = 6.0
PICTURED_AT = 0.4
"""Time of a single picture, as a fraction of the run: trails have begun, and curves go on."""
_GIF_COLORS = 128


class NoEncoder(RuntimeError):
    """Raised if the library that writes films isn't installed."""


def render(
    path: Path, target: Path, *, seconds: float = SECONDS, told: Callable[[int, int], None] | None = None
) -> Path:
    """Draw a recording as a PNG picture, or a GIF or MP4 film of the whole run.

    Args:
        path: a ``.rrd`` file.
        target: the file, whose suffix decides what is drawn.
        seconds: duration of a film.
        told: called with the number of frames drawn so far, and the total.

    Returns:
        `target`.

    Raises:
        ValueError: another suffix.
        FileNotFoundError: no such recording, or no viewer.
        NoGraphics: no Vulkan driver, see ``viewer.HeadlessViewer``.
        NoEncoder: for an MP4 film without imageio-ffmpeg.
        RuntimeError: the viewer failed.
    """
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"{target}: a picture or film must end in {', '.join(FORMATS)}")
    if suffix == ".mp4":
        _encoder()
    with HeadlessViewer(path, size=SIZE) as viewer:
        if suffix == ".png":
            viewer.seek(PICTURED_AT)
            target.write_bytes(viewer.settled_picture())
            return target
        count = max(round(seconds * FRAMES_PER_SECOND[suffix]), 2)
        frames = _frames(viewer, count, told)
        if suffix == ".gif":
            _write_gif(target, frames, FRAMES_PER_SECOND[suffix])
        else:
            _write_mp4(target, frames, FRAMES_PER_SECOND[suffix])
    return target


def _frames(viewer: HeadlessViewer, count: int, told: Callable[[int, int], None] | None) -> Iterator[Any]:
    from PIL import Image

    viewer.seek(0.0)
    viewer.settled_picture()  # the plots are read by then
    for number in range(count):
        viewer.seek(number / (count - 1))
        yield Image.open(io.BytesIO(viewer.picture())).convert("RGB")
        if told is not None:
            told(number + 1, count)


def _write_gif(target: Path, frames: Iterator[Any], rate: int) -> None:
    from PIL import Image

    first, *rest = (
        frame.resize(
            (GIF_WIDTH, round(GIF_WIDTH * frame.height / frame.width)), Image.Resampling.LANCZOS
        ).quantize(_GIF_COLORS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        for frame in frames
    )
    first.save(target, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0)


def _write_mp4(target: Path, frames: Iterator[Any], rate: int) -> None:
    encoder = _encoder()
    first = next(frames)
    width, height = (size - size % 2 for size in first.size)  # as the codec wants them
    writer = encoder.write_frames(
        str(target), (width, height), fps=rate, codec="libx264", quality=7, macro_block_size=2
    )
    writer.send(None)
    try:
        writer.send(first.crop((0, 0, width, height)).tobytes())
        for frame in frames:
            writer.send(frame.crop((0, 0, width, height)).tobytes())
    finally:
        writer.close()


def _encoder() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise NoEncoder(
            "an MP4 film needs imageio-ffmpeg: pip install 'rigidsim[film]'; a GIF needs nothing more"
        ) from None
    return imageio_ffmpeg
