"""``python -m rigidsim``."""

from rigidsim.cli.app import main

main()
