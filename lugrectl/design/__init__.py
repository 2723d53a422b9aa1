"""Gains of the proposed observer, their guaranteed error decay, and the excitation by a motion."""

from __future__ import annotations

from .certificate import Certificate, certify
from .excitation import Excitation, excitation, natural_decay
from .gains import Design, ScheduledGain, design_gains
from .paper import PAPER, Label

__all__ = [
    "PAPER",
    "Certificate",
    "Design",
    "Excitation",
    "Label",
    "ScheduledGain",
    "certify",
    "design_gains",
    "excitation",
    "natural_decay",
]
