"""One command per module, whose function has the command's name and says what it takes and does.

Each command imports what it needs when called, so that the others start fast.
"""

COMMANDS = (
    "new",
    "check",
    "run",
    "sweep",
    "resume",
    "verify",
    "plan",
    "info",
    "view",
    "plot",
    "tradeoff",
    "export",
    "analyse",
    "schema",
)
"""All commands, in the order of ``rigidsim --help``."""
