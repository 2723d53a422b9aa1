"""Collects blocks of answers into one result."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.jobs import JobError
from .prepare import Prepared
from .sweep_result import Sweep
from .worker import Block


class Gathered:
    """Arrays for the members of a range, filled as answers arrive."""

    def __init__(self, made: Prepared, index: range | None = None) -> None:
        self.made, self.index = made, range(made.count) if index is None else index
        self.y: np.ndarray | None = None
        self.x: np.ndarray | None = None
        self.reduced: np.ndarray | None = None
        self.done = np.zeros(len(self.index), dtype=bool)
        self.failed: dict[int, str] = {}
        self.coarse: dict[int, float] = {}
        self.interrupted = False

    def take(self, index: range, block: Block | JobError) -> None:
        here = slice(index.start - self.index.start, index.stop - self.index.start)
        if isinstance(block, JobError):
            self.failed |= dict.fromkeys(index, block.sentence)
        else:
            self.failed |= block.failed
            self.coarse |= block.coarse
            for name in ("y", "x"):
                setattr(self, name, self._placed(getattr(self, name), here, getattr(block, name)))
            if block.reduced is not None:
                self._reduced(block.reduced, index)
        self.done[here] = True

    def places(self) -> dict[str, Any]:
        """Arrays for workers in this process to write to."""
        plan, count = self.made.plan, len(self.index)
        if plan.reduce is None:
            self.y = np.empty((count, *plan.shape))
        if plan.keep is not None:
            self.x = np.empty((count, len(plan.keep), plan.shape[1]))
        return {"y": self.y, "x": self.x}

    def _placed(self, whole: np.ndarray | None, here: slice, part: np.ndarray | None) -> Any:
        if part is None or len(part) == len(self.index):
            return part
        if whole is None:
            whole = np.empty((len(self.index), *part.shape[1:]))
        if not np.may_share_memory(whole, part):
            whole[here] = part
        return whole

    def _reduced(self, values: list[Any], index: range) -> None:
        for member, value in zip(index, values, strict=True):
            if value is None:
                continue
            if self.reduced is None:
                self.reduced = np.full((len(self.index), *value.shape), np.nan)
            if value.shape == self.reduced.shape[1:]:
                self.reduced[member - self.index.start] = value
            else:
                self.failed[member] = (
                    f"reduce: gave the shape {value.shape}, for another member "
                    f"{self.reduced.shape[1:]}."
                )

    def result(self) -> Sweep:
        made, plan = self.made, self.made.plan
        count = len(self.index)
        if plan.reduce is None:
            self.y = self._filled(self.y, (count, *plan.shape))
        elif self.reduced is None:
            self.reduced = np.full(count, np.nan)
        if plan.keep is not None:
            self.x = self._filled(self.x, (count, len(plan.keep), plan.shape[1]))
        here = slice(self.index.start, self.index.stop)
        return Sweep(
            plan.name,
            made.t,
            made.outputs,
            made.states,
            self.y,
            self.x,
            self.reduced,
            {k: v[here] for k, v in made.params.items()},
            np.arange(self.index.start, self.index.stop),
            self.done,
            dict(sorted(self.failed.items())),
            dict(sorted(self.coarse.items())),
            self._message(),
        )

    def _filled(self, values: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
        """Fill with nan where nothing was written: members not run, tasks that failed entirely."""
        values = np.empty(shape) if values is None else values
        lost = ~self.done
        lost[[member - self.index.start for member in self.failed]] = True
        values[lost] = np.nan
        return values

    def _message(self) -> str | None:
        name, count, said = self.made.plan.name, len(self.index), []
        if self.interrupted:
            done = int(self.done.sum())
            said.append(f"interrupted: {done} of {count} members are done, the others are nan")
        if self.failed:
            member, sentence = min(self.failed.items())
            said.append(
                f"{len(self.failed)} of {count} members failed; member {member}: {sentence}"
            )
        if self.coarse:
            member, time = min(self.coarse.items())
            said.append(
                f"in {len(self.coarse)} members a sign or comparison switches without end (member "
                f"{member} near t = {time:.6g} s) and the result there is coarse"
            )
        return f"{name}: {'; '.join(said).rstrip('.')}." if said else None
