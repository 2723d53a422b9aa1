"""Gains of the observers, their guaranteed error decay, and the excitation by a motion."""

from __future__ import annotations

from .certificate import Certificate, Excitation, certify, excitation, natural_decay
from .gains import Design, ObserverDesign, ScheduledGain, design_gains

__all__ = [
    "Certificate",
    "Design",
    "Excitation",
    "ObserverDesign",
    "ScheduledGain",
    "certify",
    "design_gains",
    "excitation",
    "natural_decay",
]
