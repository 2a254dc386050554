"""SPK files: read as they are written, and refused where they are cut, swapped or damaged."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kernel_scenes import STRENGTHS, moon
from spk_files import FIRST, write_kernel
from support import run_text

import rigidsim
from rigidsim.scene.kernels.reading import KernelError, SpkKernel


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("kernel") / "moon.bsp"
    write_kernel(path)
    return path.read_bytes()


def flipped(at: int, bit: int = 0x40) -> Callable[[bytes], bytes]:
    """One bit of a byte, counted from the end where negative, is another."""

    def changed(given: bytes) -> bytes:
        data = bytearray(given)
        data[at] ^= bit
        return bytes(data)

    return changed


DAMAGE: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "cut": (lambda x: x[:20_000], "which is truncated: it has 20000 bytes, and its segments extend to 54912"),
    "empty": (lambda _: b"", "which is no SPK file, or a damaged one (file starts with b''"),
    "of attitudes": (lambda x: b"DAF/CK  " + x[8:], "it begins with DAF/CK); a file .bsp of SPICE"),
    "list without an end": (lambda x: x[:1024] + np.float64(2).tobytes() + x[1032:], "has no end"),
    "no segments": (lambda x: x[:1040] + np.float64(0).tobytes() + x[1048:], "which has no segments"),
    "other span": (flipped(-26), "is damaged or truncated (its blocks don't cover its span); copy it again"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_told_beforehand(name: str, tmp_path: Path, whole: bytes) -> None:
    change, words = DAMAGE[name]
    path = tmp_path / "moon.bsp"
    path.write_bytes(change(whole))
    with pytest.raises(rigidsim.ConfigError) as caught:
        rigidsim.plan(rigidsim.parse(moon(str(path), STRENGTHS)))
    assert words in str(caught.value)
    assert "[ephemeris] kernel: given " in str(caught.value)


def test_no_flipped_bit_of_the_directory_and_no_cut_ends_in_a_traceback(tmp_path: Path, whole: bytes) -> None:
    """Either the file is refused, or what changed was no part of what is read."""
    draw, path = random.Random(3), tmp_path / "moon.bsp"
    refused = 0
    for number in range(60):
        changed = flipped(draw.randrange(3072), 1 << draw.randrange(8))(whole)
        path.write_bytes(changed if number % 3 else whole[: draw.randrange(len(whole))])
        try:
            kernel = SpkKernel(path)
            for body in ("sun", "earth"):
                if kernel.known(body) and kernel.known("moon"):
                    kernel.sight(body, "moon")
        except KernelError:
            refused += 1
    assert refused >= 20


def test_a_run_beyond_the_file_is_refused_with_both_spans(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "moon.bsp"
    path.write_bytes(whole)
    assert FIRST == 2440368.5  # 1969-05-27
    with pytest.raises(rigidsim.ConfigError) as caught:
        run_text(moon(str(path), STRENGTHS), 'time.end="300 day"')
    words = "from 1969-05-27 to 1970-02-07 (TDB), but the run goes from 1969-06-28"
    assert f'has "earth" {words}' in str(caught.value)
