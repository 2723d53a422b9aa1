"""``lugrectl.limit_cycles``: whether a position loop hunts, rests, or stays undecided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import monotonic
from typing import Any

import numpy as np

from ..blocks.model import Model, as_model
from ..core.display import number as shown
from ..core.errors import InputError
from ..core.progress import Wanted, reporter, shows_progress
from ..core.validation import number, positive, whole
from ..simulation.encoder import Sensing
from .bristles import bristle_cycles, known
from .loop import Loop, critical, ranges, varied
from .result import LimitCycles
from .rigid import rigid_cycles
from .search import Budget, Search, continuous_run, errors, loop_run, sampled_run, sampled_starts

HORIZON = 15.0  # s, of the first run of a loop of blocks
STEPS = np.geomspace(1e-3, 10.0, 9)  # rad, of the reference of a loop of blocks
WAITS = 40.0  # kp/ki: a stick at 1/20 of the error at which kp alone breaks away
PERIODS = 12.0  # of a cycle that is checked with bristles
BELOW = "the limit is not above the torque {} at which friction breaks away: it never moves"
FROM = "from errors at breakaway of {} to {}"
INCLUDED = "at rest, with the effects of the model: {}"
LEFT_OUT = "at rest, without the effects of the sensors: {}"
NOT_GIVEN = "what is said of the loop itself is of {} = 0, which is not given"
STEPPED = "from steps of r of {} to {} rad"


@shows_progress
def limit_cycles(
    loop: Any,
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    rate: float | None = None,
    dead_time: float = 0.0,
    counts: int | None = None,
    limit: float | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    time_limit: float | None = None,
    progress: Wanted = None,
) -> LimitCycles:
    """The friction limit cycles of a position loop at rest, or their absence.

    J dw/dt = u - F, u = -(kp e + ki int e + kd w), e = theta - r, r constant. With ``rate`` the
    controller is sampled and its torque held.

    Parameters
    ----------
    loop : Model, Parameters, path, or control.NonlinearIOSystem
        A drive, around which the controller is closed; or a whole position loop with the input r
        and the outputs theta and u, such as :func:`position_loop` and :func:`cascade_loop`, which
        takes none of the options below.
    kp, ki, kd : float, optional
        N m/rad, N m/(rad s), N m s/rad. The source paper's 15, 1.55, 0 if none is given, else 0
        for those left out.
    kv : float, optional
        In 1/s: a cascade u = (kp + ki/s)(-kv e - w), kp in N m s/rad and ki in N m/rad, which is
        the PID with kp kv + ki, ki kv and kp.
    rate : float, optional
        Samples of the controller in Hz; none: continuous time. The speed is then the difference
        of two positions.
    dead_time : float
        Between measurement and torque in s, with ``rate``.
    counts : int, optional
        Of the encoder in a turn (in a metre), with ``rate``; none: exact.
    limit : float, optional
        Largest torque of the controller, N m; the integral is held back as in :func:`pid`.
    vary : dict, optional
        ``{"ki": (1, 50)}``: also the values of a gain at which hunting begins or ends.
    time_limit : float, optional
        Seconds after which a search by simulation leaves undecided what it does not know; none:
        until its budget of simulated time is used.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    LimitCycles
        Truthy if every start comes to rest; ``.outcome``: "hunts", "rests" or "undecided".
        ``.cycles``, each with ``.amplitude`` (half the peak to peak of theta, rad), ``.period``
        (s), ``.stable``, ``.multipliers``, ``.stops``; ``.basin``, ``.proof``, ``.critical``,
        ``.messages``, ``.plot()``.

    Raises
    ------
    InputError
        For a value of the model that is not known, or a gain out of its range.

    Notes
    -----
    In a stick the error is constant and u changes by -ki e, so that breakaway is towards zero at
    |u| = Fs: the state there is e alone. Let T(e) be the error of the first stick on the other
    side. T(e) = e is a symmetric cycle, T(T(e)) = e one with unequal halves; its slope is the
    multiplier of half a turn. D(e) = log(T(e)/e) is followed from 1/1000 of Fs/kp to the largest
    error that friction can keep up (at least 30 Fs/kp): |F - Fv w| is bounded, and so is e, by
    that bound times the L1 norm of the linear loop from torque to error. Its extrema and sign
    changes are located, so that unstable cycles are found too. T is then iterated: a loop whose
    only cycles are unstable, and from which every motion comes to rest, rests. That is every cycle
    that sticks, of a drive without states but theta and w, in continuous time. Those that never
    stick are found by Newton from motions that never stick and from the border of such motions.

    Absence is proven for Coulomb and viscous friction if (kd + Fv) kp > ki J (Bisoffi, Da Lio,
    Teel and Zaccarian, Global Asymptotic Stability of a PID Control System With Coulomb Friction,
    IEEE Trans. Automatic Control 63(8), 2018). Friction with bristles, effects, sampling, a limit
    and loops of blocks are simulated from many starts, each for longer and longer until it rests,
    repeats or grows: what persists is a cycle, and nothing is proven. A swing rests, too, once it
    is below a tenth of the smallest start, or at the end of the budget where it still shrinks and
    is below starts that rest. The border is bisected to 5 %. With bristles, Newton on the state
    at e = 0 then gives multipliers, and unstable cycles where it reaches them from those of the
    sliding curve. Counts are shaken by a hundredth, so that a swing that locks to a place within
    one is no hunting; a swing that scatters may come to rest by chance, and is seen for 300 half
    turns or the whole budget.

    Hunting by Stribeck friction: Olsson and Astrom, Friction Generated Limit Cycles, IEEE Trans.
    Control Systems Technology 9(4), 2001; Hensen, van de Molengraft and Steinbuch, Friction
    Induced Hunting Limit Cycles, Automatica 39(12), 2003.

    Examples
    --------
    The loop of Canudas de Wit, Olsson, Astrom and Lischinsky (1995) without bristles:

    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=1e-3, Fv=0.4)
    >>> found = lg.limit_cycles(drive, kp=3.0, ki=4.0, kd=6.0)
    >>> bool(found), round(found.cycles[0].amplitude, 4), round(found.cycles[0].period, 2)
    (False, 0.0669, 23.73)

    Without stiction nothing hunts, and that is proven:

    >>> smooth = lg.Model.of(friction="coulomb", J=1.0, Fc=1.0, Fv=0.4)
    >>> found = lg.limit_cycles(smooth, kp=3.0, ki=4.0, kd=6.0)
    >>> bool(found), found.proof[:28]
    (True, 'Coulomb and viscous friction')
    """
    end = np.inf if time_limit is None else positive(time_limit, "time_limit", "seconds")
    budget = Budget(monotonic() + end, reporter(progress))
    if hasattr(loop, "input_labels"):
        given = (kp, ki, kd, kv, rate, counts, limit, vary)
        if dead_time or any(v is not None for v in given):
            raise InputError(
                "a loop of blocks has its own gains, rate, dead time and limit: give none."
            )
        found = Search(loop_run(loop, HORIZON), STEPS, budget).answer(STEPPED)
        return replace(found, loop={"name": getattr(loop, "name", "")})
    model, gains = as_model(loop), varied(kp, ki, kd, kv)
    most = None if limit is None else positive(limit, "limit", "N m")
    task = _Task(model, _sensing(rate, dead_time, counts, model.motion), most, budget)
    ends = None if vary is None else ranges(vary, "vary")
    found = task.searched(gains())
    if ends is None:
        return found
    more = critical(lambda **x: task.searched(gains(**x)).hunts, ends, "hunting")
    none = tuple(NOT_GIVEN.format(name) for name in ends if not gains().get(name))
    said = (*more["messages"], *none, *found.messages)
    return replace(found, critical=more["critical"], messages=said)


def _sensing(rate: Any, dead_time: Any, counts: Any, motion: str) -> Sensing | None:
    late = number(dead_time, "dead_time")
    if late < 0.0:
        raise InputError(f"dead_time = {late:g} is negative.")
    if rate is None:
        if late or counts is not None:
            raise InputError("dead_time and counts belong to a sampled loop: give rate in Hz too.")
        return None
    turn = 2.0 * np.pi if motion == "rotary" else 1.0
    step = 0.0 if counts is None else turn / whole(counts, "counts", 1)
    return Sensing(1.0 / positive(rate, "rate", "Hz"), resolution=step, delay=late)


@dataclass(frozen=True)
class _Task:
    """A drive with all of a controller but its gains, and what a search may cost."""

    model: Model
    sensing: Sensing | None
    limit: float | None
    budget: Budget

    def searched(self, gains: Mapping[str, float]) -> LimitCycles:
        """What is known of the cycles of a loop."""
        loop, model = Loop.of(self.model, gains), self.model
        law, about, dry = model.friction.block, {}, loop.curve.Fs > 0.0
        found = rigid_cycles(loop) if dry else LimitCycles((), None, None, False, {})
        if self.sensing is not None:
            dt, late, step = self.sensing.dt, self.sensing.delay, self.sensing.resolution
            about = {"rate": 1.0 / dt, "dead_time": late, "resolution": step}
            starts = sampled_starts(loop, self.sensing, [c.amplitude for c in found.cycles])
            found = self._waited(sampled_run(model, loop, self.sensing, self.limit), starts)
        elif not dry or law.states or model.effects or self.limit is not None:
            found = self._with_all(loop, found)
        if self.limit is not None:
            about = {"limit": self.limit, **about}
            if self.limit <= loop.curve.Fs:
                said = BELOW.format(shown(loop.curve.Fs))
                found = replace(found, messages=(said, *found.messages))
        about = {**gains, "J": loop.J, "law": law.name, "model": model.name, **about}
        sensors = [p.key for p in model.effects if "sensor" in p.block.acts]
        inside = [p.key for p in model.effects if p.key not in sensors]
        said = [
            text.format(", ".join(keys))
            for text, keys in ((INCLUDED, inside), (LEFT_OUT, sensors))
            if keys
        ]
        said = (*found.messages, *said)
        return replace(found, loop=about, motion=model.motion, messages=said)

    def _waited(self, run: Any, starts: np.ndarray) -> LimitCycles:
        where = f"{FROM} {'rad' if self.model.motion == 'rotary' else 'm'}"
        return Search(run, starts, self.budget).answer(where)

    def _with_all(self, loop: Loop, rigid: LimitCycles) -> LimitCycles:
        """The loop with all of a model, from cycles of its sliding curve and others."""
        cycles = rigid.cycles
        seconds = max([PERIODS * c.period for c in cycles], default=0.0)
        seconds += (WAITS * loop.kp / loop.ki if loop.ki else 0.0) + WAITS / loop.wn
        run = continuous_run(self.model, loop, seconds, self.limit)
        made = self._waited(run, np.r_[[c.amplitude for c in cycles], errors(loop)])
        if loop.ki and known(self.model) and self.limit is None:
            made = replace(made, cycles=bristle_cycles(self.model, loop, cycles, made.cycles))
        if rigid.diverges and self.limit is None:
            return replace(made, diverges=True, messages=made.messages + rigid.messages)
        stable = [c.amplitude for c in cycles if c.stable]
        if not stable or any(c.stable for c in made.cycles):
            return made
        said = "with the sliding curve alone, without bristles, the loop would hunt: +-{:.3g}"
        return replace(made, messages=(*made.messages, said.format(max(stable))))
