"""The progress bar of the commands."""

from __future__ import annotations

from ..core.progress import Terminal as Bar

__all__ = ["Bar"]
