"""Accuracy and cost of settings: trials, forecasts, choices, certificates, and their bench."""
