"""What commands print: tables, verdicts and pages."""
