"""Discrete-time forms of blocks for a sampled drive, exact at constant speed or in substeps.

Also its sensor, an encoder with steps and noise and a speed or its difference; and the bristle
deflection along a measured velocity, exact for a velocity held between samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, lapack

from ..blocks.block import Steady
from ..blocks.friction import bristle
from ..blocks.model import Model, Parameters, as_model
from ..core.block_system import BlockSystem
from ..core.errors import InputError
from ..core.validation import array, names, positive
from ..engine.graph import TraceError, signal_array
from ..engine.substeps import Substeps
from . import arguments

MOST = 1e5  # substeps in a sample
MOST_STEPS = 24  # of the same length, traced
REACH = 1.2  # of a rate times the length of such a step; the method is stable up to 2.7
NODES = (0.5 - math.sqrt(1 / 12), 0.5 + math.sqrt(1 / 12))  # of Gauss, in a part of a step
SERIES = [1.0 / math.factorial(k + 3) for k in range(12, -1, -1)]  # phi3, highest power first


def sampled(
    system: ct.NonlinearIOSystem,
    dt: float,
    *,
    held: Sequence[str] | None = None,
    substep: float | None = None,
    name: str | None = None,
) -> ct.NonlinearIOSystem:
    """A block in discrete time, its states advanced jointly and exactly at constant speed.

    For dx/dt = f(x, v) over h seconds, A = df/dx: y = x + h phi1(h A) f(x), A and f averaged over
    v, then x+ = y + h (phi2 - phi1/2)(h A1) (f(y, v1) - f(y, v0)), A1 at the end. A sample is two
    such parts, divided where the speed w changes its sign, otherwise in the middle. Rates that
    are not affine in x are integrated in substeps.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        A continuous block. The rates are affine in the states at given inputs for the natural,
        existing, proposed, Friedland-Park, friction-state, normal-force, Lyapunov, disturbance and
        extended-state observers, and for all controllers without a limit of their own; not for
        the adaptive, temperature and position observers.
    dt : float
        Sample time in s.
    held : list of str, optional
        Inputs that are held between samples, as a drive holds its torque; all others are linear
        between samples. Default: the inputs declared as "u" and "excess", whatever ``inputs=`` of
        the block calls them.
    substep : float, optional
        Longest substep in s where the rates are not affine; default dt/4. Each is as short as an
        error of 1e-6, relative to the largest value of each state in the sample, needs, and ends
        where a limit or a sign switches.
    name : str, optional
        Default: the system's name.

    Returns
    -------
    control.NonlinearIOSystem
        With the inputs, outputs and parameters of the system. States: those of the system at the
        last sample, the inputs at that sample (``last_w`` ...), and ``begun``, 0 before the
        first sample, at which the states are not advanced.

    Raises
    ------
    InputError
        For a dt or a substep that is not positive, a system that is discrete or has no states,
        or an unknown input in ``held``.

    Notes
    -----
    phi1(x) = (e^x - 1)/x, phi2(x) = (phi1(x) - 1)/x. At constant speed, with the other inputs
    linear between samples, the result equals that of the continuous block, and is as stable. A
    speed that is linear between samples leaves an error of second order in dt. The bristles of
    the natural observer stay within Fs/sigma0 at every speed and dt.

    That the rates are affine is decided by the block's equations, for all values of its inputs
    and parameters; a function that cannot be traced counts as not affine, and so do rates that are
    affine in a range only (a limit, c x^3 with c = 0). Substeps follow the inputs between the
    samples; they are called at each sample, not traced, which takes some 0.2 ms.

    The block calls the functions of ``system`` at each sample, so it follows what they read; the
    default parameters are a copy, and whether the rates are affine is decided when a run begins.
    The outputs use the current sample; held inputs act from the current sample on.

    What the hold itself costs an observer does not change: let Fhat be the friction F of the drive
    at the sample, exactly. Then J dw/dt = u - (F(t) - F(t_k)) until the next, u the controller's
    torque, and with z from -Fc/sigma0 to Fc/sigma0 a reversal within the sample costs a speed of up
    to 2 Fc (dt + sigma1/sigma0)/J and, of the viscous torque, Fv |dw/dt| dt^2/(2 J). The torque was
    decided before the reversal was measured, so no observer that reads w alone avoids that: a fast
    drive compensated at a low rate may have a larger peak error than one without compensation,
    though a smaller RMS error.

    Examples
    --------
    An observer as a drive runs it at 1 kHz:

    >>> observer = lg.sampled(lg.natural_observer(lg.table1()), 1e-3)
    >>> observer.dt, observer.state_labels
    (0.001, ['zhat', 'last_w', 'begun'])

    What the hold costs at a reversal: as much with the friction itself as with the observer. The
    largest and the RMS error of a speed loop without compensation, with the friction at the
    samples, and with the observer:

    >>> def errors(rate, *compensation):
    ...     t = np.arange(0.6 * rate) / rate
    ...     r = 300.0 * np.sin(2.0 * np.pi * 5.0 * t)
    ...     drive = [lg.error(), lg.sampled(lg.pi(1.6, 0.16), 1 / rate), *compensation]
    ...     run = lg.simulate_sampled(lg.plant(lg.table1()), drive, t, {"r": r})
    ...     e = (run.outputs[run.output_labels.index("w")] - r)[rate // 5 :]
    ...     return round(float(abs(e).max()), 1), round(float(np.sqrt(np.mean(e**2))), 1)
    >>> natural = lg.natural_observer(lg.table1())
    >>> ideal, own = lg.compensation(inputs=["F"]), (lg.compensation(), lg.sampled(natural, 1e-3))
    >>> errors(1000), errors(1000, ideal), errors(1000, *own)
    ((13.4, 9.4), (13.5, 9.2), (13.5, 9.2))
    >>> errors(2000), errors(2000, ideal)
    ((13.4, 9.4), (13.2, 9.2))
    """
    system = arguments.system(system)
    dt = positive(dt, "dt, the sample time,", "seconds")
    if system.isdtime(strict=True):
        raise InputError(f"{system.name} is discrete already (dt = {system.dt}).")
    if not system.nstates:
        raise InputError(f"{system.name} has no states: use it as it is, with sampled blocks.")
    labels = list(system.input_labels)
    keep = _usually_held(system) if held is None else names(held, "held")
    strange = [s for s in keep if s not in labels]
    if strange:
        raise InputError(f"{system.name} has no input {strange[0]}; it has {', '.join(labels)}.")
    longest = dt / 4 if substep is None else positive(substep, "substep", "seconds")
    if longest * MOST < dt:
        raise InputError(f"substep = {longest:g} s is less than dt/{MOST:g}.")
    step = _Step(system, float(dt), tuple(s in keep for s in labels), float(longest))
    step.substeps.affine(system.params)  # what cannot be evaluated is refused here
    return _in_steps(step, name)


def _in_steps(step: _Step, name: str | None = None) -> ct.NonlinearIOSystem:
    system = step.system
    return BlockSystem(
        _Moved(step),
        _Answer(step),
        inputs=list(system.input_labels),
        outputs=list(system.output_labels),
        states=[*system.state_labels, *(f"last_{s}" for s in system.input_labels), "begun"],
        params=dict(system.params),
        name=name or system.name,
        dt=step.dt,
    )


def _usually_held(system: Any) -> list[str]:
    """The inputs that a drive holds, by the names with which the block declares them."""
    pairs = zip(_own_inputs(system), system.input_labels, strict=False)
    return [label for name, label in pairs if name in ("u", "excess")]


def _own_inputs(system: Any) -> list[str]:
    """The names with which the block declares its inputs."""
    declared = getattr(system.outfcn, "block", None)
    return list(system.input_labels if declared is None else declared.inputs)


@dataclass(frozen=True, eq=False)
class _Step:
    """One step of a continuous system over ``dt`` s; ``held`` says so of each input. With ``steps``
    it is so many of Runge-Kutta, which are traced, in place of those that control their error."""

    system: Any
    dt: float
    held: tuple[bool, ...]
    longest: float
    steps: int = 0

    @property
    def substeps(self) -> Substeps:
        """Kept beside the step, which pickles without it."""
        if self not in _SUBSTEPS:
            _SUBSTEPS[self] = Substeps(self.system, self.longest)
        return _SUBSTEPS[self]

    def state(self, t: Any, s: Any, v: Any, params: Any) -> np.ndarray:
        """The states of the system at the sample that is being taken."""
        n, own = int(self.system.nstates), _own_inputs(self.system)
        s, v = np.asanyarray(s), np.asanyarray(v)
        turns = 1 + own.index("w") if "w" in own else None  # friction turns over where it is 0

        def rates(x: Any, inputs: Any) -> Any:
            return signals(self.system.updfcn(inputs[0], x, inputs[1:], params))

        before = signals([t - self.dt, *s[n:-1]])
        now = signals([t, *np.where(np.array(self.held, dtype=bool), s[n:-1], v)])
        traced = object in (before.dtype, now.dtype)  # the engine follows the equations
        if traced or s[-1] < 0.5:
            self.substeps.again()
        if not traced and s[-1] < 0.5:
            return s[:n]
        if self.steps:
            moved = _runge_kutta(rates, signals(s[:n]), before, now, self.dt, self.steps)
        elif self.substeps.affine(params):
            moved = advance(rates, s[:n], before, now, self.dt, turns)
        elif traced:
            raise TraceError("runs in substeps: it is called at each sample")
        else:
            moved = self.substeps.step(s[:n], before, now, params)
        return np.where(s[-1] < 0.5, s[:n], moved) if traced else moved


_SUBSTEPS: WeakKeyDictionary[_Step, Substeps] = WeakKeyDictionary()


@dataclass(frozen=True)
class _OfStep:
    """A function of a step."""

    step: Any

    def rests_on(self) -> tuple[Any, ...]:
        """The systems whose state decides the answers: the engine looks at them."""
        return (self.step.system,)

    def renamed(self, update: Any, name: str) -> tuple[Any, Any, dict[str, str]]:
        inside = self.step.system
        if not isinstance(inside, BlockSystem) or not isinstance(update, _OfStep):
            return update, self, {}
        step = replace(self.step, system=inside.copy(name=name))
        keys = dict(zip(inside.params, step.system.params, strict=True))
        return type(update)(step), type(self)(step), keys


class _Moved(_OfStep):
    """The update function of a sampled block."""

    def __call__(self, t: float, s: Any, v: Any, params: Any) -> np.ndarray:
        return np.concatenate([self.step.state(t, s, v, params), v, [1.0]])


class _Answer(_OfStep):
    """The output function of a sampled block."""

    def __call__(self, t: float, s: Any, v: Any, params: Any) -> np.ndarray:
        system, x = self.step.system, self.step.state(t, s, v, params)
        if system.outfcn is None:
            return x[: system.noutputs]
        return signals(system.outfcn(t, x, signals(v), params))


def advance(
    rates: Callable[[Any, Any], Any],
    x: np.ndarray,
    before: np.ndarray,
    now: np.ndarray,
    dt: float,
    turns: int | None = None,
) -> np.ndarray:
    """One step of dx/dt = rates(x, v) over dt s, affine in x, as :func:`sampled` describes it.

    ``before`` and ``now`` (m, ...) are the inputs at its start and end, ``turns`` the place of one
    at whose zero the step is divided; otherwise in its middle. States, rates and inputs may be
    batches of any shape in the trailing axes.
    """
    share: Any = 0.5
    if turns is not None:
        first, last = before[turns], now[turns]
        crosses = first * last < 0.0
        share = np.where(crosses, first / np.where(crosses, first - last, 1.0), 0.5)
    between = before + share * (now - before)
    x = _part(rates, x, before, between, dt * share)
    return _part(rates, x, between, now, dt * (1.0 - share))


def _part(rates: Any, x: Any, before: Any, now: Any, dt: Any) -> np.ndarray:
    """Mean rates, then their change at the end of that.

    The weights of the mean are positive: at a speed of one sign the bristles end between where
    they were and where sliding at one of the nodes would put them.
    """

    def mean(state: Any) -> Any:
        return 0.5 * sum(rates(state, before + node * (now - before)) for node in NODES)

    def last(state: Any) -> Any:
        return rates(state, now)

    end = x + dt * ramp_response(dt * _slopes(mean, x), mean(x), 0.0 * x)
    change = last(end) - rates(end, before)
    return end + dt * ramp_response(dt * _slopes(last, x), -0.5 * change, change)


def _slopes(rate: Any, x: Any) -> np.ndarray:
    rest = rate(0.0 * x)
    columns = [rate((0.0 * x.T + unit).T) - rest for unit in np.eye(len(x))]
    return np.stack(columns, axis=1)


def ramp_response(B: np.ndarray, start: np.ndarray, change: np.ndarray) -> np.ndarray:
    """phi1(B) start + phi2(B) change: x(1) for dx/ds = B x + start + change s, x(0) = 0.

    B is (n, n, ...), the others (n, ...). A closed form for n = 1 and 2; otherwise
    ``scipy.linalg.expm``.
    """
    B, start, change = signals(B), signals(start), signals(change)
    n = len(B)
    if n == 1:
        one, two = _phi(B[0])
        return one * start + two * change
    if n == 2:
        return _by_polynomials(B, start, change)
    W = np.zeros((n + 2, n + 2, *B.shape[2:]))
    W[:n, :n], W[:n, n], W[:n, n + 1], W[n, n + 1] = B, change, start, 1.0
    whole = expm(np.moveaxis(W, (0, 1), (-2, -1)))
    return np.moveaxis(whole[..., :n, -1], -1, 0)


def _by_polynomials(B: np.ndarray, start: np.ndarray, change: np.ndarray) -> np.ndarray:
    """f(B) = a + b B for phi1 and phi2, where b is the slope of f between the eigenvalues.

    phi1 and phi2 are divided differences of e^x with one and two nodes at 0. A difference of
    three or four nodes ends with the two that are farthest apart, which avoids cancellation.
    """
    middle, half = 0.5 * (B[0, 0] + B[1, 1]), 0.5 * (B[0, 0] - B[1, 1])
    gap = half * half + B[0, 1] * B[1, 0]
    trace, det = 2.0 * middle, B[0, 0] * B[1, 1] - B[0, 1] * B[1, 0]
    reach = np.sqrt(np.abs(gap))
    size = np.where(gap >= 0.0, np.abs(middle) + reach, np.sqrt(np.abs(middle**2 - gap)))
    near, paired = _by_series(trace, det, size < 0.5), _by_pair(middle, reach, det, gap < 0.0)
    apart = _by_recursion(middle, reach, det, (gap >= 0.0) & (size >= 0.5))
    (a1, b1, a2, b2) = (
        np.where(size < 0.5, n, np.where(gap < 0.0, c, r))
        for n, c, r in zip(near, paired, apart, strict=True)
    )
    turned = [
        b1 * (B[i, 0] * start[0] + B[i, 1] * start[1])
        + b2 * (B[i, 0] * change[0] + B[i, 1] * change[1])
        for i in range(2)
    ]
    return np.array([a1 * start[i] + a2 * change[i] + turned[i] for i in range(2)])


def _by_series(trace: Any, det: Any, here: Any) -> tuple[Any, Any, Any, Any]:
    """Both eigenvalues small: phi(k) = 1/k! + B phi(k+1), B^2 = trace B - det."""
    trace, det = np.where(here, trace, 0.0), np.where(here, det, 0.0)
    a, b = SERIES[0], 0.0
    for factor in SERIES[1:]:
        a, b = factor - det * b, a + trace * b
    a2, b2 = 0.5 - det * b, a + trace * b
    return 1.0 - det * b2, a2 + trace * b2, a2, b2


def _by_pair(middle: Any, reach: Any, det: Any, here: Any) -> tuple[Any, Any, Any, Any]:
    """Eigenvalues middle +- i reach, not small: e^B = a0 + b0 B, B phi(k+1) = phi(k) - 1/k!."""
    reach, det = np.where(here, reach, 1.0), np.where(here, det, 1.0)
    trace, growth = 2.0 * middle, np.exp(np.where(here, middle, 0.0))
    b0 = growth * np.sin(reach) / reach
    a0 = growth * np.cos(reach) - middle * b0
    b1 = (1.0 - a0) / det
    a1 = b0 - trace * b1
    b2 = (1.0 - a1) / det
    return a1, b1, b1 - trace * b2, b2


def _by_recursion(middle: Any, reach: Any, det: Any, here: Any) -> tuple[Any, Any, Any, Any]:
    """Real eigenvalues, the larger one not small: divided differences that end with it."""
    large = np.where(here, middle + np.where(middle < 0.0, -reach, reach), 1.0)
    small = np.where(here, det, 0.0) / large
    highest = np.where(large > small, large, small)
    width = np.abs(large - small)
    distinct = np.where(width > 0.0, width, 1.0)
    b0 = np.exp(highest) * np.where(width > 0.0, -np.expm1(-distinct) / distinct, 1.0)
    one, two = _phi(small)
    b1 = (b0 - one) / large
    b2 = (b1 - two) / large
    return one - b1 * small, b1, two - b2 * small, b2


def _phi(x: Any) -> tuple[Any, Any]:
    """phi1, phi2, where phi0 = e^x and phi(k+1) = (phi(k) - 1/k!)/x."""
    small = np.abs(x) < 0.5
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    three = SERIES[0]
    for factor in SERIES[1:]:
        three = factor + near * three
    one = np.expm1(far) / far
    two = np.where(small, 0.5 + near * three, (one - 1.0) / far)
    return np.where(small, 1.0 + near * two, one), two


def signals(values: Any) -> np.ndarray:
    """An array of numbers, or of what the engine traces."""
    array = np.asarray(values)
    return signal_array(array) if array.dtype == object else array


def at_samples(block: Any, dt: float, points: Sequence[Mapping[str, float]]) -> Any:
    """A block in discrete time; ``points`` are usual inputs and states by name, 0 if left out.

    Rates that are not affine are advanced in a few Runge-Kutta steps of one length, which the
    engine can trace: a run takes a twentieth of the time of one in the substeps of ``sampled``.
    """
    if not block.nstates or block.isdtime(strict=True):
        return block
    held, steps = _usually_held(block), 0
    step = _Step(block, dt, tuple(s in held for s in block.input_labels), dt / 4)
    if not step.substeps.affine(block.params):
        rates = [0.0]  # the fastest of the states at the points, 1/s
        for point in points:
            v, x = ([point.get(k, 0.0) for k in names]
                    for names in (block.input_labels, block.state_labels))  # fmt: skip
            A = np.asarray(ct.linearize(block, x, v).A)
            rates.append(float(np.abs(np.linalg.eigvals(A)).max()))
        steps = max(math.ceil(min(dt * max(rates) / REACH, 1e6)), 2)
    return _in_steps(replace(step, steps=steps if steps <= MOST_STEPS else 0))


def _runge_kutta(rates: Any, x: Any, before: Any, now: Any, dt: float, steps: int) -> np.ndarray:
    """The classical method of order 4 in steps of one length."""
    h, change = dt / steps, now - before
    for k in range(steps):
        first, middle, end = (before + (k + part) / steps * change for part in (0.0, 0.5, 1.0))
        k1 = rates(x, first)
        k2 = rates(x + 0.5 * h * k1, middle)
        k3 = rates(x + 0.5 * h * k2, middle)
        x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + rates(x + h * k3, end))
    return x


WHOLE = 1.5 * 2.0**52  # a number of this size has no fraction: to add and subtract it rounds


@dataclass(frozen=True)
class Sensing:
    """What a drive measures, and how often.

    ``dt`` and ``delay`` in s; ``noise`` of the position in rad and its ``resolution`` in rad,
    0 for none; ``speed_noise`` in rad/s where the drive has a speed of its own, None where it
    takes the difference of two positions.
    """

    dt: float
    noise: float = 0.0
    resolution: float = 0.0
    speed_noise: float | None = None
    delay: float = 0.0

    def errors(self, samples: int, seed: int = 0) -> dict[str, np.ndarray]:
        """The noise of position and speed by the names of the drive's inputs."""
        random = np.random.default_rng(seed)
        sizes = {"n_theta": self.noise, "n_w": self.speed_noise or 0.0}
        return {k: random.normal(0.0, size, samples) for k, size in sizes.items()}

    def still(self) -> Sensing:
        """The same drive without noise, but with the steps of its encoder."""
        return replace(self, noise=0.0, speed_noise=None if self.speed_noise is None else 0.0)

    def quiet(self) -> Sensing:
        """The same drive with an exact sensor."""
        return Sensing(self.dt, 0.0, 0.0, None if self.speed_noise is None else 0.0, self.delay)


@dataclass(frozen=True)
class _Encoder(Steady):
    """theta_m = q round((theta + n_theta)/q), w_m its difference or w + n_w; or the state."""

    step: float
    dt: float
    own: bool
    moves: bool

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        angle = rounded(v[0] + v[2], self.step)
        if self.moves:
            return np.array([angle])
        return np.array([angle, v[1] + v[3] if self.own else (angle - x[0]) / self.dt])


def rounded(x: Any, step: float) -> Any:
    """x to the nearest multiple of a step, 0 for none; in arithmetic that the engine can trace."""
    return step * ((x / step + WHOLE) - WHOLE) if step else x


def encoder(sensing: Sensing, seen: tuple[str, str] = ("theta", "w")) -> ct.NonlinearIOSystem:
    """The sensor as a block: inputs ``seen``, n_theta, n_w, outputs theta_m, w_m."""
    given = (sensing.resolution, sensing.dt, sensing.speed_noise is not None)
    return ct.nlsys(
        _Encoder(*given, moves=True),
        _Encoder(*given, moves=False),
        inputs=[*seen, "n_theta", "n_w"],
        outputs=["theta_m", "w_m"],
        states=["last"],
        dt=sensing.dt,
        name="encoder",
    )


_dtbtrs: Any = lapack.dtbtrs  # pyrefly: ignore[missing-attribute]
KEYS = ("sigma0", "Fc", "Fs", "vs")


def deflection(w: ArrayLike, dt: float, p: Parameters | Model, z0: ArrayLike = 0.0) -> np.ndarray:
    """The bristle deflection z of the LuGre law along a velocity that is held between samples.

    z[k+1] = e^(-a dt) z[k] + (1 - e^(-a dt)) w[k]/a, a = sigma0 |w[k]| / h(w[k]).

    Parameters
    ----------
    w : (N,) or (L, N) array_like
        Velocity in rad/s, one record or L of them.
    dt : float
        Sample time in s.
    p : Parameters or Model
        Of a LuGre drive; gives sigma0, Fc, Fs, vs, and delta where it has one.
    z0 : float or (L,) array_like
        Deflection in rad at the first sample.

    Returns
    -------
    ndarray
        z in rad, of the shape of w; z[0] = z0.

    Raises
    ------
    InputError
        For a dt that is not positive, a NaN in the velocity, shapes that do not fit, or a LuGre
        parameter without a value.

    Notes
    -----
    Exact for a velocity that is constant between samples, at any speed. The velocity of a real
    drive varies between samples, which leaves an error of first order in dt. Source paper, eq.
    LuGre1, evaluated by the friction law's own function.

    Examples
    --------
    A slow reversal: the bristles bend by h(w)/sigma0, one way and then the other.

    >>> p = lg.table1()
    >>> w = np.repeat([0.1, -0.1], 500)
    >>> z = lg.deflection(w, dt=1e-3, p=p)
    >>> np.round(1e3 * z[[499, 999]], 2)  # mrad
    array([ 1.1, -1.1])
    """
    dt = positive(dt, "dt, the sample time,", "seconds")
    speed = array(w, "w")
    if speed.ndim not in (1, 2) or not speed.shape[-1]:
        raise InputError(f"w must be (N,) or (L, N), not {speed.shape}.")
    speed = np.ascontiguousarray(np.atleast_2d(speed))
    if not np.isfinite(speed).all():
        lane, k = np.argwhere(~np.isfinite(speed))[0]
        raise InputError(f"the velocity is {speed[lane, k]} at sample {k}: fill the gap first.")
    start = array(z0, "z0")
    if start.shape not in ((), (len(speed),)) or not np.all(np.isfinite(start)):
        raise InputError(f"z0 must be a finite number or {len(speed)} of them.")
    values = _values(p)
    z = np.empty((len(speed), speed.shape[1] + 1))
    z[:, 0] = start
    with np.errstate(all="ignore"):  # dz/dt = b - a z at held w
        b = bristle(speed, 0.0, *values)
        a = b - bristle(speed, 1.0, *values)
    for row in range(len(speed)):
        _advance(a[row], b[row], dt, z[row])
    return z[:, :-1].reshape(np.shape(w))


def _values(p: Parameters | Model) -> tuple[float, ...]:
    model = as_model(p, "p")
    have: dict[str, Any] = dict(model.values())
    law = model.friction.block
    if law.states and law.name != "lugre":
        raise InputError(f"{model.name} has '{law.name}' friction: deflection is for LuGre alone.")
    keys = (*KEYS, "delta") if "delta" in have else KEYS
    missing = [k for k in keys if have.get(k) is None]
    if missing:
        raise InputError(
            f"{model.name} gives no {', '.join(missing)}: the deflection needs a LuGre model."
        )
    values = {k: float(have[k]) for k in keys}
    law.check(values)
    return tuple(values.values())


def _advance(a: np.ndarray, b: np.ndarray, dt: float, z: np.ndarray) -> None:
    """In one step z covers the share 1 - e^(-a dt) of the distance to b/a, and changes by b dt if a
    is 0: a unit lower bidiagonal system of equations."""
    n, moving, less = len(a), a > 0.0, np.expm1(-dt * a)
    gain = np.where(moving, -less / np.where(moving, a, 1.0), dt)
    band = np.empty((2, n + 1), order="F")
    band[1, :n] = -1.0 - less
    z[1:] = gain * b
    z[:], _ = _dtbtrs(band, z, uplo="L", diag="U")
