"""The answer of the torque balance."""

from __future__ import annotations

from ...estimates.balance import (
    LEVELS,
    NEEDS,
    Balance,
    Combination,
    CurvePoint,
    Residual,
)

__all__ = ["LEVELS", "NEEDS", "Balance", "Combination", "CurvePoint", "Residual"]
