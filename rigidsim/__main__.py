"""``python -m rigidsim``."""

from rigidsim.cli import app

app(prog_name="rigidsim")
