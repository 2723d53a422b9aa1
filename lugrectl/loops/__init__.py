"""Ready-made loops: blocks connected by their signal names alone."""
