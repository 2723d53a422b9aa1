"""Malformed files with fixed seeds: what the readers make of each, and what must hold.

``python -m tests.fuzz [FIRST [LAST]]`` runs the cases of these numbers and prints what is wrong.
"""
