"""Position loops drawn at random: PI, PID and cascade P-PI, a third of them sampled."""

from dataclasses import dataclass

import numpy as np

import lugrectl as lg

from . import brute_force as brute


@dataclass(frozen=True)
class Drawn:
    """A loop as the package takes it (``model``, ``options``) and as the other simulation does."""

    kind: str
    model: lg.Model
    options: dict
    own: dict
    sampling: dict | None

    @property
    def unit(self):
        return self.own["Fs"] / self.own["kp"]

    def motions(self, e, held, turns=600, step=1e-3, share=0.0, vd=1.0):
        """Fates, amplitudes and periods of the other simulation."""
        if self.sampling is None:
            added = {"share": share, "vd": vd}
            return brute.settled(**self.own, e=e, held=held, turns=turns, step=step, **added)
        return brute.sampled(**self.own, e=e, held=held, **self.sampling)

    def from_breakaway(self, e, **more):
        """From errors just before breakaway."""
        e = np.asarray(e, float)
        q = self.sampling["q"] if self.sampling else 0.0
        seen = q * np.floor(e / q + 0.5) if q else e
        return self.motions(e, self.own["kp"] * seen - 0.999 * self.own["Fs"], **more)

    def starts(self, count, **more):
        """Half of them just before breakaway, half released at rest with no integral."""
        e = self.unit * np.geomspace(0.03, 30.0, count // 2)
        one = self.from_breakaway(e, **more)
        two = self.motions(e, 0.0 * e, **more)
        return tuple(np.r_[a, b] for a, b in zip(one, two, strict=True))


def drawn(seed):
    """A loop of each kind in turn; every third is sampled."""
    random = np.random.default_rng([2718, seed])
    kind, is_sampled = ("PI", "PID", "P-PI")[seed % 3], seed % 9 in (0, 4, 8)
    J, wn, unit = 10 ** random.uniform([-4, 0.5, -4], [-1, 1.8, -1.5])
    zeta, share = random.uniform(0.3, 1.2), random.uniform(0.05, 0.95)
    kp, damping = J * wn**2, 2.0 * zeta * J * wn
    viscous = damping * (1.0 if kind == "PI" else random.choice([0.0, 0.2]))
    kd, ki = damping - viscous, share * damping * kp / J
    Fc = kp * unit
    Fs = Fc * (1.0 + random.choice([0.0, 1.0], p=[0.1, 0.9]) * 10 ** random.uniform(-1.5, 0))
    vs = wn * unit * 10 ** random.uniform(-2, -0.2)
    gains = {"kp": kp, "ki": ki, "kd": kd}
    if kind == "P-PI":
        # kp = kd kv + i, ki = i kv: kv is the larger root, where there is one
        ki = min(ki, 0.24 * kp**2 / kd)
        kv = (kp + np.sqrt(kp**2 - 4.0 * kd * ki)) / (2.0 * kd)
        gains = {"kv": kv, "kp": kd, "ki": kp - kd * kv}
    law = {"J": J, "Fc": Fc, "Fs": Fs, "vs": vs, "Fv": viscous}
    own = {**law, "kp": kp, "ki": ki, "kd": kd}
    model = lg.Model.of(friction="stribeck", **law)
    if not is_sampled:
        return Drawn(kind, model, gains, own, None)
    rate = wn / random.uniform(0.01, 0.1)
    turn = round(2.0 * np.pi / (Fc / kp * 10 ** random.uniform(-1.7, -0.2)))
    late = int(random.integers(0, 3))
    counts = None if random.random() < 0.1 else max(turn, 1)
    options = {**gains, "rate": rate, "dead_time": late / rate, "counts": counts}
    q = 2.0 * np.pi / counts if counts else 0.0
    sampling = {
        "dt": 1.0 / rate,
        "q": q,
        "late": late,
        "most": 1_000_000,
        "parts": 30,
        "shake": 0.01,
    }
    return Drawn(kind, model, options, own, sampling)
