"""Errors of averaged models, and the choice of a model that is good enough."""
