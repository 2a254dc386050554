"""Puts ``configs/``, in a clone beside the package, into that of wheels; the rest is in pyproject.toml."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithReadyScenes(build_py):
    """Builds ``rigidsim/configs`` of wheels from ``configs``; ``MANIFEST.in`` puts it into source
    distributions."""

    def _get_data_files(self):
        found = super()._get_data_files()
        for folder in [Path("configs"), *sorted(x for x in Path("configs").rglob("*") if x.is_dir())]:
            names = sorted(x.name for x in folder.iterdir() if x.suffix in (".toml", ".csv", ".tpc", ".py"))
            if names:
                found.append(("rigidsim", str(folder), str(Path(self.build_lib, "rigidsim", folder)), names))
        return found


setup(cmdclass={"build_py": BuildWithReadyScenes})
