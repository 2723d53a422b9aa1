"""Malformed files with fixed seeds: what the readers make of each, and what must hold."""
