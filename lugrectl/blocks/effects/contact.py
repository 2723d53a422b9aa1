"""What the contact itself does beyond the declared law: drag, stiction, presliding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...spec import P, block
from ..friction import EPS, FC, FS, SIGMA1, VS, bristle, bristle_torque, level
from . import hints

SHARED_FC, SHARED_FS = replace(FC, shared=True), replace(FS, shared=True)
SHARED_VS, SHARED_EPS = replace(VS, shared=True), replace(EPS, shared=True)
RIGID = 1e12  # N m/rad, from which bristles count as rigid
LEAST = 1e-12  # N m
ONSET = 0.05  # of the speed from which a drive slides: so much faster it does so for certain


@block(
    "effect",
    out="d",
    acts="torque",
    confused="viscous_asymmetry thermal_drift sublinear_viscous",
    experiment="record constant speeds up to the highest that the drive allows, then a coast-down",
)
def quadratic_drag(w, coefficient: Any = P(0.0, "N m s2/rad2", 0.0, neutral=0.0)):
    """r_e = c w |w|.

    In a log: convex over speed and odd (wind, churning oil). Over a narrow range of speeds it
    is more viscous and less Coulomb friction.
    """
    return coefficient * w * np.abs(w)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="thermal_drift stribeck quadratic_drag",
    experiment="record constant speeds, each twice as fast as the one before, at one temperature",
)
def sublinear_viscous(
    w,
    coefficient: Any = P(0.0, "N m (s/rad)^n", 0.0, neutral=0.0),
    exponent: Any = P(0.5, "1", 0.02, 0.98, grid=hints.exponents),
    eps: Any = EPS,
):
    """r_e = c |w|^n sign(w), 0 < n < 1.

    Written c w (w^2 + eps^2)^((n - 1)/2), eps = 1e-4 rad/s, so that it is smooth at rest. In a
    log: concave over speed and odd (grease that thins with shear). With n near 0 it is Coulomb,
    near 1 viscous friction; over one decade of speed both together come close to it.
    """
    return coefficient * w * (w * w + eps * eps) ** (0.5 * (exponent - 1.0))


@block(
    "effect",
    out="level",
    states="rest",
    acts="Fs",
    confused="stribeck thermal_drift",
    experiment="break away after rests of 0.01 s, 0.1 s, 1 s and 10 s and compare the peaks",
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, section 2",
    tries=hints.dwells,
)
def dwell_stiction(
    w,
    rest,
    ratio: Any = P(0.0, "1", 0.0, 20.0, neutral=0.0),
    time_constant=P(1.0, "s", 1e-9),
    release=P(3e-4, "s", 1e-9, fitted=False),
    vs: Any = SHARED_VS,
):
    """Fs (1 + a (1 - exp(-t_rest/tau))).

    The drive rests while |w| < vs/2, slow presliding included. The state, 1 - exp(-t_rest/tau),
    fills at rest by d rest/dt = (1 - rest)/tau and empties within ``release`` when sliding, from
    1.05 vs/2 on; in between it does a part of either. In a log: the peak at break-away is the
    higher the longer the rest before (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica
    30(7), 1994, section 2). With rests of one length it is a higher Fs. Acts on friction laws
    with an Fs only.
    """
    part = np.minimum(np.maximum((np.abs(2.0 * w / vs) - 1.0) / ONSET, 0.0), 1.0)
    slips = part * part * (3.0 - 2.0 * part)
    rate = (1.0 - slips) * (1.0 - rest) / time_constant - slips * rest / release
    return ratio * rest, rate


@block(
    "effect",
    out="level",
    acts="Fc",
    confused="sublinear_viscous presliding dwell_stiction",
    experiment="record many constant speeds, from the slowest that the drive holds upwards",
    tries=hints.stictions,
)
def stribeck(w, Fs=P(0.0, "N m", 0.0, neutral=0.0), vs: Any = VS, Fc: Any = SHARED_FC):
    """G = 1 + max(Fs/Fc - 1, 0) exp(-(w/vs)^2).

    Makes Coulomb friction the static Stribeck map; nothing where Fs <= Fc. In a log: friction
    falls with speed below some vs, and slow motion sticks and slips. For a model whose friction
    law has no Fs: one that has it needs none of this. Where the drive runs through vs within a
    few samples it is presliding or a lower Fc.
    """
    excess = np.maximum(Fs / np.maximum(Fc, LEAST) - 1.0, 0.0)
    return level(w, 0.0, excess, vs)


@block(
    "effect",
    out="d",
    states="z",
    acts="torque",
    confused="stribeck backlash elastic_coupling coulomb_asymmetry",
    experiment="record small slow moves that turn before they break away, at several sizes",
    tries=hints.bristles,
)
def presliding(
    w,
    z,
    sigma0: Any = P(np.inf, "N m/rad", 0.0, neutral=np.inf),
    sigma1=SIGMA1,
    Fc: Any = SHARED_FC,
    Fs: Any = SHARED_FS,
    vs: Any = SHARED_VS,
    eps: Any = SHARED_EPS,
):
    """r_e = sigma0 z + sigma1 dz/dt - h(w) sign(w), dz/dt = w - sigma0 |w| z / h(w).

    The bristles of the LuGre law in place of the jump at w = 0: Coulomb or Stribeck friction
    with this effect is the LuGre law. From 1e12 N m/rad on the bristles count as rigid. In a
    log: a spring of a stiffness that does not hang on position after every reversal, which
    gives way once friction is reached. A gap or a soft coupling also delays the torque after a
    reversal. For a static friction law; LuGre has its bristles already.
    """
    soft = np.logical_and(sigma0 < RIGID, np.maximum(Fc, Fs) > LEAST)
    low, high = np.maximum(Fc, LEAST), np.maximum(Fs, LEAST)
    k = np.minimum(sigma0, RIGID)
    dz = bristle(w, z, k, low, high, vs)
    d = bristle_torque(w, z, dz, k, sigma1, 0.0) - level(w, low, high, vs) * np.tanh(w / eps)
    return np.where(soft, d, 0.0), np.where(soft, dz, 0.0)
