"""Repetitive learning: a controller that remembers its error of one period ago."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..core.errors import InputError
from ..core.validation import flag, one_name, positive, renamed, shown, within
from .block import REGISTRY, Block, P
from .declaration import block
from .factories import Names, believed, factory
from .friction import J
from .model import Model, Parameters, as_model
from .observers import DERIVED
from .sliding_control import CHEN

if TYPE_CHECKING:
    pass


HARMONICS = 9
MOST = 100_000  # samples in a period
PARAMETERS = {
    "J": J,
    "K": P(0.1, "N m s/rad", 0.0),
    "gamma": P(2.0, "N m/rad", 0.0),
    "period": P(1.0, "s", 1e-9),
}


@dataclass(frozen=True)
class Harmonics:
    """u = J ar - K s + x0 + x1 + ... + xn, dx0/dt = -gamma s, om = 2 pi/period,
    dxj/dt = -gamma s + j om yj, dyj/dt = -j om xj.
    """

    n: int

    def __call__(
        self, s: Any, ar: Any, *states: Any, J: Any, K: Any, gamma: Any, period: Any
    ) -> tuple[Any, ...]:
        x, y = states[: self.n + 1], states[self.n + 1 :]
        om = 2.0 * np.pi / period
        push, learnt = -gamma * s, x[0]
        for part in x[1:]:
            learnt = learnt + part
        turned = [push + j * om * b for j, b in enumerate(y, 1)]
        back = [-j * om * a for j, a in enumerate(x[1:], 1)]
        return J * ar - K * s + learnt, push, *turned, *back

    def block(self) -> Block:
        """The block, registered for the default number of harmonics."""
        counted = range(1, self.n + 1)
        states = ("x0", *(f"x{j}" for j in counted), *(f"y{j}" for j in counted))
        return Block(
            name="repetitive_control",
            kind="controller",
            function=self,
            inputs=("s", "ar"),
            outputs=("u",),
            states=states,
            parameters=PARAMETERS,
            start=("0",) * len(states),
            home=__name__,
            source=f"{DERIVED} {CHEN}",
        )


REGISTRY["controller", "repetitive_control"] = Harmonics(HARMONICS).block()


@block("controller", name="repetitive_memory", out="u v", source=f"{DERIVED} {CHEN}")
def _memory(
    s,
    ar,
    v_late,
    J=J,
    K: Any = P(0.1, "N m s/rad", 0.0),
    gamma: Any = P(0.1, "N m s/rad", 0.0),
    limit: Any = P(1.0, "N m", 0.0),
):
    """u = J ar - K s + v, v = clip(v_late, +-limit) - gamma s, v_late = v(t - period).

    The function of this name has the memory of v in it, sampled.
    """
    v = np.clip(v_late, -limit, limit) - gamma * s
    return J * ar - K * s + v, v


@factory()
def repetitive_control(
    p: Parameters | Model,
    period: float = 1.0,
    K: float = 0.1,
    gamma: float = 2.0,
    harmonics: int = HARMONICS,
    **names: Unpack[Names],
):
    """Learning along a periodic reference, without any friction law: inputs s, ar, output u.

    u = J ar - K s + x0 + x1 + ... + xn, dx0/dt = -gamma s,
    dxj/dt = -gamma s + j om yj, dyj/dt = -j om xj, om = 2 pi/period.

    Parameters
    ----------
    p : Parameters or Model
        Gives J.
    period : float
        Of the reference, in s.
    K, gamma : float
        Feedback gain in N m s/rad, learning gain in N m/rad.
    harmonics : int
        Number n of harmonics that are learnt.

    Returns
    -------
    States x0, then xj and yj of each harmonic, in N m.

    Raises
    ------
    When J has no value, a gain is negative, the period is not positive, or harmonics is not
    a whole number above 0.

    Notes
    -----
    x0 + x1 + ... is the Fourier series of a torque of this period whose coefficients follow
    dc/dt = -gamma s cos(j om t), dd/dt = -gamma s sin(j om t), in rotating coordinates:
    xj = c cos + d sin. With Fd the friction of the perfect motion, Fn its part up to the harmonic
    n and V = J s^2/2 + |x - x(Fn)|^2/(2 gamma), dV/dt = -K s^2 - s (F - Fn). Each harmonic that
    is left out remains in the error: with Table 1 and a sine of 0.1 rad at 1 Hz the position error
    ends at 1.7 mrad with 5 harmonics, 0.55 with 9, 0.16 with 15; a simulation compiles longer with
    more. Sampled with :func:`lugrectl.sampled` at dt it needs
    gamma (2 n + 1) < 2 K/dt, about. :func:`lugrectl.repetitive_memory` is the law itself, with a
    memory of one period.

    Status: derived here, in the spirit of the adaptive repetitive learning control of Chen et
    al. (2022); the equations of the original could not be confirmed.

    Examples
    --------
    Five harmonics of a pick-and-place cycle of 2 s:

    >>> block = lg.repetitive_control(lg.table1(), period=2.0, harmonics=5)
    >>> block.input_labels, block.nstates
    (['s', 'ar'], 11)
    """
    if isinstance(harmonics, bool) or not isinstance(harmonics, (int, np.integer)) or harmonics < 1:
        raise InputError(f"harmonics = {shown(harmonics)} must be a whole number above 0, as 9 is.")
    n = int(harmonics)
    made = REGISTRY["controller", "repetitive_control"] if n == HARMONICS else Harmonics(n).block()
    return believed(made, p, **names, period=period, K=K, gamma=gamma)


@factory()
def repetitive_memory(
    p: Parameters | Model,
    period: float = 1.0,
    dt: float = 1e-3,
    K: float = 0.1,
    gamma: float = 0.1,
    limit: float = 1.0,
    smooth: bool = False,
    **names: Unpack[Names],
):
    """Repetitive learning with a memory of one period, sampled at dt: inputs s, ar, output u.

    u = J ar - K s + v, v(t) = clip(v(t - period), +-limit) - gamma s(t).

    Parameters
    ----------
    p : Parameters or Model
        Gives J.
    period, dt : float
        Period of the reference and sample time in s; the period is taken as the nearest whole
        number of samples, 2 at least.
    K, gamma : float
        Feedback and learning gain in N m s/rad.
    limit : float
        In N m; at least the largest friction along the reference.
    smooth : bool
        True to average what is remembered with the weights 1/4, 1/2, 1/4 over three samples, so
        that noise is not learnt.

    Returns
    -------
    Of sample time dt; its states are the remembered v in N m, the oldest first: one more than
    the samples of a period.

    Raises
    ------
    When J has no value, or a number is out of bounds.

    Notes
    -----
    With Fd the friction of the perfect motion, |Fd| <= limit, and
    V = J s^2/2 + (integral over one period of (Fd - clip(v))^2)/(2 gamma), continuous time gives
    dV/dt <= -(K + gamma/2) s^2 - s (F - Fd): s goes to 0 where the gain from s to F - Fd is below
    K + gamma/2; in presliding F - Fd is about sigma0 e, which is passive from s. A gamma of a few
    times K is at the edge of stability.

    Status: derived here, in the spirit of the adaptive repetitive learning control of Chen et
    al. (2022); the equations of the original could not be confirmed.

    Examples
    --------
    A cycle of 1 s, sampled at 500 Hz:

    >>> block = lg.repetitive_memory(lg.table1(), period=1.0, dt=2e-3)
    >>> block.nstates, block.dt
    (501, 0.002)
    """
    from ..core.block_system import BlockSystem

    J = as_model(p, "p").J
    if J is None:
        raise InputError("repetitive_memory needs J, which p does not give; give it a value.")
    dt, period = positive(dt, "dt, the sample time,", "seconds"), positive(period, "period", "s")
    limit = positive(limit, "limit", "N m")
    values, name = {"J": J, "K": K, "gamma": gamma}, one_name(names.get("name"))
    for key, value in values.items():
        within(value, f"{name}.{key}", _memory.parameters[key])
    if period > MOST * dt:
        raise InputError(
            f"period = {period:g} s is {period / dt:.3g} samples of {dt:g} s, more than {MOST}."
        )
    count = max(2, round(period / dt))
    made = _Memory(name, count, float(limit), flag(smooth, "smooth"))
    return BlockSystem(
        _Remembered(made),
        _Learnt(made),
        inputs=renamed(name, "inputs", ("s", "ar"), names.get("inputs")),
        outputs=renamed(name, "outputs", ("u",), names.get("outputs")),
        states=[f"v{j}" for j in range(count + 1)],
        params={f"{name}.{k}": float(v) for k, v in values.items()},
        name=name,
        dt=float(dt),
    )


@dataclass(frozen=True)
class _Memory:
    """The remembered v of the last count + 1 samples, the oldest first."""

    name: str
    count: int
    limit: float
    smooth: bool

    def at(self, x: Any, s: Any, ar: Any, params: Any) -> Any:
        """u and v at this sample."""
        before = np.clip(x[:3], -self.limit, self.limit)
        old = 0.25 * before[0] + 0.5 * before[1] + 0.25 * before[2] if self.smooth else before[1]
        gains = {k: params[f"{self.name}.{k}"] for k in ("J", "K", "gamma")}
        return _memory.function(s, ar, old, limit=self.limit, **gains)


@dataclass(frozen=True)
class _Remembered:
    memory: _Memory

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        # float refuses a symbolic state: thousands of them are called faster than compiled
        x = np.asarray(x, dtype=float)
        return np.append(x[1:], self.memory.at(x, v[0], v[1], params)[1])


@dataclass(frozen=True)
class _Learnt:
    memory: _Memory

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        return np.array([self.memory.at(x, v[0], v[1], params)[0]])

    def renamed(self, update: Any, name: str) -> tuple[Any, Any, dict[str, str]]:
        """As :meth:`lugrectl.blocks.block.Called.renamed`."""
        memory, old = replace(self.memory, name=name), self.memory.name
        keys = {f"{old}.{k}": f"{name}.{k}" for k in ("J", "K", "gamma")}
        return _Remembered(memory), _Learnt(memory), keys
