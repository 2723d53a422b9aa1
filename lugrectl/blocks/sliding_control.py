"""Controllers that act on s = de/dt + lam e, the block that computes it, and a Smith predictor.

Their torque adds to the Fhat of an observer, as that of pi and pid does: u = J ar - KD s + Fhat.
The last ones learn along a periodic reference: they remember their error of one period ago.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from ..core.errors import InputError
from ..core.validation import flag, one_name, positive, renamed, shown, within
from .block import REGISTRY, Block, Group, P, defaults
from .controllers import MEASURED, check_kind
from .declaration import block
from .factories import Names, believed, built, factory
from .friction import FC, FS, FV, SIGMA0, SMOOTH, VS, Bristles, J, coulomb
from .model import Model, Parameters, as_model
from .observers import DERIVED
from .plant import acceleration

LAM: Any = P(20.0, "1/s", 0.0)
KD: Any = P(0.1, "N m s/rad", 0.0)
SLIDING: Any = Group(Bristles, sigma0=SIGMA0, Fc=FC, Fs=FS, vs=VS)
SLOTINE = "Slotine and Li, IEEE Trans. Automatic Control 33(11), 1988"
KELLY = "Canudas de Wit and Kelly, Asian J. Control 9(3), 2007"
CHEN = "Chen et al., Int. J. Robust and Nonlinear Control, 2022"
XU = "Xu et al., Int. J. Control, Automation and Systems, 2022"


@block("controller", name="sliding_error", out="s ar", source=SLOTINE)
def _sliding_error(theta, w, r, dr, ddr, lam=LAM):
    """s = (w - dr) + lam (theta - r), ar = ddr - lam (w - dr)."""
    return w - dr + lam * (theta - r), ddr - lam * (w - dr)


@block("variant", name="sliding_error_velocity", out="s ar")
def _sliding_error_velocity(w, r, dr):
    """s = w - r, ar = dr."""
    return w - r, 1.0 * dr


@factory
def sliding_error(lam: float = 20.0, kind: str = "position", **names: Unpack[Names]):
    """The error on which Slotine-Li controllers act: inputs theta, w, r, dr, ddr, outputs s, ar.

    s = (w - dr) + lam (theta - r), ar = ddr - lam (w - dr).

    Parameters
    ----------
    lam : float
        Rate in 1/s at which the position error decays once s = 0; not used for a velocity.
    kind : "velocity" or "position"
        For a velocity s = w - r and ar = dr, from the inputs w, r, dr.

    Returns
    -------
    Without states; outputs s in rad/s and ar in rad/s2.

    Raises
    ------
    For another kind or a negative lam.

    Notes
    -----
    d(w)/dt - ar = ds/dt. It is a block of its own on purpose: a controller that puts out both u,
    which needs Fhat, and s, from which an observer computes Fhat, would be an algebraic loop.

    Examples
    --------
    0.01 rad ahead of a reference at rest:

    >>> error = lg.sliding_error(lam=20.0)
    >>> error.input_labels
    ['theta', 'w', 'r', 'dr', 'ddr']
    >>> error.output(0.0, [], [0.01, 0.0, 0.0, 0.0, 0.0])
    array([0.2, 0. ])
    """
    check_kind(kind, MEASURED)
    if kind == "velocity":
        return _sliding_error_velocity.system(**names)
    return _sliding_error.system(**names, lam=lam)


@built("controller", out="u", source=f"{SLOTINE}, without adaptation; {KELLY}")
def slotine_li(s, ar, J=J, KD=KD):
    """The controller u = J ar - KD s: inputs s, ar of :func:`sliding_error`, output u.

    u = J ar - KD s.

    Parameters
    ----------
    KD : float
        Gain in N m s/rad.

    Returns
    -------
    Without states; output u in N m.

    Notes
    -----
    Beside an observer whose Fhat is added by :func:`lugrectl.compensation`, J ds/dt + KD s =
    Fhat - F. With the existing observer and its e wired to s (gain k without unit),
    V = J s^2/2 + sigma0 (z - zhat)^2/(2 k) has
    dV/dt = -(KD + sigma1 k) s^2 + sigma0 sigma1 x s (z - zhat) - sigma0^2 x (z - zhat)^2/k,
    x = |w|/h(w): never above 0 exactly where x <= (4/sigma1)(1 + KD/(k sigma1)). Then s and e go
    to 0. :func:`lugrectl.lyapunov_observer` removes the condition.

    Status: the structure is that of Canudas de Wit and Kelly (2007), a Slotine-Li controller
    without adaptation beside a LuGre observer; their equations could not be confirmed, and the
    law is derived here.

    References
    ----------
    Slotine and Li, IEEE Trans. Automatic Control 33(11), 1988.

    Examples
    --------
    >>> slotine_li = lg.slotine_li(lg.table1(), KD=0.1)
    >>> np.round(slotine_li.output(0.0, [], [0.2, 100.0]), 3)  # s = 0.2 rad/s, ar = 100 rad/s2
    array([0.2])
    """
    return J * ar - KD * s


@built("controller", gains="KD gJ gv gc", out="u", states="Jhat Fvhat Fchat", source=SLOTINE)
def adaptive_slotine_li(
    s,
    ar,
    w,
    Jhat,
    Fvhat,
    Fchat,
    KD=KD,
    gJ: Any = P(1e-4, "kg m2 s2/rad2", 0.0),
    gv: Any = P(0.01, "N m s2/rad3", 0.0),
    gc: Any = P(0.3, "N m/rad", 0.0),
    eps=P(0.01, "rad/s", 1e-12),
):
    """Slotine-Li with adaptation from nothing: inputs s, ar, w, output u.

    u = Jhat ar + Fvhat w + Fchat sign(w) - KD s, sign(w) = tanh(w/eps),
    dJhat/dt = -gJ ar s, dFvhat/dt = -gv w s, dFchat/dt = -gc sign(w) s.

    Parameters
    ----------
    KD : float
        Gain in N m s/rad.
    gJ, gv, gc : float
        Adaptation gains >= 0 in kg m2 s2/rad2, N m s2/rad3, N m/rad.

    Returns
    -------
    States Jhat in kg m2, Fvhat in N m s/rad and Fchat in N m.

    Notes
    -----
    Uses no parameter of the drive. On a drive with F = Fc sign(w) + Fv w, the same sign(w), and
    V = J s^2/2 + (J - Jhat)^2/(2 gJ) + (Fv - Fvhat)^2/(2 gv) + (Fc - Fchat)^2/(2 gc),
    dV/dt = -KD s^2. On bristles the difference between the two friction laws remains, and at rest
    Fchat continues to adapt to a standing error: for a set-point use
    :func:`lugrectl.dual_observer_control`. eps is a parameter of the block, 0.01 rad/s.

    References
    ----------
    Slotine and Li, IEEE Trans. Automatic Control 33(11), 1988.

    Examples
    --------
    A position loop around a drive of which nothing is known:

    >>> loop = lg.position_loop(lg.table1(), controller="adaptive_slotine_li")
    >>> loop.input_labels
    ['r', 'dr', 'ddr']
    """
    side = np.tanh(w / eps)
    u = Jhat * ar + Fvhat * w + Fchat * side - KD * s
    return u, -gJ * ar * s, -gv * w * s, -gc * side * s


@built("controller", gains="KD*", out="u", states="z0 z1 S0 S1 T", source=f"{DERIVED} {CHEN}")
def dual_observer_control(
    s,
    ar,
    w,
    z0,
    z1,
    S0,
    S1,
    T,
    J=J,
    law=SLIDING,
    KD=KD,
    k0: Any = P(0.35, "1", 0.0),
    k1: Any = P(1e-3, "s", 0.0),
    g0: Any = P(1e6, "N m/rad3", 0.0),
    g1: Any = P(1.0, "N m s2/rad3", 0.0),
    g2: Any = P(0.1, "N m s2/rad3", 0.0),
):
    """State feedback that adapts sigma0, sigma1 and Fv: inputs s, ar, w, output u.

    u = J ar - KD s + S0 z0 - S1 a z1 + T w, a = sigma0 |w|/h(w),
    dz0/dt = w - a z0 - k0 s, dz1/dt = w - a z1 + k1 a s,
    dS0/dt = -g0 s z0, dS1/dt = g1 s a z1, dT/dt = -g2 s w.

    Parameters
    ----------
    p : Parameters or Model
        Gives J and the parameters of a(w): only the ratio h(w)/sigma0 is used.
    KD : float
        Gain in N m s/rad.
    gains : float
        k0, k1, g0, g1, g2, each >= 0; those left out keep their defaults.

    Returns
    -------
    States z0, z1 in rad, S0 in N m/rad, S1 and T in N m s/rad.

    Notes
    -----
    Two copies of the bristles, because z appears in F = sigma0 z + sigma1 (w - a z) + Fv w with
    two signs. S0, S1 and T stand for sigma0, sigma1 and sigma1 + Fv and start at 0. With
    e0 = z - z0, e1 = z - z1 and
    V = J s^2/2 + sigma0 e0^2/(2 k0) + sigma1 e1^2/(2 k1) + (sigma0 - S0)^2/(2 g0) +
    (sigma1 - S1)^2/(2 g1) + (sigma1 + Fv - T)^2/(2 g2),
    dV/dt = -KD s^2 - sigma0 a e0^2/k0 - sigma1 a e1^2/k1: s and the position error go to 0 from
    every start for every smooth bounded reference, a constant one too. S0, S1 and T need not
    become the parameters.

    Status: derived here, in the spirit of the adaptive dynamic state feedback of Chen et al.
    (2022), whose equations could not be confirmed; there all LuGre parameters are unknown, here
    h(w)/sigma0 is known.

    Examples
    --------
    >>> control = lg.dual_observer_control(lg.table1(), KD=0.1)
    >>> control.state_labels
    ['z0', 'z1', 'S0', 'S1', 'T']
    """
    a = law.relaxation(w)
    u = J * ar - KD * s + S0 * z0 - S1 * a * z1 + T * w
    dz0, dz1 = w - a * z0 - k0 * s, w - a * z1 + k1 * a * s
    return u, dz0, dz1, -g0 * s * z0, g1 * s * a * z1, -g2 * s * w


@built("controller", gains="ks eps*", out="u surface", states="q", source=f"{DERIVED} {XU}")
def backstepping_smc(
    s,
    ar,
    q,
    J=J,
    a: Any = P(30.0, "1/s", 0.0),
    b: Any = P(2.0, "(rad/s)^(1-gamma)/s", 0.0),
    gamma: Any = P(0.6, "1", 1e-3, 1.0),
    ks: Any = P(100.0, "1/s", 0.0),
    eps: Any = P(5.0, "rad/s2", 0.0),
    phi: Any = P(0.01, "rad/s", 1e-12),
):
    """Backstepping with an integral fast terminal sliding mode: inputs s, ar, outputs u, surface.

    u = J (ar - dq/dt - ks y - eps y/sqrt(y^2 + phi^2)), y = s + q,
    dq/dt = a s + b |s|^gamma sign(s).

    Parameters
    ----------
    ks, eps : float
        In 1/s and rad/s2.
    gains : float
        a in 1/s, b, gamma (0 to 1) and phi in rad/s; those left out keep their defaults.

    Returns
    -------
    State q in rad/s, the unit of s on a position.

    Notes
    -----
    Uses the Fhat of :func:`lugrectl.extended_state_observer`, added by
    :func:`lugrectl.compensation`. s is that of :func:`lugrectl.sliding_error`, lam its virtual
    control. With the observer's error eD the closed loop is
    dy/dt = -eD/J - ks y - eps y/sqrt(y^2 + phi^2), so that in the end |y| <= sup|eD|/(J ks),
    |s| <= 2 |y| and |e| <= |s|/lam; |eD| <= (2/p) sup|dF/dt| for the observer's bandwidth p.
    |s|^gamma is smoothed at |s| below 1e-5 rad/s. With eps/phi = 500 1/s the switching is the
    fastest rate of the loop beside ks. Noise of w reaches u with the factor J (lam + a + ks).
    Start the observer's what at w.

    Status: derived here, in the spirit of the abstract of Xu et al. (2022): one joint, a linear
    virtual control, so that no power is singular and u needs no saturation, and a smoothed
    switching.

    Examples
    --------
    Beside the observer whose Fhat it uses:

    >>> p = lg.table1()
    >>> loop = lg.position_loop(p, "extended_state", controller="backstepping_smc")
    >>> loop.input_labels
    ['r', 'dr', 'ddr']
    """
    surface = s + q
    dq = a * s + b * s * (s * s + 1e-10) ** (0.5 * (gamma - 1.0))
    switch = eps * surface / np.sqrt(surface * surface + phi * phi)
    return J * (ar - dq - ks * surface - switch), surface, dq


HARMONICS = 9
MOST = 100_000  # samples in a period


@dataclass(frozen=True)
class Harmonics:
    """u = J ar - K s + x0 + x1 + ... + xn, dx0/dt = -gamma s, om = 2 pi/period,
    dxj/dt = -gamma s + j om yj, dyj/dt = -j om xj.
    """

    n: int

    def __call__(
        self,
        s: Any,
        ar: Any,
        *states: Any,
        J: Any = J,
        K: Any = P(0.1, "N m s/rad", 0.0),
        gamma: Any = P(2.0, "N m/rad", 0.0),
        period: Any = P(1.0, "s", 1e-9),
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
        counted = range(1, self.n + 1)
        states = ("x0", *(f"x{j}" for j in counted), *(f"y{j}" for j in counted))
        return Block(
            "repetitive_control", "controller", self, ("s", "ar"), ("u",), states, defaults(self),
            home=__name__, source=f"{DERIVED} {CHEN}",
        )  # fmt: skip


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


@factory
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


@factory
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

    values, name = {"J": as_model(p, "p").J, "K": K, "gamma": gamma}, one_name(names.get("name"))
    for key, value in (values | {"limit": limit}).items():
        within(value, f"{name}.{key}", _memory.parameters[key])
    dt, period = positive(dt, "dt, the sample time,", "seconds"), positive(period, "period", "s")
    if period > MOST * dt:
        raise InputError(
            f"period = {period:g} s is {period / dt:.3g} samples of {dt:g} s, more than {MOST}."
        )
    made = _Memory(name, float(limit), flag(smooth, "smooth"), updates=False)
    return BlockSystem(
        replace(made, updates=True),
        made,
        inputs=renamed(name, "inputs", ("s", "ar"), names.get("inputs")),
        outputs=renamed(name, "outputs", ("u",), names.get("outputs")),
        states=[f"v{j}" for j in range(max(2, round(period / dt)) + 1)],
        params={f"{name}.{k}": float(v) for k, v in values.items() if v is not None},
        name=name,
        dt=float(dt),
    )


@dataclass(frozen=True)
class _Memory:
    """The remembered v of the last samples, the oldest first, at the next one, or the torque u."""

    name: str
    limit: float
    smooth: bool
    updates: bool

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        # float refuses a symbolic state: thousands of them are called faster than compiled
        x = np.asarray(x, dtype=float) if self.updates else x
        before = np.clip(x[:3], -self.limit, self.limit)
        old = 0.25 * before[0] + 0.5 * before[1] + 0.25 * before[2] if self.smooth else before[1]
        gains = {k: params[f"{self.name}.{k}"] for k in ("J", "K", "gamma")}
        u, new = _memory.function(v[0], v[1], old, limit=self.limit, **gains)
        return np.append(x[1:], new) if self.updates else np.array([u])

    def renamed(self, update: Any, name: str) -> tuple[Any, Any, dict[str, str]]:
        keys = {f"{self.name}.{k}": f"{name}.{k}" for k in ("J", "K", "gamma")}
        return replace(update, name=name), replace(self, name=name), keys


# A predictor for a torque that acts late, J dw/dt = u(t - h) - F: a model of the drive without the
# delay, driven by u. It knows the friction h ahead; the measured velocity only corrects it.
MORGUL = "Odabas and Morgul, 2014 (Friedland-Park with a time delay)"
RUDERMAN = "Ruderman, IEEE Trans. Industrial Electronics, 2014"


@built("controller", out="ws", source=f"{DERIVED} {RUDERMAN}")
def smith_velocity(w, wp, wp_late):
    """The predicted velocity with the measured error of the prediction: inputs w, wp, wp_late.

    ws = wp + (w - wp_late).

    wp_late is wp delayed by the dead time of the drive.

    Returns
    -------
    Without states; output ws in rad/s.

    Notes
    -----
    Without the correction the model moves while the drive sticks. With exact parameters and equal
    states w(t + h) = wp(t), and the loop is that without delay, h later. A wrong friction level
    is not found by it: Fc and Fs 20 % low or high cost most of the gain.

    Status: derived here, in the spirit of the feed-forward friction observer of Ruderman (2014);
    the equations of the original could not be confirmed.

    Examples
    --------
    >>> smith = lg.smith_velocity()
    >>> smith.input_labels
    ['w', 'wp', 'wp_late']
    >>> np.round(smith.output(0.0, [], [0.9, 1.2, 1.0]), 3)
    array([1.1])
    """
    return wp + (w - wp_late)


@built("controller", out="wp", states="wp", source=f"{DERIVED} {MORGUL}")
def coulomb_predictor(u, ahat, wp, J=J, Fv=FV, eps=SMOOTH):
    """A drive with the Coulomb friction that an observer has found: inputs u, ahat, output wp.

    J dwp/dt = u - ahat sign(wp) - Fv wp, sign(wp) = tanh(wp/eps).

    Returns
    -------
    State wp in rad/s.

    Notes
    -----
    On a drive with F = a sign(w) + Fv w the error e = w(t + h) - wp(t) has J e de/dt <=
    -Fv e^2 + |a - ahat| |e|, because the sign increases: it converges for every delay once ahat
    does. The law of ahat contains no delay if its u is the torque that acts. On bristles this
    holds only where friction does not fall with speed. A gain k of the observer of 0.02 is better
    than 0.1 here. Start the controller stronger than stiction, because ahat starts at 0.

    Status: derived here, in the spirit of Odabas and Morgul (2014), whose equations could not be
    confirmed; only the velocity loop, and a predictor that contains friction.

    Examples
    --------
    A loop with a dead time of 5 ms sees the predicted speed without it:

    >>> p = lg.table1()
    >>> model = lg.coulomb_predictor(p)
    >>> late = lg.dead_time(5e-3, name="late", inputs=["wp"], outputs=["wp_late"])
    >>> model.output_labels, late.input_labels
    (['wp'], ['wp'])
    """
    (F,) = coulomb(wp, Fc=ahat, Fv=Fv, eps=eps)
    return acceleration(u, F, 0.0, J)


@built("controller", out="u", source=f"{DERIVED} {MORGUL}")
def coulomb_compensation(ws, ahat, Fv=FV, eps=SMOOTH):
    """The friction at the predicted velocity: inputs ws, ahat, output u.

    u = ahat sign(ws) + Fv ws, sign(ws) = tanh(ws/eps).

    Returns
    -------
    Without states; output u in N m.

    Examples
    --------
    >>> block = lg.coulomb_compensation(lg.table1())
    >>> block.input_labels
    ['ws', 'ahat']
    >>> np.round(block.output(0.0, [], [1.0, 0.3]), 3)  # 0.3 N m of Coulomb friction, at 1 rad/s
    array([0.318])
    """
    (F,) = coulomb(ws, Fc=ahat, Fv=Fv, eps=eps)
    return F
