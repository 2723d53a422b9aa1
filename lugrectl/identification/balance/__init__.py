"""The plain torque balance, which answers any log.

    u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + gravity(theta) + declared effects + residual

in means over windows, by a robust regression. :func:`balance` is the door.
"""

from .balance import balance
from .compare_runs import unlike
from .contradictions import UNRELATED
from .result import Balance, Combination, CurvePoint, Residual

__all__ = ["UNRELATED", "Balance", "Combination", "CurvePoint", "Residual", "balance", "unlike"]
