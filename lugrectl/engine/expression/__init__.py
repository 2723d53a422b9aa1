"""Expression graphs: operations, the NumPy protocol that builds them, derivatives."""
