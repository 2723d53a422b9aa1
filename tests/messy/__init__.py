"""Drives as machines are: one effect to name beside a background that is always there.

``draw(seed, kind)`` gives a case; ``python -m tests.messy`` scores a judge on many.
"""

from .case import EFFECTS, Answer, Case
from .first import draw

__all__ = ["EFFECTS", "Answer", "Case", "draw"]
