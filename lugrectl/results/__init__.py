"""Results of a diagnosis: small frozen objects."""
