"""The fast engine: trace python-control systems, generate code, step one run or many."""

from ..core.errors import Diverged
from .adaptive_run import Engine
from .batch_run import Lanes
from .graph import TraceError
from .tracer import AlgebraicLoop, Program, trace

__all__ = ["AlgebraicLoop", "Diverged", "Engine", "Lanes", "Program", "TraceError", "trace"]
