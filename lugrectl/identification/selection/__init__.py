"""One comparison decides what is missing from a declared model.

Every explanation is a row of one table: the declared model, the same with an effect of the
catalogue, or with an unknown torque over some signals. All rows are regressions in weak form,

    K u = J K a + K F(w, z) + sum_i b_i K f_i(theta, w, t) + residual,

over the same windows of the same log, scored by the density of each block under a fit without it.
:func:`compare` is the door.
"""

from ..regression.numbers import ALPHA, LEAST
from ..regression.score import paired, standard_error
from .compare import alone, compare
from .comparison import Compared, Comparison, Detectable, Named, Share, place_of
from .open_values import completed
from .values import HeldOut, Valued

__all__ = [
    "ALPHA",
    "LEAST",
    "Compared",
    "Comparison",
    "Detectable",
    "HeldOut",
    "Named",
    "Share",
    "Valued",
    "alone",
    "compare",
    "completed",
    "paired",
    "place_of",
    "standard_error",
]
