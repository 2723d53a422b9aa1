"""From a python-control system to its equations."""
