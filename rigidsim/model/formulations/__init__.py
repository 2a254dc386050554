"""Formulations of the rotation; importing this package registers them."""

from rigidsim.model.formulations import averaged  # noqa: F401  (it and what it imports enter themselves)
