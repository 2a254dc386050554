"""Parts of ``experiments/accuracy_certificates.py``."""
