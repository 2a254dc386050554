"""Shared fixtures."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

os.environ.setdefault("CI", "1")  # rerun's viewer collects no statistics then
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """An empty folder for run folders."""
    return tmp_path / "runs"
