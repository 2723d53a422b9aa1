"""Parallel map on threads, from the engine."""

from __future__ import annotations

from ..engine.beside import beside

__all__ = ["beside"]
