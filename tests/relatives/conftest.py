"""Shared fixtures."""

from pathlib import Path

import pytest
from made_by_commands import make


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with configs, their tables and data, and what was made of them; see ``made_by_commands``."""
    folder = tmp_path_factory.mktemp("data lost")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        make()
    return folder
