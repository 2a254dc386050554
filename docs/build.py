"""Builds the documentation as a site: ``python docs/build.py [FOLDER]``, by default docs/_site.

Needs the extra "docs" (``pip install -c constraints.txt -e '.[docs]'``) and no network. Warnings and dead
links are errors, also links to places within pages; the pages fetch nothing when they are read.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "builder"))
sys.path.insert(0, str(HERE.parent))

import checking  # noqa: E402
import reference  # noqa: E402
import staging  # noqa: E402


def build(site: Path) -> int:
    """Build the site into a folder, which is replaced.

    Returns:
        How many pages it has.

    Raises:
        SystemExit: something is wrong in a page; what, has been said.
    """
    with tempfile.TemporaryDirectory() as temporary:
        pages = Path(temporary)
        try:
            staging.gather(pages)
        except staging.DeadLinkError as error:
            raise SystemExit(f"dead links\n{error}") from None
        reference.write(pages / "reference")
        staging.add_contents(pages)
        shutil.copytree(HERE / "builder" / "_static", pages / "_static")
        shutil.rmtree(site, ignore_errors=True)
        sphinx = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-b", "html"]
        environment = ["-c", str(HERE / "builder"), "-d", str(pages / ".doctrees")]
        done = subprocess.run([*sphinx, *environment, str(pages), str(site)])
        if done.returncode:
            raise SystemExit(done.returncode)
    faults = checking.faults(site)
    if faults:
        raise SystemExit("\n".join(faults))
    return len(list(site.rglob("*.html")))


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else HERE / "_site").resolve()
    print(f"{build(where)} pages: {where / 'index.html'}")
