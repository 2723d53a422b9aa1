"""Friction maps: runs at steady speed, taken together as one map of torque over speed."""
