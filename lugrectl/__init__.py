"""Friction in servo drives: blocks for python-control, observers, checks, and diagnosis."""

from .blocks.plant import plant
from .errors import InputError, Refused
from .model import Model, Parameters, read_model, table1, write_model

__all__ = [
    "InputError",
    "Model",
    "Parameters",
    "Refused",
    "plant",
    "read_model",
    "table1",
    "write_model",
]
