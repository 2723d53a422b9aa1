"""One system, many runs: parameter sets, initial states, random inputs."""

from .run import sweep, sweep_chunks
from .sweep_result import Sweep

__all__ = ["Sweep", "sweep", "sweep_chunks"]
