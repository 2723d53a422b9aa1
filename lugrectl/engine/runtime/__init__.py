"""Generated code compiled, kept and run."""
