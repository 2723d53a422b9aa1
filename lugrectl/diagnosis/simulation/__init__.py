"""Simulation of a model along its records: errors before and after, residuals, a last polish."""
