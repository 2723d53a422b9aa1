"""Friction laws: torque F that opposes positive velocity w."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .block import Block, P
from .declaration import block

J: Any = P(0.0022, "kg m2", 1e-12)
SIGMA0: Any = P(260.0, "N m/rad", 1e-12)
SIGMA1: Any = P(0.6, "N m s/rad", 0.0)
FC: Any = P(0.285, "N m", 0.0)
FS: Any = P(0.335, "N m", 0.0)
FV: Any = P(0.018, "N m s/rad", 0.0)
VS: Any = P(0.01, "rad/s", 1e-12)
EPS: Any = P(1e-6, "rad/s", 1e-12, fitted=False, smooths=True)
SMOOTH: Any = P(
    1e-4, "rad/s", 1e-12, fitted=False
)  # of observers and laws that need a slope at rest
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


def bristle(w: Any, z: Any, sigma0: Any, Fc: Any, Fs: Any, vs: Any) -> Any:
    """dz/dt = w - sigma0 |w| z / h(w), without any correction (eq. LuGre1)."""
    return w - relaxation(w, sigma0, level(w, Fc, Fs, vs)) * z


def free_bristle(w: Any, z: Any, sigma0: Any, Fc: Any, Fs: Any, vs: Any, delta: Any) -> Any:
    """:func:`bristle` with the level of :func:`free_level`."""
    return w - relaxation(w, sigma0, free_level(w, Fc, Fs, vs, delta)) * z


def bristle_torque(w: Any, z: Any, dz: Any, sigma0: Any, sigma1: Any, Fv: Any) -> Any:
    """F = sigma0 z + sigma1 dz/dt + Fv w (eq. LuGre2)."""
    return sigma0 * z + sigma1 * dz + Fv * w


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

    As :func:`stribeck`, which it equals at delta = 2. Armstrong-Helouvry, Dupont and Canudas de
    Wit (Automatica 30(7), 1994, section 2) report delta from 0.5 to 1 for some pairs of
    materials.
    """
    return free_level(w, Fc, Fs, vs, delta) * np.tanh(w / eps) + Fv * w


def free_lugre(w, z, sigma0, sigma1, Fc, Fs, Fv, vs, delta: Any = None, vd: Any = None):
    """F = sigma0 z + sigma1 exp(-(w/vd)^2) dz/dt + Fv w, dz/dt = w - sigma0 |w| z / h(w).

    h(w) = Fc + (Fs - Fc) exp(-|w/vs|^delta). As :func:`lugre`, which it equals at delta = 2 and
    vd = infinity; None stands for these. The condition for passivity is the same, because h stays
    between Fc and Fs. In steady sliding dz/dt = 0, so that vd leaves the friction there as it is;
    a change of the speed causes less torque.
    """
    if delta is None:
        dz = bristle(w, z, sigma0, Fc, Fs, vs)
    else:
        dz = free_bristle(w, z, sigma0, Fc, Fs, vs, delta)
    damping = sigma1 if vd is None else sigma1 * np.exp(-((w / vd) ** 2))
    return bristle_torque(w, z, dz, sigma0, damping, Fv), dz


# Laws of more than one form: what an entry of a model file gives decides which. A form is a block
# under the law's own name; without such a key the law is the registered block.


def _nothing(made: Block) -> dict[str, Any]:
    return {}


@dataclass(frozen=True)
class Form:
    """The keys that an entry may give besides the parameters of the registered block.

    Parameters
    ----------
    keys : dict
        Declarations by key.
    build : callable
        ``build(entry, where)`` returns the block and the entry with its parameters alone;
        InputError, starting with ``where``, for what cannot be meant.
    written : callable
        ``written(block)``: the entry's keys that are no parameters of the block.
    """

    keys: Mapping[str, P]
    build: Callable[[Mapping[str, Any], str], tuple[Block, Mapping[str, Any]]]
    written: Callable[[Block], dict[str, Any]] = _nothing


FORMS: dict[str, Form] = {}


def form_keys(made: Block) -> Mapping[str, P]:
    """The keys of a law's form; none for other blocks."""
    form = FORMS.get(made.name) if made.kind == "friction" else None
    return form.keys if form else {}


def usual_values(made: Block, entry: Mapping[str, Any]) -> dict[str, float]:
    """The usual values of a block that an entry does not give: they are held."""
    return {k: p.value for k, p in made.own.items() if p.usual and entry.get(k) is None}


def with_usual(made: Block, entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """The entry of a law or effect with each usual value that it does not give: held."""
    usual = usual_values(made, entry)
    return {**entry, **{k: {"value": value, "fixed": True} for k, value in usual.items()}}


def formed(made: Block, entry: Mapping[str, Any], where: str) -> tuple[Block, Mapping[str, Any]]:
    """The block that an entry means, and the entry with the block's parameters alone."""
    given = {k for k in form_keys(made) if entry.get(k) is not None}
    return FORMS[made.name].build(entry, where) if given else (made, entry)


def written_form(made: Block) -> dict[str, Any]:
    """The law's name, and what an entry must give besides the parameters to mean this block."""
    more = FORMS[made.name].written(made) if form_keys(made) else {}
    return {"model": made.name, **more}


def _form(law: Any, function: Any, **keys: P) -> Form:
    """The law as it is, or with those of the keys that an entry gives as further parameters."""

    def build(entry: Any, where: str) -> Any:
        given = {k: p for k, p in keys.items() if entry.get(k) is not None}
        return replace(law, function=function, parameters={**law.parameters, **given}), entry

    return Form(keys, build)


FORMS["stribeck"] = _form(stribeck, free_stribeck, delta=DELTA)
FORMS["lugre"] = _form(lugre, free_lugre, delta=DELTA, vd=VD)
