"""Another tool's trajectory and an experiment: conventions, errors, local defects, and what they mean."""
