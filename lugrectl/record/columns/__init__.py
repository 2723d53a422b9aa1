"""Columns: which one is which channel, and in which unit."""
