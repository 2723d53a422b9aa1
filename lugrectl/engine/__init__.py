"""The fast engine: trace python-control systems, generate code, step one run or many."""

from ..core.errors import Diverged
from .expression.numpy_protocol import TraceError
from .runtime.adaptive_run import Engine
from .runtime.batch_run import Lanes
from .tracing.tracer import AlgebraicLoop, Program, trace

__all__ = ["AlgebraicLoop", "Diverged", "Engine", "Lanes", "Program", "TraceError", "trace"]
