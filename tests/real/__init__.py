"""Measured logs of real drives: what a judge says of each, beside what is known of the drive."""
