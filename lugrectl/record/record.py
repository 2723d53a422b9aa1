"""The Record: the content of a log in SI units on uniform time."""

from __future__ import annotations

import builtins
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from zlib import crc32

import numpy as np

from ..core.display import Row, Shown, noticed
from ..core.errors import InputError
from ..core.provenance import SourceFile
from ..core.result import picked
from ..core.unit_names import si_unit
from ..core.validation import array
from ..core.views import view
from .columns.names import ROLES
from .log import Log, log_of_arrays
from .samples.rows import REQUIRED

_MOTIONS = ("rotary", "linear")


@dataclass(frozen=True, eq=False, repr=False)
class Record(Shown):
    """A measured log: float64 channels of one length N, in SI units.

    :func:`lugrectl.read_record` makes one of a file; it can be built of arrays as well.

    Parameters
    ----------
    t : (N,) ndarray
        In s. It starts at its recorded value and runs in steps of ``dt``.
    u : (N,) ndarray
        Torque in N m, or force in N, held between samples.
    w, theta : (N,) ndarray or None
        In rad/s and rad, or m/s and m; one of them or both are present.
    r, d, temperature, theta_load : (N,) ndarray or None
        Reference, load torque, temperature and position of the load; None when not recorded.
    dt : float
        Sample time in s; left out it is that of ``t``.
    motion : "rotary" or "linear"
        It decides the units.
    source : str
        What messages call the record.
    dropped : int
        Samples of the file that were missing or merged.
    messages : tuple of str
        All that was noticed and changed.
    gaps : tuple of int
        Index of the first sample after each stretch of lost samples: only there ``t`` jumps by
        more than ``dt``, and no simulation may run across.
    resolution : dict
        If channels were interpolated, by role the smallest step of the recorded motion, in the
        channel's unit; without a recorded theta its ``theta`` is that of the integrated ``w``, in
        rad or m.
    file : SourceFile or None
        The file that it was read from, with its SHA-256.
    log : Log or None
        The rows as they were recorded; those of a record built of arrays, or changed after
        reading, are its own samples.

    Raises
    ------
    InputError
        When the channels differ in length, hold NaN, or w and theta are missing.

    Examples
    --------
    >>> t = 1e-3 * np.arange(2000)
    >>> record = lg.Record(t, u=0.5 * np.sin(6.28 * t), w=0.1 * np.sin(6.28 * t - 0.2))
    >>> record.rate, record.duration, list(record.channels())
    (1000.0, 2.0, ['t', 'u', 'w'])
    >>> record.slice(0, 500).samples
    500
    """

    t: np.ndarray
    u: np.ndarray
    w: np.ndarray | None = None
    theta: np.ndarray | None = None
    r: np.ndarray | None = None
    d: np.ndarray | None = None
    temperature: np.ndarray | None = None
    theta_load: np.ndarray | None = None
    dt: float = 0.0
    motion: str = "rotary"
    source: str = "record"
    dropped: int = 0
    messages: tuple[str, ...] = ()
    gaps: tuple[int, ...] = ()
    resolution: Mapping[str, float] = field(default_factory=dict)
    file: SourceFile | None = None
    log: Log | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        for role, values in self.channels().items():
            if type(values) is not np.ndarray or values.dtype != np.float64:
                values = array(values, f"{self.source}: {role}")
            values = np.ascontiguousarray(values)
            if values.ndim != 1 or values.shape != np.shape(self.t):
                raise InputError(f"{self.source}: {role} must be one-dimensional, as long as t.")
            if not np.isfinite(values).all():
                raise InputError(f"{self.source}: {role} holds values that are not finite.")
            object.__setattr__(self, role, values)
        if self.w is None and self.theta is None:
            raise InputError(f"{self.source}: a record needs w or theta.")
        if self.motion not in _MOTIONS:
            raise InputError(f"motion must be 'rotary' or 'linear', not '{self.motion}'.")
        if not self.dt > 0 and len(self.t) > 1:
            object.__setattr__(self, "dt", float(np.median(np.diff(self.t))))
        if not self.dt > 0:
            raise InputError(f"{self.source}: the time step dt must be positive.")
        if self.log is None or self.log.of not in (0, self.checksum()):
            log = log_of_arrays(self.source, self.channels(), self.motion, self.gaps)
            object.__setattr__(self, "log", replace(log, of=self.checksum()))

    def checksum(self) -> int:
        """A number that changes with the samples of torque and motion."""
        made = 1
        for role in REQUIRED:
            values = getattr(self, role)
            made = made if values is None else crc32(values, crc32(role.encode(), made))
        return made

    def read_from(self, log: Log | None) -> Record:
        """The same record, with the log that it was read from."""
        return self if log is None else replace(self, log=replace(log, of=self.checksum()))

    def _title(self) -> str:
        return f"Record {self.source}: {self.motion}"

    def _rows(self) -> Iterable[Row]:
        length = f"{self.samples} at {self.rate:.6g} Hz, {self.duration:.6g} s"
        lost = f"({self.dropped} dropped)" if self.dropped else ""
        spans = {
            role: f"{x.min():.6g} to {x.max():.6g}" if len(x) else "empty"
            for role, x in self.channels().items()
        }
        return [
            Row("samples", length, "", lost),
            *(Row(role, span, si_unit(role, self.motion)) for role, span in spans.items()),
            *([Row("gaps", len(self.gaps))] if self.gaps else []),
            *noticed(self.messages, "messages"),
        ]

    def channels(self) -> dict[str, np.ndarray]:
        """Return the channels that are present, by role, with t first."""
        return {role: getattr(self, role) for role in ROLES if getattr(self, role) is not None}

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return len(self.t)

    @property
    def rate(self) -> float:
        """Sampling rate in Hz."""
        return float(f"{1 / self.dt:.12g}")

    @property
    def duration(self) -> float:
        """Recorded time in s, with the step of the last sample, without gaps."""
        return self.samples / self.rate

    def segments(self) -> list[builtins.slice]:
        """Return the stretches without a gap, in order."""
        edges = [0, *self.gaps, self.samples]
        return [slice(a, b) for a, b in zip(edges, edges[1:], strict=False)]

    def slice(self, a: int, b: int) -> Record:
        """Return samples a to b - 1 as a record; ``messages`` and ``dropped`` do not change.
        InputError where it holds none."""
        a, b, _ = slice(a, b).indices(self.samples)
        if b <= a:
            raise InputError(f"{self.source}: the slice {a}:{b} holds no sample.")
        cut = {role: values[a:b] for role, values in self.channels().items()}
        return replace(self, **cut, gaps=tuple(g - a for g in self.gaps if a < g < b))

    def with_messages(self, *messages: str) -> Record:
        """Return the record with sentences added, each once."""
        return replace(self, messages=tuple(dict.fromkeys((*self.messages, *messages))))

    def plot(self) -> Any:
        """Draw the log as it was read, its friction over speed and what was noticed, as
        ``lugrectl plot`` does; returns the Axes."""
        balance = view("asked.balance", "diagnosis")
        return balance(self, {"motion": self.motion}).plot()

    def summary(self) -> dict[str, int | float]:
        """Return samples, rate (Hz), duration (s) and dropped as plain numbers."""
        return picked(self, "samples rate duration dropped")
