"""The fast engine: trace python-control systems, generate code, step one run or many."""

from .adaptive import Adaptive, Diverged
from .lanes import Lanes
from .program import Program
from .symbolic import TraceError
from .trace import AlgebraicLoop, trace

__all__ = ["Adaptive", "AlgebraicLoop", "Diverged", "Lanes", "Program", "TraceError", "trace"]
