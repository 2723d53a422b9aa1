"""Friction effects of the contact beyond the declared law: drag, stiction, presliding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..block import P
from ..declaration import block
from ..friction import EPS, FC, FS, SIGMA1, SMOOTH, VS, bristle, bristle_torque, level

SHARED_FC: Any = replace(FC, shared=True)
SHARED_FS: Any = replace(FS, shared=True)
SHARED_VS: Any = replace(VS, shared=True)
SHARED_EPS: Any = replace(EPS, shared=True)
RIGID = 1e12  # N m/rad; bristles of this stiffness and above count as rigid
LEAST = 1e-12  # N m
ONSET = 0.05  # the drive slides fully at a speed higher by this share than where sliding begins


@block(
    "effect",
    out="d",
    acts="torque",
    confused="viscous_asymmetry thermal_drift sublinear_viscous",
    experiment="record constant speeds up to the highest that the drive allows, then a coast-down",
)
def quadratic_drag(w, coefficient: Any = P(0.0, "N m s2/rad2", 0.0, neutral=0.0)):
    """r_e = c w |w|.

    In a log: a torque that is odd and convex over speed (air drag, churning oil). Over a narrow
    range of speeds more viscous and less Coulomb friction look the same.
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
    exponent: Any = P(0.5, "1", 0.02, 0.98),
    eps=SMOOTH,
):
    """r_e = c |w|^n sign(w), 0 < n < 1.

    Computed as c w (w^2 + eps^2)^((n - 1)/2), eps = 1e-4 rad/s, which is smooth at rest. In a
    log: a torque that is odd and concave over speed (shear-thinning grease). With n near 0 it
    equals Coulomb, with n near 1 viscous friction; over one decade of speed the sum of both looks
    almost the same.
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
)
def dwell_stiction(
    w,
    rest,
    ratio: Any = P(0.0, "1", 0.0, 20.0, neutral=0.0),
    time_constant=P(1.0, "s", 1e-9),
    release=P(3e-4, "s", 1e-9, fitted=False),
    vs=SHARED_VS,
):
    """Fs (1 + a (1 - exp(-t_rest/tau))).

    The drive counts as resting while |w| < vs/2, which includes slow presliding. The state
    ``rest`` = 1 - exp(-t_rest/tau) grows at rest by d rest/dt = (1 - rest)/tau and decays with
    the time constant ``release`` when sliding, above 1.05 vs/2; in between the two rates are
    blended. In a log: the longer the rest, the higher the peak at break-away
    (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, section 2). If all
    rests are equally long, a higher Fs looks the same. Only for friction laws with an Fs.
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
    experiment="record many constant speeds, from the slowest steady one upwards",
)
def stribeck(w, Fs=P(0.0, "N m", 0.0, neutral=0.0), vs=VS, Fc=SHARED_FC):
    """G = 1 + max(Fs/Fc - 1, 0) exp(-(w/vs)^2).

    Turns Coulomb friction into the static Stribeck map; no change if Fs <= Fc. In a log: below
    some speed vs friction falls with speed, and slow motion sticks and slips. Only for friction
    laws without an Fs; the others contain it. If the drive passes vs within a few samples,
    presliding or a lower Fc looks the same.
    """
    excess = np.maximum(Fs / np.maximum(Fc, LEAST) - 1.0, 0.0)
    return level(w, 0.0, excess, vs)


@block(
    "effect",
    out="d",
    states="z",
    acts="torque",
    confused="stribeck backlash elastic_coupling coulomb_asymmetry",
    experiment="record small slow moves of several sizes that reverse before they break away",
)
def presliding(
    w,
    z,
    sigma0: Any = P(np.inf, "N m/rad", 0.0, neutral=np.inf),
    sigma1=SIGMA1,
    Fc=SHARED_FC,
    Fs=SHARED_FS,
    vs=SHARED_VS,
    eps=SHARED_EPS,
):
    """r_e = sigma0 z + sigma1 dz/dt - h(w) sign(w), dz/dt = w - sigma0 |w| z / h(w).

    The bristles of the LuGre law in place of the jump at w = 0: Coulomb or Stribeck friction
    with this effect is the LuGre law. At 1e12 N m/rad and above the bristles count as rigid. In
    a log: after every reversal the drive acts as a spring, with a stiffness that does not depend
    on position, until the friction level is reached. A gap or a soft coupling also delays the
    torque after a reversal. Only for static friction laws; LuGre contains the bristles.
    """
    soft = np.logical_and(sigma0 < RIGID, np.maximum(Fc, Fs) > LEAST)
    low, high = np.maximum(Fc, LEAST), np.maximum(Fs, LEAST)
    k = np.minimum(sigma0, RIGID)
    dz = bristle(w, z, k, low, high, vs)
    d = bristle_torque(w, z, dz, k, sigma1, 0.0) - level(w, low, high, vs) * np.tanh(w / eps)
    return np.where(soft, d, 0.0), np.where(soft, dz, 0.0)
