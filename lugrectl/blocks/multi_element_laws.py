"""Friction laws of several elements, a spring with a slider each: Maxwell slip and its relatives.

Element i has the stiffness k_i, a part of sigma0, and slides at the share nu_i of the friction
level. Its state z_i is its deflection, F_i = k_i z_i. The true generalised Maxwell-slip law
(Al-Bender, Lampaert and Swevers 2005) is not here: an element that slides does so until the speed
changes its sign, also while F_i is below its level, so it has a memory of its own that no function
of w and F_i replaces. Parallel bristles are its smooth relative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..core.errors import InputError
from ..core.validation import array, shown, whole
from .block import REGISTRY, Block, P
from .bristle_laws import power
from .friction import FC, FORMS, FS, FV, SIGMA0, SIGMA1, VS, Form, level

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
    parameters: ClassVar[Mapping[str, P]]

    @property
    def parts(self) -> tuple[tuple[float, float], ...]:
        """Of each element the part of the stiffness and of the level; each adds up to 1."""
        N = self.elements
        k = self.stiffness or tuple(float(N + 1 - i) for i in range(1, N + 1))
        nu = self.share or tuple(float(i) for i in range(1, N + 1))
        return tuple((a / sum(k), b / sum(nu)) for a, b in zip(k, nu, strict=True))

    def block(self) -> Block:
        law: Any = self  # each law has a __call__ of its own
        return Block(
            name=self.name,
            kind="friction",
            function=law,
            inputs=("w",),
            outputs=("F",),
            states=tuple(f"z{i + 1}" for i in range(self.elements)),
            parameters=self.parameters,
            start=("0",) * self.elements,
            home=__name__,
            source=self.source,
        )

    def pull(self, z: Any, sigma0: Any) -> Any:
        """sum k_i z_i, the torque of the springs."""
        return sum(sigma0 * k * one for (k, _), one in self.each(z))

    def stopped(self, w: Any, z: Any, sigma0: Any, limit: Any, v: Any = None) -> list[Any]:
        """Rates of the deflections at speed v, w unless given, while the drive slides with w.

        v below the limits; none at them, where v has the sign of w. Beyond a limit, which may
        have come down, the deflection returns to it as the drive slides. The rate falls to 0 over
        the last ``EDGE`` of the way to the limit, so that a solver meets no jump.
        """
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
    parameters = {"sigma0": SIGMA0, "Fc": FC, "Fv": FV}

    def __call__(self, w: Any, *z: Any, sigma0: Any, Fc: Any, Fv: Any) -> tuple[Any, ...]:
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
    parameters = {"sigma0": SIGMA0, "Fc": FC, "Fs": FS, "Fv": FV, "vs": VS, "n": N}

    def __call__(
        self, w: Any, *z: Any, sigma0: Any, Fc: Any, Fs: Any, Fv: Any, vs: Any, n: Any
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
    parameters = {
        "sigma0": SIGMA0, "sigma1": SIGMA1, "Fc": FC, "Fs": FS, "Fv": FV, "vs": VS, "n": N,
    }  # fmt: skip

    def __call__(
        self, w: Any, *z: Any, sigma0: Any, sigma1: Any, Fc: Any, Fs: Any, Fv: Any, vs: Any, n: Any
    ) -> tuple[Any, ...]:
        h, Fh = level(w, Fc, Fs, vs), self.pull(z, sigma0)
        v = slipping(w, Fh / h, n)
        return Fh + sigma1 * v + Fv * w, *self.stopped(w, z, sigma0, h, v)


def _form(law: type[Elements]) -> Form:
    def build(entry: Mapping[str, Any], where: str) -> tuple[Block, Mapping[str, Any]]:
        made, total = _elements(law, entry, where)
        rest = {k: v for k, v in entry.items() if k not in KEYS}
        if total is not None and rest.get("sigma0") is None:
            rest["sigma0"] = total
        return made.block(), rest

    return Form(KEYS, build, _written)


def _elements(
    law: type[Elements], entry: Mapping[str, Any], where: str
) -> tuple[Elements, float | None]:
    """The law of an entry, and its stiffness where the entry's list gives it."""
    k, nu = (_list(entry.get(key), f"{where}: {key}") for key in ("stiffness", "share"))
    many = entry.get("elements")
    N = len(k or nu) or FEW if many is None else whole(many, f"{where}: elements", 1)
    if N > MANY:
        raise InputError(f"{where}: {N} elements; give {MANY} at most.")
    for key, given in (("stiffness", k), ("share", nu)):
        if given and len(given) != N:
            raise InputError(
                f"{where}: {key} has {len(given)} numbers, but there are {N} elements."
            )
    if nu and abs(sum(nu) - 1.0) > SUM:
        raise InputError(f"{where}: share adds up to {sum(nu):g}; the shares must add up to 1.")
    if not k or entry.get("sigma0") is not None or abs(sum(k) - 1.0) <= SUM:
        return law(N, k, nu), None
    return law(N, tuple(one / sum(k) for one in k), nu), sum(k)


def _list(given: Any, where: str) -> tuple[float, ...]:
    """Positive numbers; none where nothing is given."""
    if given is None:
        return ()
    made = array(given, where)
    if made.ndim != 1 or not made.size or not np.all(np.isfinite(made) & (made > 0.0)):
        raise InputError(f"{where} must be a list of positive numbers, not {shown(given)}.")
    return tuple(map(float, made))


def _written(made: Block) -> dict[str, Any]:
    law: Any = made.function
    lists = {"stiffness": list(law.stiffness), "share": list(law.share)}
    given = {k: v for k, v in lists.items() if v}
    return given or {"elements": law.elements}


for _law in (MaxwellSlip, ParallelBristles, Leuven):
    REGISTRY["friction", _law.name] = _law().block()
    FORMS[_law.name] = _form(_law)
