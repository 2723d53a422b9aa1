"""Friction laws: torque F that opposes positive velocity w."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..spec import P, block

J = P(0.0022, "kg m2", 1e-12)
SIGMA0 = P(260.0, "N m/rad", 1e-12)
SIGMA1 = P(0.6, "N m s/rad", 0.0)
FC = P(0.285, "N m", 0.0)
FS = P(0.335, "N m", 0.0)
FV = P(0.018, "N m s/rad", 0.0)
VS = P(0.01, "rad/s", 1e-12)
EPS = P(1e-4, "rad/s", 1e-12, fitted=False)
PAPER = "Odabas and Morgul, A Novel Observer Design for LuGre Friction Estimation and Control"
LUGRE = "Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40(3), 1995"


def level(w: Any, Fc: Any, Fs: Any, vs: Any) -> Any:
    """h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2), the sliding friction level (eq. Lugre3)."""
    return Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))


def bristle(w: Any, z: Any, sigma0: Any, Fc: Any, Fs: Any, vs: Any) -> Any:
    """dz/dt = w - sigma0 |w| z / h(w), without any correction (eq. LuGre1)."""
    return w - sigma0 * np.abs(w) / level(w, Fc, Fs, vs) * z


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

    sign(w) is written tanh(w/eps), so that a solver can come to rest: at |w| > 20 eps the two
    agree to the last bit. With a torque below Fc the drive creeps at less than eps.
    """
    return Fc * np.tanh(w / eps) + Fv * w


@block("friction", out="F", source=f"{PAPER}, eq. Lugre_ss")
def stribeck(w, Fc=FC, Fs=FS, Fv=FV, vs=VS, eps=EPS):
    """F = (Fc + (Fs - Fc) exp(-(w/vs)^2)) sign(w) + Fv w.

    The paper's static map (eq. Lugre_ss), with sign(w) as in :func:`coulomb`; eps must be well
    below vs.
    """
    return level(w, Fc, Fs, vs) * np.tanh(w / eps) + Fv * w


@block("friction", out="F", states="z", source=f"{LUGRE}, eq. 1-3")
def lugre(w, z, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS):
    """F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w - sigma0 |w| z / h(w).

    h(w) = Fc + (Fs - Fc) exp(-(w/vs)^2). Canudas de Wit et al. 1995, eq. 1-3 (in the source
    paper: LuGre1, LuGre2, Lugre3). Not passive from w to F if sigma1 is large and Fs > Fc.
    """
    dz = bristle(w, z, sigma0, Fc, Fs, vs)
    return bristle_torque(w, z, dz, sigma0, sigma1, Fv), dz
