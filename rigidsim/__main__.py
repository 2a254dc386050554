"""``python -m rigidsim``, and the program ``rigidsim``."""

from rigidsim.cli.app import main
from rigidsim.cli.ending import left_at_once


def start() -> None:
    """Run the program in a process of its own."""
    left_at_once(main)


if __name__ == "__main__":
    start()
