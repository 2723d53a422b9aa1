"""A block alone, as the engine reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


class BareSystem:
    """What the engine reads of a python-control system without blocks inside, under its names."""

    def __init__(
        self,
        updfcn: Any,
        outfcn: Any,
        *,
        inputs: Sequence[str],
        outputs: Sequence[str],
        states: Sequence[str] | None,
        params: Mapping[str, float],
        name: str,
        dt: float | None = 0,
    ) -> None:
        self.updfcn, self.outfcn, self.name, self.dt = updfcn, outfcn, name, dt
        self.input_labels, self.output_labels = list(inputs), list(outputs)
        self.state_labels = list(states or ())
        self.ninputs, self.noutputs = len(self.input_labels), len(self.output_labels)
        self.nstates, self.params = len(self.state_labels), dict(params)
        self._update_params(None)

    def isdtime(self, strict: bool = False) -> bool:
        return False

    def _update_params(self, params: Mapping[str, Any] | None) -> None:
        self._current_params = self.params | dict(params or {})

    def _rhs(self, t: Any, x: Any, u: Any) -> np.ndarray:
        return self.updfcn(t, x, u, self._current_params) if self.nstates else np.zeros(0)

    def _out(self, t: Any, x: Any, u: Any) -> np.ndarray:
        return self.outfcn(t, x, u, self._current_params)
