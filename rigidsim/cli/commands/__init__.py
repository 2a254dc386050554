"""What the commands do; ``rigidsim.cli.app`` declares their arguments, and imports them as needed."""
