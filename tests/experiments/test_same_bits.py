"""The comparison of two versions of the code, on as little as shows that it can fail."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from experiments.same_bits import ROOT, Scene, Version, compared

TEXT = (
    'name = "scene"\n[body]\nprincipal_moments = [1, 2, 2.5]\n[initial]\nangular_velocity = [0.3, 1, 0.5]\n'
    "[time]\nend = 20\nsamples = 9\n"
)


class Changed(Version):
    """A version whose middle moment of inertia is off by 4e-16."""

    def run(self, scene: Scene, *args: Any, **options: Any) -> Any:
        job = {"text": scene.job["text"].replace("[1, 2, 2.5]", "[1, 2.0000000000000004, 2.5]")}
        return super().run(Scene(scene.kind, scene.name, job), *args, **options)


@pytest.mark.slow
@pytest.mark.parametrize(("other", "found"), [(Version, ("same", "same")), (Changed, ("differs", ""))])
def test_one_bit_is_seen(other: type[Version], found: tuple[str, str]) -> None:
    whole, resumed = compared(
        Scene("free", "free", {"text": TEXT}), Version(ROOT), other(Path(ROOT)), random.Random(0)
    )
    assert (whole.split(":")[0], resumed) == found
