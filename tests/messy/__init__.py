"""Drives as machines are: one effect to name beside a background that is always there."""
