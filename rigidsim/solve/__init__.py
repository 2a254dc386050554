"""Numerical solution: precisions, the loop over steps, sampling, evaluation."""
