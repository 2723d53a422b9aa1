"""Standard bench tests, recognised by their motion and torque, and answered as such."""

from .recognise import bench_tests

__all__ = ["bench_tests"]
