"""The simulator of the tests: servo drives with friction, and records with a hidden effect.

Shares no code with the package under test.  Symbols, units and signs are those of the record:
``J dw/dt = u - F - d``, friction ``F`` and load ``d`` oppose positive ``w``.
"""

from .effects import CATALOGUE, STRANGERS
from .machines import MACHINES
from .moves import EXCITATIONS
from .record import Case, make
from .sample import draw, exported, problems, sample

__all__ = [
    "CATALOGUE",
    "EXCITATIONS",
    "MACHINES",
    "STRANGERS",
    "Case",
    "draw",
    "exported",
    "make",
    "problems",
    "sample",
]
