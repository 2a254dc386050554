"""Another tool's trajectory beside an experiment: conventions, errors, local defects, and what they mean."""
