"""The source paper recomputed: its numbers and figures, and where they do not hold."""

from __future__ import annotations

from .runs import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
