"""Friction laws of one bristle other than LuGre: Dahl, elasto-plastic, two states, Bouc-Wen."""

from __future__ import annotations

from typing import Any

import numpy as np

from .block import P
from .declaration import block
from .friction import FC, FS, FV, SIGMA0, SIGMA1, VS, bristle_torque, level, relaxation

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
def elastoplastic(w, z, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS, kappa=KAPPA):
    """F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w (1 - alpha sigma0 z sign(w)/h(w)).

    LuGre with an elastic zone: alpha = 0 up to |z| = kappa Fc/sigma0 and after every reversal,
    1 from |z| = h(w)/sigma0 on, (1 - cos(pi x))/2 in between; h as in LuGre. A torque that
    oscillates within the zone, below kappa Fc, moves the drive to and fro without drift; LuGre
    drifts. kappa near 0 is LuGre, except after a reversal. Only such a test distinguishes the
    two. Needs Fs >= Fc. Passive from w to F if Fv >= sigma1 (Fs - Fc)/Fc, where z starts within
    Fs/sigma0, as LuGre: w dz/dt >= w^2 (1 - Fs/Fc) because alpha <= 1. An observer that copies
    this law keeps its error in the elastic zone.
    """
    dz = elastoplastic_bristle(w, z, sigma0, level(w, Fc, Fs, vs), kappa * Fc / sigma0)
    return bristle_torque(w, z, dz, sigma0, sigma1, Fv), dz


@block("friction", out="F", states="z lost", source=RUDERMAN)
def two_state(
    w,
    z,
    lost,
    sigma0=SIGMA0,
    sigma1=SIGMA1,
    Fc=FC,
    Fs=FS,
    Fv=FV,
    vs=VS,
    tau: Any = P(0.005, "s", 1e-6, 100.0, usual=True),
    kappa=KAPPA,
):
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
    g = Fs - (Fs - Fc) * lost
    dz = elastoplastic_bristle(w, z, sigma0, g, kappa * g / sigma0)
    return bristle_torque(w, z, dz, sigma0, sigma1, Fv), dz, (1.0 - level(w, 0, 1, vs) - lost) / tau


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
    """The path, and the first sample and the direction of each stroke between reversals.

    ``dx`` (n,) are the steps, or the speeds at even times; the path has their unit. A step of 0
    is rest.
    """
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

    z (n,) for a level G of 1, or of 1 + asymmetry sign(w), from strokes as :func:`strokes` has
    them. Between two reversals it relaxes exponentially over the path: the small-damping limit of
    :func:`lugrectl.blocks.friction.bristle` at a constant level G, in units of that level.

    The level is both the value towards which z relaxes and, as the stiffness stays, a factor on the
    distance x0 (in the unit of the path) over which it does.
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
