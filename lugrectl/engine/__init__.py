"""The fast engine: trace python-control systems, generate code, step one run or many."""

from .expression.numpy_protocol import TraceError
from .runtime.adaptive_run import Adaptive, Diverged
from .runtime.batch_run import Lanes
from .tracing.equations import Program
from .tracing.tracer import AlgebraicLoop, trace

__all__ = ["Adaptive", "AlgebraicLoop", "Diverged", "Lanes", "Program", "TraceError", "trace"]
