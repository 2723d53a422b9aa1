"""Find what is missing from a model: fit, score test, search, hold-out, residual."""
