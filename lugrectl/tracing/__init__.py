"""Tracing what a model lacks: fit, score, search, hold-out, and what is left."""
