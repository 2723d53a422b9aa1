"""One system, many runs: parameter sets, initial states, random inputs."""

from .result import Sweep
from .sweeps import sweep, sweep_chunks

__all__ = ["Sweep", "sweep", "sweep_chunks"]
