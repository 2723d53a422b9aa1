"""A second rig: logs of servo drives with friction, made from the physics alone."""

from .drawing import draw, draw_effect

__all__ = ["draw", "draw_effect"]
