"""Drawn records and measured logs, what a judge says of them, and whether it is right."""
