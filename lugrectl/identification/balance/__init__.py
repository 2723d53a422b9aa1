"""The plain torque balance, which answers any log.

    u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + gravity(theta) + declared effects + residual

in means over windows, by a robust regression. :func:`balance` is the door.
"""

from .alike import unlike
from .face import balance
from .result import Balance, Combination, CurvePoint, Residual
from .verdicts import UNRELATED

__all__ = ["UNRELATED", "Balance", "Combination", "CurvePoint", "Residual", "balance", "unlike"]
