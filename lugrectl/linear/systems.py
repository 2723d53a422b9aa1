"""What a check is asked about, as one kind of system: exact, of many states, or measured."""

from __future__ import annotations

from typing import Any

import control as ct

from .exact_system import ExactSystem
from .measured import MeasuredSystem
from .state_system import StateSystem
from .transfer import is_measured

EXACT = 6  # states of a state-space model that is decided in exact arithmetic

System = ExactSystem | StateSystem | MeasuredSystem


def has_many_states(T: Any) -> bool:
    """Return whether T is a state-space model that is decided in floating point."""
    return isinstance(T, ct.StateSpace) and T.nstates > EXACT


def system_of(T: Any) -> System:
    """Return T of one input and output; InputError for what the checks do not take."""
    if is_measured(T):
        return MeasuredSystem.of(T)
    return StateSystem.single(T) if has_many_states(T) else ExactSystem.of(T)
