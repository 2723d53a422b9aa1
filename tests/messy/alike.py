"""Which other effects explain a record as well, by inverse dynamics along the true motion."""

from __future__ import annotations


def alike(drawn, run, torque):
    return float("inf"), frozenset()
