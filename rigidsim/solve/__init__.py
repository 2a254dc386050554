"""Numbers: precisions, the loop over steps, sampling, evaluation."""
