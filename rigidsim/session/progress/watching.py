"""Who watches a run from Python: the caller's observer, a progress bar, or nobody."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rigidsim.session.guards import Observer


@contextmanager
def watched(given: Observer | None, progress: bool | None) -> Iterator[Observer]:
    """The observer of a run.

    Args:
        given: one of the caller's.
        progress: whether a bar shows how it goes where none is given; None: in notebooks.
    """
    if given is not None or not (in_notebook() if progress is None else progress):
        yield given or Observer()
        return
    from rigidsim.session.progress.progress import observer  # it loads the library that draws bars

    with observer(notebook=in_notebook()) as bar:
        yield bar


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    shell = sys.modules.get("IPython")
    return shell is not None and hasattr(shell.get_ipython(), "kernel")
