"""One-step predictions of a model along a log, and the values that make them best."""
