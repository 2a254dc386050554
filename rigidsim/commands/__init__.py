"""The commands of ``rigidsim``, one function each; ``rigidsim.cli`` puts them together."""
