"""What commands do and print; ``rigidsim.cli.app`` declares their arguments, and imports them as needed."""
