"""Friction limit cycles of position loops, by the map from stick to stick."""
