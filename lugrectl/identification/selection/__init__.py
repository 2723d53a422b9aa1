"""One comparison decides what is missing from a declared model.

Every explanation is a row of one table: the declared model, the same with an effect of the
catalogue, or with an unknown torque over some signals. All rows are regressions in weak form,

    K u = J K a + K F(w, z) + sum_i b_i K f_i(theta, w, t) + residual,

over the same windows of the same log, scored by the density of each block under a fit without it.
:func:`compare` is the door.
"""

from .completing import completed
from .face import compare, levels
from .numbers import ALPHA, LEAST
from .result import Compared, Comparison, Detectable, Named, Share
from .score import paired, standard_error

__all__ = [
    "ALPHA",
    "LEAST",
    "Compared",
    "Comparison",
    "Detectable",
    "Named",
    "Share",
    "compare",
    "completed",
    "levels",
    "paired",
    "standard_error",
]
