"""The result of a sweep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result, library, plain
from ..core.views import view


@dataclass(frozen=True, repr=False, eq=False)
class Sweep(Result):
    """Many runs of one system. ``sweep["w"]`` is one signal of all members, (L, N).

    Attributes
    ----------
    name : str
        Name of the system.
    t : (N,) ndarray
        Times in s.
    outputs, states : tuple of str
        Labels of the rows of ``y`` and ``x``.
    y : (L, ny, N) ndarray or None
        Outputs; nan for members that failed or were not run; None with ``reduce``.
    x : (L, nx, N) ndarray or None
        The requested states.
    reduced : (L, ...) ndarray or None
        The result of ``reduce`` for each member.
    params : dict of (L,) ndarray
        The table of parameters.
    members : (L,) ndarray
        Numbers of the members (for a chunk: within the whole sweep).
    done : (L,) ndarray of bool
        Members that were run, with or without success.
    failed : dict
        Number of a failed member -> a sentence on what happened.
    coarse : dict
        Number of a member whose sign or comparison switched without end -> the time in s.
    message : str or None
        A note on the sweep as a whole.

    Examples
    --------
    What became of three values of Coulomb friction:

    >>> table = {"plant.Fc": [0.25, 0.285, 0.32]}
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> s = lg.sweep(lg.velocity_loop(lg.table1(), "proposed"), t, 0.1 * np.sin(6.28 * t), table)
    >>> s["w"].shape, bool(s.done.all()), s.failed
    ((3, 501), True, {})
    """

    name: str
    t: np.ndarray
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    y: np.ndarray | None
    x: np.ndarray | None
    reduced: np.ndarray | None
    params: Mapping[str, np.ndarray]
    members: np.ndarray
    done: np.ndarray
    failed: Mapping[int, str] = field(default_factory=dict)
    coarse: Mapping[int, float] = field(default_factory=dict)
    message: str | None = None

    def __len__(self) -> int:
        return len(self.members)

    def __getitem__(self, signal: str) -> np.ndarray:
        for labels, values in ((self.outputs, self.y), (self.states, self.x)):
            if signal in labels and values is not None:
                return values[:, labels.index(signal)]
        there = ", ".join([*(self.outputs if self.y is not None else ()), *self.states])
        raise InputError(f"this sweep holds no signal '{signal}'; it holds {there or 'none'}.")

    @property
    def ok(self) -> np.ndarray:
        """(L,) bool: the members that succeeded."""
        return self.done & ~np.isin(self.members, list(self.failed))

    def summary(self) -> dict[str, Any]:
        """Plain Python: sizes, ranges of parameters, what failed (the first ten)."""
        return plain(
            {
                "system": self.name,
                "members": len(self),
                "done": int(self.done.sum()),
                "succeeded": int(self.ok.sum()),
                "failed": len(self.failed),
                "failures": dict(sorted(self.failed.items())[:10]),
                "coarse": len(self.coarse),
                "samples": len(self.t),
                "duration": float(self.t[-1] - self.t[0]),
                "outputs": self.outputs,
                "states": self.states,
                "parameters": self._ranges(),
                "message": self.message,
            }
        )

    def to_pandas(self) -> Any:
        """A DataFrame: a row for each member and time, a column for each signal.

        With ``reduce``: a row for each member, with its parameters. Raises InputError if pandas
        is not installed.
        """
        pandas = library("pandas")
        index = pandas.Index(self.members, name="member")
        if self.reduced is not None:
            flat = self.reduced.reshape(len(self), -1)
            names = [f"reduced{i}" for i in range(flat.shape[1])]
            names = ["reduced"] if self.reduced.ndim == 1 else names
            columns = {k: flat[:, i] for i, k in enumerate(names)}
            return pandas.DataFrame({**self.params, **columns}, index=index)
        both = pandas.MultiIndex.from_product([self.members, self.t], names=["member", "t"])
        return pandas.DataFrame({k: self[k].ravel() for k in self._signals()}, index=both)

    def to_frame(self) -> Any:
        """The same as :meth:`to_pandas`."""
        return self.to_pandas()

    def to_xarray(self) -> Any:
        """A Dataset over member and t (and those of ``reduced``), parameters as coordinates.

        Raises InputError if xarray is not installed.
        """
        xarray = library("xarray")
        data: dict[str, Any] = {k: (("member", "t"), self[k]) for k in self._signals()}
        coords = {"member": self.members, "t": self.t}
        if self.reduced is not None:
            extra = [f"reduced_{i}" for i in range(self.reduced.ndim - 1)]
            data["reduced"] = (("member", *extra), self.reduced)
        beside = {k: ("member", v) for k, v in self.params.items()} | {
            "done": ("member", self.done)
        }
        taken = {*data, *coords}
        renamed = {f"parameter {k}" if k in taken else k: v for k, v in beside.items()}
        return xarray.Dataset(data, {**coords, **renamed}, {"system": self.name})

    def plot(self, ax: Any = None, output: str | None = None) -> Any:
        """Median and the band from 5 to 95 % of one output (the first); returns the Axes.

        Draws into ``ax``, or into a new figure that shows itself.
        """
        return view("loop_plots.sweep")(self, ax, output)

    def _signals(self) -> list[str]:
        outputs = self.outputs if self.y is not None else ()
        return list(dict.fromkeys([*outputs, *self.states]))

    def _ranges(self) -> dict[str, list[Any]]:
        known = {k: v for k, v in self.params.items() if not np.all(np.isnan(v))}
        return {k: [np.nanmin(v), np.nanmax(v)] for k, v in known.items()}

    def __str__(self) -> str:
        said = f"{self.name}: {int(self.ok.sum())} of {len(self)} members simulated"
        said += f", {len(self.failed)} failed" if self.failed else ""
        return said + f", {len(self.t)} samples to {self.t[-1]:g} s."

    def _title(self) -> str:
        return f"Sweep {self}"

    def _rows(self) -> Iterable[Row]:
        ranges = [*self._ranges().items()][:6]
        return [
            Row("signals", ", ".join(self._signals()) or "none"),
            *(Row(k, f"{low:.6g} to {high:.6g}") for k, (low, high) in ranges),
            *(Row(f"member {i}", said) for i, said in sorted(self.failed.items())[:3]),
        ]
