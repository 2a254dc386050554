"""Errors of averaged models."""
