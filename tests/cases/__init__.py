"""Drives, logs and systems that several tests use."""
