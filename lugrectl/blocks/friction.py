"""Friction laws: torque F that opposes positive velocity w.

The last ones have several elements, a spring with a slider each: Maxwell slip and its relatives.
Element i has the stiffness k_i, a part of sigma0, and slides at the share nu_i of the friction
level. Its state z_i is its deflection, F_i = k_i z_i. The true generalised Maxwell-slip law
(Al-Bender, Lampaert and Swevers 2005) is not here: an element that slides does so until the speed
changes its sign, also while F_i is below its level, so it has a memory of its own that no function
of w and F_i replaces. Parallel bristles are its smooth relative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from ..core.errors import InputError
from ..core.validation import array, shown, whole
from .block import REGISTRY, Block, Group, P, defaults
from .declaration import block

J: Any = P(0.0022, "kg m2", 1e-12)
SIGMA0: Any = P(260.0, "N m/rad", 1e-12)
SIGMA1: Any = P(0.6, "N m s/rad", 0.0)
FC: Any = P(0.285, "N m", 0.0)
FS: Any = P(0.335, "N m", 0.0)
FV: Any = P(0.018, "N m s/rad", 0.0)
VS: Any = P(0.01, "rad/s", 1e-12)
EPS: Any = P(1e-6, "rad/s", 1e-12, fitted=False, smooths=True)
# of observers and laws that need a slope at rest
SMOOTH: Any = P(1e-4, "rad/s", 1e-12, fitted=False)
DELTA: Any = P(2.0, "1", 0.3, 20.0, usual=True)
VD: Any = P(np.inf, "rad/s", 1e-12, neutral=np.inf, usual=True)
PAPER = "Odabas and Morgul, A Novel Observer Design for LuGre Friction Estimation and Control"
LUGRE = "Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40(3), 1995"
LEAST = 1e-24  # added to a square, so that its powers have a slope at 0


def level(w: Any, Fc: Any, Fs: Any, vs: Any) -> Any:
    """h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2), the sliding friction level (eq. Lugre3)."""
    return Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))


def free_level(w: Any, Fc: Any, Fs: Any, vs: Any, delta: Any) -> Any:
    """h(w) = Fc + (Fs - Fc) exp(-|w/vs|^delta)."""
    return Fc + (Fs - Fc) * np.exp(-(((w / vs) ** 2 + LEAST) ** (0.5 * delta)))


def relaxation(w: Any, sigma0: Any, h: Any) -> Any:
    """a(w) = sigma0 |w| / h, the rate in 1/s at which sliding forgets a deflection."""
    return sigma0 * np.abs(w) / h


def bristle(w: Any, z: Any, sigma0: Any, Fc: Any, Fs: Any, vs: Any, delta: Any = None) -> Any:
    """dz/dt = w - sigma0 |w| z / h(w), without any correction (eq. LuGre1)."""
    h = level(w, Fc, Fs, vs) if delta is None else free_level(w, Fc, Fs, vs, delta)
    return w - relaxation(w, sigma0, h) * z


def bristle_torque(w: Any, z: Any, dz: Any, sigma0: Any, sigma1: Any, Fv: Any) -> Any:
    """F = sigma0 z + sigma1 dz/dt + Fv w (eq. LuGre2)."""
    return sigma0 * z + sigma1 * dz + Fv * w


class Bristles(SimpleNamespace):
    """The values of a LuGre law, as far as a block has them."""

    def level(self, w: Any) -> Any:
        return level(w, self.Fc, self.Fs, self.vs)

    def relaxation(self, w: Any) -> Any:
        return relaxation(w, self.sigma0, self.level(w))

    def rate(self, w: Any, z: Any) -> Any:
        return bristle(w, z, self.sigma0, self.Fc, self.Fs, self.vs)

    def torque(self, w: Any, z: Any, dz: Any) -> Any:
        return bristle_torque(w, z, dz, self.sigma0, self.sigma1, self.Fv)


LAW: Any = Group(Bristles, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS)


@block("friction", out="F")
def viscous(w, Fv=FV):
    """F = Fv w."""
    return Fv * w


@block("friction", out="F")
def coulomb(w, Fc=FC, Fv=FV, eps=EPS):
    """F = Fc sign(w) + Fv w.

    At rest F is the torque that holds the drive, up to Fc: ``simulate`` takes the sign itself
    and a drive below break-away does not move. For solvers that cannot rest, such as those of
    python-control, sign(w) is written tanh(w/eps): there the drive creeps at less than eps. The
    two agree to the last bit at |w| > 20 eps. An eps above 1e-6 rad/s holds in ``simulate`` too.
    """
    return Fc * np.tanh(w / eps) + Fv * w


@block("friction", out="F", source=f"{PAPER}, eq. Lugre_ss")
def stribeck(w, Fc=FC, Fs=FS, Fv=FV, vs=VS, eps=EPS):
    """F = (Fc + (Fs - Fc) exp(-(w/vs)^2)) sign(w) + Fv w.

    The paper's static map (eq. Lugre_ss), with sign(w) as in :func:`coulomb`; eps must be well
    below vs. A model that gives ``delta`` has |w/vs|^delta in place of (w/vs)^2.
    """
    return level(w, Fc, Fs, vs) * np.tanh(w / eps) + Fv * w


@block("friction", out="F", states="z", source=f"{LUGRE}, eq. 1-3")
def lugre(w, z, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS):
    """F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w - sigma0 |w| z / h(w).

    h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2). Canudas de Wit et al. 1995, eq. 1-3 (in the source
    paper: LuGre1, LuGre2, Lugre3). Passive from w to F if Fv >= sigma1 (Fs - Fc)/Fc, where z
    starts within Fs/sigma0; otherwise it may put out energy (Barahanov and Ortega, IEEE Trans.
    Automatic Control 45(4), 2000; ``passivity_check``). Table 1 asks for Fv >= 0.105 and has
    0.018. Under a torque that
    oscillates below breakaway the deflection drifts; ``elastoplastic`` does not. A model that
    gives ``delta`` has |w/vs|^delta in place of (w/vs)^2; the observers keep (w/vs)^2. A model
    that gives ``vd`` (rad/s) has the damping sigma1 exp(-(w/vd)^2), which fades with the speed;
    the observers keep sigma1.
    """
    dz = bristle(w, z, sigma0, Fc, Fs, vs)
    return bristle_torque(w, z, dz, sigma0, sigma1, Fv), dz


def free_stribeck(w: Any, Fc: Any, Fs: Any, Fv: Any, vs: Any, eps: Any, delta: Any) -> Any:
    """F = (Fc + (Fs - Fc) exp(-|w/vs|^delta)) sign(w) + Fv w.

    Armstrong-Helouvry, Dupont and Canudas de Wit (Automatica 30(7), 1994, section 2) report delta
    from 0.5 to 1 for some pairs of materials.
    """
    return free_level(w, Fc, Fs, vs, delta) * np.tanh(w / eps) + Fv * w


def free_lugre(w, z, sigma0, sigma1, Fc, Fs, Fv, vs, delta: Any = None, vd: Any = None):
    """F = sigma0 z + sigma1 exp(-(w/vd)^2) dz/dt + Fv w, dz/dt = w - sigma0 |w| z / h(w).

    h(w) = Fc + (Fs - Fc) exp(-|w/vs|^delta); None stands for delta = 2 and vd = infinity. Passive
    under the condition of :func:`lugre`. vd leaves the friction in steady sliding as it is.
    """
    dz = bristle(w, z, sigma0, Fc, Fs, vs, delta)
    damping = sigma1 if vd is None else sigma1 * np.exp(-((w / vd) ** 2))
    return bristle_torque(w, z, dz, sigma0, damping, Fv), dz


# Laws of more than one form: what an entry of a model file gives decides which. A form is a block
# under the law's own name; without such a key the law is the registered block.


def usual_values(made: Block, entry: Mapping[str, Any]) -> dict[str, float]:
    """The usual values of a block that an entry does not give: they are held."""
    return {k: p.value for k, p in made.own.items() if p.usual and entry.get(k) is None}


def formed(made: Block, entry: Mapping[str, Any], where: str) -> tuple[Block, Mapping[str, Any]]:
    """The block that an entry means, and the entry with the block's parameters alone."""
    given = {k: p for k, p in made.form_keys.items() if entry.get(k) is not None}
    if not given:
        return made, entry
    law = made.function
    if isinstance(law, Elements):
        return elements(type(law), entry, where)
    parameters = {**made.parameters, **given}
    return replace(made, function=FREE.get(law, law), parameters=parameters), entry


def written_form(made: Block) -> dict[str, Any]:
    """The law's name, and what an entry must give besides the parameters to mean this block."""
    law = made.function
    if not isinstance(law, Elements):
        return {"model": made.name}
    lists = {"stiffness": list(law.stiffness), "share": list(law.share)}
    given = {k: v for k, v in lists.items() if v} or {"elements": law.elements}
    return {"model": made.name, **given}


FREE: dict[Any, Any] = {stribeck.function: free_stribeck, lugre.function: free_lugre}
for _made, _keys in ((stribeck, {"delta": DELTA}), (lugre, {"delta": DELTA, "vd": VD})):
    object.__setattr__(_made, "form_keys", _keys)


KAPPA: Any = P(0.7, "1", 0.01, 0.99, usual=True)
SMALL = 1e-12  # added to a square, so that its powers have a slope at 0
DAHL = "Dahl, A Solid Friction Model, Aerospace Corporation TOR-0158(3107-18)-1, 1968"
DUPONT = (
    "Dupont, Hayward, Armstrong and Altpeter, Single State Elastoplastic Friction Models, IEEE "
    "Trans. Automatic Control 47(5), 2002"
)
RUDERMAN = (
    "in the spirit of Ruderman and Bertram, Two-State Dynamic Friction Model with "
    "Elasto-Plasticity, Mech. Systems and Signal Processing 39, 2013"
)
BOUC_WEN = "Wen, Method for Random Vibration of Hysteretic Systems, ASCE J. Eng. Mech. 102(2), 1976"


def power(x: Any, exponent: Any) -> Any:
    """|x|^exponent, whose slope stays finite at 0 for an exponent below 1."""
    return (x * x + SMALL) ** (0.5 * exponent)


def elastoplastic_bristle(w: Any, z: Any, sigma0: Any, g: Any, kept: Any) -> Any:
    """dz/dt = w (1 - alpha sigma0 z sign(w)/g): elastic up to |z| = kept, sliding at g/sigma0.

    alpha = 0 up to |z| = kept and wherever z and w differ in sign, 1 from |z| = g/sigma0 on, and
    (1 - cos(pi x))/2 in between, where x goes from 0 to 1.
    """
    bend = np.abs(z)
    part = np.minimum(np.maximum((bend - kept) / (g / sigma0 - kept), 0.0), 1.0)
    alpha = 0.5 - 0.5 * np.cos(np.pi * part)
    ahead = 0.5 * (z * np.abs(w) + bend * w)  # z |w|, but 0 where z and w differ in sign
    return w - alpha * sigma0 / g * ahead


@block("friction", out="F", states="z", source=DAHL)
def dahl(w, z, sigma0=SIGMA0, Fc=FC, Fv=FV, n: Any = P(1.0, "1", 0.3, 10.0, usual=True)):
    """F = sigma0 z + Fv w, dz/dt = w (1 - q) |1 - q|^(n - 1), q = sigma0 z sign(w)/Fc.

    A bristle whose torque after a reversal falls off with the distance: for n = 1
    F = Fc (1 - 2 exp(-sigma0 x/Fc)) after sliding the other way. It depends on the distance alone,
    not on the speed: no Stribeck peak, no break-away above Fc. n below 1 ends the bend sooner, as
    in brittle materials; n above 1 later. LuGre with Fs = Fc and sigma1 = 0 is n = 1. Passive from
    w to F for every n. Under a torque that oscillates below Fc the deflection drifts.
    """
    # w (1 - q) without a sign, so that n = 1 is affine in z
    slip = w - relaxation(w, sigma0, Fc) * z
    return sigma0 * z + Fv * w, slip * power(1.0 - sigma0 * z * np.sign(w) / Fc, n - 1.0)


@block("friction", out="F", states="z", source=DUPONT)
def elastoplastic(w, z, law=LAW, kappa=KAPPA):
    """F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w (1 - alpha sigma0 z sign(w)/h(w)).

    LuGre with an elastic zone: alpha = 0 up to |z| = kappa Fc/sigma0 and after every reversal,
    1 from |z| = h(w)/sigma0 on, (1 - cos(pi x))/2 in between; h as in LuGre. A torque that
    oscillates within the zone, below kappa Fc, moves the drive to and fro without drift; LuGre
    drifts. kappa near 0 is LuGre, except after a reversal. Only such a test distinguishes the
    two. Needs Fs >= Fc. Passive from w to F if Fv >= sigma1 (Fs - Fc)/Fc, where z starts within
    Fs/sigma0, as LuGre: w dz/dt >= w^2 (1 - Fs/Fc) because alpha <= 1. An observer that copies
    this law keeps its error in the elastic zone.
    """
    dz = elastoplastic_bristle(w, z, law.sigma0, law.level(w), kappa * law.Fc / law.sigma0)
    return law.torque(w, z, dz), dz


@block("friction", out="F", states="z lost", source=RUDERMAN)
def two_state(w, z, lost, law=LAW, tau: Any = P(0.005, "s", 1e-6, 100.0, usual=True), kappa=KAPPA):
    """F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w (1 - alpha sigma0 z sign(w)/g), g lags h(w).

    The elasto-plastic bristle, whose level g follows h(w) with a lag, tau dg/dt = h(w) - g
    (frictional lag: friction falls late when the drive speeds up). alpha = 0 up to
    |z| = kappa g/sigma0, 1 from g/sigma0 on. The state ``lost`` is the part of Fs - Fc that
    sliding has removed, g = Fs - (Fs - Fc) lost: 0 is a drive at rest for long. Equations derived
    for this toolkit, because those of the source were not found. With tau near 0 it is the
    elasto-plastic law with a zone of kappa h(w); a lag well below a sample cannot be identified.
    Passive from w to F under the condition of the elasto-plastic law, because g stays between Fc
    and Fs.
    """
    g = law.Fs - (law.Fs - law.Fc) * lost
    dz = elastoplastic_bristle(w, z, law.sigma0, g, kappa * g / law.sigma0)
    return law.torque(w, z, dz), dz, (1.0 - level(w, 0, 1, law.vs) - lost) / tau


@block("friction", out="F", states="z", source=BOUC_WEN)
def bouc_wen(
    w,
    z,
    sigma0=SIGMA0,
    Fc=FC,
    Fv=FV,
    beta: Any = P(0.5, "1", 0.5, 10.0, usual=True),
    n: Any = P(1.0, "1", 1.0, 20.0, usual=True),
):
    """F = Fc y + Fv w, dy/dt = sigma0/Fc (w - |y|^n (beta |w| sign(y) + (1 - beta) w)).

    A hysteresis of any roundness: n large bends sharply. beta = 0.5 unloads along a straight line
    of stiffness sigma0, beta = n = 1 is Dahl. It depends on the distance alone, not on the speed:
    no Stribeck peak. The state is z = Fc y/sigma0, a deflection. Passive from w to F for
    beta >= 0.5, which is the lower bound: the storage sigma0 z^2/2 loses
    Fc |w| |y|^(n+1) (beta + (1 - beta) sign(w y)) >= 0. Small loops inside a large one do not
    close, and under a torque that oscillates below Fc the deflection drifts; ``maxwell_slip``
    closes them.
    """
    y = sigma0 * z / Fc
    dz = w - power(y, n - 1.0) * (beta * np.abs(w) * y + (1.0 - beta) * w * np.abs(y))
    return sigma0 * z + Fv * w, dz


def strokes(dx: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The path, and the first sample and the direction of each stroke between reversals."""
    path, side = np.cumsum(np.abs(dx)), np.sign(dx)
    moving = np.flatnonzero(side)
    if not len(moving):
        return path, moving, side[:0]
    turns = side[moving[1:]] != side[moving[:-1]]
    first = moving[np.append(True, turns)]
    return path, first, side[first]


def along(
    path: np.ndarray, first: np.ndarray, sides: np.ndarray, x0: float, asymmetry: float = 0.0
) -> np.ndarray:
    """Dahl's bristle along a measured motion, z' = (G sign(w) - z) |w|/(G x0), in closed form.

    G = 1 + asymmetry sign(w); strokes as :func:`strokes` has them. Between reversals it relaxes
    exponentially over the path.
    """
    if not len(first):  # a drive that never moves
        return np.zeros(len(path))
    level = 1.0 + asymmetry * sides
    start, limit = np.where(first > 0, path[first - 1], 0.0), sides * level
    ends = np.append(first[1:], len(path))
    decay = np.exp(-(path[ends - 1] - start) / (level * x0))
    last, before = [], 0.0
    for to, left in zip(limit.tolist(), decay.tolist(), strict=True):
        last.append(before)
        before = to + (before - to) * left
    each = np.repeat(np.arange(len(first)), ends - first)
    gone = np.exp(-(path[first[0] :] - start[each]) / (level * x0)[each])
    z = limit[each] + (np.array(last) - limit)[each] * gone
    return np.concatenate([np.zeros(first[0]), z])


FEW, MANY = 4, 20  # elements unless given, and at most
N = P(2.0, "1", 1.0, 20.0, usual=True)
KEYS = {
    "elements": P(float(FEW), "1", 1.0, float(MANY), usual=True),
    "stiffness": SIGMA0,
    "share": P(1.0, "1", 0.0, 1.0),
}
EDGE = 1e-4  # of the limit of an element
SUM = 1e-6  # error of a sum that should be 1


def slipping(w: Any, q: Any, n: Any) -> Any:
    """w (1 - sign(q w) |q|^n), the rate of a bristle at the share q of its level."""
    return w - np.abs(w) * q * power(q, n - 1.0)


@dataclass(frozen=True)
class Elements:
    """Number of elements, and their stiffnesses and shares, which are by rule where left out.

    The rule: k_i = 2 (N + 1 - i)/(N (N + 1)) sigma0 and nu_i = 2 i/(N (N + 1)), i = 1 .. N: the
    stiffest element slides first.
    """

    elements: int = FEW
    stiffness: tuple[float, ...] = ()
    share: tuple[float, ...] = ()

    name: ClassVar[str]
    source: ClassVar[str]

    @property
    def parts(self) -> tuple[tuple[float, float], ...]:
        """Of each element the part of the stiffness and of the level; each adds up to 1."""
        N = self.elements
        k = self.stiffness or tuple(float(N + 1 - i) for i in range(1, N + 1))
        nu = self.share or tuple(float(i) for i in range(1, N + 1))
        return tuple((a / sum(k), b / sum(nu)) for a, b in zip(k, nu, strict=True))

    def block(self) -> Block:
        law: Any = self  # each law has a __call__ of its own
        states = tuple(f"z{i + 1}" for i in range(self.elements))
        return Block(
            self.name, "friction", law, ("w",), ("F",), states, defaults(law),
            home=__name__, source=self.source, form_keys=KEYS,
        )  # fmt: skip

    def pull(self, z: Any, sigma0: Any) -> Any:
        return sum(sigma0 * k * one for (k, _), one in self.each(z))

    def stopped(self, w: Any, z: Any, sigma0: Any, limit: Any, v: Any = None) -> list[Any]:
        """Rates of the deflections at speed v, w unless given, while the drive slides with w: v
        below the limits, 0 at them, over the last ``EDGE`` of the way; back to a limit that has
        come down."""
        way = np.sign(w)
        back = 0.0 if v is None else way * np.minimum(v * way, 0.0)
        ahead = w if v is None else v - back
        loads = [k * sigma0 * one * way / (nu * limit) for (k, nu), one in self.each(z)]
        return [back + ahead * np.minimum((1.0 - load) / EDGE, 1.0) for load in loads]

    def each(self, z: Any) -> Any:
        return zip(self.parts, z, strict=True)


class MaxwellSlip(Elements):
    """F = sum k_i z_i + Fv w, dz_i/dt = w, but 0 where k_i |z_i| = nu_i Fc and z_i w > 0.

    Elastic elements in parallel, each of which slips at its share of Fc. After a reversal the
    torque follows the virgin curve at double size, and small loops inside a large one close: the
    hysteresis of rolling contacts with its memory of turning points. It depends on the distance
    alone, not on the speed: no Stribeck peak. A model file gives ``elements``, the number N, or
    the lists ``stiffness`` (k_i, N m/rad) and ``share`` (nu_i, sum 1); sigma0 is the sum of the
    k_i, and if it stands beside the list, only the ratio of the k_i counts. By rule
    k_i = 2 (N + 1 - i)/(N (N + 1)) sigma0 and nu_i = 2 i/(N (N + 1)). A fit changes sigma0, Fc and
    Fv and keeps the ratios. The slip sets in over the last 1e-4 of the limit. The first long
    simulation compiles: about 20 s with 10 elements, a minute with 20. Passive from w to F: each
    element stores k_i z_i^2/2 and only loses.
    """

    name = "maxwell_slip"
    source = "Iwan, A Distributed-Element Model for Hysteresis, ASME J. Applied Mechanics 33, 1966"

    def __call__(self, w: Any, *z: Any, sigma0=SIGMA0, Fc=FC, Fv=FV) -> tuple[Any, ...]:
        return self.pull(z, sigma0) + Fv * w, *self.stopped(w, z, sigma0, Fc)


class ParallelBristles(Elements):
    """F = sum k_i z_i + Fv w, dz_i/dt = w (1 - sign(z_i w) |k_i z_i/(nu_i h(w))|^n).

    A smooth relative of the generalised Maxwell-slip law: N bristles side by side, each with its
    share of the level h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2). n near 1 bends softly, n large like
    Maxwell slip. Small loops inside a large one do not close exactly. The generalised law itself
    needs a mode, stick or slip, for each element; no block can have that. A model file gives
    ``elements`` or the lists ``stiffness`` and ``share``, as for ``maxwell_slip``. A fit starts
    each stretch with unbent elements, which may cost 1 % of sigma0. Passive from w to F: each
    bristle stores k_i z_i^2/2 and only loses.
    """

    name = "parallel_bristles"
    source = (
        "derived for this toolkit, after Al-Bender, Lampaert and Swevers, IEEE TAC 50(11), 2005"
    )

    def __call__(
        self, w: Any, *z: Any, sigma0=SIGMA0, Fc=FC, Fs=FS, Fv=FV, vs=VS, n=N
    ) -> tuple[Any, ...]:
        h = level(w, Fc, Fs, vs)
        loads = [sigma0 * k * one / (nu * h) for (k, nu), one in self.each(z)]
        rates = [slipping(w, q, n) for q in loads]
        return self.pull(z, sigma0) + Fv * w, *rates


class Leuven(Elements):
    """F = Fh + sigma1 v + Fv w, v = w (1 - sign(Fh w) |Fh/h(w)|^n), Fh a Maxwell stack driven by v.

    Fh = sum k_i z_i, dz_i/dt = v, but 0 where k_i |z_i| = nu_i h(w) and z_i v > 0;
    h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2). LuGre's bristle with the hysteresis of Maxwell slip in
    place of its spring. Near break-away the bristle slips before the stack is at its limit, so
    that small loops inside a large one do not close exactly. A model file gives ``elements`` or
    the lists ``stiffness`` and ``share``, as for ``maxwell_slip``. A fit starts each stretch with
    unbent elements, which may cost 1 % of sigma0. Passive from w to F if
    Fv >= sigma1 ((Fs/Fc)^n - 1), because |Fh| <= Fs.
    """

    name = "leuven"
    source = (
        "modified Leuven: Lampaert, Swevers and Al-Bender, IEEE TAC 47(4), 2002, after Swevers et "
        "al., IEEE TAC 45(4), 2000; from memory of the source"
    )

    def __call__(
        self, w: Any, *z: Any, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS, n=N
    ) -> tuple[Any, ...]:
        h, Fh = level(w, Fc, Fs, vs), self.pull(z, sigma0)
        v = slipping(w, Fh / h, n)
        return Fh + sigma1 * v + Fv * w, *self.stopped(w, z, sigma0, h, v)


def elements(
    law: type[Elements], entry: Mapping[str, Any], where: str
) -> tuple[Block, Mapping[str, Any]]:
    k, nu = (_list(entry.get(key), f"{where}: {key}") for key in ("stiffness", "share"))
    many = entry.get("elements")
    N = len(k or nu) or FEW if many is None else whole(many, f"{where}: elements", 1)
    if N > MANY:
        raise InputError(f"{where}: {N} elements; give {MANY} at most.")
    for key, given in (("stiffness", k), ("share", nu)):
        if given and len(given) != N:
            raise InputError(f"{where}: {key} has {len(given)} numbers for {N} elements.")
    if nu and abs(sum(nu) - 1.0) > SUM:
        raise InputError(f"{where}: share adds up to {sum(nu):g}; the shares must add up to 1.")
    rest = {key: v for key, v in entry.items() if key not in KEYS}
    if k and rest.get("sigma0") is None and abs(sum(k) - 1.0) > SUM:
        rest["sigma0"] = sum(k)
        k = tuple(one / sum(k) for one in k)
    return law(N, k, nu).block(), rest


def _list(given: Any, where: str) -> tuple[float, ...]:
    if given is None:
        return ()
    made = array(given, where)
    if made.ndim != 1 or not made.size or not np.all(np.isfinite(made) & (made > 0.0)):
        raise InputError(f"{where} must be a list of positive numbers, not {shown(given)}.")
    return tuple(map(float, made))


for _law in (MaxwellSlip, ParallelBristles, Leuven):
    REGISTRY["friction", _law.name] = _law().block()
