"""Builds the documentation as a site: ``python docs/build.py [FOLDER] [--code-only]``, by default _site.

Needs the extra "docs" (``pip install -c constraints.txt -e '.[docs]'``) and no network. Notebooks are run,
and shown with what they print and draw, and scenes of the gallery play in the browser; with ``--code-only``
neither is so. Warnings and dead links are errors,
also links to places within pages; the pages fetch nothing when they are read.
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
import scenes  # noqa: E402
import staging  # noqa: E402


def build(site: Path, *, run: bool = True) -> int:
    """Build the site into a folder, which is replaced; ``run`` the notebooks and the scenes for it.

    Returns:
        How many pages it has.

    Raises:
        SystemExit: something is wrong in a page; what, has been said.
    """
    with tempfile.TemporaryDirectory() as temporary:
        pages = Path(temporary)
        try:
            staging.gather(pages, run=run)
        except staging.DeadLinkError as error:
            raise SystemExit(f"dead links\n{error}") from None
        reference.write(pages / "reference")
        staging.add_contents(pages)
        shutil.rmtree(site, ignore_errors=True)
        sphinx = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-b", "html"]
        environment = ["-c", str(HERE / "builder"), "-d", str(pages / ".doctrees")]
        done = subprocess.run([*sphinx, *environment, str(pages), str(site)])
        if done.returncode:
            raise SystemExit(done.returncode)
    if run:
        scenes.record(site)
        scenes.put_viewer(site / "_static" / "viewer")
    else:
        shutil.rmtree(site / "_static" / "viewer")  # its page without the viewer leads nowhere
    faults = checking.faults(site)
    if faults:
        raise SystemExit("\n".join(faults))
    return len(list(site.rglob("*.html")))


if __name__ == "__main__":
    given = [argument for argument in sys.argv[1:] if argument != "--code-only"]
    where = Path(given[0] if given else HERE / "_site").resolve()
    print(f"{build(where, run='--code-only' not in sys.argv)} pages: {where / 'index.html'}")
