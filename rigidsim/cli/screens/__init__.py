"""Printed output of the commands: tables, verdicts and pages."""
