"""Simulated drives with known truth, to try the plain answer on: drawn by seed, damaged by kind.

Nothing here uses the package: the physics, the integration and the sensors are written anew.
"""

from .damage import DAMAGES, damage
from .draw import KINDS, dips, draw, drawn

__all__ = ["DAMAGES", "KINDS", "damage", "dips", "draw", "drawn"]
