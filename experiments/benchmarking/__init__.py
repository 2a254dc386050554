"""The machinery of ``experiments.benchmark``: its rows, the processes timed, readers of what they write."""
