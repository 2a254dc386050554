"""Frequency analysis of equidistant samples: secular rates and spectral lines, from a Dataset alone."""
