"""One command per module, whose function has the command's name and says what it takes and does.

Each loads what it needs when it is called, so that the others start fast.
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
"""All there are, in the order in which ``rigidsim --help`` shows them."""
