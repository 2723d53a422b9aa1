"""An independent simulator of servo drives with friction: records with one hidden effect.

Shares no code with the package under test.  Symbols, units and signs are those of the record:
``J dw/dt = u - F - d``, friction ``F`` and load ``d`` oppose positive ``w``.
"""

from . import effects, strangers  # noqa: F401  (they enter the registries)
from .checks import problems
from .draws import draw, sample
from .excitation import EXCITATIONS
from .exported import exported
from .hiding import CATALOGUE, STRANGERS
from .machines import MACHINES
from .record import Case, make

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
