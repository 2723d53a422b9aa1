"""``lugrectl.hunting_chance``: how likely a loop hunts on the drives that a log leaves possible."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..blocks.model import Model
from ..core.display import Row
from ..core.errors import InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.progress import Wanted, reporter, shows_progress
from ..core.result import Result, plain
from ..core.validation import whole
from ..core.views import view
from ..estimates.members import Members
from ..hunting import limit_cycles
from .believed import believed
from .chance import Outcomes
from .standstill import HUNTS, RESTS, UNDECIDED

FATES = {"hunts": HUNTS, "rests": RESTS, "undecided": UNDECIDED}


@dataclass(frozen=True, repr=False)
class HuntingChance(Result):
    """The answer of :func:`lugrectl.hunting_chance`; truthy if every member rests.

    Attributes
    ----------
    chance : Outcomes
        ``.value``, ``.ci95``, ``.count``, ``.members``, and the shares ``.rests`` and ``.unsure``.
    amplitudes, periods : tuple of float
        Of the largest cycle of each member that hunts, rad and s; nan where the loop diverges.
    unit : str
        Of the amplitudes.
    loop : dict
        Gains, rate, dead time and counts as given.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> lg.hunting_chance(fit, members=10, kp=2.0, ki=1.0, kd=0.1).chance
    0 % (95 % from 0 to 31 %, 10 members)
    """

    chance: Outcomes
    amplitudes: tuple[float, ...]
    periods: tuple[float, ...]
    unit: str
    loop: Mapping[str, Any]

    def __bool__(self) -> bool:
        return not (self.chance.count or self.chance.undecided)

    @property
    def outcome(self) -> str:
        """ "hunts" where a member does, else "undecided" where one is, else "rests"."""
        return "hunts" if self.chance.count else "rests" if self else "undecided"

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl hunt --json`` prints it for a report."""
        rows = {"amplitudes": list(self.amplitudes), "periods": list(self.periods)}
        made = {
            "schema": 1,
            "hunts": self.chance.count > 0,
            "chance": self.chance.summary(),
            **rows,
        }
        return plain(made | {"loop": dict(self.loop)})

    def plot(self, ax: Any = None) -> Any:
        """Draw amplitude over period of each member that hunts; returns the Axes."""
        return view("assurance_plot.hunting")(self, ax)

    def _title(self) -> str:
        return f"hunts: {self.chance.words()}"

    def _rows(self) -> Iterable[Row]:
        if any(np.isfinite(self.amplitudes)):
            yield Row("amplitude", float(np.nanmedian(self.amplitudes)), self.unit, "(median)")
            yield Row("period", float(np.nanmedian(self.periods)), "s", "(median)")


@shows_progress
def hunting_chance(
    p: Any,
    *,
    members: int = 40,
    seed: int = 0,
    executor: Executor | None = None,
    jobs: int = 1,
    progress: Wanted = None,
    **loop: Any,
) -> HuntingChance:
    """How likely a position loop hunts, over the joint covariance of what a log determined.

    Parameters
    ----------
    p : Diagnosis, Identification, dict or path
        A result, or its ``report.json``.
    members : int
        Number of drives that are drawn; the interval of the probability says what that many know.
    seed : int
        Of the drives.
    executor, jobs : Executor, int
        As in :func:`sweep`: where members are searched, and on how many processes.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.
    loop
        Gains, rate, dead time and counts, as for :func:`limit_cycles`.

    Returns
    -------
    HuntingChance
        ``.chance`` with its 95 % interval, and the cycles that were found.

    Raises
    ------
    InputError
        As :func:`limit_cycles`, and for a file that is no report.
    Refused
        For a value that neither the log determines nor the model declares with a std.

    Notes
    -----
    k of N members have a cycle, or diverge; an undecided member neither hunts nor rests. The
    interval of the probability is that of Clopper and Pearson, The Use of Confidence or Fiducial
    Limits Illustrated in the Case of the Binomial,
    Biometrika 26(4), 1934. Each member is searched as :func:`limit_cycles` says, with its limits.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.hunting_chance(fit, members=20, kp=2.0, ki=5.0, kd=0.1)
    >>> bool(found), found.chance.members
    (True, 20)
    """
    beliefs, _ = believed(p)
    drawn, report = Members(beliefs, whole(members, "members", least=1), seed), reporter(progress)
    work, rows = partial(_largest, loop), dict[int, tuple[float, float, float]]()
    for i, one in run_jobs(work, list(drawn), executor=executor, jobs=jobs):
        if isinstance(one, JobError):
            raise (InputError if one.exit_code == 2 else Refused)(one.sentence)
        rows[i] = one
        report(len(rows) / len(drawn), f"{len(rows)} of {len(drawn)} drives")
    fates = [rows[i][0] for i in range(len(drawn))]
    found = [rows[i] for i in range(len(drawn)) if rows[i][0] == HUNTS]
    return HuntingChance(
        Outcomes.of(fates),
        tuple(a for _, a, _ in found),
        tuple(T for _, _, T in found),
        "rad" if beliefs[0].model.motion == "rotary" else "m",
        {k: v for k, v in loop.items() if v is not None},
    )


def _largest(loop: Mapping[str, Any], model: Model) -> tuple[float, float, float]:
    """The fate of a drive, with amplitude and period of its largest cycle."""
    found = limit_cycles(model, **loop)
    last = found.cycles[-1] if found.cycles else None
    amplitude, period = (np.nan, np.nan) if last is None else (last.amplitude, last.period)
    return FATES[found.outcome], amplitude, period
