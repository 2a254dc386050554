"""``python -m rigidsim``."""

from rigidsim.cli.app import main

if __name__ == "__main__":
    main()
