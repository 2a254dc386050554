"""``python -m rigidsim``."""

from rigidsim.cli.app import app

app(prog_name="rigidsim")
