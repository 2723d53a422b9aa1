"""The fast engine: trace python-control systems, generate code, step many runs at once."""

from .lanes import Lanes
from .symbolic import TraceError
from .trace import AlgebraicLoop, Program, trace

__all__ = ["AlgebraicLoop", "Lanes", "Program", "TraceError", "trace"]
