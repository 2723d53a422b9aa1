"""From equations to source text: one module for each kind of run."""
