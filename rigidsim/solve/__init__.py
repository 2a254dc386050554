"""Numbers: precisions, the advance loop, sampling, evaluation."""
