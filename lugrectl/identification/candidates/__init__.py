"""Whatever may be missing: each effect as columns of the regression."""
