"""The source paper recomputed: its numbers and figures, and where they do not hold."""

from __future__ import annotations

from .page import html, text, write
from .runs import Reproduction, reproduce

__all__ = ["Reproduction", "html", "reproduce", "text", "write"]
