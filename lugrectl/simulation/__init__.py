"""Time responses of python-control systems: continuous, sampled, and both together."""
